//! HTTP on 127.0.0.1, for pages of this machine alone.

mod gate;
mod message;
mod serve;

pub use message::{JSON, LONGEST_BODY, Reply, Request};
pub use serve::{Server, Site};

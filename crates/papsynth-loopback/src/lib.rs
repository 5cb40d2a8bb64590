#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod error;
mod gate;
mod message;
mod server;

pub use error::Error;
pub use message::{JSON, LONGEST_BODY, Reply, Request};
pub use server::{Server, Site};

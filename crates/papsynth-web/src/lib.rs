#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod error;
mod page;
mod server;
#[cfg(feature = "server")]
mod study;
mod view;
mod workbench;

pub use error::Error;
#[cfg(feature = "server")]
pub use server::Server;
pub use server::{JSON, MAX_BODY, Reply, Request, Site, SlowReply};
#[cfg(feature = "server")]
pub use study::serve_study;
pub use view::Viewer;
pub use workbench::{Workbench, WorkbenchParams};

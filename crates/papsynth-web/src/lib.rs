#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod error;
mod page;
mod server;
mod study;
mod view;
mod workbench;

pub use error::Error;
pub use server::{JSON, MAX_BODY, Reply, Request, Server, Site, SlowReply};
pub use study::serve_study;
pub use view::Viewer;
pub use workbench::{Workbench, WorkbenchParams};

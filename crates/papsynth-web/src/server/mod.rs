//! Requests and replies, and an HTTP server on 127.0.0.1 (feature `server`).

#[cfg(feature = "server")]
mod http;
mod message;
#[cfg(feature = "server")]
mod origin;
mod site;

#[cfg(feature = "server")]
pub use http::Server;
pub use message::{JSON, MAX_BODY, Reply, Request};
pub use site::{Site, SlowReply};

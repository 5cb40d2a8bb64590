//! The page and its server, on loopback alone.

mod desk;
mod server;

pub use server::Server;

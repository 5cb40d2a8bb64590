//! Integration tests, linked as one program.

mod http;
#[path = "../support/mod.rs"]
mod support;

//! Integration tests, linked as one program.

mod answers;
mod http;
mod slide;
#[path = "../support/mod.rs"]
mod support;

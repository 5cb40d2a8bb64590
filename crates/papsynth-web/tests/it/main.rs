//! Integration tests, linked as one binary.

mod server;
mod study;
mod study_http;
#[path = "../support/mod.rs"]
mod support;
mod view;
mod view_http;
mod view_slide;
mod workbench;

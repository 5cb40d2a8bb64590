//! Integration tests, linked as one program.

mod calibrate;
mod cli;
mod hostile;
mod judge;
mod match_fields;
mod memory;
mod scenes;
mod sets;
mod slide;
mod study;
#[path = "../support/mod.rs"]
mod support;
mod view;

//! Integration tests, linked as one program.

mod abbe;
mod bright_field;
mod calibrate;
mod gibson_lanni;
mod laws;
mod patches;
#[path = "../support/mod.rs"]
mod support;
mod transfer;

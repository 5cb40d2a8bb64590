//! Integration tests, linked as one program.

mod abbe;
mod bright_field;
mod calibrate;
mod gaussian;
mod gibson_lanni;
mod patches;
#[path = "../support/mod.rs"]
mod support;
mod transfer;

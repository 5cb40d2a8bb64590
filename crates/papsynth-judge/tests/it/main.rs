//! Integration tests, linked as one program.

mod anything;
mod judging;
mod measuring;
mod reference;
#[path = "../support/mod.rs"]
mod support;

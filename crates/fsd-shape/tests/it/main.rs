//! Integration tests, linked as one program.

mod descriptors;
mod model;
mod outline;
mod reference;
#[path = "../../examples/support/mod.rs"]
mod support;

#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod diagnose;
mod nearest;
mod schema;

pub use diagnose::{Fault, find, help_for, middle_left_out, read, unknown_classes};
pub use nearest::nearest;
pub use schema::{Schema, Section, quoted};

//! Reads the text of a recipe, and reports all its errors at once: the field, its value, its place, what is accepted,
//! and a suggestion for misspelt names.
//!
//! ```
//! let errors = papsynth::recipe::diagnose::read("[field]\nwidht_px = 96\n").unwrap_err();
//! assert_eq!(errors[0].path, ["field", "widht_px"]);
//! assert!(errors[0].help.as_ref().unwrap().contains("did you mean `width_px`?"));
//! ```
//!
//! The fields are those of the JSON schema of [`Recipe`](super::Recipe): a new field needs no change here.

mod nearest;
mod plain;
mod read;
mod schema;

pub use nearest::nearest;
pub use plain::plain;
pub use read::{FieldError, find, middle_left_out, read, unknown_classes};
pub use schema::{Schema, Section, quoted};

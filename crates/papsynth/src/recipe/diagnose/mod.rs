//! Recipes that people wrote: reads their text, and says what is wrong with it, everything at once: which field, which
//! value, where it stands, what would be accepted, and what may have been meant.
//!
//! ```
//! let faults = papsynth::recipe::diagnose::read("[field]\nwidht_px = 96\n").unwrap_err();
//! assert_eq!(faults[0].path, ["field", "widht_px"]);
//! assert!(faults[0].help.as_ref().unwrap().contains("did you mean `width_px`?"));
//! ```
//!
//! What it knows of fields is the JSON schema of [`Recipe`](super::Recipe), so that nothing here has to be told of a new
//! one.

mod nearest;
mod read;
mod schema;

pub use nearest::nearest;
pub use read::{Fault, find, middle_left_out, read, unknown_classes};
pub use schema::{Schema, Section, quoted};

//! What is known of an image because it was made: masks, labels, layers, and a row for every object.
//!
//! Truth comes from the scene and from exact coverage, never from the image.

mod labels;
mod mask;
mod object;
pub(crate) mod part;
pub(crate) mod traits;

pub(crate) use labels::fronts;
pub use labels::{LabelMap, front_masks};
pub use mask::{Bounds, Mask, Run};
pub(crate) use object::with_layers;
pub use object::{ObjectTruth, Truth};
pub use part::{COVERED, Group, Part};
pub use traits::{Trait, Traits, UnknownTrait};

//! What is known of an image because it was made: masks, labels, layers, and a row for every object.
//!
//! Truth comes from the scene and from exact coverage, never from the image.

mod labels;
mod layer;
mod mask;
mod object;
pub(crate) mod part;
pub(crate) mod traits;

pub(crate) use labels::fronts;
pub use labels::{LabelMap, front_masks};
pub(crate) use layer::with_layers;
pub use mask::{Bounds, Mask, Run};
pub use object::{ObjectTruth, Truth};
pub use part::{COVERED, Group, Part};
pub use traits::{Trait, Traits, UnknownTrait};

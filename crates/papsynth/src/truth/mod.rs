//! Ground truth of an image: masks, label maps, overlap counts, and a row for every object.
//!
//! It is computed from the scene and from exact coverage, never from the image.

mod labels;
mod mask;
mod object;
pub(crate) mod part;
mod semantic;
pub(crate) mod traits;

pub(crate) use labels::visible_masks_in;
pub use labels::{LabelMap, visible_masks};
pub use mask::{Bounds, Mask, Run};
pub(crate) use object::merge_layers;
pub use object::{ObjectTruth, Truth};
pub use part::{COVERED, Group, Part};
pub use semantic::{IGNORED, MIN_DETECTABILITY, SemanticClass};
pub use traits::{Trait, Traits, UnknownTrait};

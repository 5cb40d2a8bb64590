//! Parts of objects, and the groups within which objects occlude each other.

use crate::words::words;

/// Minimum coverage of a pixel that belongs to a mask.
pub const COVERED: f32 = 0.5;

/// The part of an object that a mask describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// The complete cell: cytoplasm including the nucleus.
    Cytoplasm,
    /// The nucleus of a cell. It has the id of its cell.
    Nucleus,
    /// An object without parts.
    Whole,
}

words! {
    /// A group of objects that occlude each other. Each group has one label map, in this order; file names use these
    /// names.
    #[derive(PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Group {
        /// The cytoplasm of cells.
        Cytoplasm = "cytoplasm",
        /// The nuclei of cells.
        Nucleus = "nucleus",
        /// Objects other than epithelial cells.
        Debris = "debris",
    }
}

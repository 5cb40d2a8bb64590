//! Parts of objects, and the groups within which they hide each other.

use crate::words::words;

/// Coverage from which on a pixel belongs to a mask.
pub const COVERED: f32 = 0.5;

/// Which part of an object a mask belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Part {
    /// The whole cell: its cytoplasm, and the nucleus within it.
    Cytoplasm,
    /// The nucleus of a cell. It carries the id of its cell.
    Nucleus,
    /// An object that has no parts.
    Whole,
}

words! {
    /// The groups within which an object is nearer to the objective than another, each with a label map of its own, in the
    /// order of these; names are those of files.
    #[derive(PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Group {
        /// The cytoplasm of cells.
        Cytoplasm = "cytoplasm",
        /// The nuclei of cells.
        Nucleus = "nucleus",
        /// Everything that is no epithelial cell.
        Debris = "debris",
    }
}

//! Parts of objects, and the groups within which they hide each other.

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

/// The groups within which an object is nearer to the objective than another, each with a label map of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Group {
    /// The cytoplasm of cells.
    Cytoplasm,
    /// The nuclei of cells.
    Nucleus,
    /// Everything that is no epithelial cell.
    Debris,
}

impl Group {
    /// All groups, in the order of their label maps.
    pub const ALL: [Self; 3] = [Self::Cytoplasm, Self::Nucleus, Self::Debris];

    /// The name of the group, as it stands in file names.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Cytoplasm => "cytoplasm",
            Self::Nucleus => "nucleus",
            Self::Debris => "debris",
        }
    }
}

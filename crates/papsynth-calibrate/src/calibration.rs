//! All that was measured on one microscope, and what is known of it before.

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::edge::Edge;
use crate::focus::Focus;
use crate::instrument::Instrument;

/// All that was measured on one microscope, as `papsynth calibrate` keeps it in `calibration.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Version of the format; the first field, so that the file tells what it is.
    pub calibration: u32,
    /// What was said of the microscope, where lengths are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub microscope: Option<Instrument>,
    /// Blur against focus offset.
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
    /// Version of the format that this crate writes and reads.
    pub const VERSION: u32 = 1;

    /// The first bytes of [`to_json`](Self::to_json).
    pub const BEGINS: &[u8] = b"{\n  \"calibration\":";

    /// Adds what another calibration of the same microscope has and this one has not.
    pub fn keep(&mut self, older: Self) {
        self.microscope = self.microscope.take().or(older.microscope);
        self.focus = self.focus.take().or(older.focus);
        self.edge = self.edge.take().or(older.edge);
        self.camera = self.camera.take().or(older.camera);
    }

    /// The calibration as JSON, with a line end after it.
    ///
    /// # Panics
    /// Never: every field is a number, a text or a list of these.
    #[must_use]
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("numbers, texts and lists can be written as JSON");
        text.push('\n');
        text
    }
}

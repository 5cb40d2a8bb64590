//! The section of a recipe about whole slides.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::number::Number;

/// A whole slide, as a scanner sees it frame by frame (`papsynth slide`); fields do not look at it.
///
/// Counts of cells and debris are those of a field, whose size then says how dense they lie where the deposit is full.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Scan {
    /// Width of the slide's picture in pixels, 64 to 1000000.
    pub width_px: u32,
    /// Height in pixels, 64 to 1000000.
    pub height_px: u32,
    /// Side of the square frames that the scanner's camera takes, pixels, 128 to 8192: each is lit and exposed by itself.
    pub frame_px: u32,
    /// Share of the unevenness of the lamp (`background.illumination`) that the scanner's correction leaves, 0 to 1.
    pub shading_left: f64,
    /// Farthest that an object's picture may reach from the object's middle, µm, 10 to 2000; what would reach further is refused.
    pub reach_um: f64,
    /// Where the material lies.
    pub deposit: Deposit,
}

/// The round deposit of a liquid-based preparation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Deposit {
    /// Its middle, µm from the left border of the picture, -1000000 to 1000000; drawn once a slide, as all that follow.
    pub x_um: Number,
    /// Its middle, µm from the upper border of the picture, -1000000 to 1000000.
    pub y_um: Number,
    /// Its radius, µm, 1 to 1000000.
    pub radius_um: Number,
    /// Distance over which it thins out at its edge, µm, 1 to 100000.
    pub edge_um: Number,
    /// How unevenly the cells lie: standard deviation of the logarithm of their density, 0 to 1.
    pub unevenness: Number,
    /// Size of its dense and thin patches, µm, 50 to 100000.
    pub patch_um: Number,
    /// Density beyond its edge, relative to that within, 0 to 1.
    pub outside: Number,
}

impl Default for Scan {
    fn default() -> Self {
        Self {
            width_px: 56_000,
            height_px: 56_000,
            frame_px: 2048,
            shading_left: 0.15,
            reach_um: 400.0,
            deposit: Deposit::default(),
        }
    }
}

impl Default for Deposit {
    /// A circle 13 mm wide, as filters and settling chambers of liquid-based preparations leave it.
    fn default() -> Self {
        Self {
            x_um: 7000.0.into(),
            y_um: 7000.0.into(),
            radius_um: 6500.0.into(),
            edge_um: 120.0.into(),
            unevenness: 0.35.into(),
            patch_um: 900.0.into(),
            outside: 0.01.into(),
        }
    }
}

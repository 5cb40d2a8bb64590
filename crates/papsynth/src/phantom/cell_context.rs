//! A cell and the shared data for drawing its phantom.

use super::assets::PhantomAssets;
use super::noise_fields::NoiseFields;
use super::phantom_scene::PhantomScene;
use crate::key::Stream;
use crate::scene::{CellBody, Object};

/// A cell and the shared data for drawing its phantom.
#[derive(Clone, Copy)]
pub(super) struct CellContext<'a> {
    pub(super) assets: &'a PhantomAssets,
    pub(super) scene: &'a PhantomScene,
    pub(super) noise_fields: &'a NoiseFields<'a>,
    pub(super) object: &'a Object,
    pub(super) body: &'a CellBody,
    /// Direction across the streaks of cells at the place of this one, radians.
    pub(super) across_streaks_rad: f64,
}

impl CellContext<'_> {
    pub(super) fn stream(&self, purpose: &str) -> Stream {
        self.scene.stream("cell", self.object, purpose)
    }

    /// Pixel size of the sheet, µm.
    pub(super) fn pixel_um(&self) -> f64 {
        self.scene.sheet_grid().pixel_um
    }
}

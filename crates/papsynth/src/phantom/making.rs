//! A cell that is being made, and what it is made with.

use super::pools::Pools;
use super::studio::Studio;
use crate::key::Stream;
use crate::scene::{CellBody, Object, Scene};

/// A cell that is being made, and what it is made with.
#[derive(Clone, Copy)]
pub(super) struct Cell<'a> {
    pub(super) studio: &'a Studio,
    pub(super) scene: &'a Scene,
    pub(super) pools: &'a Pools<'a>,
    pub(super) object: &'a Object,
    pub(super) body: &'a CellBody,
}

impl Cell<'_> {
    pub(super) fn stream(&self, purpose: &str) -> Stream {
        self.scene.stream("cell", self.object, purpose)
    }

    /// Size of a pixel of its sheet.
    pub(super) fn pixel_um(&self) -> f64 {
        self.scene.sheet_grid().pixel_um
    }
}

//! The part of a scene that phantoms depend on.

use crate::key::{Key, Stream};
use crate::scene::imaging::SceneDyes;
use crate::scene::{Object, View};

/// The part of a scene that phantoms depend on, in addition to their objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PhantomScene {
    /// Key of the scene.
    pub(crate) key: Key,
    /// The image and its pixels.
    pub(crate) view: View,
    /// Samples of the slide along the side of a pixel.
    pub(crate) oversampling: usize,
    /// Dyes of debris.
    pub(crate) dyes: SceneDyes,
}

impl PhantomScene {
    /// Returns the grid on which the slide is rendered: that of the image, or a finer one.
    pub(crate) fn grid(&self) -> View {
        self.view.finer(self.oversampling)
    }

    /// Returns the grid of cytoplasm: that of the image if it is fine enough for wrinkles, otherwise that of the slide.
    pub(crate) fn sheet_grid(&self) -> View {
        /// The maximum of a sampled Gaussian varies by 2·exp(−2π²σ²/p²) with its position, for samples at distance p:
        /// by nothing at σ = .34 µm, the centre of the default; at σ = .11 µm, its minimum, by 5 % for p = .25 µm and
        /// by 25 % for p = .33 µm.
        const COARSEST_UM: f64 = 0.35;
        if self.view.pixel_um <= COARSEST_UM { self.view } else { self.grid() }
    }

    /// Returns the stream of a purpose of an object.
    pub(crate) fn stream(&self, kind: &str, object: &Object, purpose: &str) -> Stream {
        self.key_of(object).stream(kind, object.number, purpose)
    }

    /// Returns the key of the streams of an object: that of the scene, or of its plot.
    pub(crate) fn key_of(&self, object: &Object) -> Key {
        object.plot.map_or(self.key, |plot| self.key.plot(plot.number))
    }
}

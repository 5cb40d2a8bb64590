//! How densely a whole slide is covered at each place.

use perlin_bg::{Fractal, FractalParams};
use rand_core::Rng;

use super::numbers::FieldNumbers;
use crate::recipe::Deposit as Section;
use crate::recipe::scan::SceneDeposit;

/// Densest patch, relative to the mean.
pub(super) const DENSEST: f64 = 2.5;

/// The round deposit of a slide, its numbers drawn.
#[derive(Debug)]
pub(super) struct Deposit {
    drawn: SceneDeposit,
    patches: Fractal,
}

impl Deposit {
    pub(super) fn draw(section: &Section, slide: &FieldNumbers) -> Self {
        let key = slide.key.stream("slide", 0, "scan.deposit.patches").next_u64();
        let params = FractalParams { octaves: 3, ..FractalParams::default() };
        Self {
            drawn: section.draw("scan.deposit", |path| slide.stream(path)),
            patches: Fractal::new(&params, key).expect("three octaves of noise are valid"),
        }
    }

    /// Its middle, µm.
    pub(super) fn centre_um(&self) -> [f64; 2] {
        [self.drawn.x_um, self.drawn.y_um]
    }

    /// Density at a place of the slide, µm, relative to the mean within the deposit; at most [`DENSEST`].
    pub(super) fn density(&self, [x, y]: [f64; 2]) -> f64 {
        /// Standard deviation of the noise.
        const SPREAD: f64 = 0.27;
        let SceneDeposit { x_um, y_um, radius_um, edge_um, unevenness, patch_um, outside } = self.drawn;
        let (dx, dy) = (x - x_um, y - y_um);
        let inside = (radius_um - (dx * dx + dy * dy).sqrt()) / edge_um;
        let share = (0.5 + 0.5 * inside).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share);
        let noise = f64::from(self.patches.at(x / patch_um, y / patch_um)) / SPREAD;
        let uneven = libm::exp(unevenness * (noise - 0.5 * unevenness)).min(DENSEST);
        uneven * (outside + (1.0 - outside) * share)
    }
}

//! How densely a whole slide is covered at each place.

use perlin_bg::{Fractal, FractalParams};
use rand_core::Rng;

use super::numbers::FieldNumbers;
use crate::recipe::Deposit as Section;

/// Densest patch, relative to the mean.
pub(super) const DENSEST: f64 = 2.5;

/// The round deposit of a slide, its numbers drawn.
#[derive(Debug)]
pub(super) struct Deposit {
    centre_um: [f64; 2],
    radius_um: f64,
    edge_um: f64,
    unevenness: f64,
    patch_um: f64,
    outside: f64,
    patches: Fractal,
}

impl Deposit {
    pub(super) fn draw(section: &Section, slide: &FieldNumbers) -> Self {
        let draw = |name: &str, number| slide.draw(&format!("scan.deposit.{name}"), number);
        let key = slide.key.stream("slide", 0, "scan.deposit.patches").next_u64();
        let params = FractalParams { octaves: 3, ..FractalParams::default() };
        Self {
            centre_um: [draw("x_um", &section.x_um), draw("y_um", &section.y_um)],
            radius_um: draw("radius_um", &section.radius_um),
            edge_um: draw("edge_um", &section.edge_um),
            unevenness: draw("unevenness", &section.unevenness),
            patch_um: draw("patch_um", &section.patch_um),
            outside: draw("outside", &section.outside),
            patches: Fractal::new(&params, key).expect("three octaves of noise are valid"),
        }
    }

    /// Its middle, µm.
    pub(super) fn centre_um(&self) -> [f64; 2] {
        self.centre_um
    }

    /// Density at a place of the slide, µm, relative to the mean within the deposit; at most [`DENSEST`].
    pub(super) fn density(&self, [x, y]: [f64; 2]) -> f64 {
        /// Standard deviation of the noise.
        const SPREAD: f64 = 0.27;
        let (dx, dy) = (x - self.centre_um[0], y - self.centre_um[1]);
        let inside = (self.radius_um - (dx * dx + dy * dy).sqrt()) / self.edge_um;
        let share = (0.5 + 0.5 * inside).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share);
        let noise = f64::from(self.patches.at(x / self.patch_um, y / self.patch_um)) / SPREAD;
        let uneven = libm::exp(self.unevenness * (noise - 0.5 * self.unevenness)).min(DENSEST);
        uneven * (self.outside + (1.0 - self.outside) * share)
    }
}

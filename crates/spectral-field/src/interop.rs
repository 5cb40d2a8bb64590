//! Implementation of `noise::NoiseFn` for a drawn field.

use noise::NoiseFn;
use rand_core::Rng;

use crate::SpectralField;

/// A drawn field as a function of position in pixels: bilinear between pixel centres at integers, and periodic in
/// both directions. Opposite edges match with [`Padding::Periodic`](crate::Padding::Periodic).
///
/// ```
/// use noise::{NoiseFn, ScaleBias};
/// use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
/// use spectral_field::{FieldParams, SpectralField};
///
/// let field = SpectralField::new(&FieldParams { width: 64, height: 48, ..FieldParams::paper() })?;
/// let clouds = field.draw_noise(&mut Xoshiro256PlusPlus::seed_from_u64(2));
/// assert_eq!(clouds.get([-63.75, 48.0]), 0.75 * clouds.get([0.0, 0.0]) + 0.25 * clouds.get([1.0, 0.0]));
/// let brighter = ScaleBias::new(clouds).set_scale(0.1).set_bias(0.5);
/// assert!(brighter.get([3.4, 1.2]) > 0.0);
/// # Ok::<(), spectral_field::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnField {
    values: Vec<f32>,
    width: usize,
}

impl SpectralField {
    /// Draws a new field as a function of position.
    #[must_use]
    pub fn draw_noise<R: Rng + ?Sized>(&self, rng: &mut R) -> DrawnField {
        DrawnField { values: self.draw(rng), width: self.width() }
    }
}

impl NoiseFn<f64, 2> for DrawnField {
    fn get(&self, [x, y]: [f64; 2]) -> f64 {
        let (left, right, across) = neighbours(x, self.width);
        let (top, bottom, down) = neighbours(y, self.values.len() / self.width);
        let row = |row: usize| {
            let [from, to] = [left, right].map(|column| f64::from(self.values[row * self.width + column]));
            from * (1.0 - across) + to * across
        };
        row(top) * (1.0 - down) + row(bottom) * down
    }
}

/// Returns the pixels before and after a position, and the fraction of the distance between them, 0 to 1.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "sizes are at most 2^14, and positions are reduced to them"
)]
fn neighbours(position: f64, length: usize) -> (usize, usize, f64) {
    let place = position.rem_euclid(length as f64);
    let before = place as usize % length;
    (before, (before + 1) % length, place - place.floor())
}

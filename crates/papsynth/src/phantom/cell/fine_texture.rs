//! The fine texture of cytoplasm: grains, networks and fibres.

use std::ops::Range;

use multiversion::multiversion;

use super::detail::CoarseTile;
use crate::error::ErrorKind;
use crate::key::{Key, Stream};
use crate::phantom::cell_context::CellContext;
use crate::phantom::texture_pool::{Pool, PoolSampler};
use crate::phantom::tile::Point;
use crate::random;

/// The fine texture of a cell: one kind in the ectoplasm, another in the endoplasm, with streaks in about the same
/// direction.
pub(super) struct FineTexture<'a> {
    /// Pool and place of both kinds.
    kinds: [(&'a Pool, PoolSampler); 2],
    inner: Option<CoarseTile>,
    /// Fraction of the inner kind in a row, and its values.
    rows: [Vec<f32>; 2],
    strengths: [f32; 2],
}

impl<'a> FineTexture<'a> {
    /// Returns none for a cell without texture.
    pub(super) fn new(cell: &CellContext<'a>, inner: Option<CoarseTile>) -> Result<Option<Self>, ErrorKind> {
        let (pools, pixel_um, mut rng) = (&cell.assets.textures, cell.pixel_um(), cell.stream("texture.place"));
        // A pixel shows the mean of the texture.
        let averaged = (pools.texel_um() / pixel_um).min(1.0);
        let strengths = cell.body.detail.texture.map(|strength| (strength * averaged) as f32);
        if strengths.iter().all(|strength| *strength <= 0.0) {
            return Ok(None);
        }
        let relative_um = pixel_um / cell.body.detail.texture_size;
        let mut kind = |name| {
            let across = streaks_of(cell, DEVIATION, &mut rng);
            pools.pool(name).map(|pool| (pool, pools.sampler(relative_um, across, &mut rng)))
        };
        let [outer, inner_kind] = &cell.body.textures;
        let kinds = [kind(outer)?, kind(inner_kind)?];
        Ok(Some(Self { kinds, inner, rows: Default::default(), strengths }))
    }

    /// Writes columns of row `y` of the tile.
    pub(super) fn row_into(&mut self, row: &mut [f32], columns: Range<usize>, y: usize) {
        let at = [columns.start as f64, y as f64];
        let [(outer, place), (inner, inner_place)] = &self.kinds;
        outer.row_into(&mut row[columns.clone()], place, at);
        let fractions = self.inner.as_mut().map(|zone| {
            let [fractions, values] = &mut self.rows;
            fractions.resize(row.len(), 0.0);
            values.resize(row.len(), 0.0);
            zone.row_into(fractions, y);
            inner.row_into(&mut values[columns.clone()], inner_place, at);
            (&fractions[columns.clone()], &values[columns.clone()])
        });
        match fractions {
            Some((fractions, values)) => mix_textures(&mut row[columns], values, fractions, self.strengths),
            None => row[columns].iter_mut().for_each(|value| *value *= self.strengths[0]),
        }
    }
}

/// Multiplies two textures by their strengths, and mixes them so that the variance of independent ones of one strength
/// stays the same.
#[multiversion(targets = "simd")]
fn mix_textures(outer: &mut [f32], inner: &[f32], fractions: &[f32], [outside, inside]: [f32; 2]) {
    for ((outer, inner), part) in outer.iter_mut().zip(inner).zip(fractions) {
        let rest = 1.0 - part;
        *outer = (rest * outside * *outer + part * inside * inner) / (rest * rest + part * part).sqrt();
    }
}

/// Twice the direction of streaks is the argument of a complex random field with a Gaussian correlation, of this
/// standard deviation, µm.
///
/// In normal fields of Cervix93, the directions of windows are correlated within cells and between cells. The mean of
/// cos 2Δ of two windows decreases to 0.8 at 30 µm, 0.55 at 65 µm, 0.35 at 95 µm and 0.15 at 140 µm, relative to
/// neighbouring windows.
const DIRECTION_UM: f64 = 75.0;

/// Number of plane waves of that field.
const WAVES: usize = 16;

/// Standard deviation of the direction of the streaks of a part of a cell from that of the random field, radians. In
/// real fields, the mean of cos 2Δ decreases from neighbouring windows to those at 30 µm to 0.65 to 0.8.
const DEVIATION: f64 = 0.3;

/// Draws the direction across the streaks of a part of a cell, radians, with this standard deviation from the
/// direction of the slide there.
pub(super) fn streaks_of(cell: &CellContext<'_>, deviation: f64, rng: &mut Stream) -> f64 {
    direction_at(cell.object.centre_um, cell.scene.key_of(cell.object)) + deviation * random::normal(rng)
}

/// Returns the direction across the streaks of cells at a place of an image or plot, radians.
///
/// It changes slowly over the slide, so that neighbouring cells have streaks of about the same direction.
fn direction_at(place_um: Point, key: Key) -> f64 {
    let mut rng = key.stream("field", 0, "texture.direction");
    let mut sum = [0.0; 2];
    for _ in 0..WAVES {
        let mut phase = random::direction(&mut rng);
        for at in place_um {
            phase += random::normal(&mut rng) * at / DIRECTION_UM;
        }
        sum[0] += libm::cos(phase);
        sum[1] += libm::sin(phase);
    }
    0.5 * libm::atan2(sum[1], sum[0])
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;

    use super::*;

    #[test]
    fn directions_are_correlated_as_arguments_of_a_gaussian_field() {
        const FIELDS: u64 = 4000;
        // Mean of exp(iΔ) for arguments of two complex normal deviates of correlation r: πr/4 times the hypergeometric
        // function of ½, ½, 2 and r².
        let wanted = |r: f64| {
            let sum = (0..200)
                .rev()
                .map(f64::from)
                .fold(1.0, |sum, n: f64| 1.0 + (n + 0.5) * (n + 0.5) / ((n + 2.0) * (n + 1.0)) * r * r * sum);
            0.25 * PI * r * sum
        };
        for distance in [0.1, 0.5, 1.0, 1.5, 4.0] {
            let mean = |turn: f64| {
                let of_field = |index| {
                    let key = Key { seed: 6, index };
                    let [a, b] = [0.0, distance * DIRECTION_UM].map(|x| direction_at([120.0 + x, 40.0], key));
                    libm::cos(2.0 * (b - turn * a))
                };
                (0..FIELDS).map(of_field).sum::<f64>() / FIELDS as f64
            };
            let wanted = wanted(libm::exp(-0.5 * distance * distance));
            assert!((mean(1.0) - wanted).abs() < 0.04, "{distance}: {} {wanted}", mean(1.0));
            // No direction is preferred.
            assert!(mean(0.0).abs() < 0.04, "{distance}: {}", mean(0.0));
        }
    }
}

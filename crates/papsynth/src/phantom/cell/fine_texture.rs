//! The fine texture of cytoplasm: grains, networks and fibres.

use std::ops::Range;

use multiversion::multiversion;

use super::detail::CoarseTile;
use crate::error::ErrorKind;
use crate::phantom::cell_context::CellContext;
use crate::phantom::texture_pool::{Pool, PoolSampler};
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
            let across = cell.streaks + DEVIATION * random::normal(&mut rng);
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

/// Standard deviation of the direction of the streaks of a part of a cell from that of the random field, radians. In
/// real fields, the mean of cos 2Δ decreases from neighbouring windows to those at 30 µm to 0.65 to 0.8.
const DEVIATION: f64 = 0.3;

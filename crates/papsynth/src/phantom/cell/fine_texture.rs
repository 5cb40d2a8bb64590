//! The fine texture of cytoplasm: grains, networks and fibres.

use std::ops::Range;

use multiversion::multiversion;

use super::coarse_tile::CoarseTile;
use crate::error::ErrorKind;
use crate::phantom::cell_context::CellContext;
use crate::phantom::texture_pool::{Pool, PoolSampler, Streaks};
use crate::phantom::tile::Tile;
use crate::random;

/// The fine texture of a cell: one kind in the ectoplasm, another in the endoplasm, with streaks in about the same
/// direction.
pub(super) struct FineTexture<'a> {
    /// Pool and place of both kinds.
    kinds: [(&'a Pool, PoolSampler); 2],
    inner: Option<CoarseTile>,
    /// Rows: fraction of the inner kind, and its values.
    rows: [Vec<f32>; 2],
    strengths: [f32; 2],
}

impl<'a> FineTexture<'a> {
    /// Returns none for a cell without texture.
    pub(super) fn new(
        like: &Tile,
        cell: &CellContext<'a>,
        inner: Option<CoarseTile>,
    ) -> Result<Option<Self>, ErrorKind> {
        let (pools, pixel_um, mut rng) = (&cell.assets.textures, cell.pixel_um(), cell.stream("texture.place"));
        // A pixel shows the mean of the texture.
        let averaged = (pools.texel_um() / pixel_um).min(1.0);
        let strengths = cell.body.detail.texture.map(|strength| (strength * averaged) as f32);
        if strengths.iter().all(|strength| *strength <= 0.0) {
            return Ok(None);
        }
        let relative_um = pixel_um / cell.body.detail.texture_size;
        let centre = [like.width, like.height()].map(|side| 0.5 * side as f64);
        let mut kind = |name| {
            let across = cell.across_streaks_rad + DEVIATION * random::normal(&mut rng);
            let bend = BEND * pixel_um * random::normal(&mut rng).clamp(-MOST_BENT, MOST_BENT);
            let streaks = Streaks { across, bend, centre };
            pools.pool(name).map(|pool| (pool, pools.sampler(relative_um, streaks, &mut rng)))
        };
        let [outer, inner_kind] = &cell.body.textures;
        let kinds = [kind(outer)?, kind(inner_kind)?];
        let rows = [(); 2].map(|()| vec![0.0; like.width]);
        Ok(Some(Self { kinds, inner, rows, strengths }))
    }

    /// Writes columns of row `y` of the tile.
    pub(super) fn row_into(&mut self, row: &mut [f32], columns: Range<usize>, y: usize) {
        let Self { kinds, inner, rows, strengths } = self;
        let ([(outer, place), (inner_kind, inner_place)], at) = (kinds, [columns.start as f64, y as f64]);
        let [fractions, values] = rows;
        outer.row_into(&mut row[columns.clone()], place, at);
        match inner {
            Some(zone) => {
                zone.row_into(fractions, y);
                inner_kind.row_into(&mut values[columns.clone()], inner_place, at);
                mix_textures(
                    &mut row[columns.clone()],
                    &values[columns.clone()],
                    &fractions[columns.clone()],
                    *strengths,
                );
            }
            None => row[columns.clone()].iter_mut().for_each(|value| *value *= strengths[0]),
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

/// Standard deviation of the change of direction along streaks, radians per µm, and its limit, standard deviations. It
/// gives 0.36 radians over 30 µm, and a mean of cos 2Δ of about 0.77, within the range of real fields above.
const BEND: f64 = 0.012;
const MOST_BENT: f64 = 2.0;

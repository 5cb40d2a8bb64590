//! The fine texture of cytoplasm: grains, networks and fibres.

use std::ops::Range;

use multiversion::multiversion;

use super::coarse_tile::CoarseTile;
use crate::error::ErrorKind;
use crate::phantom::cell_context::CellContext;
use crate::phantom::noise_fields::FieldSampler;
use crate::phantom::texture_pool::{Pool, PoolSampler, Streaks};
use crate::phantom::tile::Tile;
use crate::random;

/// The fine texture of a cell: one kind in the ectoplasm, another in the endoplasm, with streaks in about the same
/// direction.
pub(super) struct FineTexture<'a> {
    /// Pool and place of both kinds.
    kinds: [(&'a Pool, PoolSampler); 2],
    inner: Option<CoarseTile>,
    /// Noise that makes the strength uneven, with variance 1.
    patches: CoarseTile,
    /// Rows: fraction of the inner kind, its values, and the noise of the strength.
    rows: [Vec<f32>; 3],
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
            let across = cell.streaks + DEVIATION * random::normal(&mut rng);
            let bend = BEND * pixel_um * random::normal(&mut rng).clamp(-MOST_BENT, MOST_BENT);
            let streaks = Streaks { across, bend, centre };
            pools.pool(name).map(|pool| (pool, pools.sampler(relative_um, streaks, &mut rng)))
        };
        let [outer, inner_kind] = &cell.body.textures;
        let kinds = [kind(outer)?, kind(inner_kind)?];
        let patches = FieldSampler::clouds(PATCH_UM / pixel_um, &mut rng);
        let patches = CoarseTile::noise(like, cell.noise_fields.clouds(), &patches);
        let rows = [(); 3].map(|()| vec![0.0; like.width]);
        Ok(Some(Self { kinds, inner, patches, rows, strengths }))
    }

    /// Writes columns of row `y` of the tile.
    pub(super) fn row_into(&mut self, row: &mut [f32], columns: Range<usize>, y: usize) {
        let Self { kinds, inner, patches, rows, strengths } = self;
        let ([(outer, place), (inner_kind, inner_place)], at) = (kinds, [columns.start as f64, y as f64]);
        let [fractions, values, unevenness] = rows;
        outer.row_into(&mut row[columns.clone()], place, at);
        patches.row_into(unevenness, y);
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
        make_uneven(&mut row[columns.clone()], &unevenness[columns]);
    }
}

/// Multiplies a texture by 1 plus [`UNEVEN`] times noise within [`LIMIT`], and keeps the variance.
#[multiversion(targets = "simd")]
fn make_uneven(texture: &mut [f32], noise: &[f32]) {
    for (value, noise) in texture.iter_mut().zip(noise) {
        *value *= WEIGHT * (1.0 + UNEVEN * noise.clamp(-LIMIT, LIMIT));
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

/// Relative change of the strength of the texture inside a cell per standard deviation of noise, and the standard
/// deviation of the Gaussian that smooths this noise, µm.
///
/// In single cells of Cervix93, the strength of details of 1.4 to 2.8 px within 4 µm has a standard deviation of the
/// logarithm of 0.24 (normal) and 0.22 (low grade). In matched fields with even texture it was 0.17 and 0.20, with
/// these numbers 0.20 and 0.23; at 0.7 to 1.4 px, 0.15 and 0.17 in real cells, before 0.13 and 0.10, now 0.16 and 0.13.
const UNEVEN: f32 = 0.5;
const PATCH_UM: f64 = 4.0;

/// Largest deviation of that noise, standard deviations, and the inverse of the root mean square of 1 plus [`UNEVEN`]
/// times the limited noise.
const LIMIT: f32 = 1.2;
const WEIGHT: f32 = 0.928_96;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn uneven_texture_has_the_variance_and_the_unevenness_asked_for() {
        let mut rng = Key { seed: 5, index: 0 }.stream("test", 0, "patches");
        let mut normals = || -> Vec<f32> { (0..200_000).map(|_| random::normal(&mut rng) as f32).collect() };
        let (even, noise) = (normals(), normals());
        let mut uneven = even.clone();
        make_uneven(&mut uneven, &noise);
        let variance =
            |values: &[f32]| values.iter().map(|v| f64::from(*v) * f64::from(*v)).sum::<f64>() / values.len() as f64;
        let ratio = variance(&uneven) / variance(&even);
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
        let factors: Vec<f32> = uneven.iter().zip(&even).map(|(uneven, even)| uneven / even / WEIGHT - 1.0).collect();
        // The variance of a standard normal deviate limited to ±1.2 is 0.635.
        let found = variance(&factors).sqrt();
        assert!((found - f64::from(UNEVEN) * 0.797).abs() < 0.005, "{found}");
        assert!(factors.iter().all(|factor| factor.abs() < UNEVEN * LIMIT + 1e-3));
    }
}

//! Pools of synthesized texture of cytoplasm. Each cell reads them at a place and angle of its own.

use std::sync::OnceLock;

use rand_core::Rng;
use steerable_texture::{Pyramid, SynthesisParams, Synthesizer};

use super::parametric_shape::placed;
use super::tile::Point;
use crate::error::ErrorKind;
use crate::key::Key;
use crate::model::{CytoplasmTexture, TextureKind};
use crate::random;

/// Width and height of a pool in texels: a power of two, so that positions wrap by masking.
const SIDE: usize = 256;

/// Largest deviation that a pool stores, standard deviations.
const RANGE: f32 = 5.0;

/// Pools of the kinds of a model, the same for every image. Each is synthesized on first use.
#[derive(Debug)]
pub(crate) struct TexturePools {
    texture: CytoplasmTexture,
    pools: Vec<OnceLock<Pool>>,
    /// Texels of the pools of the built-in model; empty for other models.
    stored: &'static [[u8; SIDE * SIDE]],
}

/// Texels of all kinds of the built-in model, as [`rounded`] returns them: synthesis takes a third of a second for each
/// kind.
const BUILTIN: &[u8] = include_bytes!("../../model/cytoplasm.pools");

/// A periodic texture with mean 0 and variance 1, in units of `RANGE / 127`. Each texel holds its value and those to
/// the right, below, and below right, so that interpolation reads one number.
#[derive(Debug)]
pub(crate) struct Pool {
    texels: Vec<[i8; 4]>,
}

/// The place and direction at which a cell reads a pool.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PoolSampler {
    origin: Point,
    /// Texels per pixel along a row.
    along: Point,
    /// Texels per pixel down a column.
    down: Point,
}

impl TexturePools {
    pub(crate) fn new(texture: &CytoplasmTexture) -> Self {
        let pools = texture.kinds.iter().map(|_| OnceLock::new()).collect();
        let stored = if texture.is_builtin() { BUILTIN.as_chunks().0 } else { &[] };
        Self { texture: texture.clone(), pools, stored }
    }

    /// Returns the texel size, µm.
    pub(crate) fn texel_um(&self) -> f64 {
        self.texture.pixel_um
    }

    /// Returns the pool of a kind.
    pub(crate) fn pool(&self, name: &str) -> Result<&Pool, ErrorKind> {
        let kinds = &self.texture.kinds;
        let index = kinds.iter().position(|kind| kind.name == name);
        let index = index.ok_or_else(|| ErrorKind::ForeignTexture(name.to_owned()))?;
        if let Some(pool) = self.pools[index].get() {
            return Ok(pool);
        }
        let texels = match self.stored.get(index) {
            Some(texels) => texels.to_vec(),
            None => rounded(&synthesized(&kinds[index])?),
        };
        Ok(self.pools[index].get_or_init(|| Pool::new(&texels)))
    }

    /// Draws a place, a direction, a mirroring and a stretch. `pixel_um` is the size of the pixels that are drawn,
    /// relative to that of the texture.
    pub(crate) fn sampler<R: Rng + ?Sized>(&self, pixel_um: f64, rng: &mut R) -> PoolSampler {
        let step = pixel_um / self.texture.pixel_um;
        let [angle, stretched] = [0, 1].map(|_| random::direction(rng));
        let mirror = if random::chance(0.5, rng) { -1.0 } else { 1.0 };
        let origin = [0, 1].map(|_| random::between(0.0, SIDE as f64, rng));
        let stretch = libm::exp((STRETCH * random::normal(rng)).clamp(-MAX_STRETCH, MAX_STRETCH));
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        // A rotation, a stretch of equal area, and another rotation.
        let texels = |[x, y]: Point| {
            let [x, y] = placed([x, y], stretched, [0.0; 2]);
            let [x, y] = [step * x / stretch, step * mirror * y * stretch];
            [cos * x + sin * y, cos * y - sin * x]
        };
        PoolSampler { origin, along: texels([1.0, 0.0]), down: texels([0.0, 1.0]) }
    }
}

/// Standard deviation of the logarithm of the stretch of a texture along a direction; across it, the texture is
/// narrower by the same factor. On real slides, many cells have streaks.
const STRETCH: f64 = 0.28;
/// Maximum of this logarithm.
const MAX_STRETCH: f64 = 0.5;

/// Synthesizes the texture of a kind in the object: with the joint statistics as imaged, and the octaves without noise
/// and blur.
fn synthesized(kind: &TextureKind) -> Result<Vec<f32>, ErrorKind> {
    let texture = kind.statistics.params;
    let params = SynthesisParams { texture, ..SynthesisParams::default() };
    let mut rng = Key { seed: 0, index: 0 }.stream("texture", 0, &kind.name);
    let synthesizer = Synthesizer::new(SIDE, SIDE, &params).map_err(ErrorKind::CytoplasmTexture)?;
    let image = synthesizer.synthesize(&kind.statistics, &mut rng).map_err(ErrorKind::CytoplasmTexture)?;
    let pyramid = Pyramid::new(SIDE, SIDE, &texture.pyramid).map_err(ErrorKind::CytoplasmTexture)?;
    let mut bands = pyramid.decompose(&image);
    let (last, scales) = (bands.oriented.len() + 1, bands.oriented.len());
    let variance =
        |values: &[f32]| values.iter().map(|v| f64::from(*v) * f64::from(*v)).sum::<f64>() / values.len() as f64;
    for octave in 0..=last {
        let mut own: Vec<&mut Vec<f32>> = match octave {
            0 => vec![&mut bands.high_pass],
            octave if octave <= scales => bands.oriented[octave - 1].iter_mut().map(|band| &mut band.real).collect(),
            _ => vec![&mut bands.low_pass],
        };
        let found: f64 = own.iter().map(|band| variance(band)).sum();
        let gain = (kind.octaves[octave] * compensation(octave, scales) / found.max(1e-18).sqrt()) as f32;
        own.iter_mut().flat_map(|band| band.iter_mut()).for_each(|value| *value *= gain);
    }
    Ok(pyramid.reconstruct(&bands))
}

/// Returns the inverse of the loss of amplitude of an octave by bilinear interpolation at a random place.
fn compensation(octave: usize, scales: usize) -> f64 {
    /// Frequency of the high-pass residual, cycles per texel.
    const HIGH_PASS: f64 = 0.45;
    // Centre of the octave, cycles per texel. The mean of |1 − u + u exp(2πif)|² over u from 0 to 1 is
    // 2/3 + cos(2πf)/3.
    let frequency = match octave {
        0 => HIGH_PASS,
        octave if octave > scales => return 1.0,
        octave => 0.27 * libm::exp2(1.0 - octave as f64),
    };
    1.0 / ((2.0 + libm::cos(core::f64::consts::TAU * frequency)) / 3.0).sqrt()
}

/// Rounds values to the units of a pool, plus 128.
fn rounded(values: &[f32]) -> Vec<u8> {
    values.iter().map(|v| (libm::rintf(v.clamp(-RANGE, RANGE) * (127.0 / RANGE)) + 128.0) as u8).collect()
}

impl Pool {
    /// Makes a pool of rounded values.
    fn new(rounded: &[u8]) -> Self {
        let at = |x: usize, y: usize| rounded[y % SIDE * SIDE + x % SIDE].wrapping_sub(128).cast_signed();
        let texel = |i: usize| {
            let (x, y) = (i % SIDE, i / SIDE);
            [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)]
        };
        Self { texels: (0..SIDE * SIDE).map(texel).collect() }
    }

    /// Writes the texture at a row of pixels that starts at `first`, by bilinear interpolation.
    pub(crate) fn row_into(&self, row: &mut [f32], sampler: &PoolSampler, first: Point) {
        let PoolSampler { origin, along, down } = sampler;
        let mut position = [0, 1].map(|axis| fixed(origin[axis] + first[0] * along[axis] + first[1] * down[axis]));
        let step = along.map(fixed);
        for value in row {
            let [x, y] = position;
            let texel = self.texels[(y >> 16) as usize % SIDE * SIDE + (x >> 16) as usize % SIDE];
            let [a, b, c, d] = texel.map(f32::from);
            let [u, v] = position.map(|p| (p & 0xffff) as f32 * (RANGE / 127.0 / 65_536.0));
            // u is in units of the pool, v is a fraction.
            let v = v * (127.0 / RANGE);
            let (upper, lower) = (unit(a, b, u), unit(c, d, u));
            *value = upper + v * (lower - upper);
            position = [x.wrapping_add(step[0]), y.wrapping_add(step[1])];
        }
    }
}

/// Interpolates between two stored values; `u` is the fraction times the unit.
#[inline(always)]
fn unit(a: f32, b: f32, u: f32) -> f32 {
    a * (RANGE / 127.0) + u * (b - a)
}

/// Returns a position in 2⁻¹⁶ texels, which wraps without rounding.
fn fixed(texels: f64) -> u32 {
    // The cast to 32 bits wraps, as intended.
    (texels * 65_536.0).floor() as i64 as u32
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    #[test]
    fn a_row_matches_bilinear_interpolation_at_any_angle() {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "pool");
        let values: Vec<f32> = (0..SIDE * SIDE).map(|_| random::between(-4.0, 4.0, &mut rng) as f32).collect();
        let pool = Pool::new(&rounded(&values));
        let rounded = |x: f64, y: f64| {
            let [x, y] = [x, y].map(|c| c.rem_euclid(SIDE as f64) as usize);
            f64::from(libm::rintf(values[y * SIDE + x] * (127.0 / RANGE)) * (RANGE / 127.0))
        };
        for angle in [0.0, 0.4, 1.8, 3.3, 5.9] {
            let (sin, cos) = (0.8 * libm::sin(angle), 0.8 * libm::cos(angle));
            let sampler = PoolSampler { origin: [500.3, 7.8], along: [cos, sin], down: [-sin, cos] };
            let mut row = [0.0; 70];
            pool.row_into(&mut row, &sampler, [3.0, 11.0]);
            for (i, value) in row.iter().enumerate() {
                let (i, j) = (3.0 + i as f64, 11.0);
                let [x, y] = [500.3 + i * cos - j * sin, 7.8 + i * sin + j * cos];
                let [u, v] = [x - x.floor(), y - y.floor()];
                let upper = rounded(x, y) * (1.0 - u) + rounded(x + 1.0, y) * u;
                let lower = rounded(x, y + 1.0) * (1.0 - u) + rounded(x + 1.0, y + 1.0) * u;
                let slow = upper * (1.0 - v) + lower * v;
                assert!((f64::from(*value) - slow).abs() < 0.02, "{angle} {i}: {value} {slow}");
            }
        }
    }

    #[test]
    fn a_stretch_keeps_areas_and_differs_between_cells() {
        let pools = TexturePools::new(&crate::model::Model::builtin().cytoplasm_texture.unwrap());
        let mut rng = Key { seed: 4, index: 0 }.stream("test", 0, "stretch");
        let step = 0.25 / pools.texel_um();
        let mut ratios = Vec::new();
        for _ in 0..400 {
            let PoolSampler { along: [a, b], down: [c, d], .. } = pools.sampler(0.25, &mut rng);
            let area = a * d - b * c;
            assert!((area.abs() / (step * step) - 1.0).abs() < 1e-12, "{area}");
            // Sum of the squared singular values: stretch² + 1/stretch².
            let sum = (a * a + b * b + c * c + d * d) / (step * step);
            ratios.push((0.5 * (sum + (sum * sum - 4.0).max(0.0).sqrt())).sqrt());
        }
        assert!(ratios.iter().all(|r| (1.0 - 1e-9..=libm::exp(MAX_STRETCH) + 1e-9).contains(r)));
        assert!(ratios.iter().any(|r| *r > 1.4) && ratios.iter().any(|r| *r < 1.1));
    }

    /// `PAPSYNTH_BLESS=1` rewrites the file.
    #[test]
    fn the_stored_pools_are_those_of_the_builtin_model() {
        let texture = crate::model::Model::builtin().cytoplasm_texture.unwrap();
        let texels: Vec<u8> = texture.kinds.iter().flat_map(|kind| rounded(&synthesized(kind).unwrap())).collect();
        if std::env::var_os("PAPSYNTH_BLESS").is_some() {
            let file = concat!(env!("CARGO_MANIFEST_DIR"), "/model/cytoplasm.pools");
            std::fs::write(file, &texels).unwrap();
        } else {
            assert!(texels == BUILTIN, "the built-in texture and its pools differ");
        }
    }

    #[test]
    fn a_pool_has_the_octaves_of_its_kind() {
        let model = crate::model::Model::builtin();
        let texture = model.cytoplasm_texture.unwrap();
        for kind in &texture.kinds {
            let values = synthesized(kind).unwrap();
            let found = steerable_texture::Statistics::measure(&values, SIDE, None, &kind.statistics.params).unwrap();
            let k = found.params.pyramid.orientations;
            for (scale, found) in found.scales.iter().enumerate() {
                let found = found.real_covariance.iter().step_by(k + 1).sum::<f64>().sqrt();
                let expected = kind.octaves[scale + 1] * compensation(scale + 1, 4);
                assert!((found - expected).abs() < 0.1 * expected + 0.03, "{} {scale}: {found} {expected}", kind.name);
            }
        }
    }
}

//! Pools of synthesized texture of cytoplasm. Each cell reads them at a place and angle of its own.

use std::sync::OnceLock;

use portable_numerics::fourier::{Complex, ComplexPlane, PlaneScratch};
use rand_core::Rng;
use steerable_texture::{Pyramid, SynthesisParams, Synthesizer};

use super::tile::Point;
use crate::error::ErrorKind;
use crate::key::Key;
use crate::model::{CytoplasmTexture, TextureKind};
use crate::random;

/// Width and height of a pool in texels: a power of two, so that positions wrap by masking.
const SIDE: usize = 256;

/// Largest deviation of stored texels and of those of a pool, in units of the standard deviation after the blur of an
/// image; before it, the standard deviation is about 1.7.
const STORED_RANGE: f32 = 5.0;
const RANGE: f32 = 7.0;

/// Pools of the kinds of a model, the same for every image. Each is synthesized on first use.
#[derive(Debug)]
pub(crate) struct TexturePools {
    texture: CytoplasmTexture,
    pools: Vec<OnceLock<Pool>>,
    /// Texels of the pools of the built-in model before they are skewed; empty for other models.
    stored: &'static [[u8; SIDE * SIDE]],
}

/// Texels of all kinds of the built-in model, as [`rounded`] returns them: synthesis takes a third of a second for each
/// kind.
const BUILTIN: &[u8] = include_bytes!("../../model/cytoplasm.pools");

/// A periodic, skewed texture with mean 0, in units of `RANGE / 127`. Each texel holds its value and those to
/// the right, below, and below right, so that interpolation reads one number.
#[derive(Debug)]
pub(crate) struct Pool {
    texels: Vec<[i8; 4]>,
}

/// The place and direction at which a cell reads a pool.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PoolSampler {
    /// Position of the centre, texels of the pool and px of the tile.
    origin: Point,
    centre: Point,
    /// Texels per pixel along a row.
    along: Point,
    /// Texels per pixel down a column.
    down: Point,
    /// Curvature of the streaks, 1/px.
    bend: f64,
}

/// The streaks of a part of a cell.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Streaks {
    /// Direction across the streaks at the centre, radians.
    pub(crate) across: f64,
    /// Change of the direction along the streaks, radians per px.
    pub(crate) bend: f64,
    /// The centre, px of the tile.
    pub(crate) centre: Point,
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
        let unit = |texel: &u8| f32::from(texel.wrapping_sub(128).cast_signed()) * (STORED_RANGE / 127.0);
        let values: Vec<f32> = texels.iter().map(unit).collect();
        Ok(self.pools[index].get_or_init(|| Pool::new(&skewed(&values))))
    }

    /// Draws a place and a mirroring. `pixel_um` is the size of the pixels that are drawn, relative to that of the
    /// texture.
    pub(crate) fn sampler<R: Rng + ?Sized>(&self, pixel_um: f64, streaks: Streaks, rng: &mut R) -> PoolSampler {
        let Streaks { across, bend, centre } = streaks;
        let step = pixel_um / self.texture.pixel_um;
        let mirror = if random::chance(0.5, rng) { -step } else { step };
        let origin = [0, 1].map(|_| random::between(0.0, SIDE as f64, rng));
        let (sin, cos) = (libm::sin(across), libm::cos(across));
        PoolSampler { origin, centre, along: [step * cos, -mirror * sin], down: [step * sin, mirror * cos], bend }
    }
}

/// Frequency of a wave, cycles per texel, and exponent κ of the power of a texture as a function of the direction φ:
/// exp(κ cos 2φ) relative to its mean. Between the two frequencies κ is interpolated.
///
/// In windows of 48 pixels of 0.33 µm in cells of Cervix93, φ measured from the direction of other windows of the same
/// cells, the power is 1 + a cos 2φ with a of 0.29 to 0.36 at 0.08 to 0.14 cycles per pixel, 0.25 at 0.14 to 0.22, and
/// 0.05 to 0.08 at 0.22 to 0.32. It includes noise and other structures. In matched fields, these numbers are 0.25 to
/// 0.27, 0.22 to 0.27, and 0.06 to 0.10.
const STREAKS: [[f64; 2]; 2] = [[0.1, 1.15], [0.25, 0.1]];

/// Frequencies, cycles per texel, between which the phases of a texture become random: wavelengths of 11 to 7 texels.
///
/// The statistics of a model are means over windows, and a few windows with dark dots dominate the means of fourth
/// moments. Most real cytoplasm has the statistics of Gaussian noise at this scale: in fields of Cervix93 whose
/// cells have 1.5 times the standard deviation of the empty slide there, the kurtosis of band-pass responses at 1 px
/// is 3.1 to 3.3. With synthesized phases it was 3.5.
const RANDOM_FROM: [f64; 2] = [0.09, 0.15];

/// Synthesizes the texture of a kind in the object: with the joint statistics as imaged, the octaves without noise and
/// blur, and random phases of fine detail.
fn synthesized(kind: &TextureKind) -> Result<Vec<f32>, ErrorKind> {
    let texture = kind.statistics.params;
    let params = SynthesisParams { texture, ..SynthesisParams::default() };
    let mut rng = Key { seed: 0, index: 0 }.stream("texture", 0, &kind.name);
    let synthesizer = Synthesizer::new(SIDE, SIDE, &params).map_err(ErrorKind::CytoplasmTexture)?;
    let mut image = synthesizer.synthesize(&kind.statistics, &mut rng).map_err(ErrorKind::CytoplasmTexture)?;
    let pyramid = Pyramid::new(SIDE, SIDE, &texture.pyramid).map_err(ErrorKind::CytoplasmTexture)?;
    image = with_streaks(&image);
    for _ in 0..GAIN_STEPS {
        image = with_octaves(&image, &pyramid, &kind.octaves);
    }
    let noise: Vec<f32> = (0..SIDE * SIDE).map(|_| random::normal(&mut rng) as f32).collect();
    Ok(with_random_phases(&image, &noise))
}

/// Number of steps towards the strengths of the octaves: neighbouring bands of the pyramid overlap, so that the gain of
/// one changes the strength of the next.
const GAIN_STEPS: usize = 4;

/// Scales the bands of an image to the strengths of the octaves.
fn with_octaves(image: &[f32], pyramid: &Pyramid, octaves: &[f64]) -> Vec<f32> {
    let mut bands = pyramid.decompose(image);
    let scales = bands.oriented.len();
    let variance =
        |values: &[f32]| values.iter().map(|v| f64::from(*v) * f64::from(*v)).sum::<f64>() / values.len() as f64;
    for (octave, strength) in octaves.iter().enumerate() {
        let mut own: Vec<&mut Vec<f32>> = match octave {
            0 => vec![&mut bands.high_pass],
            octave if octave <= scales => bands.oriented[octave - 1].iter_mut().map(|band| &mut band.real).collect(),
            _ => vec![&mut bands.low_pass],
        };
        let found: f64 = own.iter().map(|band| variance(band)).sum();
        let gain = (strength * compensation(octave, scales) / found.max(1e-18).sqrt()) as f32;
        own.iter_mut().flat_map(|band| band.iter_mut()).for_each(|value| *value *= gain);
    }
    pyramid.reconstruct(&bands)
}

/// Replaces the phases of an image above the frequencies [`RANDOM_FROM`] by those of noise. Between the two frequencies
/// both are mixed; the expected power does not change.
fn with_random_phases(image: &[f32], noise: &[f32]) -> Vec<f32> {
    let noise = spectrum(noise);
    let [from, to] = RANDOM_FROM;
    filtered(image, |i, value, [fx, fy]| {
        let random = ((libm::hypot(fx, fy) - from) / (to - from)).clamp(0.0, 1.0);
        let own = (1.0 - random * random).sqrt() as f32;
        let magnitude = |z: Complex<f32>| (z.re * z.re + z.im * z.im).sqrt();
        let random = random as f32 * magnitude(value) / magnitude(noise[i]).max(f32::MIN_POSITIVE);
        Complex::new(own * value.re + random * noise[i].re, own * value.im + random * noise[i].im)
    })
}

/// Changes the power of waves with their direction, by [`STREAKS`].
fn with_streaks(image: &[f32]) -> Vec<f32> {
    filtered(image, |_, value, f| {
        let gain = of_direction(f).sqrt() as f32;
        Complex::new(gain * value.re, gain * value.im)
    })
}

/// Returns the power of a wave relative to the mean over all directions.
fn of_direction([fx, fy]: [f64; 2]) -> f64 {
    let [[from, coarse], [to, fine]] = STREAKS;
    let square = (fx * fx + fy * fy).max(f64::MIN_POSITIVE);
    let k = coarse + (fine - coarse) * ((square.sqrt() - from) / (to - from)).clamp(0.0, 1.0);
    // The series of the modified Bessel function I₀.
    let mean: f64 = (1..9).rev().fold(1.0, |sum, n| 1.0 + 0.25 * k * k / f64::from(n * n) * sum);
    libm::exp(k * (fx * fx - fy * fy) / square) / mean
}

/// Returns the discrete Fourier transform of an image, column by column.
fn spectrum(image: &[f32]) -> Vec<Complex<f32>> {
    let values: Vec<_> = image.iter().map(|v| Complex::new(*v, 0.0)).collect();
    let mut spectrum = vec![Complex::ZERO; values.len()];
    ComplexPlane::<f32, 16>::new(SIDE, SIDE).forward(&values, &mut spectrum, &mut PlaneScratch::default());
    spectrum
}

/// Changes the values of the [`spectrum`] of an image. The arguments of `change` are an index, the value
/// there, and the magnitudes of its frequencies, cycles per texel.
fn filtered(image: &[f32], change: impl Fn(usize, Complex<f32>, [f64; 2]) -> Complex<f32>) -> Vec<f32> {
    let mut spectrum = spectrum(image);
    let frequency = |k: usize| k.min(SIDE - k) as f64 / SIDE as f64;
    for (i, value) in spectrum.iter_mut().enumerate() {
        *value = change(i, *value, [i / SIDE, i % SIDE].map(frequency));
    }
    let mut changed = vec![Complex::ZERO; spectrum.len()];
    let plane = ComplexPlane::<f32, 16>::new(SIDE, SIDE);
    plane.inverse(&spectrum, |_| false, &mut changed, &mut PlaneScratch::default());
    changed.iter().map(|z| z.re / (SIDE * SIDE) as f32).collect()
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

/// Rounds values to texels of [`BUILTIN`]: units of `STORED_RANGE / 127`, plus 128.
fn rounded(values: &[f32]) -> Vec<u8> {
    let texel = |v: &f32| libm::rintf(v.clamp(-STORED_RANGE, STORED_RANGE) * (127.0 / STORED_RANGE)) + 128.0;
    values.iter().map(|v| texel(v) as u8).collect()
}

/// Weight of the square of a texture: cytoplasm has dark grains rather than pale ones. The skewness of a texture of
/// standard deviation σ becomes about six times this weight times σ.
///
/// In windows of 40 pixels of 0.33 µm inside cells of Cervix93, between nuclei and folds, band-pass responses have a
/// skewness of 0.2 at 1 px and 0.4 at 2 px, in the field with the strongest texture 0.1. In matched fields it is 0.2 to
/// 0.25 and 0.35.
const SQUARE_WEIGHT: f32 = 0.08;

/// Adds the square to values with mean 0, and keeps mean and variance.
fn skewed(values: &[f32]) -> Vec<f32> {
    let sum: f64 = values.iter().map(|v| f64::from(*v) * f64::from(*v)).sum();
    let variance = (sum / values.len() as f64) as f32;
    let scale = 1.0 / (1.0 + 2.0 * SQUARE_WEIGHT * SQUARE_WEIGHT * variance).sqrt();
    values.iter().map(|v| scale * (v + SQUARE_WEIGHT * (v * v - variance))).collect()
}

impl Pool {
    /// Makes a pool of values, which are rounded.
    fn new(values: &[f32]) -> Self {
        let rounded = |v: f32| libm::rintf(v.clamp(-RANGE, RANGE) * (127.0 / RANGE)) as i8;
        let at = |x: usize, y: usize| rounded(values[y % SIDE * SIDE + x % SIDE]);
        let texel = |i: usize| {
            let (x, y) = (i % SIDE, i / SIDE);
            [at(x, y), at(x + 1, y), at(x, y + 1), at(x + 1, y + 1)]
        };
        Self { texels: (0..SIDE * SIDE).map(texel).collect() }
    }

    /// Writes the texture at a row of pixels that starts at `first`, by bilinear interpolation.
    ///
    /// Streaks bend: at v px along them from the centre, the texture is displaced by ½ · bend · v² px across them.
    pub(crate) fn row_into(&self, row: &mut [f32], sampler: &PoolSampler, first: Point) {
        let PoolSampler { origin, centre, along, down, bend } = sampler;
        let at = [0, 1].map(|axis| first[axis] - centre[axis]);
        let mut position = [0, 1].map(|axis| origin[axis] + at[0] * along[axis] + at[1] * down[axis]);
        // Texels per pixel; v at the first pixel, which decreases by the sine along the row; and the first and second
        // differences of the displacement.
        let texels = libm::hypot(along[0], down[0]);
        let [sin, cos] = [down[0] / texels, along[0] / texels];
        let v = at[1] * cos - at[0] * sin;
        position[0] += 0.5 * bend * texels * v * v;
        let mut position = position.map(fixed);
        let mut step = along.map(fixed);
        step[0] = step[0].wrapping_add(fixed(bend * texels * sin * (0.5 * sin - v)));
        let change = fixed(bend * texels * sin * sin);
        for value in row {
            let [x, y] = position;
            let [column, line] = [x, y].map(|p| (p >> BITS) as usize % SIDE);
            let [a, b, c, d] = self.texels[line * SIDE + column].map(f32::from);
            let [u, v] = position.map(|p| (p >> (BITS - 16) & 0xffff) as f32 * (RANGE / 127.0 / 65_536.0));
            // u is in units of the pool, v is a fraction.
            let v = v * (127.0 / RANGE);
            let (upper, lower) = (unit(a, b, u), unit(c, d, u));
            *value = upper + v * (lower - upper);
            position = [x.wrapping_add(step[0]), y.wrapping_add(step[1])];
            step[0] = step[0].wrapping_add(change);
        }
    }
}

/// Interpolates between two stored values; `u` is the fraction times the unit.
#[inline(always)]
fn unit(a: f32, b: f32, u: f32) -> f32 {
    a * (RANGE / 127.0) + u * (b - a)
}

/// Bits of the fraction of a position: rounding of a bend stays below 2⁻²⁰ texels over a row of a thousand pixels.
const BITS: u32 = 40;

/// Returns a position in units of 2 to the power of -[`BITS`] texels, which wraps without rounding.
fn fixed(texels: f64) -> u64 {
    (texels * (1_u64 << BITS) as f64).floor() as i64 as u64
}

#[cfg(test)]
pub(crate) mod tests {
    use core::f64::consts::PI;

    use super::*;

    #[test]
    fn a_row_matches_bilinear_interpolation_at_any_angle() {
        let mut rng = Key { seed: 3, index: 0 }.stream("test", 0, "pool");
        let values: Vec<f32> = (0..SIDE * SIDE).map(|_| random::between(-4.0, 4.0, &mut rng) as f32).collect();
        let pool = Pool::new(&values);
        let rounded = |x: f64, y: f64| {
            let [x, y] = [x, y].map(|c| c.rem_euclid(SIDE as f64) as usize);
            f64::from(libm::rintf(values[y * SIDE + x] * (127.0 / RANGE)) * (RANGE / 127.0))
        };
        for angle in [0.0, 0.4, 1.8, 3.3, 5.9] {
            let (sin, cos) = (0.8 * libm::sin(angle), 0.8 * libm::cos(angle));
            let (along, down) = ([cos, sin], [-sin, cos]);
            let sampler = PoolSampler { origin: [500.3, 7.8], centre: [20.0, -40.0], along, down, bend: 0.004 };
            let mut row = [0.0; 70];
            pool.row_into(&mut row, &sampler, [3.0, 11.0]);
            for (i, value) in row.iter().enumerate() {
                let (i, j) = (3.0 + i as f64, 11.0);
                let (i, j) = (i - 20.0, j + 40.0);
                let bent = 0.5 * 0.004 / 0.8 * (i * sin + j * cos) * (i * sin + j * cos);
                let [x, y] = [500.3 + i * cos - j * sin + bent, 7.8 + i * sin + j * cos];
                let [u, v] = [x - x.floor(), y - y.floor()];
                let upper = rounded(x, y) * (1.0 - u) + rounded(x + 1.0, y) * u;
                let lower = rounded(x, y + 1.0) * (1.0 - u) + rounded(x + 1.0, y + 1.0) * u;
                let slow = upper * (1.0 - v) + lower * v;
                assert!((f64::from(*value) - slow).abs() < 0.02, "{angle} {i}: {value} {slow}");
            }
        }
    }

    #[test]
    fn pools_are_skewed_and_keep_mean_and_variance() {
        let pools = TexturePools::new(&crate::model::Model::builtin().cytoplasm_texture.unwrap());
        let (stored, _) = BUILTIN.as_chunks::<{ SIDE * SIDE }>();
        for (kind, texels) in pools.texture.kinds.iter().zip(stored) {
            let before = texels.iter().map(|texel| f64::from(STORED_RANGE / 127.0) * (f64::from(*texel) - 128.0));
            let pool = pools.pool(&kind.name).unwrap();
            let after = pool.texels.iter().map(|[value, ..]| f64::from(RANGE / 127.0) * f64::from(*value));
            let moments = |values: Vec<f64>| {
                let mean = |power: i32| values.iter().map(|v| (0..power).map(|_| v).product::<f64>()).sum::<f64>();
                [1, 2, 3].map(|power| mean(power) / values.len() as f64)
            };
            let ([mean_before, variance, cube_before], [mean, square, cube]) =
                (moments(before.collect()), moments(after.collect()));
            assert!((mean - mean_before).abs() < 0.01, "{}: {mean} {mean_before}", kind.name);
            assert!((square / variance - 1.0).abs() < 0.05, "{}: {square} {variance}", kind.name);
            // A normal texture has a skewness of 6 · 0.08 · 1.73 = 0.83 after that.
            let added = cube / (square * square.sqrt()) - cube_before / (variance * variance.sqrt());
            assert!((0.6..1.0).contains(&added), "{}: {added}", kind.name);
            assert!(pool.texels.iter().all(|[value, ..]| value.abs() < 127), "{} is cut", kind.name);
        }
    }

    #[test]
    fn streaks_change_the_power_of_waves_with_their_direction() {
        let mut rng = Key { seed: 4, index: 0 }.stream("test", 0, "streaks");
        let white: Vec<f32> = (0..SIDE * SIDE).map(|_| random::normal(&mut rng) as f32).collect();
        let power = |image: &[f32]| -> Vec<f32> { spectrum(image).iter().map(|z| z.re * z.re + z.im * z.im).collect() };
        for (i, (after, before)) in power(&with_streaks(&white)).iter().zip(power(&white)).enumerate() {
            let f = [i / SIDE, i % SIDE].map(|k| k.min(SIDE - k) as f64 / SIDE as f64);
            let wanted = f64::from(before) * of_direction(f);
            assert!((f64::from(*after) - wanted).abs() < 1e-3 * wanted + 1.0, "{f:?}: {after} {wanted}");
        }
        // The mean over directions is 1, and the ratio of two directions that of the exponents.
        let wave = |f: f64, angle: f64| of_direction([f * libm::cos(angle), f * libm::sin(angle)]);
        for (f, k) in [STREAKS[0], STREAKS[1], [0.03, STREAKS[0][1]], [0.5, STREAKS[1][1]]].map(Into::into) {
            let mean = (0..64).map(|i| wave(f, f64::from(i) * PI / 64.0)).sum::<f64>() / 64.0;
            let ratio = wave(f, 0.0) / wave(f, 0.5 * PI);
            assert!(
                (mean - 1.0).abs() < 1e-6 && (ratio / libm::exp(2.0 * k) - 1.0).abs() < 1e-9,
                "{f}: {mean} {ratio}"
            );
        }
    }

    #[test]
    fn cells_have_streaks_in_the_direction_asked_for() {
        const WIDTH: usize = 200;
        let pools = TexturePools::new(&crate::model::Model::builtin().cytoplasm_texture.unwrap());
        let mut rng = Key { seed: 5, index: 0 }.stream("test", 0, "streaks");
        for name in pools.texture.kinds.iter().map(|kind| &kind.name) {
            let mut coherence = 0.0;
            for direction in [0.0, 0.6, 1.9, 2.8] {
                let streaks = Streaks { across: direction, bend: 0.0, centre: [0.0; 2] };
                let sampler = pools.sampler(0.33, streaks, &mut rng);
                let mut rows = vec![[0.0; WIDTH]; WIDTH];
                for (y, row) in rows.iter_mut().enumerate() {
                    pools.pool(name).unwrap().row_into(row, &sampler, [0.0, y as f64]);
                }
                let mut tensor = [0.0_f64; 3];
                for (y, x) in (1..WIDTH - 1).flat_map(|y| (1..WIDTH - 1).map(move |x| (y, x))) {
                    let [dx, dy] = [rows[y][x + 1] - rows[y][x - 1], rows[y + 1][x] - rows[y - 1][x]].map(f64::from);
                    [dx * dx, dx * dy, dy * dy].iter().zip(&mut tensor).for_each(|(product, sum)| *sum += product);
                }
                let [xx, xy, yy] = tensor;
                let along = libm::cos(libm::atan2(2.0 * xy, xx - yy) - 2.0 * direction);
                assert!(along > 0.9, "{name} {direction}: {along}");
                coherence += 0.25 * along * libm::hypot(xx - yy, 2.0 * xy) / (xx + yy);
            }
            // A single window has an anisotropy of its own of 0.03 to 0.08.
            assert!((0.1..0.5).contains(&coherence), "{name}: {coherence}");
        }
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
    fn random_phases_keep_the_power_at_every_frequency_and_low_frequencies() {
        let mut rng = Key { seed: 6, index: 0 }.stream("test", 0, "phases");
        let [noise, other] =
            [(); 2].map(|()| (0..SIDE * SIDE).map(|_| random::normal(&mut rng) as f32).collect::<Vec<_>>());
        // Rows of narrow lines: phases agree, so that the kurtosis is large.
        let lines: Vec<f32> = (0..SIDE * SIDE).map(|i| if i % SIDE % 16 == 3 { 4.0 } else { 0.1 * other[i] }).collect();
        let mixed = with_random_phases(&lines, &noise);
        let kurtosis = |values: &[f32]| {
            let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64;
            let moment = |n: u32| values.iter().map(|v| (0..n).map(|_| f64::from(*v) - mean).product::<f64>()).sum();
            let (square, fourth): (f64, f64) = (moment(2), moment(4));
            values.len() as f64 * fourth / (square * square)
        };
        assert!(kurtosis(&lines) > 8.0 && kurtosis(&mixed) < 4.0, "{} {}", kurtosis(&lines), kurtosis(&mixed));
        // Power in bands along rows, by slow transforms of all rows.
        let power = |image: &[f32], k: usize| -> f64 {
            let of_row = |row: &[f32]| {
                let angle = |x: usize| core::f64::consts::TAU * (k * x % SIDE) as f64 / SIDE as f64;
                let sum = |f: fn(f64) -> f64| -> f64 {
                    row.iter().enumerate().map(|(x, v)| f64::from(*v) * f(angle(x))).sum()
                };
                let (re, im) = (sum(libm::cos), sum(libm::sin));
                re * re + im * im
            };
            image.chunks_exact(SIDE).map(of_row).sum()
        };
        // Below, between and above the frequencies. Between them, a mean over 256 frequencies is expected to agree.
        for (k, error) in [(16, 1e-4), (30, 0.25), (33, 0.25), (48, 1e-4), (64, 1e-4), (97, 1e-4)] {
            let ratio = power(&mixed, k) / power(&lines, k);
            assert!((ratio - 1.0).abs() < error, "{k}: {ratio}");
        }
    }

    #[test]
    fn fine_detail_of_stored_texels_has_the_kurtosis_of_gaussian_noise() {
        let texture = crate::model::Model::builtin().cytoplasm_texture.unwrap();
        let (stored, _) = BUILTIN.as_chunks::<{ SIDE * SIDE }>();
        for (kind, texels) in texture.kinds.iter().zip(stored) {
            let pyramid = Pyramid::new(SIDE, SIDE, &kind.statistics.params.pyramid).unwrap();
            let values: Vec<f32> = texels.iter().map(|texel| f32::from(*texel) - 128.0).collect();
            let bands = pyramid.decompose(&values);
            for band in &bands.oriented[0] {
                let squares: Vec<f64> = band.real.iter().map(|v| f64::from(*v) * f64::from(*v)).collect();
                let mean = squares.iter().sum::<f64>() / squares.len() as f64;
                let kurtosis = squares.iter().map(|s| s * s).sum::<f64>() / (squares.len() as f64 * mean * mean);
                assert!((kurtosis - 3.0).abs() < 0.2, "{}: {kurtosis}", kind.name);
            }
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

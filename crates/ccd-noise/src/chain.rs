//! The signal chain of the camera, one row at a time.

use portable_numerics::elementary::exp_f32;
use portable_numerics::random::SplitMix64;

use crate::exposure::SaturatedRun;
use crate::hash::{BLOCK, Block, Part, PerPixel, RowWords, Stream};
use crate::poisson::{clamp_to_zero, poisson};
use crate::{CameraParams, PhotonNoise, ReadNoise};

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chain {
    pub(crate) full_well: f32,
    gain: f32,
    offset: f32,
    read_noise: f32,
    /// Mean dark electrons.
    dark: f32,
    highest: f32,
    photon_noise: PhotonNoise,
    /// Mean from which one normal deviate stands for both noises.
    normal_from: f32,
    pub(crate) pattern: Option<Pattern>,
}

/// Records the saturated pixels of a row, if `runs` is given.
pub(crate) struct Marker<'a> {
    pub(crate) y: u32,
    pub(crate) runs: Option<&'a mut Vec<SaturatedRun>>,
}

impl Marker<'_> {
    /// Records the non-zero pixels of a block; adjacent pixels form one run.
    #[cold]
    #[inline(never)]
    fn mark(&mut self, part: &Part, full: &PerPixel<u32>) {
        let Some(runs) = &mut self.runs else { return };
        for (x, _) in (0..).map(|i| part.x.wrapping_add(i)).zip(&**full).filter(|(_, full)| **full != 0) {
            let x1 = x.wrapping_add(1);
            match runs.last_mut() {
                Some(last) if last.y == self.y && last.x1 == x => last.x1 = x1,
                _ => runs.push(SaturatedRun { y: self.y, x0: x, x1 }),
            }
        }
    }
}

impl Chain {
    #[expect(clippy::cast_possible_truncation, reason = "computations per pixel use single precision")]
    pub(crate) fn new(params: &CameraParams) -> Self {
        let read_noise = match params.read_noise {
            ReadNoise::Same { e } => e,
            ReadNoise::PerPixel { median_e, .. } => median_e,
        } as f32;
        Self {
            full_well: params.full_well_e as f32,
            gain: params.gain_dn_per_e as f32,
            offset: params.offset_dn as f32,
            read_noise,
            dark: params.dark_e() as f32,
            highest: f32::from(params.max_dn()),
            photon_noise: params.photon_noise,
            normal_from: match params.photon_noise {
                PhotonNoise::NormalAbove { mean_e } => mean_e as f32,
                PhotonNoise::Exact | PhotonNoise::Off => f32::INFINITY,
            },
            pattern: Pattern::new(params, read_noise),
        }
    }

    /// Returns y before rounding: K·charge + offset
    #[inline(always)]
    fn level(&self, charge: f32) -> f32 {
        self.gain * charge + self.offset
    }

    /// Returns the mean electrons of a block of pixels, from light and dark current.
    #[inline(always)]
    fn means(&self, electrons: &PerPixel<f32>, pixels: Option<&PixelPattern>) -> PerPixel<f32> {
        let mut means = *electrons;
        for (i, mean) in means.iter_mut().enumerate() {
            let light = clamp_to_zero(*mean);
            *mean = pixels.map_or(light, |pixels| light * pixels.response[i]) + self.dark;
        }
        means
    }

    /// Returns the mean, and writes the standard deviation of both noises to `noise`, where the mean is at least
    /// `normal_from`.
    #[inline(always)]
    fn one_normal(
        &self,
        means: &PerPixel<f32>,
        pixels: Option<&PixelPattern>,
        noise: &mut PerPixel<f32>,
        block: &Block<'_>,
    ) -> PerPixel<f32> {
        let mut everywhere = true;
        for mean in &**means {
            everywhere &= *mean >= self.normal_from;
        }
        let mut charge = if everywhere { *means } else { poisson(means, block) };
        for i in 0..BLOCK {
            let read = pixels.map_or(self.read_noise, |pixels| pixels.read_noise[i]);
            let both = (means[i].min(self.full_well) + read * read).sqrt();
            let normal = means[i] >= self.normal_from;
            noise[i] = if normal { both } else { read };
            charge[i] = if normal { means[i] } else { charge[i] };
        }
        charge
    }

    /// Writes the grey levels of a part of a row to `out`, and returns the number of saturated pixels. `before` and
    /// `after` are the charges before and after read noise.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the lowest 16 bits hold the level")]
    fn convert(
        &self,
        full_well: f32,
        [before, after]: [&PerPixel<f32>; 2],
        part: &Part,
        out: &mut [u16],
        marker: &mut Marker<'_>,
    ) -> usize {
        /// Adding 2²³ to a smaller integer leaves the integer in the lowest mantissa bits.
        const UNIT: f32 = 8_388_608.0;
        let mut codes = PerPixel([0; BLOCK]);
        let mut full = PerPixel([0; BLOCK]);
        for i in 0..BLOCK {
            let dn = self.level(after[i]);
            // ⌊y + ½⌋ within the range of the converter.
            codes[i] = ((dn + 0.5).floor().max(0.0).min(self.highest) + UNIT).to_bits() as u16;
            let saturated = (before[i] >= full_well) | (dn + 0.5 >= self.highest);
            full[i] = u32::from(saturated);
        }
        let out = &mut out[part.pixels.clone()];
        if let Some(out) = out.first_chunk_mut() {
            *out = codes.0;
        } else {
            full[..part.first].fill(0);
            full[part.first + out.len()..].fill(0);
            out.copy_from_slice(part.within(&codes));
        }
        let saturated = full.iter().sum::<u32>();
        if saturated != 0 {
            marker.mark(part, &full);
        }
        saturated as usize
    }
}

/// Returns N + d + σ·n; d is 0 without a fixed pattern.
#[inline(always)]
fn with_read_noise(
    charge: &PerPixel<f32>,
    noise: &PerPixel<f32>,
    read: &PerPixel<f32>,
    pixels: Option<&PixelPattern>,
) -> PerPixel<f32> {
    let mut after = PerPixel([0.0; BLOCK]);
    for i in 0..BLOCK {
        let offset = pixels.map_or(charge[i], |pixels| charge[i] + pixels.offset[i]);
        after[i] = offset + noise[i] * read[i];
    }
    after
}

#[multiversion::multiversion(targets = "simd")]
pub(crate) fn mean_row(chain: &Chain, electrons: &[f32], out: &mut [f32]) {
    for (dn, &mean) in out.iter_mut().zip(electrons) {
        let charge = (clamp_to_zero(mean) + chain.dark).min(chain.full_well);
        *dn = chain.level(charge).max(0.0).min(chain.highest);
    }
}

/// Exposes a row of pixels, with or without a fixed pattern.
#[multiversion::multiversion(targets = "simd")]
pub(crate) fn expose_row(
    chain: &Chain,
    row: &RowWords,
    pattern: Option<&PatternRow<'_>>,
    x: u32,
    electrons: &[f32],
    out: &mut [u16],
    marker: &mut Marker<'_>,
) -> usize {
    // Separate instances: the one without a fixed pattern has no branches.
    match pattern {
        None => expose(chain, row, None, x, electrons, out, marker),
        Some(pattern) => expose(chain, row, Some(pattern), x, electrons, out, marker),
    }
}

#[inline(always)]
fn expose(
    chain: &Chain,
    row: &RowWords,
    pattern: Option<&PatternRow<'_>>,
    x: u32,
    electrons: &[f32],
    out: &mut [u16],
    marker: &mut Marker<'_>,
) -> usize {
    let mut saturated = 0;
    for part in Part::of_row(x, electrons.len()) {
        let (block, pixels) = (row.block(part.x), pattern.map(|pattern| pattern.block(part.x)));
        let pixels = pixels.as_ref();
        let means = chain.means(&part.of(electrons), pixels);
        // g_po and the standard deviation of g_g of Eq. 13
        let mut noise = pixels.map_or(PerPixel([chain.read_noise; BLOCK]), |pixels| pixels.read_noise);
        let mut charge = match chain.photon_noise {
            PhotonNoise::Exact => poisson(&means, &block),
            PhotonNoise::Off => means,
            PhotonNoise::NormalAbove { .. } => chain.one_normal(&means, pixels, &mut noise, &block),
        };
        for charge in &mut *charge {
            *charge = charge.min(chain.full_well);
        }
        let after = with_read_noise(&charge, &noise, &block.normals(Stream::Read), pixels);
        saturated += chain.convert(chain.full_well, [&charge, &after], &part, out, marker);
    }
    saturated
}

/// Writes the whole electrons collected by a row to `charge`, without the limit of the full well.
#[multiversion::multiversion(targets = "simd")]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts from 0 to 2²⁵")]
pub(crate) fn gather_row(
    chain: &Chain,
    row: &RowWords,
    pattern: Option<&PatternRow<'_>>,
    electrons: &[f32],
    charge: &mut [u32],
) {
    for part in Part::of_row(0, electrons.len()) {
        let (block, pixels) = (row.block(part.x), pattern.map(|pattern| pattern.block(part.x)));
        let means = chain.means(&part.of(electrons), pixels.as_ref());
        let mut collected = if chain.photon_noise == PhotonNoise::Off {
            PerPixel(means.map(f32::round))
        } else {
            poisson(&means, &block)
        };
        if let PhotonNoise::NormalAbove { .. } = chain.photon_noise {
            let shot = block.normals(Stream::Shot);
            for i in 0..BLOCK {
                let normal = (means[i] + means[i].sqrt() * shot[i]).round().max(0.0);
                collected[i] = if means[i] >= chain.normal_from { normal } else { collected[i] };
            }
        }
        for (charge, collected) in charge[part.pixels.clone()].iter_mut().zip(part.within(&collected)) {
            *charge = *collected as u32;
        }
    }
}

/// Reads a row of whole electrons; each pixel holds at most `full_well`.
#[multiversion::multiversion(targets = "simd")]
pub(crate) fn read_row(
    chain: &Chain,
    row: &RowWords,
    pattern: Option<&PatternRow<'_>>,
    full_well: u32,
    charge: &[u32],
    out: &mut [u16],
    marker: &mut Marker<'_>,
) -> usize {
    let mut saturated = 0;
    for part in Part::of_row(0, charge.len()) {
        let pixels = pattern.map(|pattern| pattern.block(part.x));
        let noise = pixels.as_ref().map_or(PerPixel([chain.read_noise; BLOCK]), |pixels| pixels.read_noise);
        let charge = part.of(charge);
        let mut before = PerPixel([0.0; BLOCK]);
        for (before, charge) in before.iter_mut().zip(*charge) {
            *before = charge as f32;
        }
        let read = row.block(part.x).normals(Stream::Read);
        let after = with_read_noise(&before, &noise, &read, pixels.as_ref());
        saturated += chain.convert(full_well as f32, [&before, &after], &part, out, marker);
    }
    saturated
}

/// The fixed pattern of a camera: a pure function of its serial number and the pixel position.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pattern {
    key: u64,
    prnu: f32,
    dsnu: f32,
    read_noise: f32,
    /// Standard deviation of the natural logarithm of the read noise.
    spread: f32,
}

/// The fixed pattern of one row.
pub(crate) struct PatternRow<'a> {
    pattern: &'a Pattern,
    words: RowWords,
}

/// The fixed pattern of a block of pixels.
struct PixelPattern {
    /// Relative response to light, mean 1.
    response: PerPixel<f32>,
    /// Offset in electrons, mean 0.
    offset: PerPixel<f32>,
    /// Standard deviation of the read noise, in electrons.
    read_noise: PerPixel<f32>,
}

impl Pattern {
    /// Returns the fixed pattern, or `None` if all pixels are equal. `read_noise` is the median in electrons.
    #[expect(clippy::cast_possible_truncation, reason = "computations per pixel use single precision")]
    fn new(params: &CameraParams, read_noise: f32) -> Option<Self> {
        /// Separates serial numbers from frame keys of the same value.
        const CAMERAS: u64 = 0xca_3e7a_0000_1288;
        let spread = params.read_noise.spread() as f32;
        let uneven = params.prnu > 0.0 || params.dsnu_e > 0.0 || spread > 0.0;
        uneven.then(|| Self {
            key: SplitMix64::word(params.serial ^ CAMERAS, 0),
            prnu: params.prnu as f32,
            dsnu: params.dsnu_e as f32,
            read_noise,
            spread,
        })
    }

    pub(crate) fn row(&self, y: u32) -> PatternRow<'_> {
        PatternRow { pattern: self, words: RowWords::new(self.key, y) }
    }
}

impl PatternRow<'_> {
    /// Returns the fixed pattern of the block at `x`.
    #[inline(always)]
    fn block(&self, x: u32) -> PixelPattern {
        let Pattern { prnu, dsnu, read_noise, spread, .. } = *self.pattern;
        let block = self.words.block(x);
        let (mut response, mut offset, mut noise) =
            (PerPixel([1.0; BLOCK]), PerPixel([0.0; BLOCK]), PerPixel([read_noise; BLOCK]));
        if prnu > 0.0 {
            let normals = block.normals(Stream::Shot);
            for i in 0..BLOCK {
                response[i] = (1.0 + prnu * normals[i]).max(0.0);
            }
        }
        if dsnu > 0.0 {
            let normals = block.normals(Stream::Read);
            for i in 0..BLOCK {
                offset[i] = dsnu * normals[i];
            }
        }
        if spread > 0.0 {
            let normals = block.normals(Stream::Spread);
            for i in 0..BLOCK {
                noise[i] = read_noise * exp_f32(spread * normals[i]);
            }
        }
        PixelPattern { response, offset, read_noise: noise }
    }
}

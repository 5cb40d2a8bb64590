//! The camera as its pixels see it, a row at a time.

use portable_numerics::elementary::exp_f32;
use portable_numerics::random::SplitMix64;

use crate::exposure::SaturatedRun;
use crate::field::{blocks, padded};
use crate::hash::{BLOCK, Block, RowWords, Stream};
use crate::poisson::{at_least_nothing, poisson};
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
    /// Where one normal deviate serves for both noises.
    normal_from: f32,
    pub(crate) pattern: Option<Pattern>,
}

/// Where saturated pixels of a row are noted, if anywhere.
pub(crate) struct Marker<'a> {
    pub(crate) y: u32,
    pub(crate) runs: Option<&'a mut Vec<SaturatedRun>>,
}

impl Marker<'_> {
    /// Notes the pixels of a block at `x` that are not 0, one run for those side by side.
    #[cold]
    #[inline(never)]
    fn mark(&mut self, x: u32, full: &[u32; BLOCK]) {
        let Some(runs) = &mut self.runs else { return };
        for (x, _) in (0..).map(|i| x.wrapping_add(i)).zip(full).filter(|(_, full)| **full != 0) {
            let x1 = x.wrapping_add(1);
            match runs.last_mut() {
                Some(last) if last.y == self.y && last.x1 == x => last.x1 = x1,
                _ => runs.push(SaturatedRun { y: self.y, x0: x, x1 }),
            }
        }
    }
}

impl Chain {
    #[expect(clippy::cast_possible_truncation, reason = "pixels are single precision")]
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

    /// y before rounding: K·charge + offset
    #[inline(always)]
    fn level(&self, charge: f32) -> f32 {
        self.gain * charge + self.offset
    }

    /// Mean electrons of a block of pixels, light and dark.
    #[inline(always)]
    fn means(&self, electrons: &[f32; BLOCK], traits: Option<&Traits>) -> [f32; BLOCK] {
        let mut means = *electrons;
        for (i, mean) in means.iter_mut().enumerate() {
            let light = at_least_nothing(*mean);
            *mean = traits.map_or(light, |traits| light * traits.response[i]) + self.dark;
        }
        means
    }

    /// The mean itself, and both noises in the standard deviation, where the mean is large enough.
    #[inline(always)]
    fn one_normal(
        &self,
        means: &[f32; BLOCK],
        traits: Option<&Traits>,
        noise: &mut [f32; BLOCK],
        shot: &[f32; BLOCK],
        block: &Block<'_>,
    ) -> [f32; BLOCK] {
        let mut everywhere = true;
        for mean in means {
            everywhere &= *mean >= self.normal_from;
        }
        let mut charge = if everywhere { *means } else { poisson(means, shot, block) };
        for i in 0..BLOCK {
            let read = traits.map_or(self.read_noise, |traits| traits.read_noise[i]);
            let both = (means[i].min(self.full_well) + read * read).sqrt();
            let normal = means[i] >= self.normal_from;
            noise[i] = if normal { both } else { read };
            charge[i] = if normal { means[i] } else { charge[i] };
        }
        charge
    }

    /// Puts the grey levels of the block at `x` out, from the charges before and after reading, and returns the number of
    /// its saturated pixels.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the lowest 16 bits are the level")]
    fn convert(
        &self,
        full_well: f32,
        [before, after]: [&[f32; BLOCK]; 2],
        x: u32,
        out: &mut [u16],
        marker: &mut Marker<'_>,
    ) -> usize {
        /// Added to an integer below it, it leaves the integer in the lowest bits.
        const UNIT: f32 = 8_388_608.0;
        let mut codes = [0; BLOCK];
        let mut full = [0; BLOCK];
        for i in 0..BLOCK {
            let dn = self.level(after[i]);
            // ⌊y + ½⌋ within the range of the converter.
            codes[i] = ((dn + 0.5).floor().max(0.0).min(self.highest) + UNIT).to_bits() as u16;
            let saturated = (before[i] >= full_well) | (dn + 0.5 >= self.highest);
            full[i] = u32::from(saturated);
        }
        if let Some(out) = out.first_chunk_mut() {
            *out = codes;
        } else {
            full[out.len()..].fill(0);
            out.copy_from_slice(&codes[..out.len()]);
        }
        let saturated = full.iter().sum::<u32>();
        if saturated != 0 {
            marker.mark(x, &full);
        }
        saturated as usize
    }
}

/// N + d + σ·n, where d is 0 without a fixed pattern.
#[inline(always)]
fn with_read_noise(
    charge: &[f32; BLOCK],
    noise: &[f32; BLOCK],
    read: &[f32; BLOCK],
    traits: Option<&Traits>,
) -> [f32; BLOCK] {
    let mut after = [0.0; BLOCK];
    for i in 0..BLOCK {
        let offset = traits.map_or(charge[i], |traits| charge[i] + traits.offset[i]);
        after[i] = offset + noise[i] * read[i];
    }
    after
}

#[multiversion::multiversion(targets = "simd")]
pub(crate) fn mean_row(chain: &Chain, electrons: &[f32], out: &mut [f32]) {
    for (dn, &mean) in out.iter_mut().zip(electrons) {
        let charge = (at_least_nothing(mean) + chain.dark).min(chain.full_well);
        *dn = chain.level(charge).max(0.0).min(chain.highest);
    }
}

/// A row of a camera, with a fixed pattern or none.
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
    // Two loops: that of a camera whose pixels are alike has no branches.
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
    let both = electrons.chunks(BLOCK).zip(out.chunks_mut(BLOCK));
    for (x, (electrons, out)) in blocks(x).zip(both) {
        // Whole blocks are copied at once, which is what `first_chunk` is for; only the last of a row is not.
        let electrons = electrons.first_chunk().copied().unwrap_or_else(|| padded(electrons));
        let (block, traits) = (row.block(x), pattern.map(|pattern| pattern.block(x)));
        let (traits, [shot, read]) = (traits.as_ref(), block.normal_pairs());
        let means = chain.means(&electrons, traits);
        // g_po and the standard deviation of g_g of Eq. 13
        let mut noise = traits.map_or([chain.read_noise; BLOCK], |traits| traits.read_noise);
        let mut charge = match chain.photon_noise {
            PhotonNoise::Exact => poisson(&means, &shot, &block),
            PhotonNoise::Off => means,
            PhotonNoise::NormalAbove { .. } => chain.one_normal(&means, traits, &mut noise, &shot, &block),
        };
        for charge in &mut charge {
            *charge = charge.min(chain.full_well);
        }
        let after = with_read_noise(&charge, &noise, &read, traits);
        saturated += chain.convert(chain.full_well, [&charge, &after], x, out, marker);
    }
    saturated
}

/// The whole electrons that a row gathers, as if pixels had room for them.
#[multiversion::multiversion(targets = "simd")]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts from 0 to 2²⁵")]
pub(crate) fn gather_row(
    chain: &Chain,
    row: &RowWords,
    pattern: Option<&PatternRow<'_>>,
    electrons: &[f32],
    charge: &mut [u32],
) {
    let both = electrons.chunks(BLOCK).zip(charge.chunks_mut(BLOCK));
    for (x, (electrons, charge)) in blocks(0).zip(both) {
        let (block, traits) = (row.block(x), pattern.map(|pattern| pattern.block(x)));
        let means = chain.means(&padded(electrons), traits.as_ref());
        let [shot, _] = block.normal_pairs();
        let mut gathered =
            if chain.photon_noise == PhotonNoise::Off { means.map(f32::round) } else { poisson(&means, &shot, &block) };
        if let PhotonNoise::NormalAbove { .. } = chain.photon_noise {
            for i in 0..BLOCK {
                let normal = (means[i] + means[i].sqrt() * shot[i]).round().max(0.0);
                gathered[i] = if means[i] >= chain.normal_from { normal } else { gathered[i] };
            }
        }
        for (charge, gathered) in charge.iter_mut().zip(gathered) {
            *charge = gathered as u32;
        }
    }
}

/// A row read out of whole electrons, at most `full_well` of them.
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
    for (x, (charge, out)) in blocks(0).zip(charge.chunks(BLOCK).zip(out.chunks_mut(BLOCK))) {
        let traits = pattern.map(|pattern| pattern.block(x));
        let noise = traits.as_ref().map_or([chain.read_noise; BLOCK], |traits| traits.read_noise);
        let [_, read] = row.block(x).normal_pairs();
        let mut before = [0.0; BLOCK];
        for (before, &charge) in before.iter_mut().zip(charge) {
            *before = charge as f32;
        }
        let after = with_read_noise(&before, &noise, &read, traits.as_ref());
        saturated += chain.convert(full_well as f32, [&before, &after], x, out, marker);
    }
    saturated
}

/// The fixed pattern of a camera, a pure function of its serial number and the place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pattern {
    key: u64,
    prnu: f32,
    dsnu: f32,
    read_noise: f32,
    /// Standard deviation of the logarithm of the read noise.
    spread: f32,
}

/// The pattern of one row.
pub(crate) struct PatternRow<'a> {
    pattern: &'a Pattern,
    words: RowWords,
}

/// The pattern of a block of pixels.
struct Traits {
    /// Response to light, 1 on average.
    response: [f32; BLOCK],
    /// Offset in electrons, 0 on average.
    offset: [f32; BLOCK],
    /// Standard deviation of the read noise in electrons.
    read_noise: [f32; BLOCK],
}

impl Pattern {
    /// The pattern of these parameters, whose read noise is `read_noise` at the median, or none if all pixels are alike.
    #[expect(clippy::cast_possible_truncation, reason = "pixels are single precision")]
    fn new(params: &CameraParams, read_noise: f32) -> Option<Self> {
        /// Sets serial numbers apart from the keys of frames, which may be the same numbers.
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
    /// The pixels from `x` on.
    #[inline(always)]
    fn block(&self, x: u32) -> Traits {
        let Pattern { prnu, dsnu, read_noise, spread, .. } = *self.pattern;
        let block = self.words.block(x);
        let [mut response, mut offset] = block.normal_pairs();
        for i in 0..BLOCK {
            response[i] = (1.0 + prnu * response[i]).max(0.0);
            offset[i] *= dsnu;
        }
        let mut noise = [read_noise; BLOCK];
        if spread > 0.0 {
            let [normal, _] = block.normal_pairs_of(Stream::Chance, Stream::Fine);
            for i in 0..BLOCK {
                noise[i] = read_noise * exp_f32(spread * normal[i]);
            }
        }
        Traits { response, offset, read_noise: noise }
    }
}

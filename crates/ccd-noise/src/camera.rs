use rand_core::Rng;

use crate::field::{NoiseField, blocks, padded, rows, whole_rows};
use crate::hash::{BLOCK, Block, RowWords};
use crate::poisson::{at_least_nothing, poisson};
use crate::{CameraParams, Error, PhotonNoise};

/// A camera: photo-electrons in, grey levels out (Eq. 13 without its optics).
///
/// Per pixel, with µ its mean number of photo-electrons:
/// N = min(Poisson(µ), full well); y = ⌊K·(N + σ_d·n) + offset + ½⌋, clipped to 0 … 2ᵇ - 1,
/// where n is a standard normal deviate. In the words of EMVA 1288 the variance of y is
/// K²σ_d² + 1/12 + K·(mean of y - offset).
///
/// # Differences from the paper
///
/// Saturation and rounding stand here, which the paper leaves out; the paper's program adds both
/// noises to grey levels, which is the same with [`CameraParams::paper`].
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    electrons_per_dn: f64,
    max_dn: u16,
    chain: Chain,
}

/// The camera as the pixels see it.
#[derive(Debug, Clone, PartialEq)]
struct Chain {
    full_well: f32,
    gain: f32,
    offset: f32,
    read_noise: f32,
    highest: f32,
    photon_noise: PhotonNoise,
    /// Where one normal deviate serves for both noises.
    normal_from: f32,
}

impl Camera {
    /// Checks the parameters.
    ///
    /// # Errors
    ///
    /// If a field lies outside its range.
    #[expect(clippy::cast_possible_truncation, reason = "pixels are single precision")]
    pub fn new(params: &CameraParams) -> Result<Self, Error> {
        params.check()?;
        Ok(Self {
            electrons_per_dn: 1.0 / params.gain_dn_per_e,
            max_dn: params.max_dn(),
            chain: Chain {
                full_well: params.full_well_e as f32,
                gain: params.gain_dn_per_e as f32,
                offset: params.offset_dn as f32,
                read_noise: params.read_noise_e as f32,
                highest: f32::from(params.max_dn()),
                photon_noise: params.photon_noise,
                normal_from: match params.photon_noise {
                    PhotonNoise::NormalAbove { mean_e } => mean_e as f32,
                    PhotonNoise::Exact | PhotonNoise::Off => f32::INFINITY,
                },
            },
        })
    }

    /// Electrons that make one grey level, 1 / K.
    #[must_use]
    pub fn electrons_per_dn(&self) -> f64 {
        self.electrons_per_dn
    }

    /// The highest grey level, 2ᵇ - 1.
    #[must_use]
    pub fn max_dn(&self) -> u16 {
        self.max_dn
    }

    /// Exposes a frame: `electrons` are mean photo-electrons, >= 0 (anything else counts as
    /// 0), in rows of `width` pixels; `out` becomes the grey levels. The noise takes one 64-bit key from `rng`. Returns the number of
    /// saturated pixels, whether the pixel was full or the converter at its highest level.
    ///
    /// # Panics
    ///
    /// If `electrons` is not whole rows of `width`, or `out` not as long as it.
    pub fn expose_into<R: Rng + ?Sized>(&self, electrons: &[f32], width: usize, out: &mut [u16], rng: &mut R) -> usize {
        self.expose_window(electrons, width, [0, 0], rng.next_u64(), out)
    }

    /// Exposes a window of a frame whose first pixel lies at `origin` [x, y] of it: the same grey
    /// levels as the whole frame has there, under the same `key`. Otherwise as
    /// [`expose_into`](Self::expose_into).
    ///
    /// # Panics
    ///
    /// If `electrons` is not whole rows of `width`, or `out` not as long as it.
    pub fn expose_window(&self, electrons: &[f32], width: usize, origin: [u32; 2], key: u64, out: &mut [u16]) -> usize {
        whole_rows(electrons.len(), width);
        assert_eq!(out.len(), electrons.len(), "out has the wrong number of pixels");
        let field = NoiseField::new(key);
        let both = electrons.chunks_exact(width).zip(out.chunks_exact_mut(width));
        rows(origin)
            .zip(both)
            .map(|(y, (electrons, out))| expose_row(&self.chain, &field.row(y), origin[0], electrons, out))
            .sum()
    }

    /// The grey levels without noise and before rounding, within 0 … 2ᵇ - 1.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `electrons`.
    pub fn mean_dn_into(&self, electrons: &[f32], out: &mut [f32]) {
        assert_eq!(out.len(), electrons.len(), "out has the wrong number of pixels");
        mean_row(&self.chain, electrons, out);
    }

    /// Rounds grey levels, half up, and clips them to 0 … 2ᵇ - 1. Returns how many are at the
    /// highest level.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `dn`.
    pub fn quantise_into(&self, dn: &[f32], out: &mut [u16]) -> usize {
        assert_eq!(out.len(), dn.len(), "out has the wrong number of pixels");
        for (out, &dn) in out.iter_mut().zip(dn) {
            *out = self.chain.code(dn);
        }
        out.iter().filter(|&&code| code == self.max_dn).count()
    }
}

impl Chain {
    /// y before rounding: K·charge + offset
    #[inline(always)]
    fn level(&self, charge: f32) -> f32 {
        self.gain * charge + self.offset
    }

    /// ⌊y + ½⌋ within the range of the converter.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the lowest 16 bits are the level")]
    fn code(&self, dn: f32) -> u16 {
        /// Added to an integer below it, it leaves the integer in the lowest bits.
        const UNIT: f32 = 8_388_608.0;
        ((dn + 0.5).floor().max(0.0).min(self.highest) + UNIT).to_bits() as u16
    }

    /// Charges before and after reading, of a block of pixels.
    #[inline(always)]
    fn charges(&self, electrons: &[f32; BLOCK], row: &RowWords, x: u32) -> ([f32; BLOCK], [f32; BLOCK]) {
        let block = row.block(x);
        let [shot, read] = block.normal_pairs();
        let mut means = *electrons;
        for mean in &mut means {
            *mean = at_least_nothing(*mean);
        }
        // g_po and the standard deviation of g_g of Eq. 13
        let mut noise = [self.read_noise; BLOCK];
        let mut charge = match self.photon_noise {
            PhotonNoise::Exact => poisson(&means, &shot, &block),
            PhotonNoise::Off => means,
            PhotonNoise::NormalAbove { .. } => self.one_normal(&means, &mut noise, &shot, &block),
        };
        let mut after = [0.0; BLOCK];
        for i in 0..BLOCK {
            charge[i] = charge[i].min(self.full_well);
            after[i] = charge[i] + noise[i] * read[i];
        }
        (charge, after)
    }

    /// The mean itself, and both noises in the standard deviation, where the mean is large enough.
    #[inline(always)]
    fn one_normal(
        &self,
        means: &[f32; BLOCK],
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
            let both = (means[i].min(self.full_well) + self.read_noise * self.read_noise).sqrt();
            let normal = means[i] >= self.normal_from;
            noise[i] = if normal { both } else { noise[i] };
            charge[i] = if normal { means[i] } else { charge[i] };
        }
        charge
    }
}

#[multiversion::multiversion(targets = "simd")]
fn mean_row(chain: &Chain, electrons: &[f32], out: &mut [f32]) {
    for (dn, &mean) in out.iter_mut().zip(electrons) {
        *dn = chain.level(at_least_nothing(mean).min(chain.full_well)).max(0.0).min(chain.highest);
    }
}

#[multiversion::multiversion(targets = "simd")]
fn expose_row(chain: &Chain, row: &RowWords, x: u32, electrons: &[f32], out: &mut [u16]) -> usize {
    let mut saturated = 0;
    let both = electrons.chunks(BLOCK).zip(out.chunks_mut(BLOCK));
    for (x, (electrons, out)) in blocks(x).zip(both) {
        // Whole blocks are copied at once, which is what `first_chunk` is for; only the last of a row is not.
        let electrons = electrons.first_chunk().copied().unwrap_or_else(|| padded(electrons));
        let (before, after) = chain.charges(&electrons, row, x);
        let mut codes = [0; BLOCK];
        let mut full = [0; BLOCK];
        for i in 0..BLOCK {
            let dn = chain.level(after[i]);
            codes[i] = chain.code(dn);
            let saturated = (before[i] >= chain.full_well) | (dn + 0.5 >= chain.highest);
            full[i] = u32::from(saturated);
        }
        if let Some(out) = out.first_chunk_mut() {
            *out = codes;
        } else {
            full[out.len()..].fill(0);
            out.copy_from_slice(&codes[..out.len()]);
        }
        saturated += full.iter().sum::<u32>() as usize;
    }
    saturated
}

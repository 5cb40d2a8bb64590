//! What makes the pixels of one camera differ: a pure function of its serial number and the place.

use portable_numerics::elementary::exp_f32;
use portable_numerics::random::SplitMix64;

use crate::CameraParams;
use crate::hash::{BLOCK, RowWords, Stream};

/// The fixed pattern of a camera.
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
pub(crate) struct Traits {
    /// Response to light, 1 on average.
    pub(crate) response: [f32; BLOCK],
    /// Offset in electrons, 0 on average.
    pub(crate) offset: [f32; BLOCK],
    /// Standard deviation of the read noise in electrons.
    pub(crate) read_noise: [f32; BLOCK],
}

impl Pattern {
    /// The pattern of these parameters, whose read noise is `read_noise` at the median, or none if all pixels are alike.
    #[expect(clippy::cast_possible_truncation, reason = "pixels are single precision")]
    pub(crate) fn new(params: &CameraParams, read_noise: f32) -> Option<Self> {
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
    pub(crate) fn block(&self, x: u32) -> Traits {
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

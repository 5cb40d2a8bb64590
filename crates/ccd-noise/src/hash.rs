//! Random words as a pure function of key and position.

use portable_numerics::random::{Rng, SplitMix64, normals_of_words};

/// Pixels per block: enough to fill the widest vector registers several times.
pub(crate) const BLOCK: usize = BLOCK_STEP as usize;

/// `BLOCK` as a distance between positions.
pub(crate) const BLOCK_STEP: u32 = 64;

/// 2³² / golden ratio: distributes neighbouring positions over all bits.
const SPREAD: u32 = 0x9e37_79b9;

/// Purpose of a random word.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Stream {
    /// Radius and angle of the pair of normal deviates: one for photon noise, one for read noise.
    Radius,
    Angle,
    /// Acceptance test of a proposed count.
    Chance,
    /// Further bits of `Chance`, for counts drawn by inversion.
    Fine,
}

/// The random words of one row of a field.
#[derive(Debug, Clone)]
pub(crate) struct RowWords {
    start: u32,
    streams: [u32; 4],
    rare: u64,
}

impl RowWords {
    #[expect(clippy::cast_possible_truncation, reason = "upper and lower halves of words")]
    pub(crate) fn new(key: u64, y: u32) -> Self {
        let mut words = SplitMix64::new(key ^ SplitMix64::word(u64::from(y), 0));
        let [a, b, c] = [0; 3].map(|_| words.next_u64());
        let streams = [(a >> 32) as u32, b as u32, (b >> 32) as u32, (c >> 32) as u32];
        Self { start: a as u32, streams, rare: words.next_u64() }
    }

    /// Returns the block of pixels that starts at `x`; positions are hashed once for all streams.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "less than the block length")]
    pub(crate) fn block(&self, x: u32) -> Block<'_> {
        let mut places = [0; BLOCK];
        for (i, place) in places.iter_mut().enumerate() {
            let x = x.wrapping_add(i as u32);
            *place = mix(x.wrapping_mul(SPREAD).wrapping_add(self.start));
        }
        Block { row: self, x, places }
    }
}

/// The random words of a block of pixels in one row.
pub(crate) struct Block<'a> {
    row: &'a RowWords,
    x: u32,
    places: [u32; BLOCK],
}

impl Block<'_> {
    /// Returns one word per pixel from a stream.
    #[inline(always)]
    pub(crate) fn words(&self, stream: Stream) -> [u32; BLOCK] {
        let salt = self.row.streams[stream as usize];
        let mut words = self.places;
        for word in &mut words {
            *word = mix(word.wrapping_add(salt));
        }
        words
    }

    /// Returns two standard normal deviates per pixel: one for photon noise, one for read noise.
    #[inline(always)]
    pub(crate) fn normal_pairs(&self) -> [[f32; BLOCK]; 2] {
        self.normal_pairs_of(Stream::Radius, Stream::Angle)
    }

    /// Returns two standard normal deviates per pixel, from any two streams.
    #[inline(always)]
    pub(crate) fn normal_pairs_of(&self, radii: Stream, angles: Stream) -> [[f32; BLOCK]; 2] {
        normals_of_words(&self.words(radii), &self.words(angles))
    }

    /// Returns a generator of further words for one pixel.
    #[expect(clippy::cast_possible_truncation, reason = "less than the block length")]
    pub(crate) fn rare(&self, i: usize) -> SplitMix64 {
        let x = self.x.wrapping_add(i as u32);
        SplitMix64::new(SplitMix64::word(self.row.rare ^ u64::from(x), 0))
    }
}

/// A bijection on 32 bits: each input bit flips each output bit with a probability near one half (from C. Wellons'
/// search, bias 0.11).
#[inline(always)]
fn mix(mut x: u32) -> u32 {
    x = (x ^ (x >> 16)).wrapping_mul(0x21f0_aaad);
    x = (x ^ (x >> 15)).wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each bit of a position, a row or a key flips each bit of each word half of the time.
    #[test]
    fn every_input_bit_changes_every_output_bit() {
        let word = |key: u64, y: u32, x: u32, s: Stream| RowWords::new(key, y).block(x).words(s)[0];
        let small = |words: &mut SplitMix64| u32::try_from(words.next_u64() >> 48).unwrap();
        let samples = 4000;
        for stream in [Stream::Radius, Stream::Angle, Stream::Chance, Stream::Fine] {
            for bit in [0, 1, 2, 5, 10, 17, 31] {
                let mut flips = [[0_u32; 32]; 3];
                let mut inputs = SplitMix64::new(7);
                for _ in 0..samples {
                    let (key, y, x) = (inputs.next_u64(), small(&mut inputs), small(&mut inputs));
                    let here = word(key, y, x, stream);
                    let moved = [
                        word(key ^ (1 << bit), y, x, stream),
                        word(key, y ^ (1 << bit), x, stream),
                        word(key, y, x ^ (1 << bit), stream),
                    ];
                    for (flips, moved) in flips.iter_mut().zip(moved) {
                        for (i, flips) in flips.iter_mut().enumerate() {
                            *flips += (here ^ moved) >> i & 1;
                        }
                    }
                }
                for flips in flips.iter().flatten() {
                    // 2688 counts are compared, therefore five standard errors.
                    let z = (f64::from(*flips) - f64::from(samples) / 2.0) / (f64::from(samples) / 4.0).sqrt();
                    assert!(z.abs() < 5.0, "{stream:?}, bit {bit}: {z}");
                }
            }
        }
    }
}

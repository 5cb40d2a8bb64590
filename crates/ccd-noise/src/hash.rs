//! Random words as a pure function of key and position.

use core::ops::Range;

use portable_numerics::random::{Rng, SplitMix64, normals_of_words};

/// Pixels per block: enough to fill the widest vector registers several times. Blocks begin at multiples of this number
/// in the frame, so that the words of a pixel do not depend on the window.
pub(crate) const BLOCK: usize = BLOCK_STEP as usize;

/// `BLOCK` as a distance between positions.
const BLOCK_STEP: u32 = 128;

/// Pairs of normal deviates in a block.
const PAIRS: usize = BLOCK / 2;

/// 2³² / golden ratio: distributes neighbouring positions over all bits.
const SPREAD: u32 = 0x9e37_79b9;

/// One value per pixel of a block, aligned to the widest vector registers.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct PerPixel<T>(pub(crate) [T; BLOCK]);

impl<T> core::ops::Deref for PerPixel<T> {
    type Target = [T; BLOCK];

    #[inline(always)]
    fn deref(&self) -> &[T; BLOCK] {
        &self.0
    }
}

impl<T> core::ops::DerefMut for PerPixel<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T; BLOCK] {
        &mut self.0
    }
}

/// Purpose of a random word.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Stream {
    /// Normal deviate for photon noise.
    Shot,
    /// Normal deviate for read noise.
    Read,
    /// Normal deviate for the read noise of a pixel relative to that of others.
    Spread,
    /// Further bits of the uniform deviate, for counts drawn by inversion.
    Fine,
}

/// The random words of one row of a field.
#[derive(Debug, Clone)]
pub(crate) struct RowWords {
    start: u32,
    streams: [u32; 4],
    rare: u64,
}

/// The part of a row of pixels in one block.
pub(crate) struct Part {
    /// Position of the block in the frame.
    pub(crate) x: u32,
    /// First pixel of the block in the row.
    pub(crate) first: usize,
    /// These pixels in the row.
    pub(crate) pixels: Range<usize>,
}

impl Part {
    /// Returns the parts of a row of `len` pixels that starts at `x`.
    pub(crate) fn of_row(x: u32, len: usize) -> impl Iterator<Item = Self> {
        let (start, before) = (x - x % BLOCK_STEP, (x % BLOCK_STEP) as usize);
        (0..)
            .map(move |i: u32| start.wrapping_add(i.wrapping_mul(BLOCK_STEP)))
            .zip((0..before + len).step_by(BLOCK))
            .map(move |(x, begin)| Self {
                x,
                first: before.saturating_sub(begin),
                pixels: begin.saturating_sub(before)..(begin + BLOCK - before).min(len),
            })
    }

    /// Returns a block with the values of this part of a row. The rest of the block repeats one of them.
    #[inline(always)]
    pub(crate) fn of<T: Copy>(&self, row: &[T]) -> PerPixel<T> {
        let values = &row[self.pixels.clone()];
        PerPixel(values.first_chunk().copied().unwrap_or_else(|| {
            let mut block = [values[0]; BLOCK];
            block[self.first..][..values.len()].copy_from_slice(values);
            block
        }))
    }

    /// Returns the pixels of this part in a block.
    #[inline(always)]
    pub(crate) fn within<'b, T>(&self, block: &'b PerPixel<T>) -> &'b [T] {
        &block[self.first..][..self.pixels.len()]
    }
}

impl RowWords {
    #[expect(clippy::cast_possible_truncation, reason = "upper and lower halves of words")]
    pub(crate) fn new(key: u64, y: u32) -> Self {
        let mut words = SplitMix64::new(key ^ SplitMix64::word(u64::from(y), 0));
        let [a, b, c] = [0; 3].map(|_| words.next_u64());
        let streams = [(a >> 32) as u32, b as u32, (b >> 32) as u32, (c >> 32) as u32];
        Self { start: a as u32, streams, rare: words.next_u64() }
    }

    /// Returns the block of pixels at `x`, a multiple of [`BLOCK`]; positions are hashed once for all streams.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "less than the block length")]
    pub(crate) fn block(&self, x: u32) -> Block<'_> {
        let mut places = PerPixel([0; BLOCK]);
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
    /// The hashed positions: one word per pixel of a further stream.
    pub(crate) places: PerPixel<u32>,
}

impl Block<'_> {
    /// Returns one word per pixel from a stream.
    #[inline(always)]
    pub(crate) fn words(&self, stream: Stream) -> PerPixel<u32> {
        let salt = self.row.streams[stream as usize];
        let mut words = self.places;
        for word in &mut *words {
            *word = mix(word.wrapping_add(salt));
        }
        words
    }

    /// Returns one standard normal deviate per pixel from a stream. The words of the first half of the block are radii,
    /// those of the second half angles; both deviates of a pair are used.
    #[inline(always)]
    pub(crate) fn normals(&self, stream: Stream) -> PerPixel<f32> {
        let words = self.words(stream);
        let mut normals = PerPixel([0.0; BLOCK]);
        let (first, second) = normals.split_at_mut(PAIRS);
        for i in 0..PAIRS {
            [[first[i]], [second[i]]] = normals_of_words(&[words[i]], &[words[i + PAIRS]]);
        }
        normals
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
        let word = |key: u64, y: u32, x: u32, s: Option<Stream>| {
            let (row, i) = (RowWords::new(key, y), x as usize % BLOCK);
            let block = row.block(x - x % BLOCK_STEP);
            s.map_or(block.places[i], |s| block.words(s)[i])
        };
        let small = |words: &mut SplitMix64| u32::try_from(words.next_u64() >> 48).unwrap();
        let samples = 4000;
        let streams = [Stream::Shot, Stream::Read, Stream::Spread, Stream::Fine].map(Some);
        for stream in streams.into_iter().chain([None]) {
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
                    // 3360 counts are compared, therefore five standard errors.
                    let z = (f64::from(*flips) - f64::from(samples) / 2.0) / (f64::from(samples) / 4.0).sqrt();
                    assert!(z.abs() < 5.0, "{stream:?}, bit {bit}: {z}");
                }
            }
        }
    }
}

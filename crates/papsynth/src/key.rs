//! Streams of random numbers, one for every purpose.
//!
//! An image is a function of `(seed, index)`; every object of it, and every purpose within an object, has a
//! stream of its own. Adding one speckle therefore moves no nucleus, and the order in which objects are made,
//! or the thread that makes them, changes nothing.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use sha2::{Digest, Sha256};

/// The generator behind every stream: xoshiro256++, whose output is fixed by its 256-bit state alone.
pub type Stream = Xoshiro256PlusPlus;

/// Version of the mapping from keys to numbers, and from numbers to images. It changes when the same recipe,
/// model, seed and index would give another image, and is recorded with every data set.
pub const STREAM_VERSION: u32 = 5;

/// The [`STREAM_VERSION`] that last changed the random numbers themselves: versions since then draw the same numbers.
const NUMBERS_VERSION: u32 = 3;

/// What names one image: the seed of the data set and the index of the image in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct Key {
    /// Seed of the whole data set.
    pub seed: u64,
    /// Index of the image, counted from 0.
    pub index: u64,
}

impl Key {
    /// The key of a plot of a whole slide, whose own key this is.
    pub(crate) fn plot(self, number: u32) -> Self {
        self.part(0, number)
    }

    /// The key of a frame of a whole slide, whose own key this is.
    pub(crate) fn frame(self, number: u32) -> Self {
        self.part(1, number)
    }

    /// Returns the key of a repeated draw of the objects of an image: attempt 0 has the streams of the image.
    pub(crate) fn attempt(self, attempt: u32) -> Self {
        if attempt == 0 {
            return self;
        }
        Self { seed: self.stream("field", attempt.into(), "attempt").next_u64(), ..self }
    }

    /// The upper bit tells parts of slides from images; slides are numbered below 2³⁰.
    fn part(self, kind: u64, number: u32) -> Self {
        let slide = self.index & ((1 << 30) - 1);
        Self { seed: self.seed, index: 1 << 63 | kind << 62 | slide << 32 | u64::from(number) }
    }

    /// The stream of one purpose of one object.
    ///
    /// `kind` names the kind of object ("cell", "speckle", …, or "field" for what belongs to the whole image),
    /// `object` counts within that kind, `purpose` says what the numbers are for.
    #[must_use]
    pub fn stream(&self, kind: &str, object: u64, purpose: &str) -> Stream {
        let mut hash = Sha256::new();
        hash.update(b"papsynth");
        hash.update(NUMBERS_VERSION.to_le_bytes());
        hash.update(self.seed.to_le_bytes());
        hash.update(self.index.to_le_bytes());
        hash.update(object.to_le_bytes());
        hash.update(u32::try_from(kind.len()).unwrap_or(u32::MAX).to_le_bytes());
        hash.update(kind.as_bytes());
        hash.update(purpose.as_bytes());
        Stream::from_seed(hash.finalize().into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;

    #[test]
    fn every_part_of_a_name_matters() {
        let key = Key { seed: 1, index: 2 };
        let first = key.stream("cell", 3, "outline").next_u64();
        assert_eq!(first, key.stream("cell", 3, "outline").next_u64());
        for other in [
            Key { seed: 9, index: 2 }.stream("cell", 3, "outline"),
            Key { seed: 1, index: 9 }.stream("cell", 3, "outline"),
            key.stream("cel", 3, "loutline"),
            key.stream("cell", 4, "outline"),
            key.stream("cell", 3, "texture"),
        ] {
            let mut other = other;
            assert_ne!(first, other.next_u64());
        }
    }
}

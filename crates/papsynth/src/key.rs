//! Streams of random numbers, one for every purpose.
//!
//! An image is a function of `(seed, index)`. Each object, and each purpose within an object, has a separate stream. An
//! additional speckle therefore moves no nucleus, and results do not depend on the order of objects or on threads.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use sha2::{Digest, Sha256};

/// The generator of all streams: xoshiro256++, whose output is determined by its 256-bit state.
pub type Stream = Xoshiro256PlusPlus;

/// Version of the mapping from keys to numbers, and from numbers to images. It changes if the same recipe, model, seed
/// and index give another image, and is recorded in each data set.
pub const STREAM_VERSION: u32 = 36;

/// The last [`STREAM_VERSION`] that changed the random numbers.
const NUMBERS_VERSION: u32 = 3;

/// The key of an image: the seed of the data set and the index of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct Key {
    /// Seed of the data set.
    pub seed: u64,
    /// Index of the image, counted from 0.
    pub index: u64,
}

impl Key {
    /// Returns the key of a plot of a whole slide with this key.
    pub(crate) fn plot(self, number: u32) -> Self {
        self.part(0, number)
    }

    /// Returns the key of a frame of a whole slide with this key.
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

    /// The upper bit distinguishes parts of slides from images; slide numbers are below 2³⁰.
    fn part(self, kind: u64, number: u32) -> Self {
        let slide = self.index & ((1 << 30) - 1);
        Self { seed: self.seed, index: 1 << 63 | kind << 62 | slide << 32 | u64::from(number) }
    }

    /// Returns the stream of a purpose of an object.
    ///
    /// `kind` is the kind of object ("cell", "speckle", …, or "field" for the complete image), `object` its number
    /// within the kind, `purpose` the use of the numbers.
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
    fn every_part_of_a_key_changes_the_stream() {
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

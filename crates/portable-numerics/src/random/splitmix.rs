use core::convert::Infallible;

use rand_core::{TryRng, utils};

/// Weyl increment: 2⁶⁴ / golden ratio, odd.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// The generator SplitMix64 of Steele, Lea and Flood (doi:10.1145/2714064.2660195).
///
/// The state is one word, and each output word can be computed alone, so it also serves as a hash of keys and
/// positions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SplitMix64(u64);

impl SplitMix64 {
    /// Creates a generator with this state.
    #[must_use]
    pub fn new(state: u64) -> Self {
        Self(state)
    }

    /// Returns output word `index`, counted from 0, of the generator with the state `key`: the `index`-th key derived
    /// from `key`.
    #[must_use]
    pub fn word(key: u64, index: u64) -> u64 {
        mix(key.wrapping_add(GOLDEN.wrapping_mul(index.wrapping_add(1))))
    }
}

impl TryRng for SplitMix64 {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        // The upper half.
        self.try_next_u64().map(|word| u32::try_from(word >> 32).unwrap_or_default())
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        self.0 = self.0.wrapping_add(GOLDEN);
        Ok(mix(self.0))
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        utils::fill_bytes_via_next_word(bytes, || self.try_next_u64())
    }
}

/// The finaliser (Stafford's variant 13): a bijection in which every input bit affects every output bit.
fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;

    #[test]
    fn words_match_the_published_program() {
        // The first words of Vigna's splitmix64.c with the state 1234567.
        let mut rng = SplitMix64::new(1_234_567);
        let first = [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423];
        assert_eq!([0; 3].map(|_| rng.next_u64()), first);
        assert_eq!([0, 1, 2].map(|index| SplitMix64::word(1_234_567, index)), first);
    }
}

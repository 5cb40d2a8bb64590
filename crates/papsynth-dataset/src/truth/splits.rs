//! Splits of a data set for training, validation and test.

use sha2::{Digest, Sha256};

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Split {
    Train,
    Val,
    Test,
}

impl Split {
    pub(crate) const ALL: [Self; 3] = [Self::Train, Self::Val, Self::Test];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Val => "val",
            Self::Test => "test",
        }
    }

    /// Returns the split of a frame, independent of its slide.
    pub(crate) fn of_field(seed: u64, index: u64) -> Self {
        Self::draw(seed, "field", index)
    }

    /// Returns the split of all fields of a slide. They have the same staining and light.
    pub(crate) fn of_slide(seed: u64, slide: u64) -> Self {
        Self::draw(seed, "slide", slide)
    }

    /// Draws a split with probabilities 0.8, 0.1 and 0.1. It depends only on seed and number, so frames keep their
    /// splits when a data set grows; a split of a small data set may be empty.
    fn draw(seed: u64, what: &str, number: u64) -> Self {
        let hash = Sha256::digest(format!("papsynth split {seed} {what} {number}"));
        let word = u32::from_le_bytes([hash[0], hash[1], hash[2], hash[3]]);
        match (u64::from(word) * 10) >> 32 {
            0..8 => Self::Train,
            8 => Self::Val,
            _ => Self::Test,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_have_their_probabilities_and_differ_between_slides_and_fields() {
        for of in [Split::of_field, Split::of_slide] {
            let count = |split| (0..20_000).filter(|&n| of(7, n) == split).count();
            // Four standard deviations.
            assert!(count(Split::Train).abs_diff(16_000) < 226);
            assert!(count(Split::Val).abs_diff(2_000) < 170 && count(Split::Test).abs_diff(2_000) < 170);
        }
        assert!((0..100).any(|n| Split::of_field(7, n) != Split::of_slide(7, n)));
    }
}

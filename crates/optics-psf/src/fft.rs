use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use rustfft::{Fft as Transform, FftDirection, FftNum, FftPlanner, FftPlannerScalar};

/// Which FFT runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Fft {
    /// The best instruction set of the machine at hand. The last bits differ between machines.
    Fastest,
    /// Scalar code in one fixed order: the same bits wherever it runs, about twice as slow.
    Portable,
}

impl Fft {
    pub(crate) fn plan<T: FftNum>(self, len: usize, direction: FftDirection) -> Arc<dyn Transform<T>> {
        match self {
            Self::Fastest => FftPlanner::new().plan_fft(len, direction),
            Self::Portable => FftPlannerScalar::new().plan_fft(len, direction),
        }
    }
}

/// A forward and an inverse transform of one length.
pub(crate) type Pair = [Arc<dyn Transform<f32>>; 2];

/// Transforms of all lengths that were asked for: each is planned once.
pub(crate) struct Plans {
    fft: Fft,
    made: Mutex<BTreeMap<usize, Pair>>,
}

impl Plans {
    pub(crate) fn new(fft: Fft) -> Self {
        Self { fft, made: Mutex::default() }
    }

    pub(crate) fn pair(&self, len: usize) -> Pair {
        // A plan is whole or absent, even if a thread has panicked.
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let plan = || [FftDirection::Forward, FftDirection::Inverse].map(|direction| self.fft.plan(len, direction));
        made.entry(len).or_insert_with(plan).clone()
    }
}

/// Longest side of a grid, samples.
pub(crate) const LONGEST_SIDE: usize = 32_768;

/// The next length whose FFT is fast, 2ᵃ 3ᵇ 5ᶜ with an even number of samples.
#[must_use]
pub fn fast_length(least: usize) -> usize {
    let mut best = least.next_power_of_two().max(2);
    let mut fives = 1;
    while 2 * fives < best {
        let mut odd = fives;
        while 2 * odd < best {
            best = best.min(odd * least.div_ceil(odd).next_power_of_two().max(2));
            odd *= 3;
        }
        fives *= 5;
    }
    best
}

/// Signed frequency of a place in an FFT of `len`, in cycles per `len`.
pub(crate) fn signed(place: usize, len: usize) -> f64 {
    if 2 * place < len { place as f64 } else { place as f64 - len as f64 }
}

/// `to`, rows of `height`, becomes the transpose of `from`, rows of `width`.
pub(crate) fn transpose<T: Copy>(from: &[T], width: usize, to: &mut [T]) {
    /// Side of a tile: as much as two caches lines of numbers, whichever they are.
    const TILE: usize = 16;
    let height = from.len() / width;
    for top in (0..height).step_by(TILE) {
        for left in (0..width).step_by(TILE) {
            for x in left..(left + TILE).min(width) {
                for y in top..(top + TILE).min(height) {
                    to[x * height + y] = from[y * width + x];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_lengths_are_the_next_ones() {
        let fast = |n: usize| {
            let mut rest = n;
            for prime in [2, 3, 5] {
                while rest.is_multiple_of(prime) {
                    rest /= prime;
                }
            }
            rest == 1 && n.is_multiple_of(2)
        };
        for least in 1..1500 {
            assert_eq!(fast_length(least), (least.max(2)..).find(|&n| fast(n)).unwrap(), "{least}");
        }
    }

    #[test]
    fn transposes_ragged_tiles() {
        let from: Vec<usize> = (0..37 * 21).collect();
        let mut to = vec![0; from.len()];
        transpose(&from, 37, &mut to);
        assert!((0..37).all(|x| (0..21).all(|y| to[x * 21 + y] == y * 37 + x)));
    }

    #[test]
    fn frequencies_are_signed() {
        assert_eq!((0..4).map(|i| signed(i, 4)).collect::<Vec<_>>(), [0.0, 1.0, -2.0, -1.0]);
        assert_eq!((0..3).map(|i| signed(i, 3)).collect::<Vec<_>>(), [0.0, 1.0, -1.0]);
    }
}

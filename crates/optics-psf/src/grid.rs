//! Sides and frequencies of grids that are transformed.

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
    fn frequencies_are_signed() {
        assert_eq!((0..4).map(|i| signed(i, 4)).collect::<Vec<_>>(), [0.0, 1.0, -2.0, -1.0]);
        assert_eq!((0..3).map(|i| signed(i, 3)).collect::<Vec<_>>(), [0.0, 1.0, -1.0]);
    }
}

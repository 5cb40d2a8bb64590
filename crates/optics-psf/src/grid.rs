//! Sizes and frequencies of FFT grids.

/// Range of grid sizes in samples.
pub(crate) const SIDES: core::ops::RangeInclusive<f64> = 1.0..=32_768.0;

/// Returns the smallest even length 2ᵃ 3ᵇ 5ᶜ, for which an FFT is fast, of at least `least`.
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

/// Returns the signed frequency of an FFT index, in cycles per `len`.
pub(crate) fn signed(place: usize, len: usize) -> f64 {
    if 2 * place < len { place as f64 } else { place as f64 - len as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_length_is_the_smallest_possible() {
        // Numbers without other prime factors divide a high power of 30.
        let fast = |n: usize| n.is_multiple_of(2) && 30_u64.pow(11).is_multiple_of(n as u64);
        for least in 1..1500 {
            assert_eq!(fast_length(least), (least.max(2)..).find(|&n| fast(n)).unwrap(), "{least}");
        }
    }
}

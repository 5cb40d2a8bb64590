//! Blooming: moves excess charge to neighbouring pixels. Charge is counted in whole electrons, so that none is lost to
//! rounding.

use crate::exposure::Exposure;

/// Moves charge until no pixel holds more than `well` electrons. Does not count saturated pixels.
pub(crate) fn spread(charge: &mut [u32], width: usize, well: u32, vertical: f64, anti_blooming: f64) -> Exposure {
    let mut spill = Exposure::default();
    if charge.iter().all(|&c| c <= well) {
        return spill;
    }
    let mut sideways = vec![0; width + 2];
    for row in charge.chunks_exact_mut(width) {
        if row.iter().any(|&c| c > well) {
            sideways.fill(0);
            for (x, charge) in row.iter_mut().enumerate().filter(|(_, charge)| **charge > well) {
                let excess = *charge - well;
                let drained = fraction_of(excess, anti_blooming);
                let aside = fraction_of(excess - drained, 1.0 - vertical);
                *charge -= drained + aside;
                spill.drained_e += u64::from(drained);
                // Odd counts: the last electron goes left in even columns, right in odd columns.
                let left = (aside + u32::from(x.is_multiple_of(2))) / 2;
                sideways[x] += left;
                sideways[x + 2] += aside - left;
            }
            spill.escaped_e += u64::from(sideways[0]) + u64::from(sideways[width + 1]);
            for (charge, aside) in row.iter_mut().zip(&sideways[1..]) {
                *charge += aside;
            }
        }
    }
    // Half of the excess moves down. A second pass moves the remainder up.
    let mut carried = vec![0; width];
    for row in charge.chunks_exact_mut(width) {
        carry(row, &mut carried, well, |excess| excess / 2);
    }
    spill.escaped_e += carried.iter().sum::<u64>();
    carried.fill(0);
    for row in charge.chunks_exact_mut(width).rev() {
        carry(row, &mut carried, well, |excess| excess);
    }
    spill.escaped_e += carried.iter().sum::<u64>();
    spill
}

/// Moves `part` of the excess above `well` along, and fills free capacity of the row from `carried`.
#[inline(always)]
fn carry(row: &mut [u32], carried: &mut [u64], well: u32, part: impl Fn(u32) -> u32) {
    for (charge, carried) in row.iter_mut().zip(carried) {
        let taken = part(charge.saturating_sub(well));
        let room = u64::from(well.saturating_sub(*charge));
        let left = room.min(*carried);
        *carried = *carried - left + u64::from(taken);
        *charge = *charge - taken + narrow(left);
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most `whole`")]
fn fraction_of(whole: u32, fraction: f64) -> u32 {
    (f64::from(whole) * fraction) as u32
}

#[expect(clippy::cast_possible_truncation, reason = "at most the free capacity of a pixel")]
fn narrow(charge: u64) -> u32 {
    charge as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use portable_numerics::random::{Rng, SplitMix64};

    fn sum(charge: &[u32]) -> u64 {
        charge.iter().map(|&c| u64::from(c)).sum()
    }

    #[test]
    fn charge_is_conserved_to_the_electron() {
        let (width, well) = (37, 18_000);
        let mut words = SplitMix64::new(20);
        for vertical in [0.0, 0.3, 0.9, 1.0] {
            for anti_blooming in [0.0, 0.2, 1.0] {
                let mut charge: Vec<u32> =
                    (0..width * 23).map(|_| u32::try_from(words.next_u64() >> 51).unwrap()).collect();
                for bright in [0, 36, 37 * 11 + 20, 37 * 12 + 20, 37 * 22, 37 * 23 - 1] {
                    charge[bright] = 16_777_216;
                }
                let before = sum(&charge);
                let excess: u64 = charge.iter().map(|&c| u64::from(c.saturating_sub(well))).sum();
                let spill = spread(&mut charge, width, well, vertical, anti_blooming);
                assert_eq!(sum(&charge) + spill.drained_e + spill.escaped_e, before);
                assert!(charge.iter().all(|&c| c <= well));
                assert!(
                    spill.drained_e.abs_diff(fraction_of(u32::try_from(excess).unwrap(), anti_blooming).into()) < 10
                );
            }
        }
    }

    #[test]
    fn a_bright_pixel_fills_its_column() {
        let (width, height, well) = (9, 101, 100);
        let mut charge = vec![40; width * height];
        charge[50 * width + 4] = 100 + 2 * 20 * 60;
        let before = sum(&charge);
        assert_eq!(spread(&mut charge, width, well, 1.0, 0.0), Exposure::default());
        assert_eq!(sum(&charge), before);
        for y in 0..height {
            for x in 0..width {
                let full = x == 4 && y.abs_diff(50) <= 20;
                assert_eq!(charge[y * width + x], if full { 100 } else { 40 }, "{x} {y}");
            }
        }
        // Horizontal blooming is symmetric: both neighbouring columns receive a quarter.
        let mut charge = vec![0; width * height];
        charge[50 * width + 4] = 100 + 1000;
        spread(&mut charge, width, well, 0.5, 0.0);
        let column = |x: usize| (0..height).map(|y| charge[y * width + x]).sum::<u32>();
        assert_eq!([column(3), column(4), column(5)], [250, 600, 250]);
        // If every pixel is full, all excess charge leaves the frame.
        for (anti_blooming, drained_e) in [(0.0, 0), (1.0, 50 * 990)] {
            let mut charge = vec![1000; 50];
            let spill = spread(&mut charge, 5, 10, 0.9, anti_blooming);
            assert_eq!((spill.drained_e, spill.escaped_e, charge), (drained_e, 50 * 990 - drained_e, vec![10; 50]));
        }
    }
}

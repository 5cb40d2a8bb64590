//! Arithmetic of points and rows. Both use the same expressions in the same order: rows and points have the same bits.
//! Row loops vectorise automatically; without contraction to fused multiply-add every instruction set gives the same
//! bits.

/// Converts `f64` to `f32`, the only place of this rounding.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "rounding is the purpose")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

/// A coordinate: its lattice cell, its offset in the cell (0 to 1), and the fade value of the offset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Profile {
    pub(crate) cell: i64,
    pub(crate) offset: f32,
    pub(crate) fade: f32,
}

/// Blends the ramps of two gradients on a lattice line at a column. Returns a value and its slope along y.
#[inline(always)]
pub(crate) fn lattice_line(offset: f32, fade: f32, left: [f32; 2], right: [f32; 2]) -> [f32; 2] {
    let (from, to) = (left[0] * offset, right[0] * (offset - 1.0));
    [from + fade * (to - from), left[1] + fade * (right[1] - left[1])]
}

/// Returns the noise between the lattice lines above and below a row.
#[inline(always)]
pub(crate) fn point(above: [f32; 2], below: [f32; 2], row: Profile) -> f32 {
    let from = above[0] + above[1] * row.offset;
    let to = below[0] + below[1] * (row.offset - 1.0);
    from + row.fade * (to - from)
}

/// Computes `row[i] += amplitude * point(above[i], below[i])`. The lines are given as values and slopes.
#[multiversion::multiversion(targets = "simd")]
pub(crate) fn add_points(
    row: &mut [f32],
    above: (&[f32], &[f32]),
    below: (&[f32], &[f32]),
    profile: Profile,
    amplitude: f32,
) {
    let count = row.len();
    let (a0, a1) = (&above.0[..count], &above.1[..count]);
    let (b0, b1) = (&below.0[..count], &below.1[..count]);
    for i in 0..count {
        row[i] += amplitude * point([a0[i], a1[i]], [b0[i], b1[i]], profile);
    }
}

/// Computes `noise * scale + offset` in place.
#[multiversion::multiversion(targets = "simd")]
pub(crate) fn affine(row: &mut [f32], scale: f32, offset: f32) {
    for value in row {
        *value = *value * scale + offset;
    }
}

/// Converts a row of I_pe to I_b (Eq. 9).
#[multiversion::multiversion(targets = "simd")]
pub(crate) fn transmit(row: &mut [f32], illumination: &[f32], level: f32, strength: f32) {
    for (value, &factor) in row.iter_mut().zip(illumination) {
        // Eq. 9: I_b = (H − c_pe · I_pe) · I_dⁿ
        *value = (level - strength * *value) * factor;
    }
}

/// Replaces positive normal numbers by their decadic logarithms; the relative error is below 3e-7.
///
/// The standard library's logarithm differs between platforms, and that of `libm` does not vectorise.
#[multiversion::multiversion(targets = "simd")]
pub(crate) fn log10(row: &mut [f32]) {
    for value in row {
        *value = log10_of(*value);
    }
}

#[inline(always)]
fn log10_of(value: f32) -> f32 {
    /// Bits of √½: mantissas are in [√½, √2), where the series converges fastest.
    const SQRT_HALF: u32 = 0x3F35_04F3;
    /// log10 2 in two parts: the product of an exponent with the first is exact.
    const LOG10_2_HIGH: f32 = 0.301_025_4;
    const LOG10_2_LOW: f32 = 4.605_039e-6;
    const TWICE_LOG10_E: f32 = 0.868_589;

    let bits = value.to_bits().wrapping_sub(SQRT_HALF);
    let exponent = (bits.cast_signed() >> 23) as f32;
    let mantissa = f32::from_bits((bits & 0x007F_FFFF).wrapping_add(SQRT_HALF));
    // ln m = 2 artanh s = 2 (s + s³/3 + s⁵/5 + …) with s = (m − 1)/(m + 1), |s| ≤ 0.172
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let s2 = s * s;
    let series = 1.0 + s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0))));
    exponent * LOG10_2_HIGH + (exponent * LOG10_2_LOW + TWICE_LOG10_E * s * series)
}

/// Returns the smallest and largest of `row`, `low` and `high`.
#[multiversion::multiversion(targets = "simd")]
pub(crate) fn extremes(row: &[f32], low: f32, high: f32) -> (f32, f32) {
    /// Independent minima: the compiler may not reorder float minima.
    const LANES: usize = 16;
    let (blocks, rest) = row.as_chunks::<LANES>();
    let (mut lows, mut highs) = ([low; LANES], [high; LANES]);
    for block in blocks {
        for lane in 0..LANES {
            lows[lane] = smaller(lows[lane], block[lane]);
            highs[lane] = larger(highs[lane], block[lane]);
        }
    }
    (lows.iter().chain(rest).copied().fold(low, smaller), highs.iter().chain(rest).copied().fold(high, larger))
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn log10_matches_libm() {
        // All exponents of normal numbers, with varying mantissas.
        let values: Vec<f32> = (0..200_001u32).map(|i| f32::from_bits(0x0080_0000 + i * 10_600)).collect();
        let mut row = values.clone();
        log10(&mut row);
        for (found, value) in row.into_iter().zip(values) {
            let exact = libm::log10(f64::from(value));
            assert!((f64::from(found) - exact).abs() < 3e-7 * exact.abs().max(1e-30), "{value}: {found}");
            assert_eq!(found, log10_of(value));
        }
        assert_eq!(log10_of(1.0), 0.0);
    }

    #[test]
    fn extremes_are_correct_for_any_length() {
        for length in 0..70 {
            let row: Vec<f32> = (0..length).map(|i| ((i * 37) % 71) as f32 - 20.0).collect();
            let low = row.iter().copied().fold(5.0, f32::min);
            let high = row.iter().copied().fold(6.0, f32::max);
            assert_eq!(extremes(&row, 5.0, 6.0), (low, high));
        }
    }
}

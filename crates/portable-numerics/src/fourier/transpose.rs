//! Transposes of blocks of 16 x 16 numbers.
//!
//! Compilers turn a transpose in plain Rust into gathers and scatters, which take six times as long as shuffles. This
//! module therefore uses instructions of x86-64 where they exist. The result is the same: only data moves.

#![cfg_attr(
    target_arch = "x86_64",
    expect(unsafe_code, reason = "vector instructions; a test compares them with the plain version")
)]

use super::Square;

/// Returns the transpose of a block of single-precision numbers, given by its rows.
#[inline]
#[must_use]
pub fn transposed(rows: [&[f32; 16]; 16]) -> Square<f32, 16> {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: the processor has AVX.
        return unsafe { shuffled(rows) };
    }
    plain(rows)
}

fn plain(rows: [&[f32; 16]; 16]) -> Square<f32, 16> {
    core::array::from_fn(|i| rows.map(|row| row[i]))
}

/// Transposes four blocks of 8 x 8 in three steps: pairs of numbers, pairs of pairs, halves of registers.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx")]
fn shuffled(rows: [&[f32; 16]; 16]) -> Square<f32, 16> {
    use core::arch::x86_64::{
        _mm256_loadu_ps, _mm256_permute2f128_ps, _mm256_shuffle_ps, _mm256_storeu_ps, _mm256_unpackhi_ps,
        _mm256_unpacklo_ps,
    };
    let mut to = [[0.0; 16]; 16];
    for half in 0..2 {
        let (to_left, to_right) = to[8 * half..].split_at_mut(4);
        for other in 0..2 {
            let load = |i: usize| {
                let (eights, _) = rows[8 * other + i].as_chunks::<8>();
                // SAFETY: the pointer is to eight numbers.
                unsafe { _mm256_loadu_ps(eights[half].as_ptr()) }
            };
            let quads = |i: usize| {
                let (a, b, c, d) = (load(i), load(i + 1), load(i + 2), load(i + 3));
                let (ab, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
                let (cd, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
                [
                    _mm256_shuffle_ps::<0x44>(ab, cd),
                    _mm256_shuffle_ps::<0xEE>(ab, cd),
                    _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
                    _mm256_shuffle_ps::<0xEE>(ab_high, cd_high),
                ]
            };
            let (upper, lower) = (quads(0), quads(4));
            for j in 0..4 {
                let left = &mut to_left[j].as_chunks_mut::<8>().0[other];
                let right = &mut to_right[j].as_chunks_mut::<8>().0[other];
                // SAFETY: the pointers are to eight numbers.
                unsafe {
                    _mm256_storeu_ps(left.as_mut_ptr(), _mm256_permute2f128_ps::<0x20>(upper[j], lower[j]));
                    _mm256_storeu_ps(right.as_mut_ptr(), _mm256_permute2f128_ps::<0x31>(upper[j], lower[j]));
                }
            }
        }
    }
    to
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_become_columns() {
        let block: Square<f32, 16> = core::array::from_fn(|i| core::array::from_fn(|j| (16 * i + j) as f32));
        let rows = block.each_ref();
        for found in [transposed(rows), plain(rows)] {
            for (i, row) in found.iter().enumerate() {
                assert_eq!(*row, core::array::from_fn(|j| (16 * j + i) as f32));
            }
        }
    }
}

//! Sums over pixels. Products are added in single precision in short blocks and in double precision between them, in
//! an order that no instruction set changes.

use multiversion::multiversion;

/// Numbers added together.
const LANES: usize = 16;

/// Products added in single precision.
const BLOCK: usize = 64 * LANES;

/// Pixels whose products are computed before those of the next pixels: several images fit into the cache.
const TILE: usize = 4 * BLOCK;

/// Returns Σ aᵢ bᵢ.
#[multiversion(targets = "simd")]
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f64 {
    let mut total = 0.0;
    for (a, b) in a.chunks(BLOCK).zip(b.chunks(BLOCK)) {
        let mut lanes = [0.0_f32; LANES];
        let (whole_a, rest_a) = a.as_chunks::<LANES>();
        let (whole_b, rest_b) = b.as_chunks::<LANES>();
        for (a, b) in whole_a.iter().zip(whole_b) {
            for l in 0..LANES {
                lanes[l] += a[l] * b[l];
            }
        }
        for ((lane, a), b) in lanes.iter_mut().zip(rest_a).zip(rest_b) {
            *lane += a * b;
        }
        total += lanes.iter().map(|&lane| f64::from(lane)).sum::<f64>();
    }
    total
}

/// Returns Σ aᵢ.
#[multiversion(targets = "simd")]
pub(crate) fn sum(a: &[f32]) -> f64 {
    let mut lanes = [0.0_f64; LANES];
    let (whole, rest) = a.as_chunks::<LANES>();
    for a in whole {
        for l in 0..LANES {
            lanes[l] += f64::from(a[l]);
        }
    }
    for (lane, &a) in lanes.iter_mut().zip(rest) {
        *lane += f64::from(a);
    }
    lanes.iter().sum()
}

/// Returns the matrix of products Σ rowᵢ columnⱼ, row-major.
pub(crate) fn products<A: AsRef<[f32]>, B: AsRef<[f32]>>(rows: &[A], columns: &[B]) -> Vec<f64> {
    let mut matrix = vec![0.0; rows.len() * columns.len()];
    let len = rows.first().map_or(0, |row| row.as_ref().len());
    for from in (0..len).step_by(TILE) {
        let tile = from..(from + TILE).min(len);
        for (row, sums) in rows.iter().zip(matrix.chunks_exact_mut(columns.len().max(1))) {
            for (column, sum) in columns.iter().zip(sums) {
                *sum += dot(&row.as_ref()[tile.clone()], &column.as_ref()[tile.clone()]);
            }
        }
    }
    matrix
}

/// Adds `factor` times an image to another.
#[multiversion(targets = "simd")]
pub(crate) fn add_scaled(to: &mut [f32], from: &[f32], factor: f32) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += factor * from;
    }
}

/// Adds a number to each pixel.
pub(crate) fn shift(values: &mut [f32], by: f32) {
    values.iter_mut().for_each(|value| *value += by);
}

/// Rounds to single precision.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_match_double_precision() {
        for len in [0, 1, 15, 16, 1023, 1024, 5000] {
            let a: Vec<f32> = (0..len).map(|i| (i * 7 % 13) as f32 - 6.0).collect();
            let b: Vec<f32> = (0..len).map(|i| (i * 5 % 11) as f32 - 4.5).collect();
            let slow = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum::<f64>();
            assert_eq!(dot(&a, &b), slow(&a, &b));
            assert_eq!(sum(&a), a.iter().map(|&a| f64::from(a)).sum::<f64>());
            let images = [a, b];
            let matrix = products(&images, &images[1..]);
            let expected = [0, 1].map(|i| slow(&images[i], &images[1]));
            assert!(matrix.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-9));
        }
    }
}

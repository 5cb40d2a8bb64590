/// The path of least total error through a strip, one step sideways at most from one row to the
/// next (Efros and Freeman, doi:10.1145/383259.383296).
///
/// `errors` has rows of `breadth`; `path` gets the column of the cut for each row. Of equal paths
/// the leftmost is taken. `errors` is used up.
pub(crate) fn min_cut(errors: &mut [f32], breadth: usize, path: &mut [usize]) {
    // E(y, x) = e(y, x) + min(E(y - 1, x - 1), E(y - 1, x), E(y - 1, x + 1)).
    for y in 1..path.len() {
        for x in 0..breadth {
            let best = least_near(&errors[(y - 1) * breadth..][..breadth], x);
            errors[y * breadth + x] += errors[(y - 1) * breadth + best];
        }
    }
    let mut x = None;
    for y in (0..path.len()).rev() {
        let row = &errors[y * breadth..][..breadth];
        let best = match x {
            None => (1..breadth).fold(0, |best, x| if row[x] < row[best] { x } else { best }),
            Some(below) => least_near(row, below),
        };
        path[y] = best;
        x = Some(best);
    }
}

/// The column of the least value within one of `x`, the leftmost of equals.
fn least_near(row: &[f32], x: usize) -> usize {
    let mut best = x.saturating_sub(1);
    for candidate in best + 1..(x + 2).min(row.len()) {
        if row[candidate] < row[best] {
            best = candidate;
        }
    }
    best
}

/// The weight of a new patch `i` pixels from its edge, fading in over the overlap. The old pixel
/// has the rest, so that both sum to one.
pub(crate) fn feather(i: usize, overlap: usize) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "at most 128")]
    if i < overlap { (i + 1) as f32 / (overlap + 1) as f32 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0x5ea3;

    /// All paths through a strip, by depth-first search.
    fn least(errors: &[f32], breadth: usize, y: usize, from: Option<usize>) -> f32 {
        if y * breadth == errors.len() {
            return 0.0;
        }
        (0..breadth)
            .filter(|&x| from.is_none_or(|f| f.abs_diff(x) <= 1))
            .map(|x| errors[y * breadth + x] + least(errors, breadth, y + 1, Some(x)))
            .fold(f32::INFINITY, f32::min)
    }

    #[test]
    fn cut_equals_exhaustive_search() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for (length, breadth) in [(1, 1), (7, 5), (7, 2), (5, 1), (6, 3), (2, 5)] {
            for _ in 0..50 {
                // Whole numbers, so that sums are exact and ties occur.
                let errors: Vec<_> = (0..length * breadth).map(|_| (rng.next_u32() % 10) as f32).collect();
                let mut path = vec![0; length];
                min_cut(&mut errors.clone(), breadth, &mut path);
                assert!(path.windows(2).all(|w| w[0].abs_diff(w[1]) <= 1));
                let total: f32 = path.iter().enumerate().map(|(y, x)| errors[y * breadth + x]).sum();
                assert_eq!(total, least(&errors, breadth, 0, None));
            }
        }
    }

    #[test]
    fn feather_weights_mirror_each_other() {
        for overlap in 1..9 {
            for i in 0..overlap {
                let (new, old) = (feather(i, overlap), feather(overlap - 1 - i, overlap));
                assert!((new + old - 1.0).abs() < 1e-6);
            }
            assert_eq!(feather(overlap, overlap), 1.0);
        }
    }
}

/// The distance of each pixel inside a mask from the nearest one outside, relative to the
/// largest: 0 outside, 1 at the place farthest from the edge. All beyond the image is outside.
///
/// Exact, by lower envelopes of parabolas (Felzenszwalb and Huttenlocher,
/// doi:10.4086/toc.2012.v008a019).
pub(crate) fn centrality(inside: &[bool], width: usize) -> Vec<f32> {
    let height = inside.len() / width;
    // Distance up and down to the outside, squared.
    let mut vertical = vec![0_u32; inside.len()];
    for x in 0..width {
        let mut run = 0;
        for y in 0..height {
            run = if inside[y * width + x] { run + 1 } else { 0 };
            vertical[y * width + x] = run;
        }
        run = 0;
        for y in (0..height).rev() {
            let v = &mut vertical[y * width + x];
            run = if *v > 0 { run + 1 } else { 0 };
            *v = run.min(*v) * run.min(*v);
        }
    }
    let mut squared = vec![0_u32; inside.len()];
    let mut envelope = Envelope::default();
    for (row, out) in vertical.chunks(width).zip(squared.chunks_mut(width)) {
        envelope.transform(row, out);
    }
    let largest = squared.iter().copied().max().unwrap_or(0).max(1);
    #[expect(clippy::cast_precision_loss, reason = "rounded once, like any coordinate")]
    let root = |square: u32| (square as f32 / largest as f32).sqrt();
    squared.into_iter().map(root).collect()
}

/// The lower envelope of the parabolas (x - at)² + height along one row.
#[derive(Default)]
struct Envelope {
    /// Apex and height of the parabolas on the envelope, from the left.
    apexes: Vec<(i64, i64)>,
    /// From which x on each of them is the lowest.
    from: Vec<i64>,
}

impl Envelope {
    fn transform(&mut self, row: &[u32], out: &mut [u32]) {
        self.apexes.clear();
        self.from.clear();
        self.push(-1, 0);
        let mut end = 0;
        for &height in row {
            self.push(end, i64::from(height));
            end += 1;
        }
        self.push(end, 0);
        let mut lowest = 0;
        for (x, out) in (0..).zip(out) {
            while self.from.get(lowest + 1).is_some_and(|&from| from <= x) {
                lowest += 1;
            }
            let (at, height) = self.apexes[lowest];
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at most the height in the row, which fits"
            )]
            {
                *out = ((x - at) * (x - at) + height) as u32;
            }
        }
    }

    fn push(&mut self, at: i64, height: i64) {
        while let Some(&(before, its_height)) = self.apexes.last() {
            // First whole x at which the new parabola is no higher than the last one.
            let rise = height + at * at - its_height - before * before;
            let run = 2 * (at - before);
            let crossing = rise.div_euclid(run) + i64::from(rise.rem_euclid(run) > 0);
            if crossing > self.from[self.from.len() - 1] {
                self.from.push(crossing);
                self.apexes.push((at, height));
                return;
            }
            self.apexes.pop();
            self.from.pop();
        }
        self.from.push(-1);
        self.apexes.push((at, height));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0xd157;

    /// The nearest outside pixel of all, with a frame of outside around the image.
    fn slow(inside: &[bool], width: usize) -> Vec<f32> {
        let height = inside.len() / width;
        let framed = |x: usize, y: usize| {
            let within = (1..=width).contains(&x) && (1..=height).contains(&y);
            within && inside[(y - 1) * width + x - 1]
        };
        let outside: Vec<_> = (0..(width + 2) * (height + 2))
            .map(|i| (i % (width + 2), i / (width + 2)))
            .filter(|&(x, y)| !framed(x, y))
            .collect();
        let nearest = |i: usize| {
            let (x, y) = (i % width + 1, i / width + 1);
            let squared = |&(u, v): &(usize, usize)| x.abs_diff(u).pow(2) + y.abs_diff(v).pow(2);
            outside.iter().map(squared).min().unwrap()
        };
        let squared: Vec<_> = (0..inside.len()).map(nearest).collect();
        let largest = *squared.iter().max().unwrap().max(&1) as f32;
        squared.iter().map(|&d| (d as f32 / largest).sqrt()).collect()
    }

    #[test]
    fn equals_brute_force() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for (width, height, holes) in [(1, 1, 2), (7, 5, 3), (23, 17, 40), (12, 30, 9), (16, 9, 1)] {
            for _ in 0..20 {
                let mask: Vec<_> = (0..width * height).map(|_| !rng.next_u32().is_multiple_of(holes)).collect();
                assert_eq!(centrality(&mask, width), slow(&mask, width));
            }
        }
        let full = vec![true; 63];
        assert_eq!(centrality(&full, 9), slow(&full, 9));
        assert_eq!(centrality(&[false; 12], 4), [0.0; 12]);
    }
}

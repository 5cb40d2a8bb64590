use multiversion::multiversion;

use crate::Source;
use crate::source::LANES;

/// The positions in one source at which a patch is completely inside the mask.
#[derive(Debug, Clone)]
pub(crate) struct Candidates {
    /// One run for each row with candidates; runs may have gaps.
    pub(crate) runs: Vec<Run>,
    /// 0 at a candidate, infinity elsewhere, in the padded layout of the source.
    pub(crate) barrier: Vec<f32>,
    /// Offset of the upper left pixel of each candidate in that layout.
    pub(crate) places: Vec<usize>,
    /// Number of costs of a search, in blocks of `LANES` for each run.
    pub(crate) slots: usize,
}

/// Adjacent positions in a row of a source.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// Offset of the first position in the padded layout.
    pub(crate) place: usize,
    /// Number of blocks of `LANES` positions.
    pub(crate) blocks: usize,
    /// Index of the first cost of the run.
    pub(crate) slot: usize,
}

impl Candidates {
    pub(crate) fn new(source: &Source, patch: usize) -> Self {
        let (width, stride) = (source.width, source.stride());
        let mut candidates =
            Self { runs: Vec::new(), barrier: vec![f32::INFINITY; source.pixels.len()], places: Vec::new(), slots: 0 };
        // For each column: the number of consecutive rows with `patch` pixels inside the mask from there on.
        let mut rows = vec![0; width];
        for (y, known) in source.known.chunks(width).enumerate() {
            let mut ahead = 0;
            for x in (0..width).rev() {
                ahead = if known[x] { ahead + 1 } else { 0 };
                rows[x] = if ahead >= patch { rows[x] + 1 } else { 0 };
            }
            if y + 1 >= patch {
                candidates.add_row(&rows, patch, (y + 1 - patch) * stride);
            }
        }
        candidates
    }

    fn add_row(&mut self, rows: &[usize], patch: usize, start: usize) {
        let before = self.places.len();
        for (x, _) in rows.iter().enumerate().filter(|&(_, &n)| n >= patch) {
            self.places.push(start + x);
            self.barrier[start + x] = 0.0;
        }
        if let [first, .., last] | [first @ last] = self.places[before..] {
            let run = Run { place: first, blocks: (last - first) / LANES + 1, slot: self.slots };
            self.slots += run.blocks * LANES;
            self.runs.push(run);
        }
    }

    /// Returns the position of a slot.
    pub(crate) fn place_of_slot(&self, slot: usize) -> usize {
        let run = self.runs[self.runs.partition_point(|run| run.slot <= slot) - 1];
        run.place + slot - run.slot
    }
}

/// Phases of the comparison: each takes every second pixel of the template, so that half of the pixels are sufficient
/// to reject most candidates.
const PHASES: [usize; 2] = [0, 1];

/// The pixels that a candidate must match.
#[derive(Debug, Clone, Default)]
pub(crate) struct Template {
    /// Target pixels in the overlaps: column and row in the patch, and value.
    pub(crate) pixels: Vec<([usize; 2], f32)>,
    /// Relative distance of the centre of the patch from the edge of the target.
    pub(crate) centrality: f32,
    /// Cost factor of the squared difference of that distance.
    pub(crate) weight: f32,
}

/// Largest accepted cost, as a linear function of the smallest cost.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tolerance {
    pub(crate) factor: f32,
    pub(crate) floor: f32,
}

impl Tolerance {
    #[inline(always)]
    pub(crate) fn bound(self, least: f32) -> f32 {
        self.factor * least + self.floor
    }
}

/// A template with the pixel offsets of one source.
#[derive(Debug, Clone, Default)]
pub(crate) struct PlacedTemplate {
    /// Offset from the position of a candidate, and value.
    pixels: Vec<(usize, f32)>,
    /// Offset of the centre of the patch.
    centre: usize,
    centrality: f32,
    weight: f32,
}

impl PlacedTemplate {
    pub(crate) fn set(&mut self, source: &Source, patch: usize, template: &Template) {
        let stride = source.stride();
        self.pixels.clear();
        for phase in PHASES {
            let pixels = template.pixels.iter().skip(phase).step_by(PHASES.len());
            let lay = |&([x, y], v): &([usize; 2], f32)| (y * stride + x, v);
            self.pixels.extend(pixels.map(lay));
        }
        self.centre = (patch / 2) * (stride + 1);
        self.centrality = template.centrality;
        self.weight = template.weight;
    }

    /// Removes all terms except weight · Δ².
    pub(crate) fn clear_pixels(&mut self, weight: f32) {
        self.pixels.clear();
        self.weight = weight;
    }

    /// Returns the cost of one candidate, with the same bits as in [`scan`].
    pub(crate) fn cost(&self, source: &Source, place: usize) -> f32 {
        let mut cost = [0.0];
        self.add_distance(&mut cost, source, place);
        for stage in self.stages() {
            add_squares(&mut cost, &source.pixels, place, stage);
        }
        cost[0]
    }

    /// Returns the pixels in parts, after each of which a candidate may be rejected.
    #[inline(always)]
    fn stages(&self) -> core::slice::Chunks<'_, (usize, f32)> {
        self.pixels.chunks(self.pixels.len().div_ceil(PHASES.len()).max(1))
    }

    /// Adds weight · Δ² for adjacent candidates.
    #[inline(always)]
    fn add_distance<const N: usize>(&self, costs: &mut [f32; N], source: &Source, place: usize) {
        let depth = lanes::<N>(&source.centrality, place + self.centre);
        for lane in 0..N {
            let away = depth[lane] - self.centrality;
            costs[lane] += self.weight * (away * away);
        }
    }
}

/// Writes the cost of every candidate of a source, weight · Δ² + Σ (s - t)², or infinity if it exceeds the tolerance.
/// `least` is the smallest cost so far, and is updated.
#[multiversion(targets = "simd")]
pub(crate) fn scan(
    source: &Source,
    candidates: &Candidates,
    placed: &PlacedTemplate,
    tolerance: Tolerance,
    least: &mut f32,
    costs: &mut [f32],
) {
    for run in &candidates.runs {
        let costs = &mut costs[run.slot..][..run.blocks * LANES];
        'block: for (block, out) in costs.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            let place = run.place + block * LANES;
            let mut sum = *lanes(&candidates.barrier, place);
            placed.add_distance(&mut sum, source, place);
            for stage in placed.stages() {
                let bound = tolerance.bound(*least);
                if !sum.iter().fold(false, |any, &cost| any | (cost <= bound)) {
                    *out = [f32::INFINITY; LANES];
                    continue 'block;
                }
                add_squares(&mut sum, &source.pixels, place, stage);
            }
            *out = sum;
            *least = least.min(smallest(&sum));
        }
    }
}

/// Adds Σ (s - t)² for adjacent candidates.
#[inline(always)]
fn add_squares<const N: usize>(sums: &mut [f32; N], pixels: &[f32], place: usize, template: &[(usize, f32)]) {
    for &(offset, v) in template {
        let s = lanes::<N>(pixels, place + offset);
        for lane in 0..N {
            let d = s[lane] - v;
            sums[lane] += d * d;
        }
    }
}

#[inline(always)]
fn lanes<const N: usize>(values: &[f32], at: usize) -> &[f32; N] {
    let (block, _) = values[at..].split_first_chunk().expect("rows are padded by LANES");
    block
}

#[inline(always)]
fn smallest(values: &[f32; LANES]) -> f32 {
    let mut halves = *values;
    let mut width = LANES / 2;
    while width > 0 {
        for lane in 0..width {
            halves[lane] = if halves[lane + width] < halves[lane] { halves[lane + width] } else { halves[lane] };
        }
        width /= 2;
    }
    halves[0]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use rand_core::Rng;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0x5ca2;

    /// Returns a disc of white noise, uniform in 0..1.
    pub(crate) fn disc(width: usize, height: usize, rng: &mut impl Rng) -> Source {
        let pixels: Vec<f32> = (0..width * height).map(|_| (rng.next_u32() >> 8) as f32 / (1 << 24) as f32).collect();
        let mask: Vec<f32> = (0..width * height)
            .map(|i| {
                let x = 2.0 * ((i % width) as f32 + 0.5) / width as f32 - 1.0;
                let y = 2.0 * ((i / width) as f32 + 0.5) / height as f32 - 1.0;
                if x * x + y * y < 1.0 { 1.0 } else { 0.0 }
            })
            .collect();
        Source::new(&pixels, &mask, width).unwrap()
    }

    /// Returns an L of random values, like the overlap with two neighbours.
    pub(crate) fn template(patch: usize, overlap: usize, rng: &mut impl Rng) -> Template {
        let all = (0..patch).flat_map(|y| (0..patch).map(move |x| [x, y]));
        Template {
            pixels: all
                .filter(|&[x, y]| x < overlap || y < overlap)
                .map(|at| (at, (rng.next_u32() >> 8) as f32 / (1 << 24) as f32))
                .collect(),
            centrality: 0.4,
            weight: 0.7,
        }
    }

    /// Returns Σ (s - t)² + weight · Δ² in double precision.
    pub(crate) fn reference_cost(source: &Source, patch: usize, template: &Template, place: usize) -> f64 {
        let at = |[x, y]: [usize; 2]| place + y * source.stride() + x;
        let depth = source.centrality[at([patch / 2, patch / 2])];
        let away = f64::from(depth) - f64::from(template.centrality);
        let squares = template.pixels.iter().map(|&(p, v)| {
            let d = f64::from(source.pixels[at(p)]) - f64::from(v);
            d * d
        });
        squares.sum::<f64>() + f64::from(template.weight) * away * away
    }

    #[test]
    fn scan_equals_brute_force() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for (width, height, patch, overlap) in [(40, 40, 7, 2), (61, 23, 9, 3), (7, 7, 3, 1)] {
            let source = disc(width, height, &mut rng);
            let candidates = Candidates::new(&source, patch);
            let template = template(patch, overlap, &mut rng);
            let mut placed = PlacedTemplate::default();
            placed.set(&source, patch, &template);
            for (factor, floor) in [(1e9, 0.0), (1.1, 0.02)] {
                let tolerance = Tolerance { factor, floor };
                let mut costs = vec![f32::NAN; candidates.slots];
                let mut least = f32::INFINITY;
                scan(&source, &candidates, &placed, tolerance, &mut least, &mut costs);
                let smallest = costs.iter().copied().fold(f32::INFINITY, f32::min);
                assert_eq!(least, smallest);
                for (slot, &cost) in costs.iter().enumerate() {
                    let place = candidates.place_of_slot(slot);
                    if candidates.barrier[place] > 0.0 {
                        assert_eq!(cost, f32::INFINITY);
                        continue;
                    }
                    let reference = reference_cost(&source, patch, &template, place);
                    if cost.is_finite() {
                        assert_eq!(cost, placed.cost(&source, place));
                        // The error of a sum of n terms in single precision is at most n ε / 2.
                        assert!((f64::from(cost) / reference - 1.0).abs() < 4e-6);
                    } else {
                        assert!(reference > f64::from(tolerance.bound(least)) * (1.0 - 4e-6));
                    }
                }
            }
        }
    }

    #[test]
    fn candidates_are_completely_inside_the_mask() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for (width, height, patch) in [(40, 40, 7), (9, 30, 3), (5, 5, 5), (80, 12, 2)] {
            let mask: Vec<f32> =
                (0..width * height).map(|_| if rng.next_u32().is_multiple_of(40) { 0.0 } else { 1.0 }).collect();
            let source = Source::new(&mask, &mask, width).unwrap();
            let candidates = Candidates::new(&source, patch);
            let whole =
                |&(x, y): &(usize, usize)| (y..y + patch).all(|j| (x..x + patch).all(|i| mask[j * width + i] > 0.0));
            let reference: Vec<_> = (0..=height - patch)
                .flat_map(|y| (0..=width - patch).map(move |x| (x, y)))
                .filter(whole)
                .map(|(x, y)| y * source.stride() + x)
                .collect();
            assert_eq!(candidates.places, reference);
            let open: Vec<_> = (0..candidates.slots)
                .map(|slot| candidates.place_of_slot(slot))
                .filter(|&place| candidates.barrier[place] == 0.0)
                .collect();
            assert_eq!(open, reference);
        }
    }
}

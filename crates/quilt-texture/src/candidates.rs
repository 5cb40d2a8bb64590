use crate::Source;
use crate::source::LANES;

/// The places in one source where a patch lies wholly under the mask.
#[derive(Debug, Clone)]
pub(crate) struct Candidates {
    /// One a row, in which the candidates are, perhaps with gaps.
    pub(crate) runs: Vec<Run>,
    /// 0 at a candidate, infinity elsewhere, in the padded layout of the source.
    pub(crate) barrier: Vec<f32>,
    /// Offset of the upper left pixel of each candidate in that layout.
    pub(crate) places: Vec<usize>,
    /// Number of costs of a search: whole blocks of `LANES` for each run.
    pub(crate) slots: usize,
}

/// Neighbouring places in a row of a source.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Run {
    /// Offset of the first in the padded layout.
    pub(crate) place: usize,
    /// Number of blocks of `LANES` places.
    pub(crate) blocks: usize,
    /// Where the costs of the run begin.
    pub(crate) slot: usize,
}

impl Candidates {
    pub(crate) fn new(source: &Source, patch: usize) -> Self {
        let (width, stride) = (source.width, source.stride());
        let mut candidates =
            Self { runs: Vec::new(), barrier: vec![f32::INFINITY; source.pixels.len()], places: Vec::new(), slots: 0 };
        // For each column: how many rows in a row had `patch` known pixels from there on.
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

    /// The place whose cost is kept at a slot.
    pub(crate) fn place_of_slot(&self, slot: usize) -> usize {
        let run = self.runs[self.runs.partition_point(|run| run.slot <= slot) - 1];
        run.place + slot - run.slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::Rng;
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0xca2d;

    #[test]
    fn places_are_those_wholly_under_the_mask() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        for (width, height, patch) in [(40, 40, 7), (9, 30, 3), (5, 5, 5), (80, 12, 2)] {
            let mask: Vec<f32> =
                (0..width * height).map(|_| if rng.next_u32().is_multiple_of(40) { 0.0 } else { 1.0 }).collect();
            let source = Source::new(&mask, &mask, width).unwrap();
            let candidates = Candidates::new(&source, patch);
            let whole =
                |&(x, y): &(usize, usize)| (y..y + patch).all(|j| (x..x + patch).all(|i| mask[j * width + i] > 0.0));
            let slow: Vec<_> = (0..=height - patch)
                .flat_map(|y| (0..=width - patch).map(move |x| (x, y)))
                .filter(whole)
                .map(|(x, y)| y * source.stride() + x)
                .collect();
            assert_eq!(candidates.places, slow);
            let open: Vec<_> = (0..candidates.slots)
                .map(|slot| candidates.place_of_slot(slot))
                .filter(|&place| candidates.barrier[place] == 0.0)
                .collect();
            assert_eq!(open, slow);
        }
    }
}

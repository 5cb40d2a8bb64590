use portable_numerics::random::{below, uniform};
use rand_core::Rng;

use crate::canvas::{Canvas, Texture};
use crate::draw::{below_exp, exp_below, outcome_of_tries, slots_between};
use crate::scan::{Candidates, PlacedTemplate, Template, Tolerance, scan};
use crate::source::{COVERED, LANES, centrality};
use crate::spectral::Spectral;
use crate::{Acceptance, CentreBias, Error, QuiltParams, Search, Source};

/// Maximum number of draws of a weighted position, after which the last one is used: for a mean weight of a tenth, 19
/// of 20 draws follow the weighting.
const REDRAWS: usize = 30;

/// Synthesises textures from patches of sources ("Texture synthesis", Figs. 4 and 5).
///
/// Patches are placed row by row from the upper left. Each is chosen by the match of its overlaps with the previous
/// patches, and joined to them.
#[derive(Debug, Clone)]
pub struct Quilter<'a> {
    params: QuiltParams,
    sources: Vec<IndexedSource<'a>>,
    /// Number of candidate positions in all sources.
    places: usize,
    /// Number of costs of all candidates.
    slots: usize,
    /// Variance of the pixels relative to the mean of their source.
    variance: f64,
}

#[derive(Debug, Clone)]
struct IndexedSource<'a> {
    source: &'a Source,
    candidates: Candidates,
    spectral: Option<Spectral>,
}

/// A position of the upper left pixel of a patch.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    source_index: usize,
    place: usize,
}

/// Working memory of one texture.
#[derive(Default)]
struct Scratch {
    template: Template,
    /// The template for each source.
    placed: Vec<PlacedTemplate>,
    /// Costs of all candidates, source after source.
    costs: Vec<f32>,
    /// Probability of each candidate, relative to the greatest.
    weights: Vec<f32>,
    near: Vec<usize>,
}

impl<'a> Quilter<'a> {
    /// Finds the candidate positions in each source.
    ///
    /// # Errors
    ///
    /// If a parameter is out of range, there is no source, or a source is too small for a patch.
    pub fn new(sources: &[&'a Source], params: &QuiltParams) -> Result<Self, Error> {
        params.check()?;
        if sources.is_empty() {
            return Err(Error::NoSource);
        }
        let index = |(index, &source): (usize, &&'a Source)| {
            let candidates = Candidates::new(source, params.patch_px);
            if candidates.places.is_empty() {
                return Err(Error::SourceTooSmall { index, patch_px: params.patch_px });
            }
            let spectral = match params.search {
                Search::Direct => false,
                Search::Fft => true,
                Search::Auto => Spectral::is_faster(source, &candidates, params),
            };
            Ok(IndexedSource { source, candidates, spectral: spectral.then(|| Spectral::new(source)) })
        };
        let indexed = sources.iter().enumerate().map(index).collect::<Result<Vec<_>, _>>()?;
        let count: usize = sources.iter().map(|s| s.count).sum();
        let squares: f64 = sources.iter().map(|s| s.squares).sum();
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53 pixels")]
        let variance = squares / count as f64;
        Ok(Self {
            params: params.clone(),
            places: indexed.iter().map(|s| s.candidates.places.len()).sum(),
            slots: indexed.iter().map(|s| s.candidates.slots).sum(),
            sources: indexed,
            variance,
        })
    }

    /// Synthesises a texture for all pixels with a `target_mask` (coverage, 0 to 1) above 0.
    ///
    /// # Panics
    ///
    /// If the length of `target_mask` is not a multiple of `width`.
    #[must_use]
    pub fn synthesise<R: Rng + ?Sized>(&self, target_mask: &[f32], width: usize, rng: &mut R) -> Texture {
        assert!(
            width > 0 && target_mask.len().is_multiple_of(width),
            "target_mask has {} values: expected a multiple of the width {width}",
            target_mask.len()
        );
        let height = target_mask.len() / width;
        let depths = match self.params.centre_bias {
            CentreBias::Off => Vec::new(),
            CentreBias::Weighted { .. } => {
                let inside: Vec<bool> = target_mask.iter().map(|&m| m >= COVERED).collect();
                centrality(&inside, width)
            }
        };
        let mut canvas = Canvas::new(target_mask, width, &self.params);
        let mut scratch = Scratch::default();
        let [across, down] = canvas.patches;
        let mut above: Vec<Option<Candidate>> = vec![None; across];
        for row in 0..down {
            let mut left = None;
            for (column, above) in above.iter_mut().enumerate() {
                let corner = canvas.corner([column, row]);
                let before = [left.take(), above.take()];
                if !canvas.needs(corner) {
                    continue;
                }
                let [x, y] = corner.map(|c| c + self.params.patch_px / 2);
                let centre = y.min(height - 1) * width + x.min(width - 1);
                scratch.template.centrality = depths.get(centre).copied().unwrap_or(0.0);
                canvas.overlaps(corner, &mut scratch.template.pixels);
                let chosen = self.choose(before, &mut scratch, rng);
                let source = self.sources[chosen.source_index].source;
                canvas.paste(corner, chosen.source_index, source, chosen.place, self.params.seam);
                left = Some(chosen);
                *above = left;
            }
        }
        canvas.finish(width, height)
    }

    fn choose<R: Rng + ?Sized>(&self, before: [Option<Candidate>; 2], scratch: &mut Scratch, rng: &mut R) -> Candidate {
        if scratch.template.pixels.is_empty() {
            return self.weighted(scratch.template.centrality, rng);
        }
        match self.params.acceptance {
            Acceptance::Threshold { d_max, max_tries } => self.first_below(d_max, max_tries, scratch, rng),
            Acceptance::Near { factor, floor } => self.one_near(factor, floor, before, scratch, rng),
        }
    }

    /// Applies the paper's acceptance: returns the first random candidate with d(E_B(x,y), E_B0) < d_max, where d is
    /// the root mean square error of the overlaps.
    fn first_below<R: Rng + ?Sized>(
        &self,
        d_max: f64,
        max_tries: usize,
        scratch: &mut Scratch,
        rng: &mut R,
    ) -> Candidate {
        let Scratch { template, placed, .. } = scratch;
        template.weight = 0.0;
        self.place_template(template, placed);
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            reason = "at most 256 squared; costs are single precision"
        )]
        let enough = (d_max * d_max * template.pixels.len() as f64) as f32;
        // A try takes about as long as a block of the scan. With this limit, tries and scan together take at most about
        // twice as long as the faster of the two.
        let tries = max_tries.min(self.slots / LANES);
        let mut best = (f32::INFINITY, None);
        for _ in 0..tries {
            let candidate = self.weighted(template.centrality, rng);
            let source = self.sources[candidate.source_index].source;
            let cost = placed[candidate.source_index].cost(source, candidate.place);
            if cost <= enough {
                return candidate;
            }
            if cost < best.0 {
                best = (cost, Some(candidate));
            }
        }
        if tries < max_tries {
            let slot = self.outcome_of_tries(enough, best.0, max_tries - tries, scratch, rng);
            best.1 = slot.map(|slot| self.candidate_of_slot(slot)).or(best.1);
        }
        // There is no candidate only if all costs overflow.
        best.1.unwrap_or_else(|| self.weighted(scratch.template.centrality, rng))
    }

    /// Draws the outcome of `tries` more tries, if it is better than `least`.
    fn outcome_of_tries<R: Rng + ?Sized>(
        &self,
        enough: f32,
        least: f32,
        tries: usize,
        scratch: &mut Scratch,
        rng: &mut R,
    ) -> Option<usize> {
        let Scratch { placed, costs, weights, .. } = scratch;
        self.scan(placed, Tolerance { factor: 0.0, floor: least }, 0.0, costs, None);
        // Without pixels the cost is strength · Δ², and the weight is exp(-cost).
        #[expect(clippy::cast_possible_truncation, reason = "weights are single precision")]
        let strength = self.params.centre_bias.strength() as f32;
        placed.iter_mut().for_each(|placed| placed.clear_pixels(strength));
        let nearest = self.scan(placed, Tolerance { factor: 1.0, floor: f32::INFINITY }, f32::INFINITY, weights, None);
        exp_below(weights, nearest);
        outcome_of_tries(costs, weights, enough, least, tries, rng)
    }

    /// Computes the costs of all candidates, and returns the smallest. Uses Fourier transforms if they are faster and
    /// `template` is given.
    fn scan(
        &self,
        placed: &[PlacedTemplate],
        tolerance: Tolerance,
        mut least: f32,
        costs: &mut Vec<f32>,
        template: Option<&Template>,
    ) -> f32 {
        costs.resize(self.slots, 0.0);
        let mut rest = &mut costs[..];
        for (IndexedSource { source, candidates, spectral }, placed) in self.sources.iter().zip(placed) {
            let (costs, others) = rest.split_at_mut(candidates.slots);
            rest = others;
            match (spectral, template) {
                (Some(spectral), Some(template)) => {
                    spectral.costs(source, candidates, self.params.patch_px, template, &mut least, costs);
                }
                _ => scan(source, candidates, placed, tolerance, &mut least, costs),
            }
        }
        least
    }

    /// Applies our acceptance: returns a random candidate with a cost near the smallest.
    fn one_near<R: Rng + ?Sized>(
        &self,
        factor: f64,
        floor: f64,
        before: [Option<Candidate>; 2],
        scratch: &mut Scratch,
        rng: &mut R,
    ) -> Candidate {
        #[expect(clippy::cast_precision_loss, reason = "at most 256 squared")]
        let scale = self.variance * scratch.template.pixels.len() as f64;
        let (floor, weight) = (floor * scale, self.params.centre_bias.strength() * scale);
        #[expect(clippy::cast_possible_truncation, reason = "costs are single precision")]
        let [factor, floor, weight] = [factor, floor, weight].map(|number| number as f32);
        let tolerance = Tolerance { factor, floor };
        scratch.template.weight = weight;
        self.place_template(&scratch.template, &mut scratch.placed);
        // The continuation of a neighbour usually has a low cost, so that the scan rejects more candidates early. Its
        // cost must have the same bits as in the scan, which is not the case for Fourier transforms.
        let mut least = f32::INFINITY;
        for Candidate { source_index, place } in self.continuations(before).into_iter().flatten() {
            let IndexedSource { source, spectral, .. } = &self.sources[source_index];
            if spectral.is_none() {
                least = least.min(scratch.placed[source_index].cost(source, place));
            }
        }
        let least = self.scan(&scratch.placed, tolerance, least, &mut scratch.costs, Some(&scratch.template));
        scratch.near.clear();
        scratch.near.extend(slots_between(&scratch.costs, f32::NEG_INFINITY, tolerance.bound(least)));
        if scratch.near.is_empty() {
            // There is no candidate only if all costs overflow.
            return self.weighted(scratch.template.centrality, rng);
        }
        self.candidate_of_slot(scratch.near[below(scratch.near.len(), rng)])
    }

    fn place_template(&self, template: &Template, placed: &mut Vec<PlacedTemplate>) {
        placed.resize_with(self.sources.len(), PlacedTemplate::default);
        for (placed, indexed) in placed.iter_mut().zip(&self.sources) {
            placed.set(indexed.source, self.params.patch_px, template);
        }
    }

    /// Returns the candidates that continue the left neighbour to the right and the upper neighbour downwards.
    fn continuations(&self, [left, above]: [Option<Candidate>; 2]) -> [Option<Candidate>; 2] {
        let step = self.params.patch_px - self.params.overlap_px;
        let shift = |from: Option<Candidate>, down: bool| {
            let Candidate { source_index, place } = from?;
            let IndexedSource { source, candidates, .. } = &self.sources[source_index];
            let place = place + if down { step * source.stride() } else { step };
            let open = candidates.barrier.get(place).is_some_and(|&b| b == 0.0);
            open.then_some(Candidate { source_index, place })
        };
        [shift(left, false), shift(above, true)]
    }

    fn candidate_of_slot(&self, slot: usize) -> Candidate {
        let (source_index, slot) = self.split_index(slot, |candidates| candidates.slots);
        Candidate { source_index, place: self.sources[source_index].candidates.place_of_slot(slot) }
    }

    /// Converts an index over all sources to the index of a source and the index within it.
    fn split_index(&self, mut number: usize, count: impl Fn(&Candidates) -> usize) -> (usize, usize) {
        let mut source_index = 0;
        while number >= count(&self.sources[source_index].candidates) {
            number -= count(&self.sources[source_index].candidates);
            source_index += 1;
        }
        (source_index, number)
    }

    /// Returns a random candidate, with probability proportional to exp(-strength · Δ²).
    fn weighted<R: Rng + ?Sized>(&self, depth: f32, rng: &mut R) -> Candidate {
        let strength = self.params.centre_bias.strength();
        let mut candidate = self.any(rng);
        for _ in 0..REDRAWS {
            if strength == 0.0 {
                break;
            }
            let source = self.sources[candidate.source_index].source;
            let centre = candidate.place + (self.params.patch_px / 2) * (source.stride() + 1);
            let away = f64::from(source.centrality[centre] - depth);
            if below_exp(uniform(rng), strength * away * away) {
                break;
            }
            candidate = self.any(rng);
        }
        candidate
    }

    fn any<R: Rng + ?Sized>(&self, rng: &mut R) -> Candidate {
        let (source_index, n) = self.split_index(below(self.places, rng), |candidates| candidates.places.len());
        Candidate { source_index, place: self.sources[source_index].candidates.places[n] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::tests::assert_same_distribution;
    use crate::scan::tests::{disc, template};
    use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

    const SEED: u64 = 0xbe57;

    #[test]
    fn small_sources_are_scanned_and_large_sources_transformed() {
        let chosen = |side: usize, patch_px| {
            let source = Source::new(&vec![0.0; side * side], &vec![1.0; side * side], side).unwrap();
            let params = QuiltParams { patch_px, overlap_px: patch_px / 4, ..QuiltParams::default() };
            Quilter::new(&[&source], &params).unwrap().sources[0].spectral.is_some()
        };
        assert!(!chosen(40, 9));
        assert!(!chosen(128, 16));
        assert!(chosen(256, 64));
    }

    /// Reference implementation: the first of `max_tries` with a cost of at most `enough`, otherwise the first of the
    /// best.
    fn tried(
        quilter: &Quilter<'_>,
        enough: f32,
        max_tries: usize,
        scratch: &mut Scratch,
        rng: &mut impl Rng,
    ) -> Candidate {
        scratch.template.weight = 0.0;
        quilter.place_template(&scratch.template, &mut scratch.placed);
        let mut best = (f32::INFINITY, None);
        for _ in 0..max_tries {
            let candidate = quilter.weighted(scratch.template.centrality, rng);
            let cost = scratch.placed[candidate.source_index]
                .cost(quilter.sources[candidate.source_index].source, candidate.place);
            if cost <= enough {
                return candidate;
            }
            if cost < best.0 {
                best = (cost, Some(candidate));
            }
        }
        best.1.unwrap()
    }

    #[test]
    fn first_below_has_the_distribution_of_single_tries() {
        const DRAWS: usize = 20_000;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        let sources = [disc(14, 14, &mut rng), disc(11, 17, &mut rng)];
        let mut scratch = Scratch { template: template(5, 1, &mut rng), ..Scratch::default() };
        let n = scratch.template.pixels.len() as f64;
        // Many, few, hardly any and no candidates are accepted.
        for (d_max, strength) in [(0.42, 2.0), (0.33, 2.0), (0.3, 0.0), (0.0, 2.0), (0.0, 20.0)] {
            #[expect(clippy::cast_possible_truncation, reason = "costs are single precision")]
            let enough = (d_max * d_max * n) as f32;
            let acceptance = Acceptance::Threshold { d_max, max_tries: 60 };
            let centre_bias = CentreBias::Weighted { strength };
            let params = QuiltParams { patch_px: 5, overlap_px: 1, acceptance, centre_bias, ..QuiltParams::default() };
            let quilter = Quilter::new(&[&sources[0], &sources[1]], &params).unwrap();
            assert!(quilter.slots / LANES < 60 / 2);
            let mut counts = vec![[0.0; 2]; 2 * sources[0].pixels.len().max(sources[1].pixels.len())];
            for _ in 0..DRAWS {
                let fast = quilter.first_below(d_max, 60, &mut scratch, &mut rng);
                let reference = tried(&quilter, enough, 60, &mut scratch, &mut rng);
                counts[2 * fast.place + fast.source_index][0] += 1.0;
                counts[2 * reference.place + reference.source_index][1] += 1.0;
            }
            assert_same_distribution(&counts);
        }
    }
}

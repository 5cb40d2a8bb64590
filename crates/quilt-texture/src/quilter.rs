use portable_numerics::random::{below, uniform};
use rand_core::Rng;

use crate::canvas::{Canvas, Texture};
use crate::draw::{below_exp, exp_below, outcome_of_tries, slots_between};
use crate::scan::{Candidates, Laid, Template, Tolerance, scan};
use crate::source::{COVERED, LANES, centrality};
use crate::spectral::Spectral;
use crate::{Acceptance, CentreBias, Error, QuiltParams, Search, Source};

/// Places drawn before one is taken although the weighting is against it: enough for a weight of
/// a tenth to be obeyed nineteen times in twenty.
const REDRAWS: usize = 30;

/// Stitches textures from patches of sources ("Texture synthesis", Figs. 4 and 5).
///
/// Patches are placed row by row from the upper left. Each is chosen by how well its overlaps
/// match what is there, then joined to it.
#[derive(Debug, Clone)]
pub struct Quilter<'a> {
    params: QuiltParams,
    donors: Vec<Donor<'a>>,
    /// Number of places for a patch in all sources.
    places: usize,
    /// Number of costs of all candidates.
    slots: usize,
    /// Variance of the pixels about the mean of their source.
    variance: f64,
}

#[derive(Debug, Clone)]
struct Donor<'a> {
    source: &'a Source,
    candidates: Candidates,
    spectral: Option<Spectral>,
}

/// A place for the upper left pixel of a patch.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    donor: usize,
    place: usize,
}

/// Scratch for one texture.
#[derive(Default)]
struct Work {
    template: Template,
    /// The template laid over each source.
    laid: Vec<Laid>,
    /// Costs of all candidates, source after source.
    costs: Vec<f32>,
    /// How likely each is tried, relative to the likeliest.
    weights: Vec<f32>,
    near: Vec<usize>,
}

impl<'a> Quilter<'a> {
    /// Finds the places for patches in each source.
    ///
    /// # Errors
    ///
    /// If a parameter is out of range, there is no source, or one has no room for a patch.
    pub fn new(sources: &[&'a Source], params: &QuiltParams) -> Result<Self, Error> {
        params.check()?;
        if sources.is_empty() {
            return Err(Error::NoSource);
        }
        let donor = |(index, &source): (usize, &&'a Source)| {
            let candidates = Candidates::new(source, params.patch_px);
            if candidates.places.is_empty() {
                return Err(Error::SourceTooSmall { index, patch_px: params.patch_px });
            }
            let spectral = match params.search {
                Search::Direct => false,
                Search::Fft => true,
                Search::Auto => Spectral::is_faster(source, &candidates, params),
            };
            Ok(Donor { source, candidates, spectral: spectral.then(|| Spectral::new(source)) })
        };
        let donors = sources.iter().enumerate().map(donor).collect::<Result<Vec<_>, _>>()?;
        let count: usize = sources.iter().map(|s| s.count).sum();
        let squares: f64 = sources.iter().map(|s| s.squares).sum();
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53 pixels")]
        let variance = squares / count as f64;
        Ok(Self {
            params: params.clone(),
            places: donors.iter().map(|d| d.candidates.places.len()).sum(),
            slots: donors.iter().map(|d| d.candidates.slots).sum(),
            donors,
            variance,
        })
    }

    /// A new texture for every pixel with a `target_mask` (coverage, 0 to 1) above 0.
    ///
    /// # Panics
    ///
    /// If `target_mask` is not made of whole rows of `width` pixels.
    #[must_use]
    pub fn synthesise<R: Rng + ?Sized>(&self, target_mask: &[f32], width: usize, rng: &mut R) -> Texture {
        assert!(
            width > 0 && target_mask.len().is_multiple_of(width),
            "target_mask must have whole rows of {width} pixels, has {} values",
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
        let mut work = Work::default();
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
                work.template.centrality = depths.get(centre).copied().unwrap_or(0.0);
                canvas.overlaps(corner, &mut work.template.pixels);
                let chosen = self.choose(before, &mut work, rng);
                let source = self.donors[chosen.donor].source;
                canvas.paste(corner, chosen.donor, source, chosen.place, self.params.seam);
                left = Some(chosen);
                *above = left;
            }
        }
        canvas.finish(width, height)
    }

    fn choose<R: Rng + ?Sized>(&self, before: [Option<Candidate>; 2], work: &mut Work, rng: &mut R) -> Candidate {
        if work.template.pixels.is_empty() {
            return self.weighted(work.template.centrality, rng);
        }
        match self.params.acceptance {
            Acceptance::Threshold { d_max, max_tries } => self.first_below(d_max, max_tries, work, rng),
            Acceptance::Near { factor, floor } => self.one_near(factor, floor, before, work, rng),
        }
    }

    /// The paper's acceptance: the first random candidate with d(E_B(x,y), E_B0) < d_max, d the
    /// root of the mean squared error over the overlaps.
    fn first_below<R: Rng + ?Sized>(&self, d_max: f64, max_tries: usize, work: &mut Work, rng: &mut R) -> Candidate {
        let Work { template, laid, .. } = work;
        template.weight = 0.0;
        self.lay(template, laid);
        #[expect(
            clippy::cast_precision_loss,
            clippy::cast_possible_truncation,
            reason = "at most 256 squared; costs are single precision"
        )]
        let enough = (d_max * d_max * template.pixels.len() as f64) as f32;
        // A try takes about as long as a block of the scan. With as many tries as blocks before it,
        // the choice never takes much more than twice as long as the better of the two would.
        let tries = max_tries.min(self.slots / LANES);
        let mut best = (f32::INFINITY, None);
        for _ in 0..tries {
            let candidate = self.weighted(template.centrality, rng);
            let source = self.donors[candidate.donor].source;
            let cost = laid[candidate.donor].cost(source, candidate.place);
            if cost <= enough {
                return candidate;
            }
            if cost < best.0 {
                best = (cost, Some(candidate));
            }
        }
        if tries < max_tries {
            let slot = self.outcome_of_tries(enough, best.0, max_tries - tries, work, rng);
            best.1 = slot.map(|slot| self.candidate_of_slot(slot)).or(best.1);
        }
        // Only an overflow of every cost leaves none.
        best.1.unwrap_or_else(|| self.weighted(work.template.centrality, rng))
    }

    /// What `tries` more tries of the template that is laid would choose, if better than `least`.
    fn outcome_of_tries<R: Rng + ?Sized>(
        &self,
        enough: f32,
        least: f32,
        tries: usize,
        work: &mut Work,
        rng: &mut R,
    ) -> Option<usize> {
        let Work { laid, costs, weights, .. } = work;
        self.scan(laid, Tolerance { factor: 0.0, floor: least }, 0.0, costs, None);
        // Without pixels the cost is strength · Δ², and exp(-cost) the weight.
        #[expect(clippy::cast_possible_truncation, reason = "weights are single precision")]
        let strength = self.params.centre_bias.strength() as f32;
        laid.iter_mut().for_each(|laid| laid.forget_pixels(strength));
        let nearest = self.scan(laid, Tolerance { factor: 1.0, floor: f32::INFINITY }, f32::INFINITY, weights, None);
        exp_below(weights, nearest);
        outcome_of_tries(costs, weights, enough, least, tries, rng)
    }

    /// Costs of all candidates, and the smallest: one by one, or by Fourier transforms where a template is given and they are
    /// faster.
    fn scan(
        &self,
        laid: &[Laid],
        tolerance: Tolerance,
        mut least: f32,
        costs: &mut Vec<f32>,
        template: Option<&Template>,
    ) -> f32 {
        costs.resize(self.slots, 0.0);
        let mut rest = &mut costs[..];
        for (Donor { source, candidates, spectral }, laid) in self.donors.iter().zip(laid) {
            let (costs, others) = rest.split_at_mut(candidates.slots);
            rest = others;
            match (spectral, template) {
                (Some(spectral), Some(template)) => {
                    spectral.costs(source, candidates, self.params.patch_px, template, &mut least, costs);
                }
                _ => scan(source, candidates, laid, tolerance, &mut least, costs),
            }
        }
        least
    }

    /// Ours: one of the candidates whose cost is near the smallest.
    fn one_near<R: Rng + ?Sized>(
        &self,
        factor: f64,
        floor: f64,
        before: [Option<Candidate>; 2],
        work: &mut Work,
        rng: &mut R,
    ) -> Candidate {
        #[expect(clippy::cast_precision_loss, reason = "at most 256 squared")]
        let scale = self.variance * work.template.pixels.len() as f64;
        let (floor, weight) = (floor * scale, self.params.centre_bias.strength() * scale);
        #[expect(clippy::cast_possible_truncation, reason = "costs are single precision")]
        let [factor, floor, weight] = [factor, floor, weight].map(|number| number as f32);
        let tolerance = Tolerance { factor, floor };
        work.template.weight = weight;
        self.lay(&work.template, &mut work.laid);
        // What continues a neighbour usually fits well, and lets the scan reject early. It must be
        // found again with the same bits, which Fourier transforms do not promise.
        let mut least = f32::INFINITY;
        for Candidate { donor, place } in self.continuations(before).into_iter().flatten() {
            let Donor { source, spectral, .. } = &self.donors[donor];
            if spectral.is_none() {
                least = least.min(work.laid[donor].cost(source, place));
            }
        }
        let least = self.scan(&work.laid, tolerance, least, &mut work.costs, Some(&work.template));
        work.near.clear();
        work.near.extend(slots_between(&work.costs, f32::NEG_INFINITY, tolerance.bound(least)));
        if work.near.is_empty() {
            // Only an overflow of every cost leaves none.
            return self.weighted(work.template.centrality, rng);
        }
        self.candidate_of_slot(work.near[below(work.near.len(), rng)])
    }

    fn lay(&self, template: &Template, laid: &mut Vec<Laid>) {
        laid.resize_with(self.donors.len(), Laid::default);
        for (laid, donor) in laid.iter_mut().zip(&self.donors) {
            laid.over(donor.source, self.params.patch_px, template);
        }
    }

    /// The candidates that continue the left neighbour to the right and the upper one downwards.
    fn continuations(&self, [left, above]: [Option<Candidate>; 2]) -> [Option<Candidate>; 2] {
        let step = self.params.patch_px - self.params.overlap_px;
        let shift = |from: Option<Candidate>, down: bool| {
            let Candidate { donor, place } = from?;
            let Donor { source, candidates, .. } = &self.donors[donor];
            let place = place + if down { step * source.stride() } else { step };
            let open = candidates.barrier.get(place).is_some_and(|&b| b == 0.0);
            open.then_some(Candidate { donor, place })
        };
        [shift(left, false), shift(above, true)]
    }

    fn candidate_of_slot(&self, slot: usize) -> Candidate {
        let (donor, slot) = self.donor_of(slot, |candidates| candidates.slots);
        Candidate { donor, place: self.donors[donor].candidates.place_of_slot(slot) }
    }

    /// The donor of something that is numbered through all of them, and its number there.
    fn donor_of(&self, mut number: usize, count: impl Fn(&Candidates) -> usize) -> (usize, usize) {
        let mut donor = 0;
        while number >= count(&self.donors[donor].candidates) {
            number -= count(&self.donors[donor].candidates);
            donor += 1;
        }
        (donor, number)
    }

    /// A random candidate, with probability in proportion to exp(-strength · Δ²).
    fn weighted<R: Rng + ?Sized>(&self, depth: f32, rng: &mut R) -> Candidate {
        let strength = self.params.centre_bias.strength();
        let mut candidate = self.any(rng);
        for _ in 0..REDRAWS {
            if strength == 0.0 {
                break;
            }
            let source = self.donors[candidate.donor].source;
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
        let (donor, n) = self.donor_of(below(self.places, rng), |candidates| candidates.places.len());
        Candidate { donor, place: self.donors[donor].candidates.places[n] }
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
    fn small_sources_are_scanned_and_large_ones_transformed() {
        let chosen = |side: usize, patch_px| {
            let source = Source::new(&vec![0.0; side * side], &vec![1.0; side * side], side).unwrap();
            let params = QuiltParams { patch_px, overlap_px: patch_px / 4, ..QuiltParams::default() };
            Quilter::new(&[&source], &params).unwrap().donors[0].spectral.is_some()
        };
        assert!(!chosen(40, 9));
        assert!(!chosen(128, 16));
        assert!(chosen(256, 64));
    }

    /// The first of `max_tries` with a cost of `enough` or less, else the first of the best.
    fn tried(quilter: &Quilter<'_>, enough: f32, max_tries: usize, work: &mut Work, rng: &mut impl Rng) -> Candidate {
        work.template.weight = 0.0;
        quilter.lay(&work.template, &mut work.laid);
        let mut best = (f32::INFINITY, None);
        for _ in 0..max_tries {
            let candidate = quilter.weighted(work.template.centrality, rng);
            let cost = work.laid[candidate.donor].cost(quilter.donors[candidate.donor].source, candidate.place);
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
    fn first_below_chooses_like_tries_one_by_one() {
        const DRAWS: usize = 20_000;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
        let sources = [disc(14, 14, &mut rng), disc(11, 17, &mut rng)];
        let mut work = Work { template: template(5, 1, &mut rng), ..Work::default() };
        let n = work.template.pixels.len() as f64;
        // Many, few, hardly any and no candidates are good enough.
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
                let fast = quilter.first_below(d_max, 60, &mut work, &mut rng);
                let slow = tried(&quilter, enough, 60, &mut work, &mut rng);
                counts[2 * fast.place + fast.donor][0] += 1.0;
                counts[2 * slow.place + slow.donor][1] += 1.0;
            }
            assert_same_distribution(&counts);
        }
    }
}

//! Weight maps and rejection sampling from them (paper, section "Population Distribution Generation").

use rand_core::Rng;

use crate::error::ErrorKind;
use crate::random;

/// Relative density of cells at each place of a field, as an image stretched over the field.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightMap {
    /// Columns.
    pub width: usize,
    /// Weights of at least 0, row by row; only their ratios matter.
    pub weights: Vec<f32>,
}

/// A weight map prepared for rejection sampling.
#[derive(Debug, Clone)]
pub(crate) struct Sampler {
    width: usize,
    height: usize,
    weights: Vec<f32>,
    largest: f32,
    /// Pixels with a weight above 0.
    possible: Vec<u32>,
}

impl WeightMap {
    /// Returns a map whose weights are a function of the centres of its pixels, given as fractions of the map.
    pub(crate) fn from_fn(width: usize, height: usize, weight: impl Fn([f64; 2]) -> f64) -> Self {
        let mut weights = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let centre = [(x as f64 + 0.5) / width as f64, (y as f64 + 0.5) / height as f64];
                weights.push(weight(centre) as f32);
            }
        }
        Self { width, weights }
    }

    /// Prepares the map for sampling, or returns why it is invalid.
    pub(crate) fn sampler(&self) -> Result<Sampler, ErrorKind> {
        if self.width == 0 || self.weights.is_empty() || !self.weights.len().is_multiple_of(self.width) {
            return Err(ErrorKind::MapSize(self.weights.len(), self.width));
        }
        if let Some(bad) = self.weights.iter().position(|w| !w.is_finite() || *w < 0.0) {
            let (x, y) = (bad % self.width, bad / self.width);
            return Err(ErrorKind::Weight { x, y, weight: self.weights[bad] });
        }
        let largest = self.weights.iter().fold(0.0_f32, |a, b| a.max(*b));
        if largest <= 0.0 {
            return Err(ErrorKind::NoWeight);
        }
        let possible = (0_u32..).zip(&self.weights).filter(|(_, w)| **w > 0.0).map(|(i, _)| i).collect();
        Ok(Sampler {
            width: self.width,
            height: self.weights.len() / self.width,
            weights: self.weights.clone(),
            largest,
            possible,
        })
    }
}

impl Sampler {
    /// Returns the fraction of the field with a weight above 0.
    pub(crate) fn possible_share(&self) -> f64 {
        self.possible.len() as f64 / self.weights.len() as f64
    }

    /// Returns the expected number of tries per accepted place.
    pub(crate) fn expected_tries(&self) -> f64 {
        let sum: f64 = self.weights.iter().map(|w| f64::from(*w)).sum();
        f64::from(self.largest) * self.possible.len() as f64 / sum
    }

    /// Tries once: returns a place as fractions of the field, if it is accepted.
    ///
    /// Candidates are uniform over the places with a weight above 0 (Eq. 5) and accepted with probability
    /// W(x, y) / max W.
    pub(crate) fn try_place<R: Rng + ?Sized>(&self, rng: &mut R) -> Option<[f64; 2]> {
        let pixel = *self.possible.get(random::below(self.possible.len(), rng))? as usize;
        // Eq. 5: x = U(0, M), y = U(0, N).
        let place = [
            ((pixel % self.width) as f64 + random::uniform(rng)) / self.width as f64,
            ((pixel / self.width) as f64 + random::uniform(rng)) / self.height as f64,
        ];
        random::chance(f64::from(self.weights[pixel] / self.largest), rng).then_some(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn accepted_places_follow_the_map() {
        let map = WeightMap { width: 4, weights: vec![0.0, 1.0, 2.0, 0.5, 3.0, 0.0, 0.25, 1.0] };
        let sampler = map.sampler().unwrap();
        let mut rng = Key { seed: 11, index: 0 }.stream("test", 0, "weight");
        let mut counts = [0.0; 8];
        let mut accepted = 0.0;
        for _ in 0..60_000 {
            if let Some([x, y]) = sampler.try_place(&mut rng) {
                counts[(y * 2.0) as usize * 4 + (x * 4.0) as usize] += 1.0;
                accepted += 1.0;
            }
        }
        let sum: f32 = map.weights.iter().sum();
        let chi2: f64 = map
            .weights
            .iter()
            .zip(counts)
            .filter(|(w, _)| **w > 0.0)
            .map(|(w, n)| {
                let expected = accepted * f64::from(w / sum);
                (n - expected) * (n - expected) / expected
            })
            .sum();
        // Five degrees of freedom: 20.5 is exceeded once in a thousand.
        assert!(chi2 < 20.5, "{chi2}");
        assert_eq!(counts[0] + counts[5], 0.0);
        assert!((60_000.0 / accepted - sampler.expected_tries()).abs() < 0.05);
    }

    #[test]
    fn invalid_maps_are_errors() {
        for (width, weights, said) in [
            (2, vec![0.0; 4], "all weights are zero"),
            (0, vec![], "0 pixels"),
            (3, vec![1.0; 4], "rows of 3"),
            (2, vec![1.0, f32::NAN], "(1, 0)"),
            (2, vec![1.0, -1.0], "-1"),
        ] {
            let message = WeightMap { width, weights }.sampler().unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
    }
}

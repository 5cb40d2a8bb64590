//! Correlated random numbers along a path or an outline.

use crate::key::Stream;
use crate::random;

/// A first-order autoregression: normal numbers with mean 0, whose correlation decreases by a constant factor from
/// each to the next.
pub(super) struct Autoregression {
    state: f64,
    memory: f64,
    sd: f64,
}

impl Autoregression {
    /// Draws the first number. `memory` is the correlation of two successive numbers, `sd` the standard deviation.
    pub(super) fn new(memory: f64, sd: f64, rng: &mut Stream) -> Self {
        Self { state: sd * random::normal(rng), memory, sd }
    }

    /// Draws the next number.
    pub(super) fn next(&mut self, rng: &mut Stream) -> f64 {
        let fresh = (1.0 - self.memory * self.memory).sqrt();
        self.state = self.memory * self.state + fresh * self.sd * random::normal(rng);
        self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;

    #[test]
    fn numbers_have_their_standard_deviation_and_correlation() {
        const COUNT: u32 = 200_000;
        for (memory, sd) in [(0.6, 1.0), (0.93, 0.35)] {
            let rng = &mut Key { seed: 5, index: 0 }.stream("test", 0, "autoregression");
            let mut numbers = Autoregression::new(memory, sd, rng);
            let (mut before, mut squares, mut products) = (numbers.state, 0.0, 0.0);
            for _ in 0..COUNT {
                let number = numbers.next(rng);
                squares += number * number / (sd * sd);
                products += before * number / (sd * sd);
                before = number;
            }
            // Standard error of the mean square: √(2 (1 + m²) / ((1 − m²) n)), 0.012 for the larger memory m.
            let [square, product] = [squares, products].map(|sum| sum / f64::from(COUNT));
            assert!((square - 1.0).abs() < 0.06 && (product - memory).abs() < 0.06, "{square} {product}");
        }
    }
}

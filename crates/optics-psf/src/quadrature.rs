use core::f64::consts::PI;

/// Longest rule. A lens with more fringes than that resolves transfers nothing.
const LONGEST: usize = 1024;

/// Gauss–Legendre rules on 0..1 of 2, 4, … nodes, made when first asked for.
#[derive(Debug, Default)]
pub(crate) struct Rules {
    made: Vec<Vec<[f64; 2]>>,
}

impl Rules {
    /// Nodes and weights of a rule with at least `nodes` nodes, an even number, ascending.
    pub(crate) fn get(&mut self, nodes: usize) -> &[[f64; 2]] {
        let half = nodes.clamp(2, LONGEST).div_ceil(2);
        if self.made.len() <= half {
            self.made.resize(half + 1, Vec::new());
        }
        let rule = &mut self.made[half];
        if rule.is_empty() {
            *rule = gauss_legendre(2 * half);
        }
        rule
    }
}

/// Newton's method on the Legendre polynomial of degree `n`.
fn gauss_legendre(n: usize) -> Vec<[f64; 2]> {
    let degree = n as f64;
    let node = |i: usize| {
        let mut x = -libm::cos(PI * (i as f64 + 0.75) / (degree + 0.5));
        let mut slope = 1.0;
        // The first guess is right to a few digits, and each step doubles them.
        for _ in 0..6 {
            let (mut p, mut before) = (1.0, 0.0);
            for k in 0..n {
                let k = k as f64;
                (p, before) = (((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0), p);
            }
            slope = degree * (x * p - before) / (x * x - 1.0);
            x -= p / slope;
        }
        [0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope)]
    };
    (0..n).map(node).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_exact_for_polynomials() {
        let mut rules = Rules::default();
        for nodes in [2, 4, 7, 16, 64, 300] {
            let rule = rules.get(nodes);
            assert!(rule.len() >= nodes && rule.len() % 2 == 0);
            for degree in 0..(2 * rule.len()).min(40) {
                let power = |x: f64| (0..degree).fold(1.0, |p, _| p * x);
                let integral: f64 = rule.iter().map(|&[x, w]| w * power(x)).sum();
                assert!((integral * (degree as f64 + 1.0) - 1.0).abs() < 1e-12, "{nodes} {degree}: {integral}");
            }
        }
        assert_eq!(rules.get(100_000).len(), LONGEST);
    }
}

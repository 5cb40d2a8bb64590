use core::f64::consts::PI;

/// A pair of smooth functions on an interval as the polynomial through their values at Chebyshev's points.
pub(crate) struct Curve {
    /// Place, weight of the barycentric formula, values.
    nodes: Vec<[f64; 4]>,
}

impl Curve {
    /// At least two nodes, the ends among them.
    pub(crate) fn new([from, to]: [f64; 2], nodes: usize, mut function: impl FnMut(f64) -> [f64; 2]) -> Self {
        let last = nodes.max(2) - 1;
        let node = |i: usize| {
            let x = from + (to - from) * 0.5 * (1.0 - libm::cos(PI * i as f64 / last as f64));
            let end = if i == 0 || i == last { 0.5 } else { 1.0 };
            let [a, b] = function(x);
            [x, if i.is_multiple_of(2) { end } else { -end }, a, b]
        };
        Self { nodes: (0..=last).map(node).collect() }
    }

    /// Berrut and Trefethen, DOI 10.1137/S0036144502417715, Eq. 4.2.
    pub(crate) fn at(&self, x: f64) -> [f64; 2] {
        let mut sums = [0.0; 3];
        for &[node, weight, a, b] in &self.nodes {
            if x == node {
                return [a, b];
            }
            let share = weight / (x - node);
            sums = [sums[0] + share, sums[1] + share * a, sums[2] + share * b];
        }
        [sums[1] / sums[0], sums[2] / sums[0]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_functions_are_met_everywhere() {
        let function = |x: f64| [libm::sin(9.0 * x), (x + 1.0) * (x + 1.0).sqrt()];
        let curve = Curve::new([-1.0, 2.0], 40, function);
        for i in 0..=300 {
            let x = -1.0 + 0.01 * f64::from(i);
            let ([a, b], [c, d]) = (curve.at(x), function(x));
            // The second has no second derivative at one end.
            assert!((a - c).abs() < 1e-12 && (b - d).abs() < 1e-4, "{x}");
        }
        assert_eq!(curve.at(2.0), function(2.0));
    }
}

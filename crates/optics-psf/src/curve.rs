use core::f64::consts::PI;

use multiversion::multiversion;

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

    /// The values at `step` times `first`, `first` + 1, …
    pub(crate) fn values_into(&self, step: f64, first: usize, out: &mut [[f64; 2]]) {
        values(&self.nodes, step, first, out);
    }
}

/// Places that are looked up side by side.
const LANES: usize = 8;

/// Berrut and Trefethen, DOI 10.1137/S0036144502417715, Eq. 4.2.
#[multiversion(targets = "simd")]
fn values(nodes: &[[f64; 4]], step: f64, first: usize, out: &mut [[f64; 2]]) {
    for (block, out) in out.chunks_mut(LANES).enumerate() {
        let mut x = [0.0; LANES];
        for (lane, x) in x.iter_mut().enumerate() {
            *x = step * (first + LANES * block + lane) as f64;
        }
        let mut sums = [[0.0; LANES]; 3];
        // The formula has no value at a node.
        let mut met = [[0.0; LANES]; 3];
        for &[node, weight, a, b] in nodes {
            for l in 0..LANES {
                let away = x[l] - node;
                let (is_node, share) = (away == 0.0, weight / away);
                sums[0][l] += share;
                sums[1][l] += share * a;
                sums[2][l] += share * b;
                met[0][l] = if is_node { 1.0 } else { met[0][l] };
                met[1][l] = if is_node { a } else { met[1][l] };
                met[2][l] = if is_node { b } else { met[2][l] };
            }
        }
        for (l, out) in out.iter_mut().enumerate() {
            *out = if met[0][l] > 0.0 {
                [met[1][l], met[2][l]]
            } else {
                [sums[1][l] / sums[0][l], sums[2][l] / sums[0][l]]
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_functions_are_met_everywhere() {
        let function = |x: f64| [libm::sin(9.0 * x), x * x.sqrt()];
        let curve = Curve::new([0.0, 3.02], 40, function);
        for i in 0..=300 {
            let (step, first) = (0.01, i);
            let mut found = [[0.0; 2]; 3];
            curve.values_into(step, first, &mut found);
            for (j, [a, b]) in found.into_iter().enumerate() {
                let x = step * (first + j) as f64;
                let [c, d] = function(x);
                // The second has no second derivative at one end.
                assert!((a - c).abs() < 1e-12 && (b - d).abs() < 1e-4, "{x}");
            }
        }
        let mut nodes = [[0.0; 2]; 5];
        curve.values_into(0.5, 0, &mut nodes);
        assert_eq!(nodes[0], function(0.0), "a node at an end");
        assert!(nodes.as_flattened().iter().all(|value| value.is_finite()));
    }
}

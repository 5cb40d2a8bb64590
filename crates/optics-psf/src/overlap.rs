use core::f64::consts::PI;
use std::sync::OnceLock;

use multiversion::multiversion;

use crate::pupil::{Pupil, RoundWaves, turn};

/// Integral over the overlap of the condenser's disc with the objective's disc, shifted by a frequency:
///
/// E(f) = 1/S₀ ∫ circ(|s + f|) exp 2πi [W(s + f) − W(s)] ds, with s in the condenser's disc of area S₀.
///
/// The overlap is split along f where its outline changes from one circle to the other. A quadratic map removes the
/// square root at its pointed ends, so that Gauss–Legendre rules converge fast. The number of nodes follows the fringes
/// of the integrand. For a rotationally symmetric pupil, half of the overlap suffices.
#[derive(Debug, Default)]
pub(crate) struct OverlapIntegral {
    /// Coordinates and weights of the nodes.
    x: Vec<f32>,
    y: Vec<f32>,
    weight: Vec<f32>,
    /// Waves from the axis to both outlines, for each node along f.
    fringes: Vec<f32>,
}

/// Nodes along f: a minimum, and the number per fringe.
const ALONG: (usize, f64) = (8, 3.0);
/// Nodes across f, from the axis to the outline.
const ACROSS: (usize, f64) = (3, 2.0);

impl OverlapIntegral {
    /// Returns E at the frequency `f` >= 0 in the direction (cos, sin).
    pub(crate) fn integral(&mut self, pupil: &Pupil, f: f64, direction: [f64; 2]) -> [f64; 2] {
        for list in [&mut self.x, &mut self.y, &mut self.weight] {
            list.clear();
        }
        let (inner, outer) = (pupil.condenser, pupil.objective);
        let right = inner.min(outer - f);
        if right <= -inner {
            return [0.0; 2];
        }
        let crossing = if f > outer - inner { (outer * outer - inner * inner - f * f) / (2.0 * f) } else { 0.0 };
        let split = crossing.clamp(-inner, right);
        self.segment(pupil, f, direction, -inner, split);
        self.segment(pupil, f, direction, right, split);
        let area = PI * inner * inner;
        let sum = if pupil.is_round() { self.sum_round(pupil, f) } else { self.sum(pupil, f, direction) };
        sum.map(|part| part / area)
    }

    fn sum(&self, pupil: &Pupil, f: f64, direction: [f64; 2]) -> [f64; 2] {
        let mut total = [0.0; 2];
        for ((&x, &y), &w) in self.x.iter().zip(&self.y).zip(&self.weight) {
            let [x, y, w] = [x, y, w].map(f64::from);
            let (c, s) = turn(waves(pupil, direction, x + f, y) - waves(pupil, direction, x, y));
            total = [total[0] + w * c, total[1] + w * s];
        }
        total
    }

    #[expect(clippy::cast_possible_truncation, reason = "phases in single precision")]
    fn sum_round(&mut self, pupil: &Pupil, f: f64) -> [f64; 2] {
        for list in [&mut self.x, &mut self.y, &mut self.weight] {
            list.resize(list.len().next_multiple_of(LANES), 0.0);
        }
        let (x, y, weight) = (self.x.as_chunks().0, self.y.as_chunks().0, self.weight.as_chunks().0);
        sum_blocks(&pupil.single_precision(), f as f32, x, y, weight)
    }

    /// Adds the nodes of the part between a pointed end and the split.
    #[expect(clippy::cast_possible_truncation, reason = "nodes in single precision")]
    fn segment(&mut self, pupil: &Pupil, f: f64, direction: [f64; 2], end: f64, split: f64) {
        let half_height = |x: f64| {
            let (inner, outer) = (pupil.condenser, pupil.objective);
            let square = (inner * inner - x * x).min(outer * outer - (x + f) * (x + f));
            square.max(0.0).sqrt()
        };
        let difference = |x: f64, y: f64| waves(pupil, direction, x + f, y) - waves(pupil, direction, x, y);
        let width = split - end;
        let fringes = difference(split, 0.0) - difference(end, 0.0);
        let rule = quadrature_rule(node_count(fringes, ALONG));
        let position = |t: f64| end + width * t * t;
        let Self { fringes: across, .. } = self;
        across.clear();
        if pupil.is_round() {
            let single = pupil.single_precision();
            for block in rule.chunks(LANES) {
                let mut nodes = [[0.0; LANES]; 2];
                for (i, [t, _]) in block.iter().enumerate() {
                    (nodes[0][i], nodes[1][i]) = (position(*t) as f32, half_height(position(*t)) as f32);
                }
                across.extend_from_slice(&fringes_across(&single, f as f32, &nodes)[..block.len()]);
            }
        } else {
            across.extend(rule.iter().map(|[t, _]| {
                let (x, height) = (position(*t), half_height(position(*t)));
                let axis = difference(x, 0.0);
                ((difference(x, height) - axis).abs() + (difference(x, -height) - axis).abs()) as f32
            }));
        }
        for (&[t, w], &fringes) in rule.iter().zip(&*across) {
            let x = position(t);
            let weight = 2.0 * width.abs() * t * w;
            let height = half_height(x);
            // The upper half of an even rule covers 0..1 of the half height.
            let across = quadrature_rule(node_count(f64::from(fringes), ACROSS) * 2);
            for &[u, v] in &across[across.len() / 2..] {
                let [x, y, weight] = [x, height * (2.0 * u - 1.0), weight * 2.0 * height * v].map(|value| value as f32);
                if pupil.is_round() {
                    self.x.push(x);
                    self.y.push(y);
                    self.weight.push(2.0 * weight);
                } else {
                    self.x.extend([x, x]);
                    self.y.extend([y, -y]);
                    self.weight.extend([weight, weight]);
                }
            }
        }
    }
}

/// Returns the number of nodes for a range of waves.
fn node_count(range: f64, (least, more): (usize, f64)) -> usize {
    let fringes = range.abs().min(1000.0) * more;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4000")]
    let extra = fringes as usize;
    least + extra
}

/// Returns the waves by which the integrand changes from the axis to both outlines, at positions x and half heights.
#[multiversion(targets = "simd")]
fn fringes_across(waves: &RoundWaves, f: f32, [x, height]: &[[f32; LANES]; 2]) -> [f32; LANES] {
    let mut squares = [[0.0; LANES]; 4];
    for l in 0..LANES {
        let (x, above) = (x[l], height[l] * height[l]);
        squares[0][l] = x * x;
        squares[1][l] = (x + f) * (x + f);
        squares[2][l] = squares[0][l] + above;
        squares[3][l] = squares[1][l] + above;
    }
    let [axis, shifted_axis, rim, shifted_rim] = [0, 1, 2, 3].map(|i| waves.at(&squares[i]));
    let mut fringes = [0.0; LANES];
    for l in 0..LANES {
        fringes[l] = 2.0 * ((shifted_rim[l] - rim[l]) - (shifted_axis[l] - axis[l])).abs();
    }
    fringes
}

/// Largest rule. A pupil with more fringes transfers nothing.
const LONGEST: usize = 1024;

/// Returns nodes and weights on 0..1 of a Gauss–Legendre rule with at least `nodes` nodes, an even number, in ascending
/// order. Each rule is computed once.
pub(crate) fn quadrature_rule(nodes: usize) -> &'static [[f64; 2]] {
    static RULES: [OnceLock<Vec<[f64; 2]>>; LONGEST / 2 + 1] = [const { OnceLock::new() }; LONGEST / 2 + 1];
    let half = nodes.clamp(2, LONGEST).div_ceil(2);
    RULES[half].get_or_init(|| gauss_legendre(2 * half))
}

/// Computes a rule by Newton's method on the Legendre polynomial of degree `n`.
fn gauss_legendre(n: usize) -> Vec<[f64; 2]> {
    let degree = n as f64;
    let node = |i: usize| {
        let mut x = -libm::cos(PI * (i as f64 + 0.75) / (degree + 0.5));
        let mut slope = 1.0;
        // The initial value is accurate to a few digits, and each step doubles them.
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

/// Returns W at a point given along and across `direction`.
fn waves(pupil: &Pupil, [c, s]: [f64; 2], x: f64, y: f64) -> f64 {
    pupil.waves([c * x - s * y, s * x + c * y])
}

/// Parallel partial sums: their order is the same for every instruction set.
const LANES: usize = 16;

#[multiversion(targets = "simd")]
fn sum_blocks(waves: &RoundWaves, f: f32, x: &[[f32; LANES]], y: &[[f32; LANES]], weight: &[[f32; LANES]]) -> [f64; 2] {
    let mut sums = [[0.0_f32; LANES]; 2];
    for ((x, y), weight) in x.iter().zip(y).zip(weight) {
        let (mut shifted, mut at) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            at[l] = x[l] * x[l] + y[l] * y[l];
            shifted[l] = at[l] + f * (2.0 * x[l] + f);
        }
        let (shifted, at) = (waves.at(&shifted), waves.at(&at));
        for l in 0..LANES {
            let (c, s) = turn_f32(shifted[l] - at[l]);
            sums[0][l] += weight[l] * c;
            sums[1][l] += weight[l] * s;
        }
    }
    sums.map(|lanes| lanes.into_iter().map(f64::from).sum())
}

/// As [`turn`], with an error below 1e-6.
#[inline(always)]
fn turn_f32(x: f32) -> (f32, f32) {
    /// Adding it rounds a number to an integer.
    const WHOLE: f32 = 12_582_912.0;
    let x = x - ((x + WHOLE) - WHOLE);
    // x = quarter/4 + rest, |rest| <= 1/8.
    let quarter = (4.0 * x + WHOLE) - WHOLE;
    let t = core::f32::consts::TAU * (x - 0.25 * quarter);
    let t2 = t * t;
    let sin = t * (1.0 + t2 * (-1.0 / 6.0 + t2 * (1.0 / 120.0 + t2 * (-1.0 / 5040.0 + t2 / 362_880.0))));
    let cos = 1.0 + t2 * (-0.5 + t2 * (1.0 / 24.0 + t2 * (-1.0 / 720.0 + t2 / 40_320.0)));
    // As for double precision.
    let half = quarter.abs() > 1.5;
    let c = if half { -1.0 } else { 1.0 - quarter * quarter };
    let s = if half { 0.0 } else { quarter };
    (cos * c - sin * s, sin * c + cos * s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MicroscopeParams, Zernike};

    /// Reference: the midpoint rule on rings of the condenser's disc.
    fn oracle(pupil: &Pupil, f: f64, direction: [f64; 2]) -> [f64; 2] {
        let (rings, spokes) = (500_u32, 700_u32);
        let mut sum = [0.0; 2];
        for i in 0..rings {
            let r = pupil.condenser * ((f64::from(i) + 0.5) / f64::from(rings)).sqrt();
            for j in 0..spokes {
                let angle = core::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(spokes);
                let (x, y) = (r * libm::cos(angle), r * libm::sin(angle));
                if pupil.passes((x + f) * (x + f) + y * y) {
                    let (c, s) = turn(waves(pupil, direction, x + f, y) - waves(pupil, direction, x, y));
                    sum[0] += c;
                    sum[1] += s;
                }
            }
        }
        sum.map(|v| v / f64::from(rings * spokes))
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "single precision")]
    fn single_precision_turns_match_cosine_and_sine() {
        for i in -40_000..40_000 {
            let x = (f64::from(i) * 1.23e-3) as f32;
            let (c, s) = turn_f32(x);
            let angle = core::f64::consts::TAU * f64::from(x);
            assert!((f64::from(c) - libm::cos(angle)).abs() < 1e-6, "{x}");
            assert!((f64::from(s) - libm::sin(angle)).abs() < 1e-6, "{x}");
        }
    }

    #[test]
    fn overlap_integral_matches_the_midpoint_rule() {
        let (round, sided) =
            (Zernike::default(), Zernike { coma: [0.15, -0.05], astigmatism: [0.0, 0.1], ..Zernike::default() });
        let cases = [
            (0.3, 10.0, 0.0, round, [1.0, 0.0]),
            (0.4, 0.0, 4.0, round, [1.0, 0.0]),
            (0.6, 10.0, 0.0, round, [1.0, 0.0]),
            (0.95, 0.0, 5.0, round, [1.0, 0.0]),
            (0.95, -8.0, 2.0, round, [1.0, 0.0]),
            (1.2, 0.0, 10.0, round, [1.0, 0.0]),
            (0.6, 2.0, 0.0, sided, [1.0, 0.0]),
            (0.6, 2.0, 0.0, sided, [0.6, -0.8]),
            (0.6, 2.0, 0.0, sided, [-0.6, 0.8]),
        ];
        let mut overlap = OverlapIntegral::default();
        for (condenser_na, depth, stage, zernike, direction) in cases {
            let params = MicroscopeParams { condenser_na, zernike, ..MicroscopeParams::default() };
            let pupil = Pupil::new(&params, 0.57, depth, stage);
            for k in 0..14 {
                let f = pupil.cutoff() * (f64::from(k) + 0.3) / 14.0;
                let ([a, b], [c, d]) = (overlap.integral(&pupil, f, direction), oracle(&pupil, f, direction));
                assert!((a - c).abs().max((b - d).abs()) < 7e-4, "{condenser_na} {depth} {stage} {f}: {a} {b} {c} {d}");
            }
        }
    }

    #[test]
    fn quadrature_rules_are_exact_for_polynomials() {
        for nodes in [2, 4, 7, 16, 64, 300] {
            let rule = quadrature_rule(nodes);
            assert!(rule.len() >= nodes && rule.len().is_multiple_of(2));
            for degree in 0..(2 * rule.len()).min(40) {
                let power = |x: f64| (0..degree).fold(1.0, |p, _| p * x);
                let integral: f64 = rule.iter().map(|&[x, w]| w * power(x)).sum();
                assert!((integral * (degree as f64 + 1.0) - 1.0).abs() < 1e-12, "{nodes} {degree}: {integral}");
            }
        }
        assert_eq!(quadrature_rule(100_000).len(), LONGEST);
    }
}

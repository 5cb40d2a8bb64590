//! Discrete Fourier transform of any length, the same bits on every machine.
//!
//! Outlines have a few hundred points and are transformed a few times each, so a plain mixed-radix recursion serves. An FFT
//! library would be faster on long inputs, but takes its twiddle factors from the platform's sine and picks its algorithm by processor.

use crate::outline::{Point, count_as_f64};

/// Sign of the exponent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Direction {
    /// e^{−i2πlk/K}: from points to descriptors, without the factor 1/K.
    Forward,
    /// e^{+i2πlk/K}: back.
    Inverse,
}

pub(crate) fn multiply(a: Point, b: Point) -> Point {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// e^{iφ}.
pub(crate) fn unit(phi: f64) -> Point {
    let (sin, cos) = libm::sincos(phi);
    [cos, sin]
}

/// Σₖ zₖ e^{∓i2πlk/K} for l = 0..K.
pub(crate) fn transform(input: &[Point], direction: Direction) -> Vec<Point> {
    let len = input.len();
    let turn = match direction {
        Direction::Forward => -core::f64::consts::TAU,
        Direction::Inverse => core::f64::consts::TAU,
    };
    let mut twiddles: Vec<Point> = (0..=len / 2).map(|k| unit(turn * count_as_f64(k) / count_as_f64(len))).collect();
    // The other half of the circle mirrors the first.
    for k in len / 2 + 1..len {
        let [re, im] = twiddles[len - k];
        twiddles.push([re, -im]);
    }
    let mut output = vec![[0.0, 0.0]; len];
    let mut scratch = vec![[0.0, 0.0]; len];
    split(&Part { input, twiddles: &twiddles, stride: 1 }, &mut output, &mut scratch);
    output
}

/// Every `stride`-th point of the input (from the start of the slice), and the twiddles of the whole length.
struct Part<'a> {
    input: &'a [Point],
    twiddles: &'a [Point],
    stride: usize,
}

/// Transforms one part into `output`: its `p` interleaved parts first, then the sums over them.
fn split(part: &Part<'_>, output: &mut [Point], scratch: &mut [Point]) {
    let len = output.len();
    if len <= 1 {
        output.copy_from_slice(&part.input[..len]);
        return;
    }
    let p = next_factor(len);
    let m = len / p;
    for (r, piece) in output.chunks_exact_mut(m).enumerate() {
        let inner = Part { input: &part.input[r * part.stride..], stride: part.stride * p, ..*part };
        split(&inner, piece, &mut scratch[..m]);
    }
    let scratch = &mut scratch[..len];
    scratch.copy_from_slice(output);
    if p == 4 {
        return four(part, output, scratch);
    }
    let whole = part.twiddles.len();
    for k in 0..m {
        for q in 0..p {
            // e^{i2π r (k + q m) / len} for r = 0, 1, ...: steps of this many places round the table.
            let step = (k + q * m) * part.stride;
            let mut place = 0;
            let mut sum = [0.0, 0.0];
            for r in 0..p {
                let term = multiply(scratch[r * m + k], part.twiddles[place]);
                sum = [sum[0] + term[0], sum[1] + term[1]];
                place += step;
                if place >= whole {
                    place -= whole;
                }
            }
            output[k + q * m] = sum;
        }
    }
}

/// The sums over four interleaved parts: three twiddles, and turns by quarters that need no multiplication.
fn four(part: &Part<'_>, output: &mut [Point], scratch: &[Point]) {
    let m = output.len() / 4;
    // The sign of the exponent, of a quarter turn's twiddle.
    let sign = part.twiddles[part.twiddles.len() / 4][1].signum();
    for k in 0..m {
        let turned = |r: usize| multiply(scratch[r * m + k], part.twiddles[r * k * part.stride]);
        let [a, b, c, d] = [scratch[k], turned(1), turned(2), turned(3)];
        let (ac, bd) = ([a[0] + c[0], a[1] + c[1]], [b[0] + d[0], b[1] + d[1]]);
        let (a_c, b_d) = ([a[0] - c[0], a[1] - c[1]], [b[0] - d[0], b[1] - d[1]]);
        let quarter = [-sign * b_d[1], sign * b_d[0]];
        output[k] = [ac[0] + bd[0], ac[1] + bd[1]];
        output[k + m] = [a_c[0] + quarter[0], a_c[1] + quarter[1]];
        output[k + 2 * m] = [ac[0] - bd[0], ac[1] - bd[1]];
        output[k + 3 * m] = [a_c[0] - quarter[0], a_c[1] - quarter[1]];
    }
}

/// 4 where it divides, for fewer passes; else the smallest prime factor.
fn next_factor(len: usize) -> usize {
    if len.is_multiple_of(4) {
        return 4;
    }
    (2..).take_while(|p| p * p <= len).find(|&p| len.is_multiple_of(p)).unwrap_or(len)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rustfft::num_complex::Complex;

    #[test]
    fn agrees_with_rustfft_at_every_length() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xD0F7);
        let mut planner = rustfft::FftPlanner::new();
        for len in (1..70).chain([97, 128, 210, 420, 509, 640, 1024]) {
            let input: Vec<Point> =
                (0..len).map(|_| [f64::from(rng.next_u32() >> 8), f64::from(rng.next_u32() >> 8)]).collect();
            for direction in [Direction::Forward, Direction::Inverse] {
                let mut buffer: Vec<Complex<f64>> = input.iter().map(|p| Complex::new(p[0], p[1])).collect();
                match direction {
                    Direction::Forward => planner.plan_fft_forward(len).process(&mut buffer),
                    Direction::Inverse => planner.plan_fft_inverse(len).process(&mut buffer),
                }
                let scale = f64::from(1_u32 << 24) * count_as_f64(len);
                for (ours, theirs) in transform(&input, direction).iter().zip(&buffer) {
                    assert!((ours[0] - theirs.re).abs() < 1e-14 * scale, "{len}");
                    assert!((ours[1] - theirs.im).abs() < 1e-14 * scale, "{len}");
                }
            }
        }
    }
}

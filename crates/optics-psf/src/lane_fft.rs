//! Fourier transforms of sixteen sequences side by side, one in each lane: no sequence is ever shuffled, and the order of
//! operations is the same on every machine.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use multiversion::multiversion;

use crate::pupil::turn;

/// Sequences side by side: a cache line of single precision.
pub(crate) const LANES: usize = 16;

/// A complex number of each sequence: real parts, imaginary parts. Or two runs of real numbers, one after the other.
pub(crate) type Lanes = [[f32; LANES]; 2];

pub(crate) const ZERO: Lanes = [[0.0; LANES]; 2];

/// A forward transform of one length (Stockham's, with decimation in frequency). The inverse is the forward transform of
/// the reversed sequence.
#[derive(Debug, Clone)]
pub(crate) struct LaneFft {
    passes: Vec<Pass>,
}

#[derive(Debug, Clone)]
struct Pass {
    radix: usize,
    /// Butterflies, and numbers side by side that each of them takes.
    butterflies: usize,
    stride: usize,
    /// Of each butterfly, exp −2πi pk/n for k = 1 … radix − 1.
    twiddles: Vec<[f32; 2]>,
    /// exp −2πi k/radix, where the radix has no code of its own.
    roots: Vec<[f32; 2]>,
}

impl LaneFft {
    /// Large prime factors are slow.
    pub(crate) fn new(len: usize) -> Self {
        let (mut passes, mut rest, mut stride) = (Vec::new(), len, 1);
        while rest > 1 {
            let radix = [4, 2, 3, 5].into_iter().find(|&radix| rest.is_multiple_of(radix));
            let radix = radix.unwrap_or_else(|| (7..).find(|&prime| rest.is_multiple_of(prime)).unwrap_or(rest));
            let butterflies = rest / radix;
            let places = (0..butterflies).flat_map(|p| (1..radix).map(move |k| p * k));
            let twiddles = places.map(|place| root(place, rest)).collect();
            let roots = if radix > 5 { (0..radix).map(|k| root(k, radix)).collect() } else { Vec::new() };
            passes.push(Pass { radix, butterflies, stride, twiddles, roots });
            rest = butterflies;
            stride *= radix;
        }
        Self { passes }
    }

    /// Transforms `values`, whose memory and that of `spare`, of the same length, may change places.
    pub(crate) fn process(&self, values: &mut Vec<Lanes>, spare: &mut Vec<Lanes>) {
        if run(&self.passes, values, spare) {
            core::mem::swap(values, spare);
        }
    }
}

/// Transforms of all lengths that were asked for: each is planned once.
#[derive(Debug, Default)]
pub(crate) struct LanePlans {
    made: Mutex<BTreeMap<usize, Arc<LaneFft>>>,
}

impl LanePlans {
    pub(crate) fn get(&self, len: usize) -> Arc<LaneFft> {
        // A plan is whole or absent, even if a thread has panicked.
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(made.entry(len).or_insert_with(|| Arc::new(LaneFft::new(len))))
    }
}

/// exp −2πi k/n.
#[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 numbers")]
fn root(k: usize, n: usize) -> [f32; 2] {
    let (c, s) = turn((k % n) as f64 / n as f64);
    [c as f32, -s as f32]
}

/// Says whether the spectrum is in `spare`.
#[multiversion(targets = "simd")]
fn run(passes: &[Pass], values: &mut [Lanes], spare: &mut [Lanes]) -> bool {
    let (mut from, mut to) = (values, spare);
    for pass in passes {
        match pass.radix {
            2 => by_2(pass, from, to),
            3 => by_3(pass, from, to),
            4 => by_4(pass, from, to),
            5 => by_5(pass, from, to),
            _ => by_any(pass, from, to),
        }
        core::mem::swap(&mut from, &mut to);
    }
    !passes.len().is_multiple_of(2)
}

#[inline(always)]
fn times([re, im]: [f32; 2], w: [f32; 2]) -> [f32; 2] {
    [re * w[0] - im * w[1], re * w[1] + im * w[0]]
}

/// The `j`-th run of the stride of numbers that a butterfly takes.
#[inline(always)]
fn run_of<'a>(pass: &Pass, from: &'a [Lanes], butterfly: usize, j: usize) -> &'a [Lanes] {
    &from[pass.stride * (butterfly + pass.butterflies * j)..][..pass.stride]
}

#[inline(always)]
fn by_2(pass: &Pass, from: &[Lanes], to: &mut [Lanes]) {
    let s = pass.stride;
    for (p, (to, w)) in to.chunks_exact_mut(2 * s).zip(&pass.twiddles).enumerate() {
        let run = |j| run_of(pass, from, p, j);
        let (a, b) = (run(0), run(1));
        let (to_0, to_1) = to.split_at_mut(s);
        for q in 0..s {
            two(&a[q], &b[q], w, &mut to_0[q], &mut to_1[q]);
        }
    }
}

#[inline(always)]
fn by_3(pass: &Pass, from: &[Lanes], to: &mut [Lanes]) {
    let s = pass.stride;
    for (p, (to, w)) in to.chunks_exact_mut(3 * s).zip(pass.twiddles.as_chunks().0).enumerate() {
        let run = |j| run_of(pass, from, p, j);
        let (a, b, c) = (run(0), run(1), run(2));
        let (to_0, to) = to.split_at_mut(s);
        let (to_1, to_2) = to.split_at_mut(s);
        for q in 0..s {
            three(&a[q], &b[q], &c[q], w, &mut to_0[q], &mut to_1[q], &mut to_2[q]);
        }
    }
}

#[inline(always)]
fn by_4(pass: &Pass, from: &[Lanes], to: &mut [Lanes]) {
    let s = pass.stride;
    for (p, (to, w)) in to.chunks_exact_mut(4 * s).zip(pass.twiddles.as_chunks().0).enumerate() {
        let run = |j| run_of(pass, from, p, j);
        let (a, b, c, d) = (run(0), run(1), run(2), run(3));
        let (to_0, to) = to.split_at_mut(s);
        let (to_1, to) = to.split_at_mut(s);
        let (to_2, to_3) = to.split_at_mut(s);
        for q in 0..s {
            four(&a[q], &b[q], &c[q], &d[q], w, &mut to_0[q], &mut to_1[q], &mut to_2[q], &mut to_3[q]);
        }
    }
}

#[inline(always)]
fn by_5(pass: &Pass, from: &[Lanes], to: &mut [Lanes]) {
    let s = pass.stride;
    for (p, (to, w)) in to.chunks_exact_mut(5 * s).zip(pass.twiddles.as_chunks().0).enumerate() {
        let run = |j| run_of(pass, from, p, j);
        let (a, b, c, d, e) = (run(0), run(1), run(2), run(3), run(4));
        let (to_0, to) = to.split_at_mut(s);
        let (to_1, to) = to.split_at_mut(s);
        let (to_2, to) = to.split_at_mut(s);
        let (to_3, to_4) = to.split_at_mut(s);
        for q in 0..s {
            let to = (&mut to_0[q], &mut to_1[q], &mut to_2[q], &mut to_3[q], &mut to_4[q]);
            five(&a[q], &b[q], &c[q], &d[q], &e[q], w, to.0, to.1, to.2, to.3, to.4);
        }
    }
}

/// The sum itself, for other primes.
#[inline(always)]
fn by_any(pass: &Pass, from: &[Lanes], to: &mut [Lanes]) {
    let (s, radix) = (pass.stride, pass.radix);
    let butterflies = to.chunks_exact_mut(radix * s).zip(pass.twiddles.chunks_exact(radix - 1));
    for (p, (to, w)) in butterflies.enumerate() {
        for (k, to) in to.chunks_exact_mut(s).enumerate() {
            for (q, to) in to.iter_mut().enumerate() {
                let mut sum = ZERO;
                for j in 0..radix {
                    let value = &from[s * (p + pass.butterflies * j) + q];
                    let root = pass.roots[j * k % radix];
                    for l in 0..LANES {
                        let [re, im] = times([value[0][l], value[1][l]], root);
                        sum[0][l] += re;
                        sum[1][l] += im;
                    }
                }
                let w = k.checked_sub(1).map_or([1.0, 0.0], |k| w[k]);
                for l in 0..LANES {
                    [to[0][l], to[1][l]] = times([sum[0][l], sum[1][l]], w);
                }
            }
        }
    }
}

// Butterflies: functions of their own, whose arguments the compiler knows to lie apart, so that lanes become vectors.

#[inline(always)]
fn two(a: &Lanes, b: &Lanes, w: &[f32; 2], to_0: &mut Lanes, to_1: &mut Lanes) {
    for l in 0..LANES {
        (to_0[0][l], to_0[1][l]) = (a[0][l] + b[0][l], a[1][l] + b[1][l]);
        [to_1[0][l], to_1[1][l]] = times([a[0][l] - b[0][l], a[1][l] - b[1][l]], *w);
    }
}

#[inline(always)]
fn three(a: &Lanes, b: &Lanes, c: &Lanes, w: &[[f32; 2]; 2], to_0: &mut Lanes, to_1: &mut Lanes, to_2: &mut Lanes) {
    /// sin 2π/3.
    const SIN: f32 = 0.866_025_4;
    for l in 0..LANES {
        let sum = [b[0][l] + c[0][l], b[1][l] + c[1][l]];
        let apart = [SIN * (b[0][l] - c[0][l]), SIN * (b[1][l] - c[1][l])];
        let rest = [a[0][l] - 0.5 * sum[0], a[1][l] - 0.5 * sum[1]];
        (to_0[0][l], to_0[1][l]) = (a[0][l] + sum[0], a[1][l] + sum[1]);
        [to_1[0][l], to_1[1][l]] = times([rest[0] + apart[1], rest[1] - apart[0]], w[0]);
        [to_2[0][l], to_2[1][l]] = times([rest[0] - apart[1], rest[1] + apart[0]], w[1]);
    }
}

#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "what lies apart is an argument each")]
fn four(
    a: &Lanes,
    b: &Lanes,
    c: &Lanes,
    d: &Lanes,
    w: &[[f32; 2]; 3],
    to_0: &mut Lanes,
    to_1: &mut Lanes,
    to_2: &mut Lanes,
    to_3: &mut Lanes,
) {
    for l in 0..LANES {
        let even = [a[0][l] + c[0][l], a[1][l] + c[1][l]];
        let even_apart = [a[0][l] - c[0][l], a[1][l] - c[1][l]];
        let odd = [b[0][l] + d[0][l], b[1][l] + d[1][l]];
        let odd_apart = [b[0][l] - d[0][l], b[1][l] - d[1][l]];
        (to_0[0][l], to_0[1][l]) = (even[0] + odd[0], even[1] + odd[1]);
        [to_1[0][l], to_1[1][l]] = times([even_apart[0] + odd_apart[1], even_apart[1] - odd_apart[0]], w[0]);
        [to_2[0][l], to_2[1][l]] = times([even[0] - odd[0], even[1] - odd[1]], w[1]);
        [to_3[0][l], to_3[1][l]] = times([even_apart[0] - odd_apart[1], even_apart[1] + odd_apart[0]], w[2]);
    }
}

#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "what lies apart is an argument each")]
fn five(
    a: &Lanes,
    b: &Lanes,
    c: &Lanes,
    d: &Lanes,
    e: &Lanes,
    w: &[[f32; 2]; 4],
    to_0: &mut Lanes,
    to_1: &mut Lanes,
    to_2: &mut Lanes,
    to_3: &mut Lanes,
    to_4: &mut Lanes,
) {
    /// Cosines and sines of 2π/5 and 4π/5.
    const COS: [f32; 2] = [0.309_017, -0.809_017];
    const SIN: [f32; 2] = [0.951_056_5, 0.587_785_24];
    for l in 0..LANES {
        let outer = [b[0][l] + e[0][l], b[1][l] + e[1][l]];
        let outer_apart = [b[0][l] - e[0][l], b[1][l] - e[1][l]];
        let inner = [c[0][l] + d[0][l], c[1][l] + d[1][l]];
        let inner_apart = [c[0][l] - d[0][l], c[1][l] - d[1][l]];
        (to_0[0][l], to_0[1][l]) = (a[0][l] + outer[0] + inner[0], a[1][l] + outer[1] + inner[1]);
        let near = [a[0][l] + COS[0] * outer[0] + COS[1] * inner[0], a[1][l] + COS[0] * outer[1] + COS[1] * inner[1]];
        let far = [a[0][l] + COS[1] * outer[0] + COS[0] * inner[0], a[1][l] + COS[1] * outer[1] + COS[0] * inner[1]];
        let near_apart =
            [SIN[0] * outer_apart[0] + SIN[1] * inner_apart[0], SIN[0] * outer_apart[1] + SIN[1] * inner_apart[1]];
        let far_apart =
            [SIN[1] * outer_apart[0] - SIN[0] * inner_apart[0], SIN[1] * outer_apart[1] - SIN[0] * inner_apart[1]];
        [to_1[0][l], to_1[1][l]] = times([near[0] + near_apart[1], near[1] - near_apart[0]], w[0]);
        [to_2[0][l], to_2[1][l]] = times([far[0] + far_apart[1], far[1] - far_apart[0]], w[1]);
        [to_3[0][l], to_3[1][l]] = times([far[0] - far_apart[1], far[1] + far_apart[0]], w[2]);
        [to_4[0][l], to_4[1][l]] = times([near[0] - near_apart[1], near[1] + near_apart[0]], w[3]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};

    #[test]
    fn spectra_are_the_sums() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xF0);
        for len in [1, 2, 3, 4, 5, 6, 7, 8, 12, 15, 16, 22, 30, 49, 60, 64, 90, 96, 125, 128, 150, 162] {
            let mut number = || (rng.next_u32() >> 8) as f32 / 16_777_216.0 - 0.5;
            let image: Vec<Lanes> = (0..len).map(|_| [0, 1].map(|_| core::array::from_fn(|_| number()))).collect();
            let (mut values, mut spare) = (image.clone(), vec![ZERO; len]);
            LaneFft::new(len).process(&mut values, &mut spare);
            for (k, found) in values.iter().enumerate() {
                for l in 0..LANES {
                    let mut sum = [0.0; 2];
                    for (j, value) in image.iter().enumerate() {
                        let (c, s) = turn(((j * k) % len) as f64 / len as f64);
                        let [re, im] = [f64::from(value[0][l]), f64::from(value[1][l])];
                        sum[0] += re * c + im * s;
                        sum[1] += im * c - re * s;
                    }
                    let error = (f64::from(found[0][l]) - sum[0]).abs() + (f64::from(found[1][l]) - sum[1]).abs();
                    assert!(error < 1e-6 * (len as f64).max(4.0), "{len} {k} {l}: {error}");
                }
            }
        }
    }
}

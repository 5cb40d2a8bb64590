//! Stockham's transform, which needs no bit reversal. The order of operations is the same on every machine.

use core::f64::consts::TAU;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use multiversion::multiversion;

use super::{Lanes, Real};

/// A forward transform of sequences of one length (Stockham's, with decimation in frequency). The inverse is the
/// forward transform of the reversed sequence.
#[derive(Debug, Clone)]
pub struct LaneFft<T> {
    len: usize,
    passes: Vec<Pass<T>>,
}

#[derive(Debug, Clone)]
struct Pass<T> {
    radix: usize,
    butterflies: usize,
    /// Adjacent numbers that each butterfly processes.
    stride: usize,
    /// exp −2πi pk/n of each butterfly p, for k = 1 … radix − 1.
    twiddles: Vec<[T; 2]>,
    /// exp −2πi k/radix, for a radix without specialised code.
    roots: Vec<[T; 2]>,
}

impl<T: Real> LaneFft<T> {
    /// Plans a transform of `len` numbers. Prime factors above 5 are slow.
    #[must_use]
    pub fn new(len: usize) -> Self {
        let (mut passes, mut rest, mut stride, mut roots_of) = (Vec::new(), len, 1, Roots::new(len));
        while rest > 1 {
            let radix = [4, 2, 3, 5].into_iter().find(|&radix| rest.is_multiple_of(radix));
            let radix = radix.unwrap_or_else(|| (7..).find(|&prime| rest.is_multiple_of(prime)).unwrap_or(rest));
            let butterflies = rest / radix;
            let places = (0..butterflies).flat_map(|p| (1..radix).map(move |k| p * k));
            let twiddles = places.map(|place| roots_of.root(place * stride)).collect();
            let own_roots = if radix > 5 { radix } else { 0 };
            let roots = (0..own_roots).map(|k| roots_of.root(k * (len / radix))).collect();
            passes.push(Pass { radix, butterflies, stride, twiddles, roots });
            rest = butterflies;
            stride *= radix;
        }
        Self { len, passes }
    }

    /// Transforms `values` in place. `spare` is working memory; the two buffers may be swapped.
    ///
    /// # Panics
    ///
    /// If `values` or `spare` has another length than the plan.
    pub fn process<const N: usize>(&self, values: &mut Vec<Lanes<T, N>>, spare: &mut Vec<Lanes<T, N>>) {
        let lens = [values.len(), spare.len()];
        assert!(
            lens == [self.len; 2],
            "expected {} numbers, found {} of values and {} of spare",
            self.len,
            lens[0],
            lens[1]
        );
        for pass in &self.passes {
            run(pass, values, spare);
            core::mem::swap(values, spare);
        }
    }

    /// Writes the transform of `from` to `to`. `spare` is working memory.
    ///
    /// # Panics
    ///
    /// If a slice has another length than the plan.
    pub fn transform<const N: usize>(&self, from: &[Lanes<T, N>], to: &mut [Lanes<T, N>], spare: &mut [Lanes<T, N>]) {
        let lens = [from.len(), to.len(), spare.len()];
        assert!(lens == [self.len; 3], "expected {} numbers, found {lens:?} of from, to and spare", self.len);
        let [first, rest @ ..] = &self.passes[..] else { return to.copy_from_slice(from) };
        let (mut done, mut next) = if rest.len().is_multiple_of(2) { (to, spare) } else { (spare, to) };
        run(first, from, done);
        for pass in rest {
            run(pass, done, next);
            core::mem::swap(&mut done, &mut next);
        }
    }

    /// Returns the transform of a single sequence of `[re, im]`.
    ///
    /// # Panics
    ///
    /// If `values` has another length than the plan.
    #[must_use]
    pub fn forward(&self, values: &[[T; 2]]) -> Vec<[T; 2]> {
        let mut lanes: Vec<Lanes<T, 1>> = values.iter().map(|value| value.map(|part| [part])).collect();
        let mut spare = lanes.clone();
        self.process(&mut lanes, &mut spare);
        lanes.into_iter().map(|value| value.map(|[part]| part)).collect()
    }

    /// Returns the inverse transform, times the length.
    ///
    /// # Panics
    ///
    /// If `values` has another length than the plan.
    #[must_use]
    pub fn inverse(&self, values: &[[T; 2]]) -> Vec<[T; 2]> {
        let mut reversed = self.forward(values);
        if let Some(rest) = reversed.get_mut(1..) {
            rest.reverse();
        }
        reversed
    }
}

/// A cache of transforms: each length is planned once.
#[derive(Debug, Default)]
pub struct Plans<T> {
    plans: Mutex<BTreeMap<usize, Arc<LaneFft<T>>>>,
}

impl<T: Real> Plans<T> {
    /// Returns the plan for `len` numbers.
    #[must_use]
    pub fn get(&self, len: usize) -> Arc<LaneFft<T>> {
        // The map stays valid if a thread panics while it holds the lock.
        let mut plans = self.plans.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(plans.entry(len).or_insert_with(|| Arc::new(LaneFft::new(len))))
    }
}

/// The roots exp −2πi k/n of one n. Sines and cosines are computed once, for angles up to an eighth of a turn.
struct Roots {
    n: usize,
    /// Sine and cosine of 2πi/8n.
    eighth: Vec<Option<(f64, f64)>>,
}

impl Roots {
    fn new(n: usize) -> Self {
        Self { n, eighth: vec![None; n + 1] }
    }

    fn root<T: Real>(&mut self, k: usize) -> [T; 2] {
        // In units of 1/(8n) turn, which are integers even if n is odd.
        let (n, k) = (self.n, 8 * (k % self.n));
        let is_below = k > 4 * n;
        let k = if is_below { 8 * n - k } else { k };
        let is_left = k > 2 * n;
        let k = if is_left { 4 * n - k } else { k };
        let is_steep = k > n;
        let k = if is_steep { 2 * n - k } else { k };
        let (sin, cos) = *self.eighth[k].get_or_insert_with(|| libm::sincos(TAU * (k as f64 / (8 * n) as f64)));
        let (cos, sin) = if is_steep { (sin, cos) } else { (cos, sin) };
        [if is_left { -cos } else { cos }, if is_below { sin } else { -sin }].map(T::nearest)
    }
}

/// Runs a pass.
#[multiversion(targets = "simd")]
fn run<T: Real, const N: usize>(pass: &Pass<T>, from: &[Lanes<T, N>], to: &mut [Lanes<T, N>]) {
    match pass.radix {
        2 => by_2(pass, from, to),
        3 => by_3(pass, from, to),
        4 => by_4(pass, from, to),
        5 => by_5(pass, from, to),
        _ => by_any(pass, from, to),
    }
}

#[inline(always)]
fn times<T: Real>([re, im]: [T; 2], w: [T; 2]) -> [T; 2] {
    [re * w[0] - im * w[1], re * w[1] + im * w[0]]
}

/// Defines the pass of one radix. The butterfly is a separate function, because reference arguments cannot alias: the
/// compiler then vectorises over the lanes.
macro_rules! radix {
    ($radix:literal, $pass:ident($w:ident, $($j:literal $from:ident $to:ident),*) $body:block) => {
        #[inline(always)]
        fn $pass<T: Real, const N: usize>(pass: &Pass<T>, from: &[Lanes<T, N>], to: &mut [Lanes<T, N>]) {
            #[inline(always)]
            #[allow(clippy::too_many_arguments, reason = "separate arguments cannot alias")]
            fn butterfly<T: Real, const N: usize>(
                $w: &[[T; 2]; $radix - 1],
                $($from: &Lanes<T, N>,)*
                $($to: &mut Lanes<T, N>),*
            ) $body

            let s = pass.stride;
            for (p, (to, w)) in to.chunks_exact_mut($radix * s).zip(pass.twiddles.as_chunks().0).enumerate() {
                $(let $from = &from[s * (p + pass.butterflies * $j)..][..s];)*
                $(let ($to, to) = to.split_at_mut(s);)*
                let _: &[_] = to;
                for q in 0..s {
                    butterfly(w, $(&$from[q],)* $(&mut $to[q]),*);
                }
            }
        }
    };
}

radix!(2, by_2(w, 0 a to_0, 1 b to_1) {
    for l in 0..N {
        (to_0[0][l], to_0[1][l]) = (a[0][l] + b[0][l], a[1][l] + b[1][l]);
        [to_1[0][l], to_1[1][l]] = times([a[0][l] - b[0][l], a[1][l] - b[1][l]], w[0]);
    }
});

radix!(3, by_3(w, 0 a to_0, 1 b to_1, 2 c to_2) {
    /// sin 2π/3.
    const SIN: f64 = 0.866_025_403_784_438_6;
    let (sine, half) = (T::nearest(SIN), T::nearest(0.5));
    for l in 0..N {
        let sum = [b[0][l] + c[0][l], b[1][l] + c[1][l]];
        let difference = [sine * (b[0][l] - c[0][l]), sine * (b[1][l] - c[1][l])];
        let rest = [a[0][l] - half * sum[0], a[1][l] - half * sum[1]];
        (to_0[0][l], to_0[1][l]) = (a[0][l] + sum[0], a[1][l] + sum[1]);
        [to_1[0][l], to_1[1][l]] = times([rest[0] + difference[1], rest[1] - difference[0]], w[0]);
        [to_2[0][l], to_2[1][l]] = times([rest[0] - difference[1], rest[1] + difference[0]], w[1]);
    }
});

radix!(4, by_4(w, 0 a to_0, 1 b to_1, 2 c to_2, 3 d to_3) {
    for l in 0..N {
        let even = [a[0][l] + c[0][l], a[1][l] + c[1][l]];
        let even_difference = [a[0][l] - c[0][l], a[1][l] - c[1][l]];
        let odd = [b[0][l] + d[0][l], b[1][l] + d[1][l]];
        let odd_difference = [b[0][l] - d[0][l], b[1][l] - d[1][l]];
        (to_0[0][l], to_0[1][l]) = (even[0] + odd[0], even[1] + odd[1]);
        [to_1[0][l], to_1[1][l]] = times([even_difference[0] + odd_difference[1], even_difference[1] - odd_difference[0]], w[0]);
        [to_2[0][l], to_2[1][l]] = times([even[0] - odd[0], even[1] - odd[1]], w[1]);
        [to_3[0][l], to_3[1][l]] = times([even_difference[0] - odd_difference[1], even_difference[1] + odd_difference[0]], w[2]);
    }
});

radix!(5, by_5(w, 0 a to_0, 1 b to_1, 2 c to_2, 3 d to_3, 4 e to_4) {
    /// Cosines and sines of 2π/5 and 4π/5.
    const COS: [f64; 2] = [0.309_016_994_374_947_4, -0.809_016_994_374_947_4];
    const SIN: [f64; 2] = [0.951_056_516_295_153_6, 0.587_785_252_292_473_1];
    let (cos, sin) = (COS.map(T::nearest), SIN.map(T::nearest));
    for l in 0..N {
        let outer = [b[0][l] + e[0][l], b[1][l] + e[1][l]];
        let outer_difference = [b[0][l] - e[0][l], b[1][l] - e[1][l]];
        let inner = [c[0][l] + d[0][l], c[1][l] + d[1][l]];
        let inner_difference = [c[0][l] - d[0][l], c[1][l] - d[1][l]];
        (to_0[0][l], to_0[1][l]) = (a[0][l] + outer[0] + inner[0], a[1][l] + outer[1] + inner[1]);
        let near = [a[0][l] + cos[0] * outer[0] + cos[1] * inner[0], a[1][l] + cos[0] * outer[1] + cos[1] * inner[1]];
        let far = [a[0][l] + cos[1] * outer[0] + cos[0] * inner[0], a[1][l] + cos[1] * outer[1] + cos[0] * inner[1]];
        let near_difference =
            [sin[0] * outer_difference[0] + sin[1] * inner_difference[0], sin[0] * outer_difference[1] + sin[1] * inner_difference[1]];
        let far_difference =
            [sin[1] * outer_difference[0] - sin[0] * inner_difference[0], sin[1] * outer_difference[1] - sin[0] * inner_difference[1]];
        [to_1[0][l], to_1[1][l]] = times([near[0] + near_difference[1], near[1] - near_difference[0]], w[0]);
        [to_2[0][l], to_2[1][l]] = times([far[0] + far_difference[1], far[1] - far_difference[0]], w[1]);
        [to_3[0][l], to_3[1][l]] = times([far[0] - far_difference[1], far[1] + far_difference[0]], w[2]);
        [to_4[0][l], to_4[1][l]] = times([near[0] - near_difference[1], near[1] + near_difference[0]], w[3]);
    }
});

/// The direct sum, for other primes.
#[inline(always)]
fn by_any<T: Real, const N: usize>(pass: &Pass<T>, from: &[Lanes<T, N>], to: &mut [Lanes<T, N>]) {
    let (s, radix) = (pass.stride, pass.radix);
    let butterflies = to.chunks_exact_mut(radix * s).zip(pass.twiddles.chunks_exact(radix - 1));
    for (p, (to, w)) in butterflies.enumerate() {
        for (k, to) in to.chunks_exact_mut(s).enumerate() {
            for (q, to) in to.iter_mut().enumerate() {
                let mut sum = [[T::default(); N]; 2];
                for j in 0..radix {
                    let value = &from[s * (p + pass.butterflies * j) + q];
                    let root = pass.roots[j * k % radix];
                    for l in 0..N {
                        let [re, im] = times([value[0][l], value[1][l]], root);
                        sum[0][l] += re;
                        sum[1][l] += im;
                    }
                }
                let w = k.checked_sub(1).map_or([1.0, 0.0].map(T::nearest), |k| w[k]);
                for l in 0..N {
                    [to[0][l], to[1][l]] = times([sum[0][l], sum[1][l]], w);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ZERO;
    use super::*;
    use rand_xoshiro::Xoshiro256PlusPlus;
    use rand_xoshiro::rand_core::{Rng, SeedableRng};
    use rustfft::FftPlanner;
    use rustfft::num_complex::Complex64;

    #[test]
    fn roots_are_cosines_and_sines() {
        for n in 1..300 {
            let mut roots = Roots::new(n);
            for k in 0..2 * n {
                let [re, im] = roots.root::<f64>(k);
                let (sin, cos) = libm::sincos(TAU * (k % n) as f64 / n as f64);
                assert!((re - cos).abs() + (im + sin).abs() < 2e-15, "{k}/{n}");
                assert_eq!(roots.root::<f64>(n - k % n), [re, -im], "{k}/{n} mirrored");
            }
        }
    }

    /// Returns the largest error of all lanes relative to the largest value, compared with rustfft.
    fn error<T: Real + Into<f64>, const N: usize>(len: usize) -> f64 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xF0);
        let mut number = || f64::from(rng.next_u32() >> 8) / 16_777_216.0 - 0.5;
        let image: Vec<Lanes<T, N>> =
            (0..len).map(|_| [0, 1].map(|_| core::array::from_fn(|_| T::nearest(number())))).collect();
        let (mut values, mut spare) = (image.clone(), image.clone());
        LaneFft::new(len).process(&mut values, &mut spare);
        let oracle = FftPlanner::new().plan_fft_forward(len);
        let mut worst = 0.0_f64;
        for l in 0..N {
            let complex = |from: &Lanes<T, N>| Complex64::new(from[0][l].into(), from[1][l].into());
            let mut expected: Vec<Complex64> = image.iter().map(complex).collect();
            oracle.process(&mut expected);
            let largest = expected.iter().map(|z| z.norm()).fold(0.0, f64::max);
            for (found, expected) in values.iter().map(complex).zip(&expected) {
                worst = worst.max((found - expected).norm() / largest);
            }
        }
        worst
    }

    #[test]
    fn spectra_match_rustfft() {
        let lengths = [1, 2, 3, 4, 5, 6, 7, 8, 12, 15, 16, 22, 30, 49, 60, 64, 90, 96, 101, 125, 128, 150, 162, 512];
        for len in lengths {
            let (single, double) = (error::<f32, 16>(len), error::<f64, 8>(len));
            assert!(single < 1e-6 && double < 2e-15, "{len}: {single}, {double}");
        }
    }

    #[test]
    fn single_sequences_match_lanes_and_invert() {
        for len in [1, 2, 7, 30, 64, 101, 640] {
            let values: Vec<[f64; 2]> = (0..len).map(|i| [(i * i % 7) as f64, (i * i % 11) as f64]).collect();
            let fft = LaneFft::new(len);
            let spectrum = fft.forward(&values);
            let mut lanes: Vec<Lanes<f64, 8>> = values.iter().map(|v| v.map(|part| [part; 8])).collect();
            fft.process(&mut lanes, &mut vec![[[0.0; 8]; 2]; len]);
            assert!(spectrum.iter().zip(&lanes).all(|(one, lane)| *one == lane.map(|parts| parts[3])), "{len}");
            for (back, value) in fft.inverse(&spectrum).iter().zip(&values) {
                let error = (0..2).map(|i| (back[i] / len as f64 - value[i]).abs()).fold(0.0, f64::max);
                assert!(error < 1e-13, "{len}: {error}");
            }
        }
    }

    #[test]
    #[should_panic(expected = "expected 4 numbers")]
    fn a_wrong_length_is_reported() {
        LaneFft::new(4).process(&mut vec![ZERO; 4], &mut vec![ZERO; 3]);
    }
}

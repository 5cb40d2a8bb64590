//! Normal deviates by the inverse of the distribution function, without a branch.

use crate::hash::BLOCK;

/// Deviates looked through together for those of the tails.
const GROUP: usize = 16;

/// Where the polynomial of the tails takes over, as w: beyond 2.93 standard deviations, for 0.34 % of all.
const TAIL_FROM: f32 = 5.0;

/// One standard normal deviate for each word: the central polynomial for all of them, then that of the
/// tails for the few it does not hold for.
#[inline(always)]
pub(crate) fn normals(words: &[u32; BLOCK]) -> [f32; BLOCK] {
    let mut normals = [0.0; BLOCK];
    let mut beyond = [0_u32; BLOCK];
    for i in 0..BLOCK {
        let place = Place::of(words[i]);
        normals[i] = place.central();
        beyond[i] = u32::from(place.w >= TAIL_FROM);
    }
    for at in (0..BLOCK).step_by(GROUP) {
        if beyond[at..at + GROUP].iter().fold(0, |any, b| any | b) == 0 {
            continue;
        }
        for i in at..at + GROUP {
            let tail = Place::of(words[i]).tail();
            normals[i] = if beyond[i] != 0 { tail } else { normals[i] };
        }
    }
    normals
}

/// Where a word lies in the standard normal distribution: at the probability (word + ½)·2⁻³², the word
/// taken as signed and the probability counted from the middle. The distance to the nearer end is formed
/// in integers, so both tails are as fine as 2⁻³²: ±6.2 standard deviations.
///
/// √2 erf⁻¹ in the form of Giles (doi:10.1016/B978-0-12-385963-1.00010-1), its two polynomials fitted
/// anew because his end at 2⁻²⁴; relative error below 6e-7.
struct Place {
    sign: u32,
    x: f32,
    /// w = -ln(1 - x²)
    w: f32,
}

impl Place {
    #[inline(always)]
    fn of(word: u32) -> Self {
        const STEP: f32 = 1.0 / (1_u32 << 31) as f32;
        let sign = word & 0x8000_0000;
        // For a negative word the complement is its distance below zero less one.
        let from_middle = (word ^ 0u32.wrapping_sub(sign >> 31)).cast_signed();
        let to_end = i32::MAX - from_middle;
        let x = (from_middle as f32 + 0.5) * STEP;
        let end = (to_end as f32 + 0.5) * STEP;
        Self { sign, x, w: -ln(end * (1.0 + x)) }
    }

    #[inline(always)]
    fn central(&self) -> f32 {
        self.signed(polynomial(CENTRAL, self.w - 2.5))
    }

    #[inline(always)]
    fn tail(&self) -> f32 {
        self.signed(polynomial(TAIL, self.w.sqrt() - 3.0))
    }

    #[inline(always)]
    fn signed(&self, quantile: f32) -> f32 {
        f32::from_bits((quantile * self.x).to_bits() | self.sign)
    }
}

/// Polynomials in w - 2.5 and √w - 3, highest power first: least greatest relative error, 1e-7 for
/// w < 5 and 3e-7 up to the end of the tail.
const CENTRAL: [f32; 9] = [
    4.035_463_5e-8,
    4.861_039_3e-7,
    -4.990_565_2e-6,
    -6.217_993e-6,
    3.091_502e-4,
    -1.773_010_2e-3,
    -5.908_171e-3,
    0.348_802_66,
    2.123_313_6,
];
const TAIL: [f32; 9] = [
    -2.795_082_4e-5,
    -1.624_656_8e-4,
    1.623_469e-3,
    -4.842_372_5e-3,
    8.227_211e-3,
    -1.089_863_4e-2,
    1.333_056_6e-2,
    1.416_591,
    4.006_435,
];

/// Natural logarithm of a normal positive number, to 1e-7 (the polynomial of Cephes' `logf`).
#[inline(always)]
fn ln(x: f32) -> f32 {
    const SQRT_HALF: u32 = 0x3f35_04f3;
    let above = x.to_bits().wrapping_sub(SQRT_HALF);
    let exponent = (above.cast_signed() >> 23) as f32;
    let m = f32::from_bits((above & 0x007f_ffff) + SQRT_HALF) - 1.0;
    let p = polynomial(
        [
            7.037_683_6e-2,
            -1.151_461e-1,
            1.167_699_9e-1,
            -1.242_014_1e-1,
            1.424_932_3e-1,
            -1.666_805_7e-1,
            2.000_071_5e-1,
            -2.499_999_4e-1,
            3.333_333e-1,
        ],
        m,
    );
    let square = m * m;
    // ln 2 in two parts, the first of which is exact when multiplied by the exponent.
    let low = p * m * square - 2.121_944_4e-4 * exponent - 0.5 * square;
    0.693_359_4 * exponent + (m + low)
}

/// A polynomial, highest power first: even and odd powers side by side, which halves the wait.
#[inline(always)]
fn polynomial(terms: [f32; 9], x: f32) -> f32 {
    let square = x * x;
    let (mut even, mut odd) = (terms[0], terms[1]);
    for i in [2, 4, 6] {
        even = even * square + terms[i];
        odd = odd * square + terms[i + 1];
    }
    (even * square + terms[8]) + odd * x
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The quantile of one word, as in a block of them.
    fn normal(word: u32) -> f32 {
        let place = Place::of(word);
        if place.w < TAIL_FROM { place.central() } else { place.tail() }
    }

    #[test]
    fn a_block_is_its_words_one_by_one() {
        for start in (0..u32::MAX - 64_000_000).step_by(99_999_989).chain([0x7fff_ff00, 0x8000_0010]) {
            let words: [u32; BLOCK] =
                core::array::from_fn(|i| start + u32::try_from(i).unwrap() * 1_000_003 % 64_000_000);
            assert_eq!(normals(&words), words.map(normal));
        }
    }

    /// The probability of a standard normal deviate beyond |x|, on one side.
    fn beyond(x: f32) -> f64 {
        0.5 * libm::erfc(f64::from(x.abs()) / core::f64::consts::SQRT_2)
    }

    #[test]
    fn quantiles_are_the_inverse_of_the_distribution() {
        for i in 0..2_000_000_u32 {
            // Every part of the range, and the ends closely.
            let magnitude = if i % 2 == 0 { i * 1073 } else { 0x7fff_ffff - i };
            let x = normal(magnitude);
            let tail = (f64::from(0x7fff_ffff - magnitude) + 0.5) / 4_294_967_296.0;
            // An error dx changes the tail by φ(x) dx, and |x| φ(x) < 1.2 · tail · (1 + x²).
            let square = f64::from(x * x);
            let error = (beyond(x) / tail - 1.0).abs() / (1.0 + square);
            assert!(error < 6e-7, "{magnitude}: {x}, {error}");
            assert_eq!(normal(!magnitude), -x);
        }
        let furthest = normal(0x7fff_ffff);
        assert!((6.2..6.4).contains(&furthest), "{furthest}");
    }

    #[test]
    fn moments_are_normal_to_a_millionth() {
        // Over all words, in even steps.
        let step = 1 << 8;
        let mut sums = [0.0; 4];
        for i in 0..1_u32 << 23 {
            let x = f64::from(normal(i * step + step / 2));
            let mut power = 1.0;
            for sum in &mut sums {
                power *= x;
                *sum += power;
            }
        }
        // The other half is its mirror image.
        let [first, second, third, fourth] = sums.map(|s| s / f64::from(1 << 23));
        let half = core::f64::consts::FRAC_2_PI.sqrt();
        assert!((first - half).abs() < 1e-6, "{first}");
        assert!((second - 1.0).abs() < 1e-6, "{second}");
        assert!((third - 2.0 * half).abs() < 5e-6, "{third}");
        assert!((fourth - 3.0).abs() < 3e-5, "{fourth}");
    }

    #[test]
    fn ln_is_the_logarithm() {
        for i in 1..1_000_000_u32 {
            let x = i as f32 * 1e-6;
            let exact = libm::log(f64::from(x));
            assert!((f64::from(ln(x)) - exact).abs() < 1.2e-7 * exact.abs() + 1e-8, "{x}");
        }
    }
}

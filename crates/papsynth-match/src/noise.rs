//! Noise beyond that of the empty slide, how uneven light is, and small things: how many there are of each size and darkness.

use crate::error::Error;
use papsynth_judge::Control;
use papsynth_judge::filter::separable;
use papsynth_judge::number::{single, whole};
use portable_numerics::statistics::{deviation, mean, quantile};

/// Side of the blocks that noise is compared in, pixels.
const BLOCK: usize = 8;

/// Absorbances that blocks are sorted by: empty slide first.
const BINS: [[f64; 2]; 4] = [[-0.03, 0.02], [0.05, 0.12], [0.12, 0.25], [0.25, 0.6]];

/// The most even part of the blocks of a bin shows noise, the rest structure.
const EVENEST: f64 = 0.15;

/// Fewest blocks of a bin.
const LEAST_BLOCKS: usize = 12;

/// Numbers of [`law`].
const LAW: usize = BINS.len() - 1;

/// Logarithm of the noise of ever darker places over that of the empty slide; NaN where there are none.
pub(crate) fn law(grey: &[f32], width: usize, empty: f64) -> [f64; LAW] {
    let mut bins: [Vec<f64>; BINS.len()] = Default::default();
    let height = grey.len() / width;
    for top in (0..height.saturating_sub(BLOCK - 1)).step_by(BLOCK) {
        for left in (0..width.saturating_sub(BLOCK - 1)).step_by(BLOCK) {
            let at = |x: usize, y: usize| f64::from(grey[(top + y) * width + left + x]);
            let sum: f64 = (0..BLOCK).flat_map(|y| (0..BLOCK).map(move |x| (x, y))).map(|(x, y)| at(x, y)).sum();
            let absorbance = -libm::log10((sum / (BLOCK * BLOCK) as f64 / empty).max(1e-3));
            let Some(bin) = BINS.iter().position(|[from, to]| absorbance >= *from && absorbance < *to) else {
                continue;
            };
            // A mask that planes and saddles vanish under (Immerkær, doi:10.1006/cviu.1996.0060).
            let mut energy = 0.0;
            for y in 1..BLOCK - 1 {
                for x in 1..BLOCK - 1 {
                    let line = |y: usize| at(x - 1, y) - 2.0 * at(x, y) + at(x + 1, y);
                    let value = line(y - 1) - 2.0 * line(y) + line(y + 1);
                    energy += value * value;
                }
            }
            bins[bin].push(energy);
        }
    }
    let levels =
        bins.map(
            |mut blocks| if blocks.len() < LEAST_BLOCKS { f64::NAN } else { quantile(&mut blocks, EVENEST).max(1e-3) },
        );
    std::array::from_fn(|i| libm::log(levels[i + 1] / levels[0]))
}

/// Widths of the Gaussians between which the light's unevenness is looked for, pixels.
const UNEVEN_PX: [f64; 2] = [6.0, 24.0];

/// Empty slide is within this absorbance after the wider of them.
const EVEN: f32 = 0.012;

/// Side of the blocks between which it is looked for coarsely, pixels; what of a block is paler than so many of its pixels is slide,
/// if it is within this part of the light.
const BLOCK_PX: usize = 32;
const PALE: f64 = 0.75;
const SLIDE: f64 = 0.04;

/// Logarithm of the unevenness of empty slide between two scales, and about a quadratic surface; NaN where nothing is empty.
pub(crate) fn unevenness(grey: &[f32], width: usize, empty: f64) -> [f64; 2] {
    let light: Vec<f32> = grey.iter().map(|g| g / single(empty)).collect();
    let [fine, coarse] = UNEVEN_PX.map(|sigma| blur(&light, width, sigma));
    // Whatever lies there is darker than the slide: the paler half is the slide.
    let slide = fine.iter().zip(&coarse).filter(|(_, c)| **c > 1.0 - 2.0 * EVEN);
    let mut rests: Vec<f64> = slide.map(|(f, c)| f64::from((f - c).abs())).collect();
    let finely = if rests.len() < grey.len() / 50 { f64::NAN } else { quantile(&mut rests, 0.5) };
    [finely, coarsely(&fine, width)].map(|v| if v.is_nan() { v } else { libm::log(v.max(1e-6)) })
}

/// Three quarters of the distance between quartiles of pale places about their quadratic surface.
fn coarsely(light: &[f32], width: usize) -> f64 {
    let height = light.len() / width;
    let mut places = Vec::new();
    for top in (0..height).step_by(BLOCK_PX) {
        for left in (0..width).step_by(BLOCK_PX) {
            let rows = top..(top + BLOCK_PX).min(height);
            let row = |y: usize| &light[y * width + left..y * width + (left + BLOCK_PX).min(width)];
            // Every fourth pixel: the light is blurred.
            let mut block: Vec<f64> =
                rows.step_by(4).flat_map(|y| row(y).iter().step_by(4).map(|v| f64::from(*v))).collect();
            let pale = quantile(&mut block, PALE);
            if (pale - 1.0).abs() < SLIDE {
                let [x, y] = [left as f64 / width as f64 - 0.5, top as f64 / height as f64 - 0.5];
                places.push(([1.0, x, y, x * x, x * y, y * y], pale - 1.0));
            }
        }
    }
    /// Fewer blocks say nothing beyond their surface.
    const LEAST_PLACES: usize = 24;
    if places.len() < LEAST_PLACES {
        return f64::NAN;
    }
    let rows = nalgebra::DMatrix::from_fn(places.len(), 6, |i, j| places[i].0[j]);
    let values = nalgebra::DVector::from_iterator(places.len(), places.iter().map(|p| p.1));
    let Some(surface) = rows.tr_mul(&rows).cholesky().map(|c| c.solve(&rows.tr_mul(&values))) else { return f64::NAN };
    let mut rests: Vec<f64> = (values - rows * surface).iter().copied().collect();
    0.741 * (quantile(&mut rests, 0.75) - quantile(&mut rests, 0.25))
}

/// Width of the Gaussian whose remainder is noise, pixels.
const NOISE_PX: f64 = 6.0;

/// Of that whose difference from a wider one shows that something lies there.
const THINGS_PX: f64 = 2.5;

/// How many times its usual size that difference may have where nothing lies.
const USUAL: f64 = 3.0;

/// Empty slide is within this part of its light.
const NEAR: f32 = 0.04;

/// Fewest pixels of empty slide that noise is measured on.
const LEAST_EMPTY: usize = 4000;

/// Mean product of pixels that are known in both; NaN of fewer than so many.
fn mean_product(a: &[f32], b: &[f32], least: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for (a, b) in a.iter().zip(b) {
        let value = f64::from(a * b);
        if value.is_finite() {
            sum += value;
            count += 1;
        }
    }
    if count < least { f64::NAN } else { sum / count as f64 }
}

/// Noise of the empty parts of a field.
pub(crate) struct Empty {
    /// Over the light there; NaN elsewhere.
    pub(crate) relative: Vec<f32>,
    /// Its standard deviation, in the levels of the picture; NaN where too little is empty.
    pub(crate) deviation: f64,
    /// What it shares with the next pixel of the row and of the column.
    pub(crate) shared: [f64; 2],
}

/// What a Gaussian takes of the covariance of noise when it is taken off: this part of the sum over all distances. A
/// remainder g − G∗g has the covariance γ − (2G − G∗G)∗γ, and noise is narrow beside G.
const TAKEN: f64 = 3.0 / (4.0 * std::f64::consts::PI * NOISE_PX * NOISE_PX);

impl Empty {
    /// Of a picture whose empty slide is at a level.
    pub(crate) fn new(grey: &[f32], width: usize, level: f64) -> Self {
        let wide = blur(grey, width, NOISE_PX);
        let things: Vec<f32> = blur(grey, width, THINGS_PX).iter().zip(&wide).map(|(a, b)| a - b).collect();
        let slide = single((1.0 - f64::from(NEAR)) * level);
        let mut sizes: Vec<f64> =
            things.iter().zip(&wide).filter(|(_, w)| **w > slide).map(|(t, _)| f64::from(t.abs())).collect();
        // The median size of a normal is 0.674 of its deviation; what lies there makes it larger, by little.
        let most = single(USUAL * quantile(&mut sizes, 0.4).max(1e-6) / 0.524);
        let known = |(w, t): (&f32, &f32)| *w > slide && t.abs() < most;
        let parts = grey.iter().zip(wide.iter().zip(&things));
        let rest: Vec<f32> = parts.map(|(g, at)| if known(at) { g - at.0 } else { f32::NAN }).collect();
        let relative = rest.iter().zip(&wide).map(|(r, w)| r / w).collect();
        let found = [0, 1, width].map(|step| mean_product(&rest, &rest[step..], LEAST_EMPTY));
        let mut own = found;
        /// Each round leaves a fiftieth of the error of the one before.
        const ROUNDS: usize = 6;
        for _ in 0..ROUNDS {
            let all = own[0] * (1.0 + 2.0 * own[1] / own[0]) * (1.0 + 2.0 * own[2] / own[0]);
            own = found.map(|f| f + TAKEN * all);
        }
        Self { relative, deviation: own[0].sqrt(), shared: [own[1] / own[0], own[2] / own[0]] }
    }

    /// By what to multiply variances of [`relative`](Self::relative): the Gaussian took a part of them.
    pub(crate) fn restored(&self) -> f64 {
        1.0 / (1.0 - TAKEN * (1.0 + 2.0 * self.shared[0]) * (1.0 + 2.0 * self.shared[1]))
    }
}

/// Fewest pixels that two fields have empty in common.
const LEAST_PIXELS: usize = 5000;

/// Mean over pairs of fields of the relative variance that they share, with its standard error; none of fields without common slide.
pub(crate) fn pattern(fields: &[Vec<f32>], control: &Control) -> Result<Option<[f64; 2]>, Error> {
    let mut products = Vec::new();
    for (i, a) in fields.iter().enumerate() {
        for b in &fields[i + 1..] {
            control.check()?;
            products.extend(Some(mean_product(a, b, LEAST_PIXELS)).filter(|product| product.is_finite()));
        }
    }
    let pairs = products.len();
    // Pairs share fields: as many are independent as there are fields.
    let sd = if pairs > 1 { deviation(&products) } else { mean(&products).abs() };
    Ok((pairs > 0).then(|| [mean(&products), sd / (fields.len().min(pairs) as f64).sqrt()]))
}

/// Scales at which small things are sought, pixels.
const SCALES: [f64; 3] = [1.0, 2.0, 4.0];

/// Least darkness of small things over their surroundings after a difference of Gaussians, absorbance.
const DARKNESS: [f32; 3] = [0.006, 0.02, 0.06];

/// What lies around is empty slide if it is paler, absorbance after a wide Gaussian.
const EMPTY_AROUND: f32 = 0.025;

/// Width of that Gaussian, pixels.
const AROUND_PX: f64 = 10.0;

/// A thing is long if its curvature across is so many times that along.
const LONG: f32 = 2.5;

/// Least light, a part of that of the empty slide.
const LEAST_LIGHT: f32 = 0.004;

/// Logarithms of how many there are a thousand pixels, and the share of long ones; `empty` is the level of the empty slide.
pub(crate) fn counts(grey: &[f32], width: usize, empty: f32) -> Vec<(String, f64)> {
    let height = grey.len() / width;
    let absorbance: Vec<f32> = grey.iter().map(|g| -libm::log10f((g / empty).max(LEAST_LIGHT))).collect();
    let around = blur(&absorbance, width, AROUND_PX);
    let mut out = Vec::new();
    for scale in SCALES {
        let fine = blur(&absorbance, width, scale);
        let coarse = blur(&absorbance, width, 1.6 * scale);
        let band: Vec<f32> = fine.iter().zip(&coarse).map(|(a, b)| a - b).collect();
        let mut found = [[0_u32; DARKNESS.len()]; 2];
        let mut long = [0_u32; 2];
        for y in 1..height.saturating_sub(1) {
            for x in 1..width - 1 {
                let p = y * width + x;
                let own = band[p];
                if own < DARKNESS[0] {
                    continue;
                }
                let before = [p - width - 1, p - width, p - width + 1, p - 1];
                let after = [p + 1, p + width - 1, p + width, p + width + 1];
                if before.iter().any(|q| band[*q] >= own) || after.iter().any(|q| band[*q] > own) {
                    continue;
                }
                let place = usize::from(around[p] > EMPTY_AROUND);
                for (count, level) in found[place].iter_mut().zip(DARKNESS) {
                    *count += u32::from(own >= level);
                }
                long[place] += u32::from(is_long(&band, p, width));
            }
        }
        let thousands = grey.len() as f64 / 1000.0;
        for ((found, long), place) in found.into_iter().zip(long).zip(["on empty slide", "on cells"]) {
            out.extend(found.into_iter().zip(DARKNESS).map(|(count, level)| {
                let name = format!("things of {scale} px above {level} {place}");
                (name, libm::log(f64::from(count) / thousands + 0.01))
            }));
            let share = if found[0] >= 5 { f64::from(long) / f64::from(found[0]) } else { f64::NAN };
            out.push((format!("long ones of {scale} px {place}"), share));
        }
    }
    out
}

/// Whether a maximum is a ridge.
fn is_long(band: &[f32], p: usize, width: usize) -> bool {
    let at = |q: usize| band[q];
    let xx = 2.0 * at(p) - at(p - 1) - at(p + 1);
    let yy = 2.0 * at(p) - at(p - width) - at(p + width);
    let xy = 0.25 * (at(p + width - 1) + at(p - width + 1) - at(p + width + 1) - at(p - width - 1));
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let root = (half * half + xy * xy).sqrt();
    mean + root > LONG * (mean - root).max(0.0)
}

/// A Gaussian, mirrored at the pixels of the border.
fn blur(image: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    let reach = whole(3.0 * sigma) + 1;
    let mut kernel: Vec<f32> =
        (0..=reach).map(|i| single(libm::exp(-0.5 * (i * i) as f64 / (sigma * sigma)))).collect();
    let sum = kernel[0] + 2.0 * kernel[1..].iter().sum::<f32>();
    kernel.iter_mut().for_each(|k| *k /= sum);
    separable(image, width, &kernel, |i, reach, count| {
        let i = i.abs_diff(reach);
        (if i >= count { (2 * count - 2).saturating_sub(i) } else { i }).min(count - 1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::{Rng, SeedableRng};

    fn noise(seed: u64, count: usize, sd: f32) -> Vec<f32> {
        let mut rng = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut one = || (rng.next_u64() >> 40) as f32 / (1_u64 << 24) as f32 - 0.5;
        (0..count).map(|_| sd * 12.0_f32.sqrt() * 0.5 * (one() + one() + one() + one())).collect()
    }

    #[test]
    fn what_fields_share_is_found() {
        let (width, height) = (400, 300);
        let shared = noise(1, width * height, 0.01);
        let field = |seed: u64| {
            let own = noise(seed, width * height, 2.0);
            let grey: Vec<f32> = shared.iter().zip(own).map(|(s, o)| 220.0 * (1.0 + s) + o).collect();
            Empty::new(&grey, width, 220.0)
        };
        let fields = [field(2), field(3), field(4)];
        let [variance, error] =
            pattern(&fields.each_ref().map(|f| f.relative.clone()), &Control::NONE).unwrap().unwrap();
        // 1.2·10⁵ pixels: 5·10⁻⁷ of error, the pattern's own chance included.
        assert!((variance * fields[0].restored() - 1e-4).abs() < 1.5e-6, "{variance} {error}");
        assert_eq!(pattern(&[fields[0].relative.clone()], &Control::NONE), Ok(None));
        // 2 and a hundredth of 220, on 1.2·10⁵ pixels.
        assert!((fields[0].deviation / (4.0_f64 + 4.84).sqrt() - 1.0).abs() < 0.02, "{}", fields[0].deviation);
        assert!(fields[0].shared.iter().all(|s| s.abs() < 0.02), "{:?}", fields[0].shared);
    }

    #[test]
    fn neighbours_that_share_noise_do_and_things_on_the_slide_do_not_count() {
        let (width, height) = (300, 300);
        let own = noise(9, width * height + width + 1, 3.0);
        let mut grey: Vec<f32> =
            (0..width * height).map(|i| 200.0 + (own[i] + own[i + width]) / 2.0_f32.sqrt()).collect();
        for y in 100..160 {
            grey[y * width + 100..y * width + 160].fill(120.0);
        }
        let empty = Empty::new(&grey, width, 200.0);
        assert!((empty.deviation - 3.0).abs() < 0.05, "{}", empty.deviation);
        assert!(empty.shared[0].abs() < 0.02 && (empty.shared[1] - 0.5).abs() < 0.02, "{:?}", empty.shared);
    }

    #[test]
    fn photons_are_told_from_reading() {
        let (width, height) = (160, 160);
        let own = noise(5, width * height, 1.0);
        let light = |i: usize| if (i % width) < 80 { 220.0_f32 } else { 150.0 };
        let of = |sd: &dyn Fn(f32) -> f32| {
            let grey: Vec<f32> = own.iter().enumerate().map(|(i, n)| light(i) + n * sd(light(i))).collect();
            law(&grey, width, 220.0)[1]
        };
        let (reading, photons) = (of(&|_| 2.0), of(&|l| (l / 55.0).sqrt()));
        assert!(reading.abs() < 0.1 && (photons - libm::log(150.0 / 220.0)).abs() < 0.1, "{reading} {photons}");
    }

    #[test]
    fn a_blur_keeps_light_and_spreads_a_point_as_wide_as_asked() {
        let width = 41;
        let mut image = vec![0.0; width * width];
        image[20 * width + 20] = 1.0;
        let out = blur(&image, width, 2.0);
        let sum: f32 = out.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        let off = |i: usize| (i % width) as f64 - 20.0;
        let variance: f64 = out.iter().enumerate().map(|(i, v)| f64::from(*v) * off(i) * off(i)).sum();
        assert!((variance - 4.0).abs() < 0.1, "{variance}");
        assert!(blur(&vec![3.0; 400], 20, 10.0).iter().all(|v| (v - 3.0).abs() < 1e-5));
    }

    #[test]
    fn dots_and_rods_are_counted_apart() {
        let width = 100;
        let mut grey = vec![200.0; width * width];
        for k in 0..5 {
            grey[(10 + 18 * k) * width + 20] = 60.0;
            for x in 60..70 {
                grey[(10 + 18 * k) * width + x] = 100.0;
            }
        }
        let found = counts(&grey, width, 200.0);
        assert_eq!(found.len(), 24);
        let things = (libm::exp(found[0].1) - 0.01) * 10.0;
        assert!((9.5..20.5).contains(&things), "{things}");
        assert!((0.2..0.8).contains(&found[3].1), "{:?}", found[3]);
    }
}

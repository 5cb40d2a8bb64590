//! Noise as a function of darkness, and unevenness of the light.

use crate::error::Error;
use papsynth_judge::Control;
use papsynth_judge::filter::separable;
use papsynth_judge::number::{single, whole};
use portable_numerics::statistics::{deviation, mean, quantile};

/// Size of the blocks for noise, pixels.
const BLOCK: usize = 8;

/// Ranges of absorbance of the blocks; the first one is empty slide.
const BINS: [[f64; 2]; 4] = [[-0.03, 0.02], [0.05, 0.12], [0.12, 0.25], [0.25, 0.6]];

/// Quantile of the blocks of a range that measures noise; other blocks contain structure.
const EVENEST: f64 = 0.15;

/// Minimum number of blocks of a range.
const LEAST_BLOCKS: usize = 12;

/// Number of values of [`noise_by_darkness`].
const DARK_BINS: usize = BINS.len() - 1;

/// Returns the logarithm of the noise in darker ranges over that of the empty slide; NaN for ranges without blocks.
pub(crate) fn noise_by_darkness(grey: &[f32], width: usize, empty: f64) -> [f64; DARK_BINS] {
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
            // A kernel that removes planes and saddles (Immerkær, doi:10.1006/cviu.1996.0060).
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

/// Standard deviations of the Gaussians between which texture is measured, pixels.
const TEXTURE_PX: [f64; 4] = [0.7, 1.4, 2.8, 5.6];

/// Standard deviation of the Gaussian after which a pixel is in a range of absorbance, pixels.
const LEVEL_PX: f64 = 4.0;

/// Minimum number of pixels of a range.
const LEAST_TEXTURE: usize = 2000;

/// Number of values of [`texture_by_darkness`].
const TEXTURES: usize = (TEXTURE_PX.len() - 1) * DARK_BINS;

/// Returns the logarithm of the texture of absorbance in the dark ranges, for each band from fine to coarse; NaN for
/// ranges without pixels. Texture is the median magnitude, which edges hardly change.
pub(crate) fn texture_by_darkness(grey: &[f32], width: usize, empty: f64) -> [f64; TEXTURES] {
    let absorbance: Vec<f32> = grey.iter().map(|g| -libm::log10f((g / single(empty)).max(1e-3))).collect();
    let level = blur(&absorbance, width, LEVEL_PX);
    let smooth = TEXTURE_PX.map(|sigma| blur(&absorbance, width, sigma));
    std::array::from_fn(|i| {
        let (band, [from, to]) = (i / DARK_BINS, BINS[1 + i % DARK_BINS]);
        let values = level.iter().zip(&smooth[band]).zip(&smooth[band + 1]);
        let inside = values.filter(|((level, _), _)| (from..to).contains(&f64::from(**level)));
        let mut magnitudes: Vec<f64> = inside.map(|((_, fine), coarse)| f64::from((fine - coarse).abs())).collect();
        if magnitudes.len() < LEAST_TEXTURE { f64::NAN } else { libm::log(quantile(&mut magnitudes, 0.5).max(1e-6)) }
    })
}

/// Standard deviations of the Gaussians of the band in which unevenness is measured, pixels.
const UNEVEN_PX: [f64; 2] = [6.0, 24.0];

/// Maximum absorbance of empty slide after the wider Gaussian.
const EVEN: f32 = 0.012;

/// Size of the blocks for coarse unevenness, pixels; the quantile of a block that measures the slide; and its maximum
/// deviation from the light, relative.
const BLOCK_PX: usize = 32;
const PALE: f64 = 0.75;
const SLIDE: f64 = 0.04;

/// Returns the logarithm of the unevenness of empty slide in a band, and around a quadratic surface; NaN without empty
/// slide.
pub(crate) fn unevenness(grey: &[f32], width: usize, empty: f64) -> [f64; 2] {
    let light: Vec<f32> = grey.iter().map(|g| g / single(empty)).collect();
    let [fine, coarse] = UNEVEN_PX.map(|sigma| blur(&light, width, sigma));
    // Objects are darker than the slide, so the brighter half is the slide.
    let slide = fine.iter().zip(&coarse).filter(|(_, c)| **c > 1.0 - 2.0 * EVEN);
    let mut rests: Vec<f64> = slide.map(|(f, c)| f64::from((f - c).abs())).collect();
    let finely = if rests.len() < grey.len() / 50 { f64::NAN } else { quantile(&mut rests, 0.5) };
    [finely, coarsely(&fine, width)].map(|v| if v.is_nan() { v } else { libm::log(v.max(1e-6)) })
}

/// Returns a robust standard deviation of bright blocks around their quadratic surface.
fn coarsely(light: &[f32], width: usize) -> f64 {
    let height = light.len() / width;
    let mut places = Vec::new();
    for top in (0..height).step_by(BLOCK_PX) {
        for left in (0..width).step_by(BLOCK_PX) {
            let rows = top..(top + BLOCK_PX).min(height);
            let row = |y: usize| &light[y * width + left..y * width + (left + BLOCK_PX).min(width)];
            // Every fourth pixel suffices, because the light is blurred.
            let mut block: Vec<f64> =
                rows.step_by(4).flat_map(|y| row(y).iter().step_by(4).map(|v| f64::from(*v))).collect();
            let pale = quantile(&mut block, PALE);
            if (pale - 1.0).abs() < SLIDE {
                let [x, y] = [left as f64 / width as f64 - 0.5, top as f64 / height as f64 - 0.5];
                places.push(([1.0, x, y, x * x, x * y, y * y], pale - 1.0));
            }
        }
    }
    /// Minimum number of blocks.
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

/// Standard deviation of the Gaussian that is subtracted to obtain noise, pixels.
const NOISE_PX: f64 = 6.0;

/// Standard deviation of the Gaussian that detects objects, pixels.
const OBJECTS_PX: f64 = 2.5;

/// Maximum signal of empty slide in the detection of objects, relative to its typical size.
const OBJECT_FACTOR: f64 = 3.0;

/// Maximum relative deviation of empty slide from its light.
const NEAR: f32 = 0.04;

/// Minimum number of pixels of empty slide for noise.
const LEAST_EMPTY: usize = 4000;

/// Returns the mean product of pixels that are known in both images; NaN for fewer than `least`.
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

/// Noise of the empty slide of a field.
pub(crate) struct Empty {
    /// Noise over the light; NaN outside the empty slide.
    pub(crate) relative: Vec<f32>,
    /// Standard deviation, grey levels of the image; NaN for too little empty slide.
    pub(crate) deviation: f64,
    /// Correlation with the next pixel of the row and of the column.
    pub(crate) correlation: [f64; 2],
}

/// Reduction of the covariance of noise by subtraction of a Gaussian, relative to the sum over all distances. The
/// remainder g − G∗g has the covariance γ − (2G − G∗G)∗γ, and the correlation length of noise is short compared with G.
const SUBTRACTED: f64 = 3.0 / (4.0 * std::f64::consts::PI * NOISE_PX * NOISE_PX);

impl Empty {
    /// Measures an image with this grey level of the empty slide.
    pub(crate) fn new(grey: &[f32], width: usize, level: f64) -> Self {
        let wide = blur(grey, width, NOISE_PX);
        let things: Vec<f32> = blur(grey, width, OBJECTS_PX).iter().zip(&wide).map(|(a, b)| a - b).collect();
        let slide = single((1.0 - f64::from(NEAR)) * level);
        let mut sizes: Vec<f64> =
            things.iter().zip(&wide).filter(|(_, w)| **w > slide).map(|(t, _)| f64::from(t.abs())).collect();
        // The quantile 0.4 of the absolute value of a normal number is 0.524 standard deviations.
        let most = single(OBJECT_FACTOR * quantile(&mut sizes, 0.4).max(1e-6) / 0.524);
        let known = |(w, t): (&f32, &f32)| *w > slide && t.abs() < most;
        let parts = grey.iter().zip(wide.iter().zip(&things));
        let rest: Vec<f32> = parts.map(|(g, at)| if known(at) { g - at.0 } else { f32::NAN }).collect();
        let relative = rest.iter().zip(&wide).map(|(r, w)| r / w).collect();
        let found = [0, 1, width].map(|step| mean_product(&rest, &rest[step..], LEAST_EMPTY));
        let mut own = found;
        /// Each round reduces the error by a factor of about 50.
        const ROUNDS: usize = 6;
        for _ in 0..ROUNDS {
            let all = own[0] * (1.0 + 2.0 * own[1] / own[0]) * (1.0 + 2.0 * own[2] / own[0]);
            own = found.map(|f| f + SUBTRACTED * all);
        }
        Self { relative, deviation: own[0].sqrt(), correlation: [own[1] / own[0], own[2] / own[0]] }
    }

    /// Returns the factor that corrects variances of [`relative`](Self::relative) for the subtracted Gaussian.
    pub(crate) fn restored(&self) -> f64 {
        1.0 / (1.0 - SUBTRACTED * (1.0 + 2.0 * self.correlation[0]) * (1.0 + 2.0 * self.correlation[1]))
    }
}

/// Minimum number of pixels that are empty in both fields.
const LEAST_PIXELS: usize = 5000;

/// Returns the mean over pairs of fields of their relative covariance, with its standard error; none without common
/// empty slide.
pub(crate) fn pattern(fields: &[Vec<f32>], control: &Control) -> Result<Option<[f64; 2]>, Error> {
    let mut products = Vec::new();
    for (i, a) in fields.iter().enumerate() {
        for b in &fields[i + 1..] {
            control.check()?;
            products.extend(Some(mean_product(a, b, LEAST_PIXELS)).filter(|product| product.is_finite()));
        }
    }
    let pairs = products.len();
    // Pairs with a common field are not independent: the number of fields limits the degrees of freedom.
    let sd = if pairs > 1 { deviation(&products) } else { mean(&products).abs() };
    Ok((pairs > 0).then(|| [mean(&products), sd / (fields.len().min(pairs) as f64).sqrt()]))
}

/// Blurs with a Gaussian; border pixels are the mirror.
pub(crate) fn blur(image: &[f32], width: usize, sigma: f64) -> Vec<f32> {
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
    fn pattern_noise_is_measured() {
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
        // 1.2·10⁵ pixels: a standard error of 5·10⁻⁷.
        assert!((variance * fields[0].restored() - 1e-4).abs() < 1.5e-6, "{variance} {error}");
        assert_eq!(pattern(&[fields[0].relative.clone()], &Control::NONE), Ok(None));
        // Variances of 2 and of 1 % of 220, on 1.2·10⁵ pixels.
        assert!((fields[0].deviation / (4.0_f64 + 4.84).sqrt() - 1.0).abs() < 0.02, "{}", fields[0].deviation);
        assert!(fields[0].correlation.iter().all(|s| s.abs() < 0.02), "{:?}", fields[0].correlation);
    }

    #[test]
    fn texture_is_measured_in_each_range_whatever_the_edges() {
        let (width, height, empty) = (240, 200, 200.0);
        // Three ranges of absorbance with noise of 2, 4 and 3 % of the light.
        let grains = noise(5, width * height, 1.0);
        let image = |edges: bool| -> Vec<f32> {
            let pixel = |i: usize| {
                let (x, y) = (i % width, i / width);
                let (absorbance, sd) = [(0.08, 0.02), (0.18, 0.04), (0.4, 0.03)][x / 80];
                let line = if edges && y % 50 < 2 { 0.8 } else { 1.0 };
                200.0 * libm::powf(10.0, -absorbance) * (1.0 + sd * grains[i]) * line
            };
            (0..width * height).map(pixel).collect()
        };
        let (plain, edged) = [false, true].map(|edges| texture_by_darkness(&image(edges), width, empty)).into();
        // The coarsest band reaches from one range into the next.
        for band in 0..2 {
            let [a, b, c] = [0, 1, 2].map(|bin| plain[band * DARK_BINS + bin]);
            assert!((b - a - libm::log(2.0)).abs() < 0.15 && (c - a - libm::log(1.5)).abs() < 0.15, "{plain:?}");
        }
        assert!(plain[..3].iter().zip(&edged).all(|(a, b)| (a - b).abs() < 0.25), "{plain:?} {edged:?}");
        let empty_slide = vec![200.0; width * height];
        assert!(texture_by_darkness(&empty_slide, width, empty).iter().all(|value| value.is_nan()));
    }

    #[test]
    fn correlated_noise_is_measured_without_objects() {
        let (width, height) = (300, 300);
        let own = noise(9, width * height + width + 1, 3.0);
        let mut grey: Vec<f32> =
            (0..width * height).map(|i| 200.0 + (own[i] + own[i + width]) / 2.0_f32.sqrt()).collect();
        for y in 100..160 {
            grey[y * width + 100..y * width + 160].fill(120.0);
        }
        let empty = Empty::new(&grey, width, 200.0);
        assert!((empty.deviation - 3.0).abs() < 0.05, "{}", empty.deviation);
        assert!(
            empty.correlation[0].abs() < 0.02 && (empty.correlation[1] - 0.5).abs() < 0.02,
            "{:?}",
            empty.correlation
        );
    }

    #[test]
    fn photon_noise_and_read_noise_are_distinguished() {
        let (width, height) = (160, 160);
        let own = noise(5, width * height, 1.0);
        let light = |i: usize| if (i % width) < 80 { 220.0_f32 } else { 150.0 };
        let of = |sd: &dyn Fn(f32) -> f32| {
            let grey: Vec<f32> = own.iter().enumerate().map(|(i, n)| light(i) + n * sd(light(i))).collect();
            noise_by_darkness(&grey, width, 220.0)[1]
        };
        let (reading, photons) = (of(&|_| 2.0), of(&|l| (l / 55.0).sqrt()));
        assert!(reading.abs() < 0.1 && (photons - libm::log(150.0 / 220.0)).abs() < 0.1, "{reading} {photons}");
    }

    #[test]
    fn a_blur_keeps_the_sum_and_has_its_standard_deviation() {
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
}

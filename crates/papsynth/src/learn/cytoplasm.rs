//! Learns the texture of cytoplasm from areas of fields that show cytoplasm alone.

use portable_numerics::random::Ziggurat;
use portable_numerics::statistics::quantile;
use steerable_texture::{Analyzer, Statistics, TextureParams};

use super::rounded;
use crate::error::{Error, ErrorKind};
use crate::key::Key;
use crate::model::{CytoplasmTexture, LogNormal, Model, Provenance, TextureKind};

/// A field, and the areas that show cytoplasm without nuclei, borders, folds and debris.
#[derive(Debug, Clone, Default)]
pub struct CytoplasmImage {
    /// Name of the image, for error messages.
    pub name: String,
    /// Columns.
    pub width: usize,
    /// Absorbance, row by row.
    pub absorbance: Vec<f32>,
    /// Local mean of the absorbance in these areas.
    pub mean: Vec<f32>,
    /// 1 in these areas, 0 elsewhere.
    pub mask: Vec<f32>,
    /// 1 on the empty slide, 0 elsewhere.
    pub empty: Vec<f32>,
    /// Standard deviation of the noise of the empty slide, absorbance.
    pub noise: f64,
    /// Median blur of edges, standard deviation in pixels.
    pub blur_px: f64,
}

/// Parameters for learning the texture of cytoplasm.
#[derive(Debug, Clone)]
pub struct CytoplasmParams {
    /// Pixel size of the images, µm, 0.2 to 0.5.
    pub pixel_um: f64,
    /// Source of the material, for the provenance record.
    pub source: String,
}

/// Accepted pixel sizes, µm.
const PIXEL_UM: [f64; 2] = [0.2, 0.5];

/// Side of a window, px. Windows overlap by half.
const WINDOW: usize = 64;

/// Side of the image in which a window is analysed, px.
const FRAME: usize = 128;

/// Smallest part of a window that shows cytoplasm.
const COVERED: f64 = 0.6;

/// Minimum number of windows.
const MIN_WINDOWS: usize = 20;

/// Minimum absorbance for relative deviations.
const MIN_MEAN: f32 = 0.03;

/// Octaves whose variance is the strength of a window: the scales of wavelengths from 3 to 20 px.
const STRONG: std::ops::Range<usize> = 1..4;

/// Significant digits of the statistics of a texture.
const TEXTURE_DIGITS: usize = 4;

/// A measured window.
struct Window {
    image: usize,
    statistics: Statistics,
    /// Variances of the octaves without noise and blur: high-pass residual, scales, low-pass residual.
    octaves: Vec<f64>,
    kind: usize,
    /// Weight in means: fields count equally, except those with few windows.
    weight: f64,
}

/// Windows of a field that counts fully.
const WHOLE_FIELD: usize = 10;

/// The test of a kind of texture.
type Test = fn(&Features) -> bool;

/// Kinds of texture, with the test that a window passes. The first one that matches counts.
const KINDS: [(&str, Test); 4] = [
    ("keratohyaline", |f| f.skewness > 0.9),
    ("fibrillar", |f| f.coherence > 0.35),
    ("reticulated", |f| f.skewness < 0.15),
    ("granular", |_| true),
];

/// Index of the fibrillar kind in [`KINDS`]. Its windows are rotated until the fibres are horizontal.
const FIBRILLAR: usize = 1;

/// Features of a window that determine its kind.
struct Features {
    /// Skewness of the low-pass image of the second scale: positive for dark spots.
    skewness: f64,
    /// Coherence of orientations, 0 (none) to 1 (all energy in one direction).
    coherence: f64,
    /// Direction of the fibres, radians.
    direction: f64,
}

/// Learns the texture of cytoplasm and returns the model with it.
///
/// # Errors
/// If the images are invalid or show too little cytoplasm.
pub fn learn_cytoplasm(base: &Model, images: &[CytoplasmImage], params: &CytoplasmParams) -> Result<Model, Error> {
    learned(base, images, params).map_err(|cause| Error::Learn { class: "cytoplasm".to_owned(), cause })
}

fn learned(base: &Model, images: &[CytoplasmImage], params: &CytoplasmParams) -> Result<Model, ErrorKind> {
    if !(PIXEL_UM[0]..=PIXEL_UM[1]).contains(&params.pixel_um) {
        return Err(ErrorKind::TexturePixel(params.pixel_um));
    }
    let texture = TextureParams::default();
    let analyzer = Analyzer::new(FRAME, FRAME, &texture).map_err(ErrorKind::CytoplasmTexture)?;
    for image in images {
        let pixels = image.absorbance.len();
        let others = [image.mean.len(), image.mask.len(), image.empty.len()];
        if image.width == 0 || pixels % image.width != 0 || others != [pixels; 3] {
            return Err(ErrorKind::CytoplasmSize(image.name.clone()));
        }
    }
    let noise = Noise::measure(images, &analyzer, &texture)?;
    let mut windows = Vec::new();
    for (index, image) in images.iter().enumerate() {
        let relative = image.relative();
        let places = image.places(&image.mask);
        let weight = 1.0 / places.len().max(WHOLE_FIELD) as f64;
        for place in places {
            windows.push(Window { weight, ..Window::new(index, image, &relative, place, &analyzer, &noise)? });
        }
    }
    if windows.len() < MIN_WINDOWS {
        return Err(ErrorKind::LittleCytoplasm { found: windows.len(), least: MIN_WINDOWS });
    }
    let mut model = base.clone();
    let what = "texture of cytoplasm";
    model.provenance.retain(|p| p.what != what);
    model.provenance.push(Provenance {
        class: "all".to_owned(),
        what: what.to_owned(),
        count: windows.len(),
        pixel_um: params.pixel_um,
        source: params.source.clone(),
    });
    let kinds = KINDS.iter().enumerate().filter_map(|(kind, (name, _))| summary(name, kind, &windows).transpose());
    let kinds = kinds.collect::<Result<Vec<TextureKind>, ErrorKind>>()?;
    let field_log_sd = between_fields(&windows);
    model.cytoplasm_texture =
        Some(CytoplasmTexture { pixel_um: params.pixel_um, field_log_sd, field_kind: field_kind(&windows), kinds });
    model.checked()?;
    Ok(model)
}

impl CytoplasmImage {
    /// Returns the relative deviation from the local mean; 0 outside the mask.
    fn relative(&self) -> Vec<f32> {
        let of = |i: usize| {
            let mean = self.mean[i].max(MIN_MEAN);
            self.mask[i] * (self.absorbance[i] - mean) / mean
        };
        (0..self.absorbance.len()).map(of).collect()
    }

    /// Returns the top left corners of the windows of a mask.
    fn places(&self, mask: &[f32]) -> Vec<[usize; 2]> {
        let height = self.absorbance.len() / self.width;
        let starts = |length: usize| (0..(length + 1).saturating_sub(WINDOW)).step_by(WINDOW / 2);
        let covered = |[left, top]: &[usize; 2]| {
            let rows = (*top..top + WINDOW).map(|y| &mask[y * self.width + left..][..WINDOW]);
            let sum: f64 = rows.flatten().map(|m| f64::from(*m)).sum();
            sum >= COVERED * (WINDOW * WINDOW) as f64
        };
        let places = starts(height).flat_map(|top| starts(self.width).map(move |left| [left, top]));
        places.filter(covered).collect()
    }

    /// Returns the interpolated relative deviation and mask around the centre of a window, rotated by an angle. The
    /// mask is 0 outside the window.
    fn frame(&self, relative: &[f32], mask: &[f32], [left, top]: [usize; 2], direction: f64) -> [Vec<f32>; 2] {
        let height = self.absorbance.len() / self.width;
        let (sin, cos) = (libm::sin(direction), libm::cos(direction));
        let centre = [left, top].map(|corner| (corner + WINDOW / 2) as f64 - 0.5);
        let at = |x: f64, y: f64| {
            let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < height as f64;
            inside.then(|| y as usize * self.width + x as usize)
        };
        let mut values = vec![0.0; FRAME * FRAME];
        let mut weights = values.clone();
        for (i, (value, weight)) in values.iter_mut().zip(&mut weights).enumerate() {
            let [u, v] = [i % FRAME, i / FRAME].map(|k| k as f64 - 0.5 * (FRAME - 1) as f64);
            let inside = u.abs() < 0.5 * WINDOW as f64 && v.abs() < 0.5 * WINDOW as f64;
            let [x, y] = [centre[0] + cos * u - sin * v, centre[1] + sin * u + cos * v];
            let [fx, fy] = [x - x.floor(), y - y.floor()];
            for (dx, dy, share) in [
                (0.0, 0.0, (1.0 - fx) * (1.0 - fy)),
                (1.0, 0.0, fx * (1.0 - fy)),
                (0.0, 1.0, (1.0 - fx) * fy),
                (1.0, 1.0, fx * fy),
            ] {
                let Some(p) = at(x.floor() + dx, y.floor() + dy) else { continue };
                *value += (share * f64::from(relative[p])) as f32;
                *weight += if inside { (share * f64::from(mask[p])) as f32 } else { 0.0 };
                *weight = weight.min(1.0);
            }
        }
        [values, weights]
    }
}

impl Window {
    fn new(
        index: usize,
        image: &CytoplasmImage,
        relative: &[f32],
        place: [usize; 2],
        analyzer: &Analyzer,
        noise: &Noise,
    ) -> Result<Self, ErrorKind> {
        let measure = |direction: f64| {
            let [values, weights] = image.frame(relative, &image.mask, place, direction);
            analyzer.measure(&values, Some(&weights)).map_err(ErrorKind::CytoplasmTexture)
        };
        let mut statistics = measure(0.0)?;
        let features = Features::new(&statistics);
        let kind = KINDS.iter().position(|(_, matches)| matches(&features)).unwrap_or(KINDS.len() - 1);
        let variance = image.noise_of(place, noise.of(image));
        let octaves = object_octaves(&statistics, variance, image.blur_px, &noise.octaves);
        if kind == FIBRILLAR {
            statistics = measure(features.direction)?;
        }
        Ok(Self { image: index, statistics, octaves, kind, weight: 1.0 })
    }

    /// Returns the standard deviation of the texture.
    fn strength(&self) -> f64 {
        self.octaves[STRONG].iter().sum::<f64>().sqrt()
    }
}

impl CytoplasmImage {
    /// Returns the variance of the noise in a window, relative to its mean absorbance.
    /// `noise` is the standard deviation on the empty slide.
    fn noise_of(&self, [left, top]: [usize; 2], noise: f64) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for y in top..top + WINDOW {
            for i in y * self.width + left..y * self.width + left + WINDOW {
                let (mask, mean) = (f64::from(self.mask[i]), f64::from(self.mean[i].max(MIN_MEAN)));
                // Photon noise: the variance of the absorbance is inversely proportional to the light.
                sum += mask * libm::exp10(mean) * (noise / mean) * (noise / mean);
                count += mask;
            }
        }
        sum / f64::max(count, 1.0)
    }
}

impl Features {
    fn new(statistics: &Statistics) -> Self {
        let k = statistics.params.pyramid.orientations;
        let (mut total, mut cos, mut sin) = (0.0, 0.0, 0.0);
        for scale in &statistics.scales[1..3] {
            for (orientation, energy) in scale.real_covariance.iter().step_by(k + 1).enumerate() {
                let angle = core::f64::consts::TAU * orientation as f64 / k as f64;
                total += energy;
                cos += energy * libm::cos(angle);
                sin += energy * libm::sin(angle);
            }
        }
        // The energy is largest across the fibres.
        let across = 0.5 * libm::atan2(sin, cos);
        Self {
            skewness: statistics.low_pass[1].moments.skewness(),
            coherence: (cos * cos + sin * sin).sqrt() / f64::max(total, f64::MIN_POSITIVE),
            direction: across + core::f64::consts::FRAC_PI_2,
        }
    }
}

/// Returns the variances of high-pass residual, scales and low-pass residual.
fn octaves(statistics: &Statistics) -> Vec<f64> {
    let k = statistics.params.pyramid.orientations;
    let scales = statistics.scales.iter().map(|s| s.real_covariance.iter().step_by(k + 1).sum::<f64>());
    let residual = statistics.low_pass.last().map_or(0.0, |low| low.moments.variance);
    [statistics.high_pass_variance].into_iter().chain(scales).chain([residual]).collect()
}

/// Noise of the camera.
struct Noise {
    /// Octaves of the variance, relative to the variance.
    octaves: Vec<f64>,
    /// Median of the standard deviations of the images, absorbance.
    typical: f64,
}

impl Noise {
    /// Measures the octaves on the empty slide; without empty slide, they are those of white noise.
    fn measure(images: &[CytoplasmImage], analyzer: &Analyzer, texture: &TextureParams) -> Result<Self, ErrorKind> {
        let mut known: Vec<f64> = images.iter().map(|image| image.noise).filter(|noise| noise.is_finite()).collect();
        let typical = if known.is_empty() { 0.0 } else { quantile(&mut known, 0.5) };
        let mut found: Vec<Vec<f64>> = Vec::new();
        for image in images.iter().filter(|image| image.noise >= typical && image.noise > 0.0) {
            for place in image.places(&image.empty).into_iter().step_by(STEP_OF_EMPTY) {
                let [values, weights] = image.frame(&image.absorbance, &image.empty, place, 0.0);
                let measured = analyzer.measure(&values, Some(&weights)).map_err(ErrorKind::CytoplasmTexture)?;
                found.push(octaves(&measured).iter().map(|v| v / (image.noise * image.noise)).collect());
            }
        }
        let mut white = white_octaves(texture)?;
        if found.len() >= MIN_WINDOWS {
            for (octave, value) in white.iter_mut().enumerate() {
                // Dirt adds to the coarse octaves of some windows.
                *value = quantile(&mut found.iter().map(|o| o[octave]).collect::<Vec<_>>(), 0.25);
            }
        }
        Ok(Self { octaves: white, typical })
    }

    /// Returns the standard deviation of the noise of an image on a slide without saturation: where the slide
    /// saturates, it shows less noise than the cells.
    fn of(&self, image: &CytoplasmImage) -> f64 {
        if image.noise.is_finite() { image.noise.max(self.typical) } else { 0.0 }
    }
}

/// Every one of this many windows of the empty slide is measured.
const STEP_OF_EMPTY: usize = 4;

/// Returns the octaves of white noise with variance 1.
fn white_octaves(texture: &TextureParams) -> Result<Vec<f64>, ErrorKind> {
    const SIDE: usize = 512;
    let mut rng = Key { seed: 0, index: 0 }.stream("learn", 0, "noise");
    let ziggurat = Ziggurat::new();
    let noise: Vec<f32> = (0..SIDE * SIDE / 2).flat_map(|_| ziggurat.pair(&mut rng)).collect();
    Ok(octaves(&Statistics::measure(&noise, SIDE, None, texture).map_err(ErrorKind::CytoplasmTexture)?))
}

/// Returns the variances of the octaves in the object: without noise, and before the blur of the image.
fn object_octaves(statistics: &Statistics, noise: f64, blur_px: f64, white: &[f64]) -> Vec<f64> {
    /// Smallest part of the measured variance that is texture.
    const LEAST: f64 = 0.05;
    /// Smallest modulation transfer whose loss is compensated.
    const TRANSFER: f64 = 0.2;
    let blur = if blur_px.is_finite() { blur_px } else { 0.0 };
    let object = |(octave, (measured, white)): (usize, (f64, &f64))| {
        // Centre of the octave, cycles per pixel.
        let frequency = if octave == 0 { 0.45 } else { 0.27 * libm::exp2(1.0 - octave as f64) };
        let angular = core::f64::consts::TAU * frequency * blur;
        let transfer = libm::exp(-0.5 * angular * angular).max(TRANSFER);
        (measured - noise * white).max(LEAST * measured) / (transfer * transfer)
    };
    octaves(statistics).into_iter().zip(white).enumerate().map(object).collect()
}

/// Returns the summary of the windows of a kind; none without windows.
fn summary(name: &str, kind: usize, windows: &[Window]) -> Result<Option<TextureKind>, ErrorKind> {
    let own: Vec<&Window> = windows.iter().filter(|w| w.kind == kind).collect();
    if own.is_empty() {
        return Ok(None);
    }
    // Strong and weak textures count equally.
    let weighted: Vec<(&Statistics, f64)> =
        own.iter().map(|w| (&w.statistics, w.weight / w.statistics.pixels.variance.max(1e-12))).collect();
    let statistics = Statistics::mean(&weighted).map_err(ErrorKind::CytoplasmTexture)?.rounded(TEXTURE_DIGITS);
    let total: f64 = own.iter().map(|w| w.weight).sum();
    let octave = |octave: usize| {
        let relative = |w: &&Window| w.weight * w.octaves[octave] / (w.strength() * w.strength()).max(1e-12);
        rounded((own.iter().map(relative).sum::<f64>() / total).sqrt())
    };
    let mean = own.iter().map(|w| w.weight * libm::log(w.strength().max(1e-6))).sum::<f64>() / total;
    let all: f64 = windows.iter().map(|w| w.weight).sum();
    Ok(Some(TextureKind {
        name: name.to_owned(),
        weight: rounded(total / all),
        strength: LogNormal { median: rounded(libm::exp(mean)), log_sd: rounded(within_fields(&own)) },
        octaves: (0..own[0].octaves.len()).map(octave).collect(),
        statistics,
    }))
}

/// Returns the mean logarithm of the strength and the number of windows of each image.
fn by_field(windows: &[&Window]) -> Vec<(f64, f64)> {
    let images = windows.iter().map(|w| w.image).max().map_or(0, |most| most + 1);
    let mut sums = vec![(0.0, 0.0); images];
    for window in windows {
        let (sum, count) = &mut sums[window.image];
        *sum += libm::log(window.strength().max(1e-6));
        *count += 1.0;
    }
    sums.iter().map(|(sum, count)| (sum / f64::max(*count, 1.0), *count)).collect()
}

/// Returns the standard deviation of the logarithm of the strength within fields.
fn within_fields(windows: &[&Window]) -> f64 {
    let fields = by_field(windows);
    let deviation = |w: &&Window| libm::log(w.strength().max(1e-6)) - fields[w.image].0;
    let squares: f64 = windows.iter().map(|w| deviation(w) * deviation(w)).sum();
    let free = windows.len() as f64 - fields.iter().filter(|f| f.1 > 0.0).count() as f64;
    (squares / free.max(1.0)).sqrt()
}

/// Returns the standard deviation of the logarithm of the strength between fields.
fn between_fields(windows: &[Window]) -> f64 {
    let fields = by_field(&windows.iter().collect::<Vec<_>>());
    let means: Vec<f64> = fields.iter().filter(|f| f.1 > 0.0).map(|f| f.0).collect();
    rounded(super::normal(means.into_iter()).sd)
}

/// Returns the probability that a window has the kind of its field: p² = (S − D)/(1 − D), where S and D are the
/// probabilities that two windows of the same field and of different fields have the same kind.
fn field_kind(windows: &[Window]) -> f64 {
    let fields = windows.iter().map(|w| w.image).max().map_or(0, |most| most + 1);
    let mut counts = vec![[0.0; KINDS.len()]; fields];
    for window in windows {
        counts[window.image][window.kind] += 1.0;
    }
    counts.retain(|of_kinds| of_kinds.iter().sum::<f64>() >= WHOLE_FIELD as f64);
    let (mut same, mut different, mut pairs) = (0.0, 0.0, 0.0);
    for (i, first) in counts.iter().enumerate() {
        let n = first.iter().sum::<f64>();
        same += first.iter().map(|count| count * (count - 1.0)).sum::<f64>() / (n * (n - 1.0));
        for second in &counts[..i] {
            different += first.iter().zip(second).map(|(a, b)| a * b).sum::<f64>() / (n * second.iter().sum::<f64>());
            pairs += 1.0;
        }
    }
    if pairs == 0.0 {
        return 0.0;
    }
    let (same, different) = (same / counts.len() as f64, different / pairs);
    rounded(((same - different) / (1.0 - different).max(1e-9)).clamp(0.0, 1.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Stream;
    use crate::random;
    use spectral_field::{FieldParams, SpectralField, Spectrum};

    const SIDE: usize = 256;

    /// Returns a field of cytoplasm of absorbance 0.2 with a texture of this relative strength.
    fn field(strength: f32, noise: f64, rng: &mut Stream) -> CytoplasmImage {
        let spectrum = Spectrum::Matern { nu: 1.0, length_px: 1.5 };
        let params = FieldParams { width: SIDE, height: SIDE, spectrum, ..FieldParams::default() };
        let texture = SpectralField::new(&params).unwrap().draw(rng);
        let absorbance = texture.iter().map(|t| 0.2 * (1.0 + strength * t) + (noise * random::normal(rng)) as f32);
        CytoplasmImage {
            name: "field".to_owned(),
            width: SIDE,
            absorbance: absorbance.collect(),
            mean: vec![0.2; SIDE * SIDE],
            mask: vec![1.0; SIDE * SIDE],
            empty: vec![0.0; SIDE * SIDE],
            noise: noise * libm::pow(10.0, -0.1),
            blur_px: 0.0,
        }
    }

    fn learned(images: &[CytoplasmImage]) -> Result<CytoplasmTexture, String> {
        let params = CytoplasmParams { pixel_um: 0.33, source: "test".to_owned() };
        let model = learn_cytoplasm(&Model::builtin(), images, &params).map_err(|e| e.to_string())?;
        // The JSON of the model can be read back.
        assert_eq!(Model::from_json(&model.to_json()).unwrap(), model);
        Ok(model.cytoplasm_texture.unwrap())
    }

    #[test]
    fn strength_and_octaves_do_not_depend_on_noise() {
        let rng = || Key { seed: 5, index: 0 }.stream("test", 0, "cytoplasm");
        let main = |texture: &CytoplasmTexture| {
            texture.kinds.iter().max_by(|a, b| a.weight.total_cmp(&b.weight)).unwrap().clone()
        };
        let clean = main(&learned(&[field(0.08, 0.0, &mut rng())]).unwrap());
        let noisy = main(&learned(&[field(0.08, 0.004, &mut rng())]).unwrap());
        let double = main(&learned(&[field(0.16, 0.0, &mut rng())]).unwrap());
        assert!((noisy.strength.median / clean.strength.median - 1.0).abs() < 0.08, "{noisy:?}");
        assert!((double.strength.median / clean.strength.median - 2.0).abs() < 0.1, "{double:?}");
        for octave in 1..5 {
            let ratio = noisy.octaves[octave] / clean.octaves[octave];
            assert!((ratio - 1.0).abs() < 0.15, "{octave}: {ratio}");
        }
    }

    #[test]
    fn fields_of_different_strength_give_the_variation_between_fields() {
        let mut rng = Key { seed: 6, index: 0 }.stream("test", 0, "cytoplasm");
        let strengths = [0.05_f32, 0.1, 0.2];
        let found = learned(&strengths.map(|s| field(s, 0.0, &mut rng))).unwrap();
        // Logarithms 0.69 apart have a standard deviation of 0.69.
        assert!((found.field_log_sd - 0.69).abs() < 0.08, "{}", found.field_log_sd);
        assert!(found.kinds.iter().all(|kind| kind.strength.log_sd < 0.2));
    }

    #[test]
    fn unusable_images_are_reported() {
        let mut rng = Key { seed: 7, index: 0 }.stream("test", 0, "cytoplasm");
        let whole = field(0.1, 0.0, &mut rng);
        let empty = CytoplasmImage { mask: vec![0.0; SIDE * SIDE], ..whole.clone() };
        assert!(learned(&[empty]).unwrap_err().contains("0 areas of cytoplasm"));
        let short = CytoplasmImage { mean: vec![0.2; 3], ..whole };
        assert!(learned(&[short]).unwrap_err().contains("differ in size"));
    }
}

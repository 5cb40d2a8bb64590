//! Statistics of images for the regressions.

use papsynth_judge::number::{single, whole};
use papsynth_judge::{Control, FeatureTable, Field, FieldImage, Statistics};

use crate::error::Error;
use crate::halo::halo;
use crate::hues::{HUES, Hues, hues};
use crate::noise;
use crate::objects;
use crate::sampler::Sampler;
use portable_numerics::statistics::{mean, quantile};

/// Transform of a feature.
#[derive(Clone, Copy)]
enum Transform {
    Identity,
    /// Logarithm of the value plus an offset.
    Log(f64),
}

impl Transform {
    fn of(self, value: f64) -> f64 {
        match self {
            Self::Identity => value,
            // NaN stays NaN.
            Self::Log(more) => libm::log((value + more).clamp(1e-9, f64::MAX)),
        }
    }
}

/// Identifier and transform of a feature.
type Feature = (&'static str, Transform);

/// Statistic of nuclear area: median of its logarithm.
pub(crate) const NUCLEAR_AREA: &str = "nuclei: nucleus area, um2";

/// Features of nuclei.
const NUCLEI: [Feature; 25] = [
    ("nucleus area, um2", Transform::Log(0.0)),
    ("core absorbance", Transform::Identity),
    ("core above surroundings", Transform::Identity),
    ("absorbance beside", Transform::Identity),
    ("spread beside", Transform::Log(0.005)),
    ("core sd", Transform::Log(0.002)),
    ("core sd without trend", Transform::Log(0.002)),
    ("core sd over contrast", Transform::Log(0.01)),
    ("core slope", Transform::Log(0.002)),
    ("core slope over sd", Transform::Identity),
    ("rim to centre, bin 1 of 5", Transform::Identity),
    ("rim to centre, bin 2 of 5", Transform::Identity),
    ("rim to centre, bin 3 of 5", Transform::Identity),
    ("rim to centre, bin 5 of 5", Transform::Identity),
    ("rim sigma, px", Transform::Log(0.0)),
    ("darkest depth over core", Transform::Identity),
    ("rim slope over contrast", Transform::Identity),
    ("core correlation at 1 px", Transform::Identity),
    ("core correlation at 2 px", Transform::Identity),
    ("core correlation at 4 px", Transform::Identity),
    ("core power at 1 px", Transform::Log(0.001)),
    ("core power at 4 px", Transform::Log(0.001)),
    ("log moment 2", Transform::Identity),
    ("core skewness", Transform::Identity),
    ("nucleus eccentricity", Transform::Identity),
];

/// Distances of counted pairs of nuclei, µm.
const PAIRS_UM: [f64; 5] = [8.0, 16.0, 33.0, 66.0, 130.0];

/// Features of free cells.
const CELLS: [Feature; 13] = [
    ("cell area, um2", Transform::Log(0.0)),
    ("cytoplasm absorbance", Transform::Log(0.005)),
    ("cytoplasm sd over median", Transform::Log(0.02)),
    ("cytoplasm quantile 0.9 over median", Transform::Identity),
    ("cytoplasm power at 1 px over median", Transform::Log(0.002)),
    ("cytoplasm power at 2 px over median", Transform::Log(0.002)),
    ("cytoplasm power at 4 px over median", Transform::Log(0.002)),
    ("cytoplasm power at 8 px over median", Transform::Log(0.002)),
    ("cytoplasm slope over median", Transform::Log(0.002)),
    ("dark spots in cytoplasm, um-2", Transform::Identity),
    ("sigma of the cell's rim, px, quantile 0.25", Transform::Log(0.2)),
    ("nucleus over cell area", Transform::Log(0.001)),
    ("cell circularity", Transform::Identity),
];

/// Absorbances above which the fraction of the window is measured.
const TAILS: [f64; 8] = [0.05, 0.09, 0.15, 0.21, 0.31, 0.41, 0.61, 0.81];

/// Minimum number of nuclei or cells for a median.
const LEAST: usize = 4;

/// Returns the scalars of the statistics of an image.
fn scalars(s: &Statistics) -> Vec<(&'static str, f64)> {
    let ripley = s.ripley.map(|k| Transform::Log(0.1).of(k));
    vec![
        ("log noise", Transform::Log(0.0).of(s.noise_dn)),
        ("noise correlation across", s.noise_across),
        ("noise correlation down", s.noise_down),
        ("noise correlation diagonally", s.noise_diagonal),
        ("log coverage", Transform::Log(0.01).of(s.coverage)),
        ("log absorbance of what is covered", Transform::Log(0.005).of(s.covered_a)),
        ("log range of absorbance of what is covered", Transform::Log(0.0).of(s.covered_range)),
        ("log fraction of overlaps", Transform::Log(0.02).of(s.layered)),
        ("slope of the spectrum", s.spectrum_slope),
        ("log edge sigma p10", Transform::Log(0.1).of(s.edge_sigma_p10)),
        ("log edge sigma p50", Transform::Log(0.1).of(s.edge_sigma_p50)),
        ("log nuclei", Transform::Log(20.0).of(s.nuclei_mm2)),
        ("Clark-Evans", s.clark_evans),
        ("log K at 16.5 um", ripley[0]),
        ("log K at 33 um", ripley[1]),
        ("log K at 66 um", ripley[2]),
        ("circularity of cells", s.circularity),
        ("profile, bin 1", s.profile[0]),
        ("profile, bin 2", s.profile[1]),
        ("profile, bin 9", s.profile[8]),
    ]
}

/// Statistics of an image; NaN if unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Names of the statistics.
    pub names: Vec<String>,
    /// Values of the statistics.
    pub values: Vec<f64>,
    /// Number of nuclei in the image.
    pub nuclei: usize,
}

impl Summary {
    /// Measures an image.
    ///
    /// # Errors
    /// If the image is invalid; [`Error::Stopped`] if the stop flag is set.
    pub fn of(image: &FieldImage, sampler: &Sampler, control: &Control) -> Result<Self, Error> {
        let field = sampler.measurer.measure_with(image, control)?;
        control.check()?;
        Self::of_field(&field, image, sampler, control)
    }

    /// As [`of`](Self::of), for an image that is measured already.
    pub(crate) fn of_field(
        field: &Field,
        image: &FieldImage,
        sampler: &Sampler,
        control: &Control,
    ) -> Result<Self, Error> {
        let Field { statistics: s, nuclei, cells, .. } = field;
        let (grey, width) = (&image.grey, image.width);
        let empty = s.background_dn * f64::from(image.full_scale) / crate::recipe::LEVELS;
        let mut all = Self { names: Vec::new(), values: Vec::new(), nuclei: nuclei.len() };
        for (name, value) in scalars(s) {
            all.put(name, value);
        }
        for (name, value) in papsynth_judge::CYTOPLASM_NAMES.into_iter().zip(s.cytoplasm) {
            all.put(name, value);
        }
        for (i, power) in s.spectrum.iter().enumerate() {
            all.put(format!("log power, ring {i}"), *power);
        }
        for a in TAILS {
            all.put(format!("fraction above {a}"), Transform::Log(0.002).of(tail(&s.histogram, a)));
        }
        all.put("absorbance of the darkest parts", darkest(&s.histogram));
        for (i, noise) in (1..).zip(noise::noise_by_darkness(grey, width, empty)) {
            all.put(format!("noise in the dark, bin {i}"), noise);
        }
        for (i, texture) in (1..).zip(noise::texture_by_darkness(grey, width, empty)) {
            all.put(format!("texture in the dark, value {i}"), texture);
        }
        let [fine, coarse] = noise::unevenness(grey, width, empty);
        all.put("unevenness of the light, finely", fine);
        all.put("unevenness of the light, coarsely", coarse);
        all.put("halo of objects", halo(grey, width, empty, sampler.pixel_um));
        control.check()?;
        for (name, value) in objects::counts(grey, width, single(empty)) {
            all.put(name, value);
        }
        for (name, value) in objects::bodies(grey, width, single(empty), &nuclei.places, sampler.pixel_um) {
            all.put(name, value);
        }
        all.put_objects("nuclei", nuclei, &NUCLEI);
        for um in PAIRS_UM {
            let [found, expected] = pairs(&nuclei.places, image, um / sampler.pixel_um);
            all.put(format!("pairs of nuclei within {um} um"), libm::log((found + 1.0) / (expected + 1.0)));
        }
        all.put_objects("cells", cells, &CELLS);
        if sampler.colour {
            HUES.into_iter()
                .zip(hues(image, &nuclei.places, sampler.pixel_um))
                .for_each(|(name, hue)| all.put(name, hue));
        }
        Ok(all)
    }

    /// Returns the mean of several summaries of one field: of its known values.
    pub(crate) fn mean(parts: &[Self]) -> Self {
        let one =
            |i: usize| mean(&parts.iter().map(|part| part.values[i]).filter(|v| v.is_finite()).collect::<Vec<f64>>());
        let names = parts.first().map_or(Vec::new(), |part| part.names.clone());
        let values = (0..names.len()).map(one).collect();
        Self { names, values, nuclei: parts.iter().map(|part| part.nuclei).sum() }
    }

    /// Returns the hues, the last statistics of a colour image.
    pub(crate) fn hues(&self) -> Option<Hues> {
        self.values.last_chunk().copied()
    }

    fn put(&mut self, name: impl Into<String>, value: f64) {
        self.names.push(name.into());
        self.values.push(value);
    }

    /// Adds median and robust standard deviation (0.741 times the interquartile range) of features of objects.
    fn put_objects(&mut self, kind: &str, table: &FeatureTable, features: &[Feature]) {
        for (name, scale) in features {
            let mut values: Vec<f64> = table.column(name).map(|v| scale.of(v)).collect();
            let [middle, spread] = if values.len() < LEAST {
                [f64::NAN; 2]
            } else {
                let [low, middle, high] = [0.25, 0.5, 0.75].map(|q| quantile(&mut values, q));
                [middle, 0.741 * (high - low)]
            };
            self.put(format!("{kind}: {name}"), middle);
            self.put(format!("{kind}: {name}, sd"), Transform::Log(0.003).of(spread));
        }
    }
}

/// Returns the number of pairs within a distance, and the expected number for random positions.
fn pairs(places: &[[f64; 2]], image: &FieldImage, within_px: f64) -> [f64; 2] {
    let near = |a: &[f64; 2], b: &[f64; 2]| {
        let [x, y] = [a[0] - b[0], a[1] - b[1]];
        x * x + y * y <= within_px * within_px
    };
    let found: usize =
        places.iter().enumerate().map(|(i, a)| places[i + 1..].iter().filter(|b| near(a, b)).count()).sum();
    let n = places.len() as f64;
    let part = std::f64::consts::PI * within_px * within_px / image.grey.len() as f64;
    [found as f64, 0.5 * n * (n - 1.0) * part]
}

/// Fraction of the field that its darkest parts cover.
const DARKEST: f64 = 0.0005;

/// Returns the absorbance that the darkest parts of a field exceed, at most that of the last bin of the histogram.
fn darkest(histogram: &[f64]) -> f64 {
    let mut darker = 0.0;
    for (bin, part) in histogram.iter().enumerate().rev() {
        darker += part;
        if darker >= DARKEST {
            // The darkest pixels of the bin belong to the darkest parts.
            let bins = bin as f64 + (darker - DARKEST) / part;
            return papsynth_judge::HISTOGRAM_FROM + papsynth_judge::HISTOGRAM_STEP * bins;
        }
    }
    f64::NAN
}

/// Returns the fraction of the histogram above an absorbance.
fn tail(histogram: &[f64], above: f64) -> f64 {
    let from = whole((above - papsynth_judge::HISTOGRAM_FROM) / papsynth_judge::HISTOGRAM_STEP + 0.5);
    histogram.iter().skip(from).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_darkest_parts_are_the_upper_end_of_the_histogram() {
        let mut histogram = vec![0.0; 60];
        (histogram[0], histogram[20], histogram[30]) = (0.9, 0.0999, 0.0001);
        // 0.0004 of the 0.0999 in bin 20.
        let wanted = -0.05 + 0.02 * (21.0 - 0.0004 / 0.0999);
        assert!((darkest(&histogram) - wanted).abs() < 1e-9);
        (histogram[0], histogram[59]) = (0.0, 0.9);
        assert!((1.149..1.15).contains(&darkest(&histogram)));
        assert!(darkest(&[f64::NAN; 60]).is_nan() && darkest(&[]).is_nan());
    }
}

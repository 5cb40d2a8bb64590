//! Statistics of windows for the regressions.

use papsynth_judge::number::{single, whole};
use papsynth_judge::{Control, FeatureTable, Field, FieldImage, Statistics};
use rayon::prelude::*;

use crate::error::Error;
use crate::noise;
use crate::view::WindowSampler;
use portable_numerics::statistics::{deviation, mean, quantile};

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

/// Features of nuclei with separate standard deviations within windows and between windows.
const NUCLEI_APART: [Feature; 5] = [
    ("core above surroundings", Transform::Log(0.02)),
    ("core sd over contrast", Transform::Log(0.01)),
    ("core sd without trend", Transform::Log(0.002)),
    ("rim sigma, px", Transform::Log(0.0)),
    ("absorbance beside", Transform::Log(0.01)),
];

/// Features of free cells with separate standard deviations.
const CELLS_APART: [Feature; 2] =
    [("cytoplasm absorbance", Transform::Log(0.005)), ("cell area, um2", Transform::Log(0.0))];

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

/// Measurements of a window.
#[derive(Debug, Clone)]
pub(crate) struct Window {
    /// Statistics of the complete window.
    whole: Vec<(String, f64)>,
    nuclei: FeatureTable,
    cells: FeatureTable,
    /// Pairs of nuclei within each of [`PAIRS_UM`], and the expected number for random positions.
    pairs: [[f64; 2]; PAIRS_UM.len()],
}

/// Returns the scalars of the statistics of a window.
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

/// Statistics of the complete window with a standard deviation between windows.
const WITH_SD: [&str; 13] = [
    "log noise",
    "log coverage",
    "log absorbance of what is covered",
    "log range of absorbance of what is covered",
    "log edge sigma p10",
    "log edge sigma p50",
    "log nuclei",
    "log power, ring 4",
    "log power, ring 9",
    "log power, ring 11",
    "fraction above 0.15",
    "fraction above 0.41",
    "log fraction of overlaps",
];

impl Window {
    pub(crate) fn new(image: &FieldImage, view: &WindowSampler, control: &Control) -> Result<Self, Error> {
        let Field { statistics: s, nuclei, cells, .. } = view.measurer.measure_with(image, control)?;
        control.check()?;
        let (grey, width) = (&image.grey, image.width);
        let empty = s.background_dn * f64::from(image.full_scale) / crate::recipe::LEVELS;
        let [fine, coarse] = noise::unevenness(grey, width, empty);
        let named = |(name, value): (&str, f64)| (name.to_owned(), value);
        let mut whole: Vec<(String, f64)> = scalars(&s).into_iter().map(named).collect();
        whole.extend(s.spectrum.iter().enumerate().map(|(i, power)| (format!("log power, ring {i}"), *power)));
        whole.extend(TAILS.map(|a| (format!("fraction above {a}"), Transform::Log(0.002).of(tail(&s.histogram, a)))));
        let dark = (1..).zip(noise::noise_by_darkness(grey, width, empty));
        whole.extend(dark.map(|(i, noise)| (format!("noise in the dark, bin {i}"), noise)));
        whole.push(("unevenness of the light, finely".to_owned(), fine));
        whole.push(("unevenness of the light, coarsely".to_owned(), coarse));
        control.check()?;
        whole.extend(noise::counts(grey, width, single(empty)));
        let pairs = PAIRS_UM.map(|um| pairs(&nuclei.places, image, um / view.pixel_um));
        Ok(Self { whole, nuclei, cells, pairs })
    }

    /// Measures several images in parallel.
    pub(crate) fn all(images: &[FieldImage], view: &WindowSampler, control: &Control) -> Result<Vec<Self>, Error> {
        let phase = control.phase("measuring windows", images.len());
        let one = |image: &FieldImage| -> Result<Self, Error> {
            let window = Self::new(image, view, control)?;
            phase.step()?;
            Ok(window)
        };
        images.par_iter().map(one).collect::<Vec<_>>().into_iter().collect()
    }

    pub(crate) fn nuclei(&self) -> usize {
        self.nuclei.len()
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

/// Returns the fraction of the histogram above an absorbance.
fn tail(histogram: &[f64], above: f64) -> f64 {
    let from = whole((above - papsynth_judge::HISTOGRAM_FROM) / papsynth_judge::HISTOGRAM_STEP + 0.5);
    histogram.iter().skip(from).sum()
}

/// Statistics of several windows of one microscope; NaN if unknown.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// Names of the statistics.
    pub names: Vec<String>,
    /// Values of the statistics.
    pub values: Vec<f64>,
}

impl Summary {
    /// Measures windows of fields.
    ///
    /// # Errors
    /// If an image is invalid.
    pub fn of(images: &[FieldImage], view: &WindowSampler) -> Result<Self, Error> {
        Ok(Self::new(&Window::all(images, view, &Control::NONE)?))
    }

    pub(crate) fn new(windows: &[Window]) -> Self {
        let mut all = Self { names: Vec::new(), values: Vec::new() };
        for (i, (name, _)) in windows.first().into_iter().flat_map(|w| &w.whole).enumerate() {
            let known: Vec<f64> = windows.iter().map(|w| w.whole[i].1).filter(|v| v.is_finite()).collect();
            all.put(name.clone(), mean(&known));
            if WITH_SD.contains(&name.as_str()) {
                all.put(format!("{name}, sd"), Transform::Log(0.01).of(deviation(&known)));
            }
        }
        let nuclei: Vec<&FeatureTable> = windows.iter().map(|w| &w.nuclei).collect();
        all.put_objects("nuclei", &nuclei, &NUCLEI, &NUCLEI_APART);
        for (i, um) in PAIRS_UM.iter().enumerate() {
            let [found, expected] = [0, 1].map(|k| windows.iter().map(|w| w.pairs[i][k]).sum::<f64>());
            all.put(format!("pairs of nuclei within {um} um"), libm::log((found + 1.0) / (expected + 1.0)));
        }
        let cells: Vec<&FeatureTable> = windows.iter().map(|w| &w.cells).collect();
        all.put_objects("cells", &cells, &CELLS, &CELLS_APART);
        all
    }

    fn put(&mut self, name: String, value: f64) {
        self.names.push(name);
        self.values.push(value);
    }

    /// Adds features of objects of one kind: over all windows, and within and between windows.
    fn put_objects(&mut self, kind: &str, tables: &[&FeatureTable], features: &[Feature], separate: &[Feature]) {
        for (name, scale) in features {
            let [middle, spread] = pooled(tables, name, *scale);
            self.put(format!("{kind}: {name}"), middle);
            self.put(format!("{kind}: {name}, sd"), Transform::Log(0.003).of(spread));
        }
        for (name, scale) in separate {
            let [within, between] = apart(tables, name, *scale);
            self.put(format!("{kind}: {name}, within windows"), Transform::Log(0.01).of(within));
            self.put(format!("{kind}: {name}, between windows"), Transform::Log(0.02).of(between));
        }
    }
}

/// Returns median and robust standard deviation (0.741 times the interquartile range) of a feature over all tables.
fn pooled(tables: &[&FeatureTable], name: &str, scale: Transform) -> [f64; 2] {
    let mut values: Vec<f64> = tables.iter().flat_map(|t| t.column(name)).map(|v| scale.of(v)).collect();
    if values.len() < LEAST {
        return [f64::NAN; 2];
    }
    let [low, middle, high] = [0.25, 0.5, 0.75].map(|q| quantile(&mut values, q));
    [middle, 0.741 * (high - low)]
}

/// Returns the standard deviation within tables, and that between their means, corrected for the variation within.
fn apart(tables: &[&FeatureTable], name: &str, scale: Transform) -> [f64; 2] {
    let known = tables.iter().map(|t| t.column(name).map(|v| scale.of(v)).collect::<Vec<f64>>());
    let groups: Vec<Vec<f64>> = known.filter(|v| v.len() >= 2).collect();
    if groups.is_empty() {
        return [f64::NAN; 2];
    }
    let rest: f64 = groups.iter().map(|g| deviation(g) * deviation(g) * (g.len() - 1) as f64).sum();
    let freedom: f64 = groups.iter().map(|g| (g.len() - 1) as f64).sum();
    let variance = rest / freedom;
    if groups.len() < 3 {
        return [variance.sqrt(), f64::NAN];
    }
    let means: Vec<f64> = groups.iter().map(|g| mean(g)).collect();
    let chance: Vec<f64> = groups.iter().map(|g| variance / g.len() as f64).collect();
    [variance.sqrt(), (deviation(&means) * deviation(&means) - mean(&chance)).max(0.0).sqrt()]
}

//! What windows are like, in numbers that regressions learn from.

use papsynth_judge::number::{single, whole};
use papsynth_judge::{Control, FeatureTable, Field, FieldImage, Statistics};
use rayon::prelude::*;

use crate::error::Error;
use crate::noise;
use crate::view::WindowSampler;
use portable_numerics::statistics::{deviation, mean, quantile};

/// How a number enters.
#[derive(Clone, Copy)]
enum Transform {
    Itself,
    /// The logarithm of it and so much.
    Log(f64),
}

impl Transform {
    fn of(self, value: f64) -> f64 {
        match self {
            Self::Itself => value,
            // What is unknown stays so.
            Self::Log(more) => libm::log((value + more).clamp(1e-9, f64::MAX)),
        }
    }
}

/// A feature of a table and how it enters.
type Feature = (&'static str, Transform);

/// Features of nuclei that are looked at.
const NUCLEI: [Feature; 25] = [
    ("nucleus area, um2", Transform::Log(0.0)),
    ("core absorbance", Transform::Itself),
    ("core above surroundings", Transform::Itself),
    ("absorbance beside", Transform::Itself),
    ("spread beside", Transform::Log(0.005)),
    ("core sd", Transform::Log(0.002)),
    ("core sd without trend", Transform::Log(0.002)),
    ("core sd over contrast", Transform::Log(0.01)),
    ("core slope", Transform::Log(0.002)),
    ("core slope over sd", Transform::Itself),
    ("rim to centre, bin 1 of 5", Transform::Itself),
    ("rim to centre, bin 2 of 5", Transform::Itself),
    ("rim to centre, bin 3 of 5", Transform::Itself),
    ("rim to centre, bin 5 of 5", Transform::Itself),
    ("rim sigma, px", Transform::Log(0.0)),
    ("darkest depth over core", Transform::Itself),
    ("rim slope over contrast", Transform::Itself),
    ("core correlation at 1 px", Transform::Itself),
    ("core correlation at 2 px", Transform::Itself),
    ("core correlation at 4 px", Transform::Itself),
    ("core power at 1 px", Transform::Log(0.001)),
    ("core power at 4 px", Transform::Log(0.001)),
    ("log moment 2", Transform::Itself),
    ("core skewness", Transform::Itself),
    ("nucleus eccentricity", Transform::Itself),
];

/// Features whose spread within windows and between them are told apart: where the field differs, all its nuclei do.
const NUCLEI_APART: [Feature; 5] = [
    ("core above surroundings", Transform::Log(0.02)),
    ("core sd over contrast", Transform::Log(0.01)),
    ("core sd without trend", Transform::Log(0.002)),
    ("rim sigma, px", Transform::Log(0.0)),
    ("absorbance beside", Transform::Log(0.01)),
];

/// The same of free cells.
const CELLS_APART: [Feature; 2] =
    [("cytoplasm absorbance", Transform::Log(0.005)), ("cell area, um2", Transform::Log(0.0))];

/// Distances within which pairs of nuclei are counted over all windows, µm.
const PAIRS_UM: [f64; 5] = [8.0, 16.0, 33.0, 66.0, 130.0];

/// Features of free cells.
const CELLS: [Feature; 13] = [
    ("cell area, um2", Transform::Log(0.0)),
    ("cytoplasm absorbance", Transform::Log(0.005)),
    ("cytoplasm sd over median", Transform::Log(0.02)),
    ("cytoplasm quantile 0.9 over median", Transform::Itself),
    ("cytoplasm power at 1 px over median", Transform::Log(0.002)),
    ("cytoplasm power at 2 px over median", Transform::Log(0.002)),
    ("cytoplasm power at 4 px over median", Transform::Log(0.002)),
    ("cytoplasm power at 8 px over median", Transform::Log(0.002)),
    ("cytoplasm slope over median", Transform::Log(0.002)),
    ("dark spots in cytoplasm, um-2", Transform::Itself),
    ("sigma of the cell's rim, px, quantile 0.25", Transform::Log(0.2)),
    ("nucleus over cell area", Transform::Log(0.001)),
    ("cell circularity", Transform::Itself),
];

/// Parts of a window darker than these.
const TAILS: [f64; 8] = [0.05, 0.09, 0.15, 0.21, 0.31, 0.41, 0.61, 0.81];

/// Fewest nuclei, or cells, that have a middle.
const LEAST: usize = 4;

/// What is measured in a window.
#[derive(Debug, Clone)]
pub(crate) struct Window {
    /// Numbers of the window as a whole.
    whole: Vec<(String, f64)>,
    nuclei: FeatureTable,
    cells: FeatureTable,
    /// Pairs of nuclei within each of [`PAIRS_UM`], and how many as many nuclei thrown at random would make.
    pairs: [[f64; 2]; PAIRS_UM.len()],
}

/// Numbers of the statistics of a window.
fn scalars(s: &Statistics) -> Vec<(&'static str, f64)> {
    let ripley = s.ripley.map(|k| Transform::Log(0.1).of(k));
    vec![
        ("log noise", Transform::Log(0.0).of(s.noise_dn)),
        ("noise correlation across", s.noise_across),
        ("noise correlation down", s.noise_down),
        ("noise correlation diagonally", s.noise_diagonal),
        ("log coverage", Transform::Log(0.01).of(s.coverage)),
        ("log absorbance of what is covered", Transform::Log(0.005).of(s.covered_a)),
        ("log range of it", Transform::Log(0.0).of(s.covered_range)),
        ("log part of it in layers", Transform::Log(0.02).of(s.layered)),
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

/// Those of a window as a whole whose deviation between windows is looked at too.
const SPREAD: [&str; 13] = [
    "log noise",
    "log coverage",
    "log absorbance of what is covered",
    "log range of it",
    "log edge sigma p10",
    "log edge sigma p50",
    "log nuclei",
    "log power, ring 4",
    "log power, ring 9",
    "log power, ring 11",
    "part above 0.15",
    "part above 0.41",
    "log part of it in layers",
];

impl Window {
    pub(crate) fn new(picture: &FieldImage, view: &WindowSampler, control: &Control) -> Result<Self, Error> {
        let Field { statistics: s, nuclei, cells, .. } = view.measurer.measure_with(picture, control)?;
        control.check()?;
        let (grey, width) = (&picture.grey, picture.width);
        let empty = s.background_dn * f64::from(picture.full_scale) / crate::recipe::LEVELS;
        let [fine, coarse] = noise::unevenness(grey, width, empty);
        let named = |(name, value): (&str, f64)| (name.to_owned(), value);
        let mut whole: Vec<(String, f64)> = scalars(&s).into_iter().map(named).collect();
        whole.extend(s.spectrum.iter().enumerate().map(|(i, power)| (format!("log power, ring {i}"), *power)));
        whole.extend(TAILS.map(|a| (format!("part above {a}"), Transform::Log(0.002).of(tail(&s.histogram, a)))));
        let law = (1..).zip(noise::law(grey, width, empty));
        whole.extend(law.map(|(i, noise)| (format!("noise in the dark, bin {i}"), noise)));
        whole.push(("unevenness of the light, finely".to_owned(), fine));
        whole.push(("unevenness of the light, coarsely".to_owned(), coarse));
        control.check()?;
        whole.extend(noise::counts(grey, width, single(empty)));
        let pairs = PAIRS_UM.map(|um| pairs(&nuclei.places, picture, um / view.pixel_um));
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

/// How many pairs of places are within a distance, and how many are to be expected.
fn pairs(places: &[[f64; 2]], picture: &FieldImage, within_px: f64) -> [f64; 2] {
    let near = |a: &[f64; 2], b: &[f64; 2]| {
        let [x, y] = [a[0] - b[0], a[1] - b[1]];
        x * x + y * y <= within_px * within_px
    };
    let found: usize =
        places.iter().enumerate().map(|(i, a)| places[i + 1..].iter().filter(|b| near(a, b)).count()).sum();
    let n = places.len() as f64;
    let part = std::f64::consts::PI * within_px * within_px / picture.grey.len() as f64;
    [found as f64, 0.5 * n * (n - 1.0) * part]
}

/// Part of the histogram above an absorbance.
fn tail(histogram: &[f64], above: f64) -> f64 {
    let from = whole((above - papsynth_judge::HISTOGRAM_FROM) / papsynth_judge::HISTOGRAM_STEP + 0.5);
    histogram.iter().skip(from).sum()
}

/// What several windows of one microscope are like: named numbers, NaN where there is none.
#[derive(Debug, Clone, PartialEq)]
pub struct Summary {
    /// What they are.
    pub names: Vec<String>,
    /// The numbers.
    pub values: Vec<f64>,
}

impl Summary {
    /// Of windows of fields.
    ///
    /// # Errors
    /// If a picture is none.
    pub fn of(images: &[FieldImage], view: &WindowSampler) -> Result<Self, Error> {
        Ok(Self::new(&Window::all(images, view, &Control::NONE)?))
    }

    pub(crate) fn new(windows: &[Window]) -> Self {
        let mut all = Self { names: Vec::new(), values: Vec::new() };
        for (i, (name, _)) in windows.first().into_iter().flat_map(|w| &w.whole).enumerate() {
            let known: Vec<f64> = windows.iter().map(|w| w.whole[i].1).filter(|v| v.is_finite()).collect();
            all.put(name.clone(), mean(&known));
            if SPREAD.contains(&name.as_str()) {
                all.put(format!("{name}, sd"), Transform::Log(0.01).of(deviation(&known)));
            }
        }
        let nuclei: Vec<&FeatureTable> = windows.iter().map(|w| &w.nuclei).collect();
        all.put_things("nuclei", &nuclei, &NUCLEI, &NUCLEI_APART);
        for (i, um) in PAIRS_UM.iter().enumerate() {
            let [found, expected] = [0, 1].map(|k| windows.iter().map(|w| w.pairs[i][k]).sum::<f64>());
            all.put(format!("pairs of nuclei within {um} um"), libm::log((found + 1.0) / (expected + 1.0)));
        }
        let cells: Vec<&FeatureTable> = windows.iter().map(|w| &w.cells).collect();
        all.put_things("cells", &cells, &CELLS, &CELLS_APART);
        all
    }

    fn put(&mut self, name: String, value: f64) {
        self.names.push(name);
        self.values.push(value);
    }

    /// Features of things of one kind: over all windows, and within windows and between them.
    fn put_things(&mut self, kind: &str, tables: &[&FeatureTable], features: &[Feature], told_apart: &[Feature]) {
        for (name, scale) in features {
            let [middle, spread] = pooled(tables, name, *scale);
            self.put(format!("{kind}: {name}"), middle);
            self.put(format!("{kind}: {name}, spread"), Transform::Log(0.003).of(spread));
        }
        for (name, scale) in told_apart {
            let [within, between] = apart(tables, name, *scale);
            self.put(format!("{kind}: {name}, within windows"), Transform::Log(0.01).of(within));
            self.put(format!("{kind}: {name}, between windows"), Transform::Log(0.02).of(between));
        }
    }
}

/// Middle and spread (three quarters of the distance between quartiles) of a feature over all tables.
fn pooled(tables: &[&FeatureTable], name: &str, scale: Transform) -> [f64; 2] {
    let mut values: Vec<f64> = tables.iter().flat_map(|t| t.column(name)).map(|v| scale.of(v)).collect();
    if values.len() < LEAST {
        return [f64::NAN; 2];
    }
    let [low, middle, high] = [0.25, 0.5, 0.75].map(|q| quantile(&mut values, q));
    [middle, 0.741 * (high - low)]
}

/// Standard deviation within tables, and that of their means without what the former makes of it.
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

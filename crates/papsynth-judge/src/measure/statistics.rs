//! What a field is like as a whole.

use serde::{Deserialize, Serialize};

use super::cell::{COVERED, Cell, PROFILE};
use super::layout::{clark_evans, ripley};
use super::maps::Maps;
use super::noise::{BLOCK, Noise};
use super::spectrum::{RINGS, rings, slope};
use crate::number::{nearest, whole};
use crate::region::Region;
use crate::statistics::{median, of_sorted};

/// Radii at which Ripley's K is taken, µm: 50, 100, 200 and 300 pixels of 0.33 µm.
pub const RADII_UM: [f64; 4] = [16.5, 33.0, 66.0, 99.0];

/// Bins of the histogram of absorbance.
pub const HISTOGRAM: usize = 60;

/// Lower end of its first bin; what is below counts there.
pub const HISTOGRAM_FROM: f64 = -0.05;

/// Width of a bin, absorbance; what is beyond the last counts there.
pub const HISTOGRAM_STEP: f64 = 0.02;

/// A place is covered twice and more when it is so many times as dark as the middle of what is covered.
const TWICE: f64 = 1.6;

/// Blocks of empty slide nowhere differ by more from the background, absorbance after a Gaussian of 1 pixel.
const EMPTY: f32 = 0.02;

/// What a field is like as a whole; NaN where it cannot be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Light of the empty slide, levels of 8 bits, mean over the field.
    #[serde(deserialize_with = "number")]
    pub background_dn: f64,
    /// Its highest less its lowest, over its mean.
    #[serde(deserialize_with = "number")]
    pub background_valley: f64,
    /// Its curvature across, x from −1 to 1, over its value in the middle: level × (1 + x²·this).
    #[serde(deserialize_with = "number")]
    pub background_x2: f64,
    /// Its curvature down.
    #[serde(deserialize_with = "number")]
    pub background_y2: f64,
    /// Standard deviation of noise on empty slide, levels of 8 bits.
    #[serde(deserialize_with = "number")]
    pub noise_dn: f64,
    /// Correlation of noise with that of the pixel to the right.
    #[serde(deserialize_with = "number")]
    pub noise_across: f64,
    /// With that of the pixel below.
    #[serde(deserialize_with = "number")]
    pub noise_down: f64,
    /// With that of the pixel to the right and below.
    #[serde(deserialize_with = "number")]
    pub noise_diagonal: f64,
    /// Part of the field that is covered by anything.
    #[serde(deserialize_with = "number")]
    pub coverage: f64,
    /// Median absorbance of what is covered, nuclei left out.
    #[serde(deserialize_with = "number")]
    pub covered_a: f64,
    /// Its 90th over its 10th percentile.
    #[serde(deserialize_with = "number")]
    pub covered_range: f64,
    /// Part of what is covered, nuclei left out, that is more than 1.6 times as dark as its median: flaps and overlaps.
    #[serde(deserialize_with = "number")]
    pub layered: f64,
    /// Exponent of the power of absorbance against frequency.
    #[serde(deserialize_with = "number")]
    pub spectrum_slope: f64,
    /// 10th percentile of the blur of edges, pixels.
    #[serde(deserialize_with = "number")]
    pub edge_sigma_p10: f64,
    /// Median of it.
    #[serde(deserialize_with = "number")]
    pub edge_sigma_p50: f64,
    /// Nuclei a square millimetre.
    #[serde(deserialize_with = "number")]
    pub nuclei_mm2: f64,
    /// Distance to the nearest neighbour over that of points at random.
    #[serde(deserialize_with = "number")]
    pub clark_evans: f64,
    /// Ripley's K over that of points at random, at [`RADII_UM`].
    #[serde(deserialize_with = "numbers")]
    pub ripley: [f64; 4],
    /// Median area of nuclei, µm².
    #[serde(deserialize_with = "number")]
    pub nucleus_um2: f64,
    /// Free cells with one nucleus.
    pub cells: usize,
    /// Their median area, µm².
    #[serde(deserialize_with = "number")]
    pub cell_um2: f64,
    /// Median circularity of free cells.
    #[serde(deserialize_with = "number")]
    pub circularity: f64,
    /// Median solidity of them.
    #[serde(deserialize_with = "number")]
    pub solidity: f64,
    /// Mean number of corners of them.
    #[serde(deserialize_with = "number")]
    pub corners: f64,
    /// Median part of their outline that is straight.
    #[serde(deserialize_with = "number")]
    pub straight: f64,
    /// Median over free cells of their absorbance in ten bins from rim to centre, over each cell's median.
    #[serde(deserialize_with = "numbers")]
    pub profile: [f64; PROFILE],
    /// Parts of the field in bins of absorbance, from [`HISTOGRAM_FROM`] in steps of [`HISTOGRAM_STEP`].
    pub histogram: Vec<f64>,
    /// Logarithm to base 10 of the power of absorbance in rings of [`frequencies`](super::frequencies).
    #[serde(deserialize_with = "numbers")]
    pub spectrum: [f64; RINGS],
}

/// A statistic's name and value.
pub type Named = (&'static str, f64);

impl Statistics {
    /// All single numbers, by name.
    #[must_use]
    pub fn scalars(&self) -> Vec<Named> {
        let mut all = vec![
            ("background, dn", self.background_dn),
            ("background, peak to valley", self.background_valley),
            ("background, curvature across", self.background_x2),
            ("background, curvature down", self.background_y2),
            ("noise, dn", self.noise_dn),
            ("noise correlation across", self.noise_across),
            ("noise correlation down", self.noise_down),
            ("noise correlation diagonally", self.noise_diagonal),
            ("coverage", self.coverage),
            ("absorbance of what is covered", self.covered_a),
            ("its 90th over its 10th percentile", self.covered_range),
            ("part of it in layers", self.layered),
            ("slope of the spectrum", self.spectrum_slope),
            ("edge sigma p10, px", self.edge_sigma_p10),
            ("edge sigma p50, px", self.edge_sigma_p50),
            ("nuclei a mm2", self.nuclei_mm2),
            ("Clark-Evans", self.clark_evans),
        ];
        let radii = [
            "K over Poisson at 16.5 um",
            "K over Poisson at 33 um",
            "K over Poisson at 66 um",
            "K over Poisson at 99 um",
        ];
        all.extend(radii.into_iter().zip(self.ripley));
        all.extend([
            ("area of nuclei, um2", self.nucleus_um2),
            ("area of free cells, um2", self.cell_um2),
            ("circularity of free cells", self.circularity),
            ("solidity of free cells", self.solidity),
            ("corners of free cells", self.corners),
            ("straight part of their outline", self.straight),
        ]);
        all
    }

    pub(super) fn new(maps: &Maps, nuclei: &[Region], cells: &[Cell], pixel_um: f64) -> Self {
        let pixels = maps.absorbance.len() as f64;
        let noise = empty_noise(maps);
        let noise_of = |f: &dyn Fn(&Noise) -> f64| noise.as_ref().map_or(f64::NAN, f);
        let mut inside = vec![false; maps.absorbance.len()];
        nuclei.iter().flat_map(|n| &n.pixels).for_each(|p| inside[*p as usize] = true);
        let covered = maps.smooth.iter().filter(|a| **a > COVERED).count() as f64;
        let mut cytoplasm: Vec<f64> = maps
            .smooth
            .iter()
            .zip(&inside)
            .filter(|(a, i)| **a > COVERED && !**i)
            .map(|(a, _)| f64::from(*a))
            .collect();
        cytoplasm.sort_unstable_by(f64::total_cmp);
        let middle = of_sorted(&cytoplasm, 0.5);
        let layered = cytoplasm.iter().filter(|a| **a > TWICE * middle).count() as f64 / cytoplasm.len() as f64;
        let mut sigmas: Vec<f64> = maps.edges.iter().map(|e| e.sigma).collect();
        sigmas.sort_unstable_by(f64::total_cmp);
        let sharp = |q: f64| if sigmas.len() < super::edges::LEAST { f64::NAN } else { of_sorted(&sigmas, q) };
        let centres: Vec<[f64; 2]> = nuclei.iter().map(|n| n.shape().centre).collect();
        let (width, height) = (maps.width as f64, maps.height as f64);
        let um2 = pixel_um * pixel_um;
        let spectrum = rings(&maps.absorbance, maps.width);
        let of_cells = |f: &dyn Fn(&Cell) -> f64| middle_of(cells.iter().map(f));
        let profiles: Vec<[f64; PROFILE]> = cells.iter().map(|c| c.profile(maps)).collect();
        let [level, _, _, x2, _, y2] = maps.background.surface.0;
        Self {
            background_dn: 255.0 * maps.background.mean(),
            background_valley: maps.background.peak_to_valley(),
            background_x2: x2 / level,
            background_y2: y2 / level,
            noise_dn: noise_of(&|n| n.variance.sqrt()),
            noise_across: noise_of(&|n| n.correlation(0)),
            noise_down: noise_of(&|n| n.correlation(1)),
            noise_diagonal: noise_of(&|n| n.correlation(2)),
            coverage: covered / pixels,
            covered_a: if cytoplasm.is_empty() { f64::NAN } else { middle },
            covered_range: of_sorted(&cytoplasm, 0.9) / of_sorted(&cytoplasm, 0.1),
            layered,
            spectrum_slope: slope(&spectrum),
            edge_sigma_p10: sharp(0.1),
            edge_sigma_p50: sharp(0.5),
            nuclei_mm2: nuclei.len() as f64 / (pixels * um2) * 1e6,
            clark_evans: clark_evans(&centres, width, height),
            ripley: RADII_UM.map(|r| ripley(&centres, width, height, r / pixel_um)),
            nucleus_um2: middle_of(nuclei.iter().map(|n| n.pixels.len() as f64 * um2)),
            cells: cells.len(),
            cell_um2: of_cells(&|c| c.shape.area * um2),
            circularity: of_cells(&|c| c.shape.circularity),
            solidity: of_cells(&|c| c.shape.solidity),
            corners: cells.iter().map(|c| c.outline().corners).sum::<f64>() / cells.len() as f64,
            straight: of_cells(&|c| c.outline().straight),
            profile: std::array::from_fn(|i| middle_of(profiles.iter().map(|p| p[i]))),
            histogram: histogram(&maps.absorbance),
            spectrum,
        }
    }
}

/// The median of what is known; NaN of nothing.
fn middle_of(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    if values.is_empty() { f64::NAN } else { median(&mut values) }
}

fn histogram(absorbance: &[f32]) -> Vec<f64> {
    let mut counts = vec![0.0; HISTOGRAM];
    for a in absorbance {
        counts[whole((f64::from(*a) - HISTOGRAM_FROM) / HISTOGRAM_STEP).min(HISTOGRAM - 1)] += 1.0;
    }
    counts.iter().map(|c| c / absorbance.len() as f64).collect()
}

/// Noise of the empty slide, or of the flattest thirtieth of the field where nothing is empty.
fn empty_noise(maps: &Maps) -> Option<Noise> {
    const LEAST: usize = 8;
    const FLATTEST: f64 = 1.0 / 30.0;
    let along = |length: usize| (0..=length - BLOCK).step_by(BLOCK);
    let places: Vec<(usize, usize)> = along(maps.height).flat_map(|y| along(maps.width).map(move |x| (x, y))).collect();
    let empty = |(x, y): &&(usize, usize)| {
        (*y..y + BLOCK).all(|y| maps.smooth[y * maps.width + x..][..BLOCK].iter().all(|a| a.abs() < EMPTY))
    };
    let noise = |(x, y): &(usize, usize)| Noise::of(&maps.grey, maps.width, *x, *y);
    let mut blocks: Vec<Noise> = places.iter().filter(empty).map(noise).collect();
    if blocks.len() < LEAST {
        blocks = places.iter().map(noise).collect();
        blocks.sort_by(|a, b| a.variance.total_cmp(&b.variance));
        blocks.truncate(nearest(FLATTEST * places.len() as f64).max(1));
    }
    Noise::mean(&mut blocks)
}

/// JSON has no NaN: it is written as null.
fn number<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Option::<f64>::deserialize(from).map(|v| v.unwrap_or(f64::NAN))
}

fn numbers<'de, D: serde::Deserializer<'de>, const N: usize>(from: D) -> Result<[f64; N], D::Error> {
    let values = Vec::<Option<f64>>::deserialize(from)?;
    let values: Vec<f64> = values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect();
    let count = values.len();
    values.try_into().map_err(|_| serde::de::Error::invalid_length(count, &"as many numbers as were written"))
}

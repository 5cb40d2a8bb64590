//! Measurements of field images.

mod bare_cytoplasm;
mod cell;
mod cytoplasm;
mod maps;
mod noise;
mod nucleus;
mod patch;
mod statistics;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::control::Control;
use crate::error::Error;
use crate::image::{FieldImage, NucleiAnnotation};
use crate::nuclei::{NucleiParams, nuclei};
use crate::number::nearest;
use crate::region::Region;
use crate::table::FeatureTable;
use maps::Maps;

pub use bare_cytoplasm::BareCytoplasm;
pub use cell::PROFILE;
pub use cytoplasm::{NAMES as CYTOPLASM_NAMES, TEXTURE};
pub(crate) use patch::PATCH_PX;
pub use statistics::{
    HISTOGRAM, HISTOGRAM_FROM, HISTOGRAM_STEP, Named, RADII_UM, Statistics, clark_evans, frequencies, ripley,
};

/// Source of the nuclei, the same for both sides of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum NucleiFrom {
    /// Segmentation of the image.
    #[default]
    Search,
    /// Segmentation of the darkest compact object around each annotated point, or around the centre of each mask.
    Points,
    /// Annotated masks.
    Masks,
}

impl NucleiFrom {
    /// All sources, from the least to the most annotation.
    pub const ALL: [Self; 3] = [Self::Search, Self::Points, Self::Masks];

    /// Returns the name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Search => "search",
            Self::Points => "points",
            Self::Masks => "masks",
        }
    }

    /// Returns the source that uses an annotation best.
    #[must_use]
    pub fn of(annotation: &NucleiAnnotation) -> Self {
        match annotation {
            NucleiAnnotation::None => Self::Search,
            NucleiAnnotation::Points(_) => Self::Points,
            NucleiAnnotation::Masks(_) => Self::Masks,
        }
    }
}

/// Extent of the measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// Field statistics, nuclei and free cells.
    Statistics,
    /// Also patches, which doubles the time, and a copy of the image for reports.
    #[default]
    Everything,
}

/// Parameters of the measurements, the same for both sides of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MeasurerParams {
    /// Pixel size in the object plane, µm, 0.02 to 10. Default 0.33, for a 20x objective.
    pub pixel_um: f64,
    /// Source of the nuclei. Default: segmentation.
    pub nuclei_from: NucleiFrom,
    /// Parameters of the segmentation of nuclei.
    pub nuclei: NucleiParams,
    /// Extent of the measurements. Default: everything.
    pub detail: Detail,
}

impl Default for MeasurerParams {
    fn default() -> Self {
        let (nuclei_from, detail) = (NucleiFrom::default(), Detail::default());
        Self { pixel_um: 0.33, nuclei_from, nuclei: NucleiParams::default(), detail }
    }
}

/// Measures field images with one set of parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurer {
    params: MeasurerParams,
}

/// Measurements of an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Name of the image.
    pub name: String,
    /// Group of the image.
    pub group: String,
    /// Columns, without black borders.
    pub width: usize,
    /// Rows, without black borders.
    pub height: usize,
    /// Statistics of the complete field.
    pub statistics: Statistics,
    /// Nuclei that do not touch the border.
    pub nuclei: FeatureTable,
    /// Free cells with one nucleus.
    pub cells: FeatureTable,
    /// Patches of 200 x 200 pixels; none with [`Detail::Statistics`].
    pub patches: FeatureTable,
    /// The image in 8 bits, for reports; empty with [`Detail::Statistics`].
    pub(crate) thumbnail: Vec<u8>,
    /// Hash of the grey levels: equal for equal images.
    pub(crate) fingerprint: u64,
    pub(crate) params: MeasurerParams,
}

impl Measurer {
    /// Checks the parameters.
    ///
    /// # Errors
    /// If a parameter is out of range.
    pub fn new(params: &MeasurerParams) -> Result<Self, Error> {
        let n = &params.nuclei;
        Error::check(&[
            ("pixel_um", params.pixel_um, [0.02, 10.0], "0.02 to 10 um"),
            ("nuclei.smallest_um2", n.smallest_um2, [1.0, 1e4], "1 to 10000 um2"),
            ("nuclei.largest_um2", n.largest_um2, [n.smallest_um2, 1e5], "nuclei.smallest_um2 to 100000 um2"),
            ("nuclei.least_ellipse", n.least_ellipse, [0.0, 1.0], "0 to 1"),
            ("nuclei.least_solidity", n.least_solidity, [0.0, 1.0], "0 to 1"),
            ("nuclei.least_contrast", n.least_contrast, [0.0, 3.0], "0 to 3"),
            ("nuclei.least_steepness", n.least_steepness, [0.0, 100.0], "0 to 100"),
        ])?;
        Ok(Self { params: params.clone() })
    }

    /// Measures an image.
    ///
    /// # Errors
    /// If the image is too small or constant, or has grey levels outside its scale.
    pub fn measure(&self, image: &FieldImage) -> Result<Field, Error> {
        self.measure_with(image, &Control::NONE)
    }

    /// As [`measure`](Self::measure), with a stop flag. It reports no progress.
    ///
    /// # Errors
    /// As `measure`; [`Error::Stopped`] if the stop flag is set.
    pub fn measure_with(&self, image: &FieldImage, control: &Control) -> Result<Field, Error> {
        control.check()?;
        image.check()?;
        let image = image.trimmed();
        // The trimmed image may be too small.
        image.check()?;
        let pixel_um = self.params.pixel_um;
        let maps = Maps::new(&image);
        control.check()?;
        let regions = self.nuclei(&maps, &image.nuclei);
        control.check()?;
        let ids = ids(&maps, &regions);
        let cells = cell::cells(&maps, &ids, &regions, pixel_um);
        let free = regions.iter().filter(|r| !r.at_border());
        let of_nuclei = free.map(|r| {
            control.check()?;
            Ok((nucleus::features(&maps, r, &ids, pixel_um), r.shape().centre))
        });
        let of_nuclei = of_nuclei.collect::<Result<_, Error>>()?;
        let of_cells = cells.iter().map(|cell| {
            control.check()?;
            Ok((cell.features(&maps, pixel_um), cell.shape.centre))
        });
        let of_cells = of_cells.collect::<Result<_, Error>>()?;
        let windows = cytoplasm::windows(&maps, &ids);
        let (patches, thumbnail) = match self.params.detail {
            Detail::Statistics => (FeatureTable::default(), Vec::new()),
            Detail::Everything => {
                let in_8_bits = maps.grey.iter().map(|g| u8::try_from(nearest(f64::from(*g))).unwrap_or(u8::MAX));
                (patch::patches(&maps, &windows, control)?, in_8_bits.collect())
            }
        };
        Ok(Field {
            name: image.name.clone(),
            group: image.group.clone(),
            width: maps.width,
            height: maps.height,
            statistics: Statistics::new(&maps, &ids, &regions, &cells, &windows, pixel_um),
            nuclei: of_nuclei,
            cells: of_cells,
            patches,
            thumbnail,
            fingerprint: fingerprint(&image),
            params: self.params.clone(),
        })
    }

    /// Returns the areas of an image that show the texture of cytoplasm alone.
    ///
    /// # Errors
    /// As [`measure`](Self::measure).
    pub fn bare_cytoplasm(&self, image: &FieldImage) -> Result<BareCytoplasm, Error> {
        image.check()?;
        let image = image.trimmed();
        image.check()?;
        let maps = Maps::new(&image);
        let regions = self.nuclei(&maps, &image.nuclei);
        let ids = ids(&maps, &regions);
        let noise_dn = statistics::empty_noise(&maps).map_or(f64::NAN, |noise| noise.variance.sqrt());
        let sigmas = crate::statistics::sorted(maps.edges.iter().map(|e| e.sigma));
        let blur_px = maps::width_at(&sigmas, 0.5);
        Ok(BareCytoplasm::new(maps, &ids, noise_dn, blur_px, self.params.pixel_um))
    }

    /// Measures several images in parallel. `read` returns the image of an item, so that not all images are in memory
    /// at once. The phase of the progress reports is "measuring fields".
    ///
    /// # Errors
    /// The first error of `read` or of [`measure_with`](Self::measure_with), in the order of the items.
    pub fn measure_all<T: Sync, E: From<Error> + Send>(
        &self,
        items: &[T],
        read: impl Fn(&T) -> Result<FieldImage, E> + Sync,
        control: &Control,
    ) -> Result<Vec<Field>, E> {
        let phase = control.phase("measuring fields", items.len());
        let measure = |item: &T| -> Result<Field, E> {
            control.check()?;
            let field = self.measure_with(&read(item)?, control)?;
            phase.step()?;
            Ok(field)
        };
        let fields: Vec<Result<Field, E>> = items.par_iter().map(measure).collect();
        fields.into_iter().collect()
    }

    fn nuclei(&self, maps: &Maps, annotation: &NucleiAnnotation) -> Vec<Region> {
        let search = |annotation: &NucleiAnnotation| {
            nuclei(&maps.absorbance, maps.width, self.params.pixel_um, annotation, &self.params.nuclei)
        };
        match (self.params.nuclei_from, annotation) {
            (NucleiFrom::Masks, NucleiAnnotation::Masks(_)) | (NucleiFrom::Points, NucleiAnnotation::Points(_)) => {
                search(annotation)
            }
            (NucleiFrom::Points, NucleiAnnotation::Masks(_)) => {
                search(&NucleiAnnotation::Points(search(annotation).iter().map(|r| r.shape().centre).collect()))
            }
            _ => search(&NucleiAnnotation::None),
        }
    }
}

/// Returns a hash of the grey levels (FNV-1a).
fn fingerprint(image: &FieldImage) -> u64 {
    let words = [image.width as u64].into_iter().chain(image.grey.iter().map(|g| u64::from(g.to_bits())));
    words.fold(0xcbf2_9ce4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
}

/// Returns the number of the region of each pixel, from 1; 0 outside all regions.
fn ids(maps: &Maps, regions: &[Region]) -> Vec<u32> {
    let mut ids = vec![0; maps.absorbance.len()];
    for (id, region) in (1..).zip(regions) {
        region.pixels.iter().for_each(|p| ids[*p as usize] = id);
    }
    ids
}

/// Returns the mean; NaN of no values.
fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(s, n), v| (s + v, n + 1));
    if count == 0 { f64::NAN } else { sum / count as f64 }
}

//! From a picture to numbers.

mod cell;
mod maps;
mod noise;
mod nucleus;
mod patch;
mod statistics;

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::nuclei::{NucleiParams, nuclei};
use crate::number::nearest;
use crate::picture::{Known, Picture};
use crate::region::Region;
use crate::table::Table;
use maps::Maps;

pub use cell::PROFILE;
pub(crate) use patch::PATCH_PX;
pub use statistics::{
    HISTOGRAM, HISTOGRAM_FROM, HISTOGRAM_STEP, Named, RADII_UM, Statistics, clark_evans, frequencies, ripley,
};

/// Which knowledge of nuclei is used: what both sides have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum NucleiFrom {
    /// Nothing: nuclei are found.
    #[default]
    Search,
    /// Points: the darkest compact thing around each. Where a picture brings masks, their centres are the points.
    Points,
    /// The masks that pictures bring.
    Masks,
}

impl NucleiFrom {
    /// All of them, from the least to the most that is known.
    pub const ALL: [Self; 3] = [Self::Search, Self::Points, Self::Masks];

    /// What it is called.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Search => "search",
            Self::Points => "points",
            Self::Masks => "masks",
        }
    }

    /// The most that a picture allows.
    #[must_use]
    pub fn of(known: &Known) -> Self {
        match known {
            Known::Nothing => Self::Search,
            Known::Points(_) => Self::Points,
            Known::Masks(_) => Self::Masks,
        }
    }
}

/// How much is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// The field as a whole, nuclei and free cells.
    Statistics,
    /// Patches too, which takes about twice as long, and a copy of the picture for reports.
    #[default]
    Everything,
}

/// How pictures are measured: both sides the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GaugeParams {
    /// Size of a pixel of every picture in the object, µm, 0.02 to 10. Default 0.33: that of a 20x objective.
    pub pixel_um: f64,
    /// Where nuclei are known from. Default: nowhere, they are found.
    pub nuclei_from: NucleiFrom,
    /// What is taken for a nucleus.
    pub nuclei: NucleiParams,
    /// How much is measured. Default: everything.
    pub detail: Detail,
}

impl Default for GaugeParams {
    fn default() -> Self {
        let (nuclei_from, detail) = (NucleiFrom::default(), Detail::default());
        Self { pixel_um: 0.33, nuclei_from, nuclei: NucleiParams::default(), detail }
    }
}

/// Measures pictures, all alike.
#[derive(Debug, Clone, PartialEq)]
pub struct Gauge {
    params: GaugeParams,
}

/// A picture in numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// The picture's name.
    pub name: String,
    /// The picture's group.
    pub group: String,
    /// Columns, without dead borders.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The field as a whole.
    pub statistics: Statistics,
    /// Its nuclei that do not touch the border.
    pub nuclei: Table,
    /// Its free cells with one nucleus.
    pub cells: Table,
    /// Its patches of 200 x 200 pixels; none at [`Detail::Statistics`].
    pub patches: Table,
    /// The picture in 8 bits, for reports; nothing at [`Detail::Statistics`].
    pub(crate) thumbnail: Vec<u8>,
    pub(crate) params: GaugeParams,
}

impl Gauge {
    /// Checks the parameters.
    ///
    /// # Errors
    /// If one is outside its range.
    pub fn new(params: &GaugeParams) -> Result<Self, Error> {
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

    /// Measures a picture.
    ///
    /// # Errors
    /// If it is no picture: too small, the same everywhere, or with grey levels outside its scale.
    pub fn measure(&self, picture: &Picture) -> Result<Field, Error> {
        picture.check()?;
        let picture = picture.trimmed();
        // What is left of it may be too little.
        picture.check()?;
        let pixel_um = self.params.pixel_um;
        let maps = Maps::new(&picture);
        let regions = self.nuclei(&maps, &picture.nuclei);
        let ids = ids(&maps, &regions);
        let cells = cell::cells(&maps, &ids, &regions, pixel_um);
        let free = regions.iter().filter(|r| !r.at_border());
        let of_nuclei = free.map(|r| (nucleus::features(&maps, r, &ids, pixel_um), r.shape().centre));
        let of_cells = cells.iter().map(|cell| (cell.features(&maps, pixel_um), cell.shape.centre));
        let (patches, thumbnail) = match self.params.detail {
            Detail::Statistics => (Table::default(), Vec::new()),
            Detail::Everything => {
                let in_8_bits = maps.grey.iter().map(|g| u8::try_from(nearest(f64::from(*g))).unwrap_or(u8::MAX));
                (patch::patches(&maps), in_8_bits.collect())
            }
        };
        Ok(Field {
            name: picture.name.clone(),
            group: picture.group.clone(),
            width: maps.width,
            height: maps.height,
            statistics: Statistics::new(&maps, &ids, &regions, &cells, pixel_um),
            nuclei: of_nuclei.collect(),
            cells: of_cells.collect(),
            patches,
            thumbnail,
            params: self.params.clone(),
        })
    }

    fn nuclei(&self, maps: &Maps, known: &Known) -> Vec<Region> {
        let search =
            |known: &Known| nuclei(&maps.absorbance, maps.width, self.params.pixel_um, known, &self.params.nuclei);
        match (self.params.nuclei_from, known) {
            (NucleiFrom::Masks, Known::Masks(_)) | (NucleiFrom::Points, Known::Points(_)) => search(known),
            (NucleiFrom::Points, Known::Masks(_)) => {
                search(&Known::Points(search(known).iter().map(|r| r.shape().centre).collect()))
            }
            _ => search(&Known::Nothing),
        }
    }
}

/// In every pixel the number of its region from 1 on, or 0.
fn ids(maps: &Maps, regions: &[Region]) -> Vec<u32> {
    let mut ids = vec![0; maps.absorbance.len()];
    for (id, region) in (1..).zip(regions) {
        region.pixels.iter().for_each(|p| ids[*p as usize] = id);
    }
    ids
}

/// The mean; NaN of nothing.
fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_usize), |(s, n), v| (s + v, n + 1));
    if count == 0 { f64::NAN } else { sum / count as f64 }
}

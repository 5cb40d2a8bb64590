//! From a picture to numbers.

mod maps;
mod nucleus;
mod patch;

use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::nuclei::{Hints, NucleiParams, nuclei};
use crate::number::nearest;
use crate::picture::{Known, Picture};
use crate::table::Table;
use maps::Maps;

/// Which knowledge of nuclei is used: what both sides have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default)]
#[serde(rename_all = "kebab-case")]
pub enum NucleiFrom {
    /// The masks that pictures bring.
    Masks,
    /// The points that pictures bring: the darkest compact thing around each.
    Points,
    /// Nothing: they are found.
    #[default]
    Search,
}

/// A picture in numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    pub name: String,
    pub group: String,
    pub width: usize,
    pub height: usize,
    pub pixel_um: f64,
    pub nuclei: Table,
    pub patches: Table,
    /// 8 bits
    pub thumbnail: Vec<u8>,
}

pub fn measure(picture: &Picture, pixel_um: f64, from: NucleiFrom) -> Result<Field, Error> {
    picture.check()?;
    let picture = picture.trimmed();
    let maps = Maps::new(&picture);
    let hints = match (&picture.nuclei, from) {
        (Known::Masks(m), NucleiFrom::Masks) => Hints::Masks(m),
        (Known::Points(p), NucleiFrom::Points) => Hints::Points(p),
        _ => Hints::Nothing,
    };
    let regions = nuclei(&maps.absorbance, maps.width, pixel_um, &hints, &NucleiParams::default());
    let mut inside = vec![false; maps.absorbance.len()];
    for r in &regions {
        for p in &r.pixels {
            inside[*p as usize] = true;
        }
    }
    let mut table = Table::default();
    for r in regions.iter().filter(|r| !r.at_border(maps.height)) {
        table.push(nucleus::features(&maps, r, &inside, pixel_um), r.shape().centre);
    }
    let patches = patch::patches(&maps);
    Ok(Field {
        name: picture.name.clone(),
        group: picture.group.clone(),
        width: maps.width,
        height: maps.height,
        pixel_um,
        nuclei: table,
        patches,
        thumbnail: maps.grey.iter().map(|g| u8::try_from(nearest(f64::from(*g))).unwrap_or(u8::MAX)).collect(),
    })
}

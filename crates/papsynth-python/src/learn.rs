//! Classes of cells, learned from images and outlines.

use papsynth::learn::{Donors, LearnParams, Material, NucleusImage};
use pyo3::prelude::*;

use crate::array::{Given, nth, pixels, pixels_within, points};
use crate::engine::read_model;
use crate::error::wrong;

/// A model with a class that is learned, as JSON.
///
/// Parameters
/// ----------
/// name : str
///     Of the class.
/// pixel_um : float
///     Of all the material.
/// nuclei : list of (array_like, array_like), optional
///     Images with their masks, each (height, width).
/// nucleus_outlines, cytoplasm_outlines : list of array_like, optional
///     Each (points, 2), pixels.
/// like : str, optional
///     Class that it takes after in everything the material does not show; by default that of its name.
/// bethesda, source : str
/// numbers_only : bool
///     Whether the model holds no textures.
/// model : None, dict, str or os.PathLike
///     What the class is added to.
#[pyfunction]
#[pyo3(signature = (name, pixel_um, *, nuclei=None, nucleus_outlines=None, cytoplasm_outlines=None, like=None, bethesda="", source="", numbers_only=false, model=None))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn learn(
    py: Python<'_>,
    name: &str,
    pixel_um: f64,
    nuclei: Option<Vec<(Given<'_>, Given<'_>)>>,
    nucleus_outlines: Option<Vec<Given<'_>>>,
    cytoplasm_outlines: Option<Vec<Given<'_>>>,
    like: Option<String>,
    bethesda: &str,
    source: &str,
    numbers_only: bool,
    model: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let base = read_model(py, model)?;
    let nuclei: Vec<NucleusImage> = nuclei
        .unwrap_or_default()
        .iter()
        .enumerate()
        .map(|(number, (image, mask))| nucleus(number, image, mask))
        .collect::<PyResult<_>>()?;
    let nucleus_outlines = outlines("nucleus_outlines", nucleus_outlines)?;
    let cytoplasm_outlines = outlines("cytoplasm_outlines", cytoplasm_outlines)?;
    if nuclei.is_empty() && nucleus_outlines.is_empty() && cytoplasm_outlines.is_empty() {
        let message = "nuclei, nucleus_outlines, cytoplasm_outlines: none is given; expected some material";
        return Err(wrong(message));
    }
    let material =
        Material { nuclei: &nuclei, nucleus_outlines: &nucleus_outlines, cytoplasm_outlines: &cytoplasm_outlines };
    let params = LearnParams {
        class: name.to_owned(),
        like: like.unwrap_or_else(|| name.to_owned()),
        bethesda: bethesda.to_owned(),
        pixel_um,
        source: source.to_owned(),
        donors: if numbers_only { Donors::NumbersOnly } else { Donors::Keep },
    };
    let learned = py.detach(|| papsynth::learn::learn(&base, &material, &params));
    Ok(learned.map_err(|error| wrong(error))?.to_json())
}

fn nucleus(number: usize, image: &Given<'_>, mask: &Given<'_>) -> PyResult<NucleusImage> {
    let name = nth("nuclei", number);
    let (light, width) = pixels(&format!("{name}[0]"), image)?;
    let (mask, mask_width) = pixels_within(&format!("{name}[1]"), mask, [0.0, 1.0])?;
    if (light.len(), width) != (mask.len(), mask_width) {
        let [image, mask] = [(&light, width), (&mask, mask_width)].map(|(values, width)| (values.len() / width, width));
        return Err(wrong(format!("{name}: image of {image:?}, mask of {mask:?}; expected one shape")));
    }
    let mask = mask.into_iter().map(|inside| if inside > 0.5 { 1.0 } else { 0.0 }).collect();
    Ok(NucleusImage { name, light, mask, width })
}

fn outlines(name: &str, outlines: Option<Vec<Given<'_>>>) -> PyResult<Vec<Vec<[f64; 2]>>> {
    let outlines = outlines.unwrap_or_default();
    let one = |(number, outline): (usize, &Given<'_>)| {
        let name = nth(name, number);
        let outline = points(&name, outline)?;
        match outline.len() {
            0..3 => Err(wrong(format!("{name}: {} points; expected 3 or more", outline.len()))),
            _ => Ok(outline),
        }
    };
    outlines.iter().enumerate().map(one).collect()
}

//! Classes of cells, learned from images and outlines.

use numpy::{AllowTypeChange, PyArrayLike2};
use papsynth::learn::{Donors, LearnParams, Material, NucleusImage};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::engine::read_model;

type Image<'py> = PyArrayLike2<'py, f32, AllowTypeChange>;
type Points<'py> = PyArrayLike2<'py, f64, AllowTypeChange>;

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
    nuclei: Option<Vec<(Image<'_>, Image<'_>)>>,
    nucleus_outlines: Option<Vec<Points<'_>>>,
    cytoplasm_outlines: Option<Vec<Points<'_>>>,
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
    Ok(learned.map_err(|error| PyValueError::new_err(error.to_string()))?.to_json())
}

fn nucleus(number: usize, image: &Image<'_>, mask: &Image<'_>) -> PyResult<NucleusImage> {
    let (image, mask) = (image.as_array(), mask.as_array());
    if image.shape() != mask.shape() || image.is_empty() {
        let message = format!("nuclei[{number}]: image of {:?}, mask of {:?}", image.shape(), mask.shape());
        return Err(PyValueError::new_err(message));
    }
    Ok(NucleusImage {
        name: format!("nuclei[{number}]"),
        light: image.iter().copied().collect(),
        mask: mask.iter().map(|&inside| if inside > 0.5 { 1.0 } else { 0.0 }).collect(),
        width: image.ncols(),
    })
}

fn outlines(name: &str, outlines: Option<Vec<Points<'_>>>) -> PyResult<Vec<Vec<[f64; 2]>>> {
    let outlines = outlines.unwrap_or_default();
    let one = |(number, outline): (usize, &Points<'_>)| {
        let view = outline.as_array();
        if view.ncols() != 2 {
            let message = format!("{name}[{number}]: {:?}; expected rows of x and y, (points, 2)", view.shape());
            return Err(PyValueError::new_err(message));
        }
        Ok(view.rows().into_iter().map(|row| [row[0], row[1]]).collect())
    };
    outlines.iter().enumerate().map(one).collect()
}

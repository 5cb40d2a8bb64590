//! Conversion of Python arrays, with checks of type, shape and finite values.

use numpy::{Element, PyArray2, PyArrayMethods, dtype};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::error::wrong;

/// Any object that NumPy can convert to an array.
pub(crate) type ArrayLike<'py> = Bound<'py, PyAny>;

/// Returns the values, row-major, and the numbers of rows and columns.
fn numbers<T: Element + Copy + Into<f64>>(name: &str, given: &ArrayLike<'_>) -> PyResult<(Vec<T>, [usize; 2])> {
    let py = given.py();
    let not_array = |error: PyErr| PyTypeError::new_err(format!("{name}: expected an array ({})", error.value(py)));
    let array = py.import("numpy")?.call_method1("asarray", (given,)).map_err(not_array)?;
    let found = array.getattr("dtype")?;
    if !["b", "i", "u", "f"].contains(&found.getattr("kind")?.extract::<String>()?.as_str()) {
        return Err(PyTypeError::new_err(format!("{name}: expected booleans, integers or floats, found {found}")));
    }
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    // An empty list has one dimension.
    if shape.contains(&0) && shape.len() <= 2 {
        return Ok((Vec::new(), [0, shape.get(1).copied().unwrap_or(0)]));
    }
    let &[rows, columns] = shape.as_slice() else {
        return Err(wrong(format!("{name}: expected two dimensions, found the shape {shape:?}")));
    };
    let array = array.call_method1("astype", (dtype::<T>(py),))?;
    let array = array.cast::<PyArray2<T>>()?;
    let values: Vec<T> = array.readonly().as_array().iter().copied().collect();
    match values.iter().position(|&value| !value.into().is_finite()) {
        Some(place) => {
            let (row, column, value) = (place / columns, place % columns, values[place].into());
            Err(wrong(format!("{name}[{row}, {column}]: {value} is out of range: expected a finite number")))
        }
        None => Ok((values, [rows, columns])),
    }
}

/// Returns the pixels of an image, row-major, and its width.
pub(crate) fn pixels(name: &str, image: &ArrayLike<'_>) -> PyResult<(Vec<f32>, usize)> {
    let (values, [_, width]) = numbers(name, image)?;
    if values.is_empty() {
        return Err(wrong(format!("{name}: the image is empty; expected (height, width)")));
    }
    Ok((values, width))
}

/// Grey levels; red and blue of a colour image, of which the grey levels are the green channel; and the width.
pub(crate) type Channels = (Vec<f32>, Option<[Vec<f32>; 2]>, usize);

/// Returns the pixels of a grey image, or of a colour image of shape (height, width, 3).
pub(crate) fn channels(name: &str, image: &ArrayLike<'_>) -> PyResult<Channels> {
    let py = image.py();
    let shape: Vec<usize> = py.import("numpy")?.call_method1("shape", (image,))?.extract().unwrap_or_default();
    if shape.len() != 3 || shape[2] != 3 {
        let (grey, width) = pixels(name, image)?;
        return Ok((grey, None, width));
    }
    let array = py.import("numpy")?.call_method1("asarray", (image,))?;
    let channel = |c: usize| pixels(name, &array.get_item((py.Ellipsis(), c))?);
    let ((red, _), (green, width), (blue, _)) = (channel(0)?, channel(1)?, channel(2)?);
    Ok((green, Some([red, blue]), width))
}

/// Returns the pixels of an image with values in a range, and its width.
pub(crate) fn pixels_within(name: &str, image: &ArrayLike<'_>, [low, high]: [f32; 2]) -> PyResult<(Vec<f32>, usize)> {
    let (values, width) = pixels(name, image)?;
    match values.iter().position(|value| !(low..=high).contains(value)) {
        Some(place) => {
            let (row, column, value) = (place / width, place % width, values[place]);
            let range = if high < f32::MAX { format!("{low} to {high}") } else { format!("{low} or more") };
            Err(wrong(format!("{name}[{row}, {column}]: {value} is out of range: expected {range}")))
        }
        None => Ok((values, width)),
    }
}

/// Returns points from an array of shape (n, 2); n may be 0.
pub(crate) fn points(name: &str, points: &ArrayLike<'_>) -> PyResult<Vec<[f64; 2]>> {
    let (values, [rows, columns]) = numbers::<f64>(name, points)?;
    if !values.is_empty() && columns != 2 {
        let message = format!("{name}: expected the shape (n, 2), found ({rows}, {columns})");
        return Err(wrong(message));
    }
    Ok(values.as_chunks::<2>().0.to_vec())
}

pub(crate) fn nth(name: &str, number: usize) -> String {
    format!("{name}[{number}]")
}

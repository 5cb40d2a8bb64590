//! Arrays that Python hands over: of numbers, of the right shape, and finite.

use numpy::{Element, PyArray2, PyArrayMethods, dtype};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::error::wrong;

/// Anything that NumPy may make an array of.
pub(crate) type Given<'py> = Bound<'py, PyAny>;

/// Numbers row by row, with rows and columns.
fn numbers<T: Element + Copy + Into<f64>>(name: &str, given: &Given<'_>) -> PyResult<(Vec<T>, [usize; 2])> {
    let py = given.py();
    let told = |error: PyErr| PyTypeError::new_err(format!("{name}: {}; expected an array", error.value(py)));
    let array = py.import("numpy")?.call_method1("asarray", (given,)).map_err(told)?;
    let found = array.getattr("dtype")?;
    if !["b", "i", "u", "f"].contains(&found.getattr("kind")?.extract::<String>()?.as_str()) {
        return Err(PyTypeError::new_err(format!("{name}: is of type {found}; expected bool, whole or real numbers")));
    }
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    // An empty list has one dimension.
    if shape.contains(&0) && shape.len() <= 2 {
        return Ok((Vec::new(), [0, shape.get(1).copied().unwrap_or(0)]));
    }
    let &[rows, columns] = shape.as_slice() else {
        return Err(wrong(format!("{name}: has the shape {shape:?}; expected two dimensions")));
    };
    let array = array.call_method1("astype", (dtype::<T>(py),))?;
    let array = array.cast::<PyArray2<T>>()?;
    let values: Vec<T> = array.readonly().as_array().iter().copied().collect();
    match values.iter().position(|&value| !value.into().is_finite()) {
        Some(place) => {
            let (row, column, value) = (place / columns, place % columns, values[place].into());
            Err(wrong(format!("{name}[{row}, {column}]: {value}; expected finite numbers")))
        }
        None => Ok((values, [rows, columns])),
    }
}

/// The pixels of an image row by row, and its width.
pub(crate) fn pixels(name: &str, image: &Given<'_>) -> PyResult<(Vec<f32>, usize)> {
    let (values, [_, width]) = numbers(name, image)?;
    if values.is_empty() {
        return Err(wrong(format!("{name}: has no pixel; expected (height, width)")));
    }
    Ok((values, width))
}

/// The same, of values that lie between two.
pub(crate) fn pixels_within(name: &str, image: &Given<'_>, [low, high]: [f32; 2]) -> PyResult<(Vec<f32>, usize)> {
    let (values, width) = pixels(name, image)?;
    match values.iter().position(|value| !(low..=high).contains(value)) {
        Some(place) => {
            let (row, column, value) = (place / width, place % width, values[place]);
            let range = if high < f32::MAX { format!("{low} to {high}") } else { format!("at least {low}") };
            Err(wrong(format!("{name}[{row}, {column}]: {value}; expected {range}")))
        }
        None => Ok((values, width)),
    }
}

/// Points as rows of x and y; there may be none.
pub(crate) fn points(name: &str, points: &Given<'_>) -> PyResult<Vec<[f64; 2]>> {
    let (values, [rows, columns]) = numbers::<f64>(name, points)?;
    if !values.is_empty() && columns != 2 {
        let message = format!("{name}: has the shape [{rows}, {columns}]; expected rows of x and y, (n, 2)");
        return Err(wrong(message));
    }
    Ok(values.as_chunks::<2>().0.to_vec())
}

pub(crate) fn nth(name: &str, number: usize) -> String {
    format!("{name}[{number}]")
}

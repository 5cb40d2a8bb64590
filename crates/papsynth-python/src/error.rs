//! Conversion of errors to Python exceptions.

use papsynth::recipe::diagnose::FieldError;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyList;

/// Returns a `ValueError`.
pub(crate) fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Returns a `papsynth.RecipeError` with field, message and help of each invalid field.
pub(crate) fn recipe(py: Python<'_>, source: &str, faults: &[FieldError]) -> PyErr {
    let errors: Vec<(String, String, Option<String>)> =
        faults.iter().map(|fault| (fault.path.join("."), fault.message.clone(), fault.help.clone())).collect();
    let raise = || -> PyResult<PyErr> {
        let class = py.import("papsynth._errors")?.getattr("RecipeError")?;
        Ok(PyErr::from_value(class.call1((source, PyList::new(py, errors)?))?))
    };
    raise().unwrap_or_else(|error| error)
}

/// Converts an error of the engine.
pub(crate) fn engine(py: Python<'_>, source: &str, error: &papsynth::Error) -> PyErr {
    let fault = |field: &str, message: String| {
        let path = field.split('.').map(str::to_owned).collect();
        FieldError { path, span: None, message, help: None }
    };
    match error {
        papsynth::Error::Recipe(problems) => {
            let faults: Vec<FieldError> = problems.iter().map(|p| fault(&p.field, p.to_string())).collect();
            recipe(py, source, &faults)
        }
        papsynth::Error::Layout(_) => recipe(py, source, &[fault("layout", error.to_string())]),
        other => wrong(other),
    }
}

/// Converts an error of reading or writing files.
pub(crate) fn dataset(error: &papsynth_dataset::Error) -> PyErr {
    let is_io = matches!(error, papsynth_dataset::Error::Io { .. });
    if is_io { PyOSError::new_err(error.to_string()) } else { wrong(error) }
}

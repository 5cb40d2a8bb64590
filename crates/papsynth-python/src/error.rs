//! What goes wrong, as Python's exceptions.

use papsynth::recipe::diagnose::FieldError;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyList;

/// What a value or a library has against what was asked for.
pub(crate) fn wrong(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A `papsynth.RecipeError` of these faults, each as its field, what is wrong with it and what would help.
pub(crate) fn recipe(py: Python<'_>, source: &str, faults: &[FieldError]) -> PyErr {
    let told: Vec<(String, String, Option<String>)> =
        faults.iter().map(|fault| (fault.path.join("."), fault.message.clone(), fault.help.clone())).collect();
    let raise = || -> PyResult<PyErr> {
        let class = py.import("papsynth._errors")?.getattr("RecipeError")?;
        Ok(PyErr::from_value(class.call1((source, PyList::new(py, told)?))?))
    };
    raise().unwrap_or_else(|error| error)
}

/// What the engine says against a recipe or a scene.
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

/// What reading files says.
pub(crate) fn dataset(error: &papsynth_dataset::Error) -> PyErr {
    let is_of_system = matches!(error, papsynth_dataset::Error::Io { .. });
    if is_of_system { PyOSError::new_err(error.to_string()) } else { wrong(error) }
}

//! What goes wrong, as Python's exceptions.

use papsynth::recipe::diagnose::Fault;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyList;

/// A `papsynth.RecipeError` of these faults, each as its field, what is wrong with it and what would help.
pub(crate) fn recipe(py: Python<'_>, source: &str, faults: &[Fault]) -> PyErr {
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
    match error {
        papsynth::Error::Recipe(problems) => {
            let fault = |problem: &papsynth::recipe::Problem| Fault {
                path: problem.field.split('.').map(str::to_owned).collect(),
                span: None,
                message: problem.to_string(),
                help: None,
            };
            recipe(py, source, &problems.iter().map(fault).collect::<Vec<_>>())
        }
        papsynth::Error::Layout(_) => {
            let fault = Fault { path: vec!["layout".to_owned()], span: None, message: error.to_string(), help: None };
            recipe(py, source, &[fault])
        }
        other => PyValueError::new_err(other.to_string()),
    }
}

/// What reading files says.
pub(crate) fn dataset(error: &papsynth_dataset::Error) -> PyErr {
    let is_of_system = matches!(error, papsynth_dataset::Error::Io { .. });
    if is_of_system { PyOSError::new_err(error.to_string()) } else { PyValueError::new_err(error.to_string()) }
}

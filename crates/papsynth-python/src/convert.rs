//! Conversion of Python dictionaries to TOML.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use toml::{Table, Value};

use crate::error::wrong;

/// Maximum nesting depth: detects lists that contain themselves.
const MAX_DEPTH: usize = 16;

/// Converts a dictionary at a path and depth to TOML. A recipe has the path `""` and depth 0.
pub(crate) fn table(dict: &Bound<'_, PyDict>, path: &str, depth: usize) -> PyResult<Table> {
    let mut table = Table::new();
    for (key, value) in dict {
        let Ok(key) = key.cast::<PyString>() else {
            let path = if path.is_empty() { "recipe" } else { path };
            return Err(PyTypeError::new_err(format!("{path}: expected a field name (string), found {}", key.repr()?)));
        };
        let key = key.to_str()?.to_owned();
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        table.insert(key, self::value(&value, &path, depth + 1)?);
    }
    Ok(table)
}

fn value(value: &Bound<'_, PyAny>, path: &str, depth: usize) -> PyResult<Value> {
    if depth > MAX_DEPTH {
        return Err(wrong(format!("{path}: nested too deeply")));
    }
    if let Ok(truth) = value.cast::<PyBool>() {
        return Ok(Value::Boolean(truth.is_true()));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(Value::String(text.to_str()?.to_owned()));
    }
    if let Ok(dict) = value.cast::<PyDict>() {
        return Ok(Value::Table(table(dict, path, depth)?));
    }
    if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        let items = value.try_iter()?.map(|item| self::value(&item?, path, depth + 1));
        return Ok(Value::Array(items.collect::<PyResult<_>>()?));
    }
    if value.is_instance_of::<PyInt>() {
        let whole = value.extract::<i64>();
        return whole
            .map(Value::Integer)
            .map_err(|_| wrong(format!("{path}: {} is out of range: expected a 64-bit integer", repr(value))));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(value.extract()?));
    }
    // Sections and distributions of `papsynth.recipes`, then NumPy scalars.
    if let Ok(true) = value.hasattr("to_dict")
        && let Ok(inner) = value.call_method0("to_dict")
    {
        return self::value(&inner, path, depth + 1);
    }
    if value.getattr("ndim").and_then(|ndim| ndim.extract::<usize>()).is_ok_and(|ndim| ndim == 0)
        && let Ok(plain) = value.call_method0("item")
    {
        return self::value(&plain, path, depth + 1);
    }
    let kind = value.get_type().name()?.to_string();
    Err(PyTypeError::new_err(format!(
        "{path}: expected a number, string, boolean, list or dictionary, found {} ({kind})",
        repr(value)
    )))
}

/// Returns the first 80 characters of the `repr` of a value.
fn repr(value: &Bound<'_, PyAny>) -> String {
    let text = value.repr().map(|text| text.to_string()).unwrap_or_default();
    text.chars().take(80).collect()
}

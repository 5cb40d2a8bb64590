//! Dictionaries of Python as the text of a recipe.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use toml::{Table, Value};

use crate::error::wrong;

/// No recipe is nested as deep; a list that holds itself is.
const DEEPEST: usize = 16;

/// A dictionary as TOML; it lies at a path, so deep. That of a recipe lies at `""`, 0.
pub(crate) fn table(dict: &Bound<'_, PyDict>, path: &str, depth: usize) -> PyResult<Table> {
    let mut table = Table::new();
    for (key, value) in dict {
        let Ok(key) = key.cast::<PyString>() else {
            let path = if path.is_empty() { "recipe" } else { path };
            return Err(PyTypeError::new_err(format!("{path}: {} is no name of a field", key.repr()?)));
        };
        let key = key.to_str()?.to_owned();
        let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        table.insert(key, self::value(&value, &path, depth + 1)?);
    }
    Ok(table)
}

fn value(value: &Bound<'_, PyAny>, path: &str, depth: usize) -> PyResult<Value> {
    if depth > DEEPEST {
        return Err(wrong(format!("{path}: nested deeper than any recipe")));
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
        return whole.map(Value::Integer).map_err(|_| wrong(format!("{path}: {} is too large", repr(value))));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(value.extract()?));
    }
    // Numbers of NumPy, and a distribution or section that knows how it is written.
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
        "{path}: {} is a {kind}; expected a number, a text, a truth value, a list or a dictionary",
        repr(value)
    )))
}

/// A value as Python shows it, or its beginning.
fn repr(value: &Bound<'_, PyAny>) -> String {
    let text = value.repr().map(|text| text.to_string()).unwrap_or_default();
    text.chars().take(80).collect()
}

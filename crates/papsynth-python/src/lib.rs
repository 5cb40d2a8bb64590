//! The native module `papsynth._native` of the Python package.
#![forbid(unsafe_code)]

mod array;
mod calibrate;
mod convert;
mod engine;
mod error;
mod frame;
mod learn;
mod matching;
mod pool;
mod sets;
mod techniques;

#[pyo3::pymodule]
mod _native {
    use pyo3::prelude::*;

    /// Initialises NumPy's C API on import, where no signal interferes.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        numpy::PyArray1::<u8>::zeros(module.py(), 0, false);
        Ok(())
    }

    #[pymodule_export]
    use crate::{
        calibrate::{calibrate_camera, calibrate_microscope},
        engine::{Engine, identity, recipe_schema, resolve},
        frame::{Frame, restored},
        learn::{judge, learn},
        matching::match_fields,
        pool::after_fork,
        sets::{generate, merge, missing, shards, verify},
        techniques::{cloth, cytoskeleton, dyes, fields, fsd, noise, optics, texture},
    };
}

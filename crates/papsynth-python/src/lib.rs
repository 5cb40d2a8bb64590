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
    use papsynth::truth::{IGNORED, MIN_DETECTABILITY, SemanticClass};
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;

    /// Initialises NumPy's C API on import, where no signal interferes.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        numpy::PyArray1::<u8>::zeros(module.py(), 0, false);
        let classes = SemanticClass::ALL.map(SemanticClass::name);
        let mimics = SemanticClass::ALL.into_iter().filter(|class| class.is_mimic()).map(SemanticClass::name);
        module.add("SEMANTIC_CLASSES", PyTuple::new(module.py(), classes)?)?;
        module.add("MIMICS", PyTuple::new(module.py(), mimics.collect::<Vec<_>>())?)?;
        module.add("MIN_DETECTABILITY", MIN_DETECTABILITY)?;
        module.add("IGNORED", IGNORED)
    }

    #[pymodule_export]
    use crate::{
        calibrate::{calibrate_camera, calibrate_microscope},
        engine::{Engine, identity, presets, recipe_schema, resolve},
        frame::{Frame, restored},
        learn::{judge, learn},
        matching::match_fields,
        pool::after_fork,
        sets::{generate, merge, missing, shards, verify},
        techniques::{cloth, cytoskeleton, dyes, fields, fsd, noise, optics, texture},
    };
}

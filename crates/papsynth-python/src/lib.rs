//! The engine on NumPy arrays: what `papsynth._native` holds, over which `python/papsynth` lies.
#![forbid(unsafe_code)]

mod array;
mod calibrate;
mod convert;
mod engine;
mod error;
mod frame;
mod judge;
mod learn;
mod pickled;
mod pool;
mod sets;
mod techniques;

#[pyo3::pymodule]
mod _native {
    use pyo3::prelude::*;

    /// Finds NumPy's C interface now, and not where a signal may come in between.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        numpy::PyArray1::<u8>::zeros(module.py(), 0, false);
        Ok(())
    }

    #[pymodule_export]
    use crate::calibrate::calibrate_camera;
    #[pymodule_export]
    use crate::calibrate::calibrate_microscope;
    #[pymodule_export]
    use crate::engine::Engine;
    #[pymodule_export]
    use crate::engine::identity;
    #[pymodule_export]
    use crate::engine::recipe_schema;
    #[pymodule_export]
    use crate::engine::resolve;
    #[pymodule_export]
    use crate::frame::Frame;
    #[pymodule_export]
    use crate::frame::restored;
    #[pymodule_export]
    use crate::judge::judge;
    #[pymodule_export]
    use crate::learn::learn;
    #[pymodule_export]
    use crate::pool::after_fork;
    #[pymodule_export]
    use crate::sets::generate;
    #[pymodule_export]
    use crate::sets::merge;
    #[pymodule_export]
    use crate::sets::missing;
    #[pymodule_export]
    use crate::sets::shards;
    #[pymodule_export]
    use crate::sets::verify;
    #[pymodule_export]
    use crate::techniques::{cloth, cytoskeleton, dyes, fields, fsd, noise, optics, texture};
}

//! The engine on NumPy arrays: what `papsynth._native` holds, over which `python/papsynth` lies.
#![forbid(unsafe_code)]

mod convert;
mod engine;
mod error;
mod frame;
mod judge;
mod learn;
mod pool;
mod sets;
mod techniques;

#[pyo3::pymodule]
mod _native {
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
    use crate::techniques::{camera, cloth, cytoskeleton, dyes, fields, fsd, optics, texture};
}

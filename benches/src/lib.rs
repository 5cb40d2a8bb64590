//! Workloads of the techniques and of the engine, for timing against other programs and for counting instructions.
//!
//! A [`Workload`] contains its inputs; each call performs it once. Inputs and seeds are fixed, and everything runs on
//! one thread.

#![forbid(unsafe_code)]
#![expect(clippy::missing_panics_doc, reason = "inputs are constants: a panic is a bug in the workload")]

mod cell;
mod clock;
mod field;
mod frame;
mod named;

pub use cell::{cytoskeleton, sheets, texture, thickness};
pub use clock::cpu_seconds;
pub use field::{at_density, default_files, default_recipe, fields, peer_recipe};
pub use frame::{blur, exposure, gibson_lanni, perlin};
pub use named::{Timed, named};

/// A repeatable operation with its inputs.
pub type Workload = Box<dyn FnMut()>;

/// Width and height in pixels.
pub type Size = [usize; 2];

/// Size of a camera frame in pixels.
pub const FRAME: Size = [1376, 1038];

/// Returns a random number generator.
fn rng(seed: u64) -> rand_xoshiro::Xoshiro256PlusPlus {
    use rand_xoshiro::rand_core::SeedableRng;
    rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed)
}

/// Returns uniform random numbers from 0 to 1.
fn noise(len: usize, seed: u64) -> Vec<f32> {
    use rand_xoshiro::rand_core::Rng;
    let mut rng = rng(seed);
    (0..len).map(|_| (rng.next_u32() >> 8) as f32 / 16_777_216.0).collect()
}

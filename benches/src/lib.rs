//! Works of the techniques and of the engine, as they are timed beside other programs and counted in instructions.
//!
//! A [`Work`] has its inputs; calling it does the work once. Inputs are fixed, seeds too, nothing runs on a second thread.

#![forbid(unsafe_code)]
#![expect(clippy::missing_panics_doc, reason = "inputs are constants: what panics is a work that is broken")]

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

/// Something that is done again and again, its inputs made.
pub type Work = Box<dyn FnMut()>;

/// Side of a square in pixels, or width and height of a rectangle.
pub type Size = [usize; 2];

/// A frame of the camera, in pixels.
pub const FRAME: Size = [1376, 1038];

/// The generator of a seed.
fn rng(seed: u64) -> rand_xoshiro::Xoshiro256PlusPlus {
    use rand_xoshiro::rand_core::SeedableRng;
    rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(seed)
}

/// Even random numbers from 0 to 1.
fn noise(len: usize, seed: u64) -> Vec<f32> {
    use rand_xoshiro::rand_core::Rng;
    let mut rng = rng(seed);
    (0..len).map(|_| (rng.next_u32() >> 8) as f32 / 16_777_216.0).collect()
}

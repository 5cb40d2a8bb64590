//! Batched Fourier transforms: many sequences at once, one in each vector lane.
//!
//! The forward transform is Σ xⱼ exp −2πi jk/n, without a factor; the inverse is the forward transform of the
//! reversed sequence.
//! Any length is accepted; the time of a pass grows with the prime factor above 5.
//! [`LaneFft::process`] transforms many sequences,
//! [`LaneFft::forward`] and [`LaneFft::inverse`] a single one, [`ComplexPlane`] an image.
//!
//! ```
//! use portable_numerics::fourier::{LaneFft, Lanes, ZERO};
//!
//! // Sixteen sequences of three complex numbers: real parts, imaginary parts.
//! let mut values: Vec<Lanes<f32, 16>> = vec![ZERO; 3];
//! values[1][0][4] = 1.0;
//! let mut spare = values.clone();
//! LaneFft::new(3).process(&mut values, &mut spare);
//! assert_eq!((values[0][0][4], values[0][1][4]), (1.0, 0.0));
//! assert!((values[2][0][4] + 0.5).abs() < 1e-6);
//! ```

mod plane;
mod transform;
mod transpose;

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Mul, Sub};

pub use num_complex::Complex;
pub use plane::{ComplexPlane, PlaneScratch};
pub use transform::{LaneFft, Plans};
pub use transpose::transposed;

/// A real number in single or double precision.
pub trait Real:
    Copy + Debug + Default + Send + Sync + Add<Output = Self> + AddAssign + Sub<Output = Self> + Mul<Output = Self>
{
    /// Returns the nearest number of this precision.
    fn nearest(value: f64) -> Self;
}

impl Real for f32 {
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "rounds to the nearest f32")]
    fn nearest(value: f64) -> Self {
        value as Self
    }
}

impl Real for f64 {
    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value
    }
}

/// One complex number of each of `N` sequences: real parts, then imaginary parts. Fastest if each part fills a cache
/// line: 16 in single precision, 8 in double.
pub type Lanes<T, const N: usize> = [[T; N]; 2];

/// Zeros in single precision, sixteen lanes.
pub const ZERO: Lanes<f32, 16> = [[0.0; 16]; 2];

/// A square block: `N` sequences of `N` numbers.
pub type Square<T, const N: usize> = [[T; N]; N];

//! Fourier transforms of many sequences side by side, one in each lane of a vector.
//!
//! The forward transform is Σ xⱼ exp −2πi jk/n, without a factor; the inverse is the forward one of the reversed sequence.
//! Any length is transformed; prime factors above 5 take time in proportion to themselves. [`LaneFft::process`] transforms many sequences,
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

mod lanes;
mod plane;
mod transform;

pub use lanes::{Lanes, Real, Square, ZERO, transposed};
pub use num_complex::Complex;
pub use plane::{ComplexPlane, PlaneScratch};
pub use transform::{LaneFft, Plans};

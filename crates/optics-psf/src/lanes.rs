//! Sequences side by side, as they are transformed.

pub(crate) use portable_numerics::fourier::{LaneFft, ZERO};

/// Sequences side by side: a cache line of single precision.
pub(crate) const LANES: usize = 16;

/// A complex number of each sequence: real parts, imaginary parts. Or two runs of real numbers, one after the other.
pub(crate) type Lanes = portable_numerics::fourier::Lanes<f32, LANES>;

/// Transforms of all lengths that were asked for.
pub(crate) type LanePlans = portable_numerics::fourier::Plans<f32>;

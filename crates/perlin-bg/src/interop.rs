//! Implementations of `noise::NoiseFn`.

use noise::NoiseFn;

use crate::{Fractal, Perlin};

/// [`Perlin::at`]: positions in lattice cells, values within ±√2/2.
///
/// ```
/// use noise::{NoiseFn, ScalePoint};
/// use perlin_bg::{Perlin, PerlinParams};
///
/// let noise = ScalePoint::new(Perlin::new(&PerlinParams::default(), 1)?).set_scale(1.0 / 16.0);
/// assert_eq!(noise.get([32.0, 48.0]), 0.0); // a lattice point
/// # Ok::<(), perlin_bg::Error>(())
/// ```
impl NoiseFn<f64, 2> for Perlin {
    fn get(&self, [x, y]: [f64; 2]) -> f64 {
        self.at(x, y).into()
    }
}

/// [`Fractal::at`]: positions in cells of the coarsest layer, values within [`Fractal::amplitude_bound`].
///
/// ```
/// use noise::{Add, Constant, NoiseFn};
/// use perlin_bg::{Fractal, FractalParams};
///
/// let clouds = Fractal::new(&FractalParams::default(), 1)?;
/// let brighter = Add::new(clouds.clone(), Constant::new(0.5));
/// assert_eq!(brighter.get([3.4, 1.2]), f64::from(clouds.at(3.4, 1.2)) + 0.5);
/// # Ok::<(), perlin_bg::Error>(())
/// ```
impl NoiseFn<f64, 2> for Fractal {
    fn get(&self, [x, y]: [f64; 2]) -> f64 {
        self.at(x, y).into()
    }
}

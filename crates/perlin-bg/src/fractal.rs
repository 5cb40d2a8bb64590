use crate::error::{Error, require};
use crate::kernel::{self, single};
use crate::perlin::{Perlin, PerlinParams};
use crate::rows::{Rows, Window, for_each_row};
use portable_numerics::random::{SplitMix64, unit};

/// Parameters of [`Fractal`].
#[derive(Debug, Clone, PartialEq)]
pub struct FractalParams {
    /// Number of layers, 1 to 32. Default: 4 (ours; the paper does not specify the octaves of its "Perlin noise").
    pub octaves: usize,
    /// Ratio of the amplitudes of a layer and the coarser one before it, above 0, at most 4. With lacunarity 2 the
    /// power spectrum falls as f^(2 log2(persistence) - 2). Default: 0.5 (ours).
    pub persistence: f64,
    /// Ratio of the frequencies of a layer and the one before it, 1 to 16. Default: 2 (ours).
    pub lacunarity: f64,
    /// Noise of each layer.
    pub base: PerlinParams,
}

impl Default for FractalParams {
    fn default() -> Self {
        Self { octaves: 4, persistence: 0.5, lacunarity: 2.0, base: PerlinParams::default() }
    }
}

/// Fractal noise: a sum of layers of [`Perlin`] noise with increasing frequency and decreasing amplitude.
///
/// Positions are in cells of the coarsest layer. The coarsest layer equals `Perlin::new(&params.base, key)`. Each
/// further layer has its own key and a shift by a fraction of a cell, so that lattice points do not coincide.
#[derive(Debug, Clone)]
pub struct Fractal {
    layers: Vec<Layer>,
    bound: f64,
}

#[derive(Debug, Clone)]
struct Layer {
    noise: Perlin,
    frequency: f64,
    shift: [f64; 2],
    amplitude: f64,
}

impl Layer {
    fn along(&self, axis: usize, position: f64) -> f64 {
        position * self.frequency + self.shift[axis]
    }
}

impl Fractal {
    /// Creates the noise of a `key`.
    ///
    /// # Errors
    /// [`Error::OutOfRange`] if a parameter is out of range.
    pub fn new(params: &FractalParams, key: u64) -> Result<Self, Error> {
        let FractalParams { octaves, persistence, lacunarity, ref base } = *params;
        require("octaves", octaves as f64, (1..=32).contains(&octaves), "between 1 and 32")?;
        require("persistence", persistence, persistence > 0.0 && persistence <= 4.0, "above 0, at most 4")?;
        require("lacunarity", lacunarity, (1.0..=16.0).contains(&lacunarity), "between 1 and 16")?;

        let coarsest = Layer { noise: Perlin::new(base, key)?, frequency: 1.0, shift: [0.0, 0.0], amplitude: 1.0 };
        let layers: Vec<Layer> = core::iter::successors(Some((0, coarsest)), |(octave, layer)| {
            let octave = octave + 1;
            let key = SplitMix64::word(key, octave);
            let finer = Layer {
                noise: layer.noise.with_key(key),
                frequency: layer.frequency * lacunarity,
                shift: [0, 1].map(|axis| unit(SplitMix64::word(key, axis))),
                amplitude: layer.amplitude * persistence,
            };
            Some((octave, finer))
        })
        .map(|(_, layer)| layer)
        .take(octaves)
        .collect();
        let bound = Perlin::BOUND * layers.iter().map(|layer| layer.amplitude).sum::<f64>();
        Ok(Self { layers, bound })
    }

    /// Returns the bound of the noise's absolute value: √2/2 times the sum of the layers' amplitudes. Actual values
    /// stay far below it. Their standard deviation is about 0.215 times the root of the sum of squared amplitudes.
    pub fn amplitude_bound(&self) -> f64 {
        self.bound
    }

    /// Returns the noise at a point, in cells of the coarsest layer.
    pub fn at(&self, x: f64, y: f64) -> f32 {
        self.layers.iter().fold(0.0, |sum, layer| {
            sum + single(layer.amplitude) * layer.noise.at(layer.along(0, x), layer.along(1, y))
        })
    }

    /// Returns the paper's I_pe ∈ [0, 1] at a point: noise / (2 · bound) + ½
    /// ([`UnitRange::Bound`](crate::UnitRange::Bound)).
    pub fn unit_at(&self, x: f64, y: f64) -> f32 {
        self.at(x, y) * self.unit_scale() + 0.5
    }

    /// Adds `amplitude` times the noise to every pixel of `image`, at the pixel positions of `window`. On a zeroed
    /// image with amplitude 1 the result equals [`Fractal::at`].
    ///
    /// # Panics
    /// If `width` is zero or does not divide the length of `image`.
    pub fn add_into(&self, image: &mut [f32], width: usize, window: &Window, amplitude: f32) {
        let mut rows = self.rows(width, window, amplitude);
        for_each_row(image, width, |r, row| rows.add_row(row, window.y(r)));
    }

    /// Fills `image` with the paper's I_pe ∈ [0, 1], the values of [`Fractal::unit_at`].
    ///
    /// # Panics
    /// If `width` is zero or does not divide the length of `image`.
    pub fn unit_into(&self, image: &mut [f32], width: usize, window: &Window) {
        let mut rows = self.rows(width, window, 1.0);
        for_each_row(image, width, |r, row| {
            row.fill(0.0);
            rows.add_row(row, window.y(r));
            kernel::affine(row, self.unit_scale(), 0.5);
        });
    }

    pub(crate) fn unit_scale(&self) -> f32 {
        single(0.5 / self.bound)
    }

    /// Returns a sampler for rows. A row stays in cache while its layers are added.
    pub(crate) fn rows(&self, width: usize, window: &Window, amplitude: f32) -> FractalRows<'_> {
        let layers = self
            .layers
            .iter()
            .map(|layer| {
                let positions = (0..width).map(|c| layer.along(0, window.x(c)));
                let amplitude = amplitude * single(layer.amplitude);
                (layer, Rows::new(&layer.noise, positions, amplitude))
            })
            .collect();
        FractalRows { layers }
    }
}

#[derive(Debug)]
pub(crate) struct FractalRows<'a> {
    layers: Vec<(&'a Layer, Rows<'a>)>,
}

impl FractalRows<'_> {
    pub(crate) fn add_row(&mut self, row: &mut [f32], y: f64) {
        for (layer, rows) in &mut self.layers {
            rows.add_row(row, layer.along(1, y));
        }
    }
}

#[cfg(test)]
mod tests;

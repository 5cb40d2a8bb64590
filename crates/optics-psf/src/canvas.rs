use multiversion::multiversion;
use rustfft::num_complex::Complex32;

use crate::Microscope;
use crate::exp::times_exp;
use crate::fft::Plans;
use crate::filter::{Column, Filter, Lattice, Part};
use crate::pupil::turn;
use crate::real_plane::{PlaneScratch, RealPlane, Support};
use crate::transfer::Transfer;

/// Least light that anything lets through: W ⊗ 10^(−A) undershoots to about −0.05 beside things of A > 1,
/// and there is no negative light.
pub const LEAST_LIGHT: f32 = 1e-3;

/// A periodic rectangle of the slide: the lattices on which what is in it is imaged.
pub(crate) struct Canvas {
    object: Raster,
    camera: Raster,
    /// Steps of the filters' tables from one frequency to the next along x and y.
    steps: [f32; 2],
    /// What the mean over a pixel does to frequencies along x and y.
    pixel: [PixelMean; 2],
}

/// A lattice, and its frequencies that the microscope transfers.
struct Raster {
    plane: RealPlane,
    support: Support,
}

/// What the mean over a pixel does to frequencies 0, 1, … of one axis.
struct PixelMean {
    /// Around the middle of the pixel.
    size: Vec<f32>,
    /// From its first sample.
    moved: Vec<Complex32>,
}

impl PixelMean {
    fn new(side: usize, oversampling: usize) -> Self {
        let mean = |k: usize| mean_over_pixel(k as f64 / side as f64, oversampling);
        let (size, moved) = (0..=side / 2).map(mean).unzip();
        Self { size, moved }
    }
}

/// Spectra of what is at one depth; empty where there is nothing.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectra {
    /// Of 1 − 10^(−A).
    pub(crate) absorbed: Vec<Complex32>,
    /// Of a = 1 − 10^(−A/2), if it is needed for the correction, and then of 1 − 10^(−A) − 2a.
    pub(crate) amplitude: Vec<Complex32>,
    /// Of (1 − W₀ ⊗ a)² − W₀ ⊗ 10^(−A), once it was needed.
    pub(crate) correction: Vec<Complex32>,
    /// Of φ.
    pub(crate) phase: Vec<Complex32>,
}

impl Spectra {
    pub(crate) fn is_empty(&self) -> bool {
        self.absorbed.is_empty() && self.phase.is_empty()
    }

    /// Forgets what is absorbed.
    pub(crate) fn clear_absorbed(&mut self) {
        for spectrum in [&mut self.absorbed, &mut self.amplitude, &mut self.correction] {
            spectrum.clear();
        }
    }

    pub(crate) fn clear(&mut self) {
        self.clear_absorbed();
        self.phase.clear();
    }
}

/// Working memory of [`Canvas`].
#[derive(Debug, Clone, Default)]
pub(crate) struct Memory {
    plane: PlaneScratch,
    weights: Vec<f32>,
    square: Vec<f32>,
}

impl Canvas {
    /// `size` in samples of the object, multiples of the oversampling.
    pub(crate) fn new(microscope: &Microscope, size: [usize; 2], plans: &Plans) -> Self {
        let oversampling = microscope.params().oversampling;
        let pitch = microscope.pitch_um();
        let raster = |stride: usize| {
            let [width, height] = size.map(|side| side / stride);
            let support = Support::new(width, height, microscope.cutoff() * pitch * stride as f64);
            Raster { plane: RealPlane::new(width, height, plans), support }
        };
        #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 tables")]
        let steps = size.map(|side| (1.0 / (side as f64 * pitch * Transfer::step_of(microscope))) as f32);
        Self {
            object: raster(1),
            camera: raster(oversampling),
            steps,
            pixel: size.map(|side| PixelMean::new(side, oversampling)),
        }
    }

    /// Samples of the object from left to right.
    pub(crate) fn width(&self) -> usize {
        self.object.plane.width
    }

    /// Samples of the object from top to bottom.
    pub(crate) fn height(&self) -> usize {
        self.object.plane.height
    }

    fn raster(&self, lattice: Lattice) -> &Raster {
        match lattice {
            Lattice::Object => &self.object,
            Lattice::Camera => &self.camera,
        }
    }

    /// The spectrum of an image on the object's lattice, or an empty one if the image is empty. `row` fills each of
    /// `rows`, or says that it is empty, as all other rows are.
    pub(crate) fn transform(
        &self,
        rows: core::ops::Range<usize>,
        row: impl FnMut(usize, &mut [f32]) -> bool,
        spectrum: &mut Vec<Complex32>,
        memory: &mut Memory,
    ) {
        self.object.plane.forward(&self.object.support, rows, row, spectrum, &mut memory.plane);
    }

    /// Frequencies of a column.
    fn column(&self, x: usize) -> Column<'_> {
        Column {
            x: x as f32 * self.steps[0],
            step: self.steps[1],
            pixel_x: self.pixel[0].size[x],
            pixel_y: &self.pixel[1].size,
        }
    }

    /// The correction of the in-focus form, if that is not known yet. With 1 − T = 2a − a² it is
    /// (1 − W₀ ⊗ a)² − W₀ ⊗ T = (W₀ ⊗ a)² + W₀ ⊗ (1 − T − 2a).
    pub(crate) fn correct(&self, in_focus: &Filter, spectra: &mut Spectra, memory: &mut Memory) {
        let Spectra { absorbed, amplitude, correction, .. } = spectra;
        if !correction.is_empty() || amplitude.is_empty() {
            return;
        }
        let Raster { plane, support } = &self.object;
        let Memory { plane: scratch, weights, square } = memory;
        let (width, norm) = (plane.width, plane.norm());
        square.resize(width * plane.height, 0.0);
        let fill = |x: usize, to: [&mut [Complex32]; 2]| {
            in_focus.add(Part::Absorption, self.column(x), support.column(amplitude, x, to[1].len()), to, weights);
        };
        let row = |y: usize, row: &[f32]| squared(&mut square[y * width..(y + 1) * width], row, norm);
        plane.inverse(support, fill, plane.height, row, scratch);
        let fill = |y: usize, line: &mut [f32]| {
            line.copy_from_slice(&square[y * width..(y + 1) * width]);
            true
        };
        plane.forward(support, 0..plane.height, fill, correction, scratch);
        for (amplitude, absorbed) in amplitude.iter_mut().zip(&*absorbed) {
            *amplitude = absorbed - *amplitude * 2.0;
        }
        for x in 0..support.columns() {
            let to = support.column_mut(correction, x);
            in_focus.add(Part::Absorption, self.column(x), support.column(amplitude, x, to[1].len()), to, weights);
        }
    }

    /// What is absorbed in the picture, in units of 1 over the object's samples: `row` gets the first `rows` rows.
    pub(crate) fn absorption(
        &self,
        filter: &Filter,
        spectra: &Spectra,
        memory: &mut Memory,
        rows: usize,
        row: impl FnMut(usize, &[f32]),
    ) {
        let Memory { plane, weights, .. } = memory;
        let add = |x: usize, [above, below]: [&mut [Complex32]; 2]| {
            let (reach, at) = (below.len(), self.column(x));
            let from = self.object.support.column(&spectra.absorbed, x, reach);
            filter.add(Part::Absorption, at, from, [&mut *above, &mut *below], weights);
            if filter.is_corrected {
                let from = self.object.support.column(&spectra.correction, x, reach);
                filter.add(Part::Correction, at, from, [above, below], weights);
            }
        };
        self.invert(filter.lattice, add, rows, row, plane);
    }

    /// The phases in the picture of all that is imaged on `lattice`, in units of 1 over the object's samples.
    pub(crate) fn phase<'a>(
        &self,
        lattice: Lattice,
        parts: impl Iterator<Item = (&'a Filter, &'a Spectra)> + Clone,
        memory: &mut Memory,
        rows: usize,
        row: impl FnMut(usize, &[f32]),
    ) {
        let Memory { plane, weights, .. } = memory;
        let add = |x: usize, [above, below]: [&mut [Complex32]; 2]| {
            for (filter, spectra) in parts.clone() {
                let from = self.object.support.column(&spectra.phase, x, below.len());
                filter.add(Part::Phase, self.column(x), from, [&mut *above, &mut *below], weights);
            }
        };
        self.invert(lattice, add, rows, row, plane);
    }

    fn invert(
        &self,
        lattice: Lattice,
        mut add: impl FnMut(usize, [&mut [Complex32]; 2]),
        rows: usize,
        row: impl FnMut(usize, &[f32]),
        scratch: &mut PlaneScratch,
    ) {
        let Raster { plane, support } = self.raster(lattice);
        let fill = |x: usize, [above, below]: [&mut [Complex32]; 2]| {
            add(x, [&mut *above, &mut *below]);
            if lattice == Lattice::Camera {
                let (mean_x, mean_y) = (self.pixel[0].moved[x], &self.pixel[1].moved);
                for (value, mean_y) in above.iter_mut().zip(mean_y) {
                    *value *= mean_x * mean_y;
                }
                for (value, mean_y) in below.iter_mut().rev().zip(&mean_y[1..]) {
                    *value *= mean_x * mean_y.conj();
                }
            }
        };
        plane.inverse(support, fill, rows, row, scratch);
    }

    /// Multiplies `product`, rows of `width`, by what one thing lets through; gives the number of values that were
    /// too low.
    pub(crate) fn transmit(
        &self,
        filter: &Filter,
        spectra: &Spectra,
        memory: &mut Memory,
        product: &mut [f32],
        width: usize,
    ) -> usize {
        let (norm, mut floored) = (self.object.plane.norm(), 0);
        let rows = product.len() / width;
        self.absorption(filter, spectra, memory, rows, |y, row| {
            floored += transmit(&mut product[y * width..(y + 1) * width], row, norm);
        });
        floored
    }

    /// Multiplies `product`, rows of `width`, by the light that phases move.
    pub(crate) fn refract<'a>(
        &self,
        lattice: Lattice,
        parts: impl Iterator<Item = (&'a Filter, &'a Spectra)> + Clone,
        memory: &mut Memory,
        product: &mut [f32],
        width: usize,
    ) {
        let norm = self.object.plane.norm();
        let rows = product.len() / width;
        self.phase(lattice, parts, memory, rows, |y, row| {
            times_exp(&mut product[y * width..(y + 1) * width], row, -2.0 * norm);
        });
    }
}

/// (1/n) ∑ₖ exp 2πi f k over the samples of a pixel: around its middle, and from its first sample, k = 0 … n − 1. f
/// in cycles per sample.
#[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 spectra")]
fn mean_over_pixel(f: f64, n: usize) -> (f32, Complex32) {
    let (mut middle, mut moved) = (0.0, [0.0; 2]);
    for k in 0..n {
        let (c, s) = turn(f * k as f64);
        moved = [moved[0] + c / n as f64, moved[1] + s / n as f64];
        middle += turn(f * (k as f64 - 0.5 * (n - 1) as f64)).0 / n as f64;
    }
    (middle as f32, Complex32::new(moved[0] as f32, moved[1] as f32))
}

#[multiversion(targets = "simd")]
fn squared(to: &mut [f32], u: &[f32], norm: f32) {
    for (to, u) in to.iter_mut().zip(u) {
        let u = u * norm;
        *to = u * u;
    }
}

/// Multiplies by 1 − lost light; gives the number of values that were too low.
#[multiversion(targets = "simd")]
fn transmit(product: &mut [f32], lost: &[f32], norm: f32) -> usize {
    let mut floored = 0_u32;
    for (product, lost) in product.iter_mut().zip(lost) {
        let light = 1.0 - lost * norm;
        floored += u32::from(light < LEAST_LIGHT);
        *product *= light.max(LEAST_LIGHT);
    }
    floored as usize
}

/// From 1 − T to 1 − √T.
#[multiversion(targets = "simd")]
pub(crate) fn amplitude(line: &mut [f32]) {
    for v in line {
        // (1 − T)/(1 + √T) keeps the digits of little absorption.
        *v /= 1.0 + (1.0 - *v).max(0.0).sqrt();
    }
}

/// From T to 1 − T; says whether there is anything.
#[multiversion(targets = "simd")]
pub(crate) fn absorbed_of(transmittance: &[f32], line: &mut [f32]) -> bool {
    let mut lit = false;
    for (line, t) in line.iter_mut().zip(transmittance) {
        *line = 1.0 - t;
        lit |= *t != 1.0;
    }
    lit
}

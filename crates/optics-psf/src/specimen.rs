use multiversion::multiversion;
use rustfft::num_complex::Complex32;

use crate::BrightField;
use crate::exp::{absorbed, times_exp};
use crate::filter::{Filter, Grid, Part};
use crate::real_plane::{PlaneScratch, Support};

/// Least light that a slab lets through: W ⊗ 10^(−A) undershoots to about −0.05 beside things of A > 1,
/// and there is no negative light.
pub const LEAST_LIGHT: f32 = 1e-3;

/// What is on the slide, slab by slab, as the spectra of what it absorbs and delays. It is made by
/// [`BrightField::specimen`], belongs to that, and is also its working memory: with the same one,
/// nothing is allocated after the first object and picture.
#[derive(Debug, Clone, Default)]
pub struct Specimen {
    slabs: Vec<Slab>,
    memory: Memory,
}

/// One slab; spectra are empty where there is nothing.
#[derive(Debug, Clone, Default)]
struct Slab {
    /// Of 1 − 10^(−A).
    absorbed: Vec<Complex32>,
    /// Of a = 1 − 10^(−A/2), where some plane needs it.
    amplitude: Vec<Complex32>,
    /// Of (1 − W₀ ⊗ a)² − W₀ ⊗ 10^(−A), once it was needed.
    correction: Vec<Complex32>,
    /// Of φ.
    phase: Vec<Complex32>,
}

#[derive(Debug, Clone, Default)]
struct Memory {
    plane: PlaneScratch,
    line: Vec<f32>,
    sum: Vec<Complex32>,
    product: Vec<f32>,
    correction: Vec<f32>,
}

impl Slab {
    fn is_empty(&self) -> bool {
        self.absorbed.is_empty() && self.phase.is_empty()
    }
}

impl Memory {
    /// A sum of spectra, as yet of none.
    fn start(&mut self, support: &Support) {
        self.sum.clear();
        self.sum.resize(support.len(), Complex32::ZERO);
    }
}

impl Specimen {
    pub(crate) fn new(slabs: usize) -> Self {
        Self { slabs: vec![Slab::default(); slabs], memory: Memory::default() }
    }

    /// Empties the slide.
    pub fn clear(&mut self) {
        for slab in &mut self.slabs {
            for spectrum in [&mut slab.absorbed, &mut slab.amplitude, &mut slab.correction, &mut slab.phase] {
                spectrum.clear();
            }
        }
    }
}

impl BrightField {
    /// Puts decadic absorbances, 0 or more, into a slab in place of what was there; its phase stays.
    ///
    /// # Panics
    ///
    /// If there is no such slab, or the slice has not as many samples as the object.
    pub fn set_absorbance(&self, specimen: &mut Specimen, slab: usize, absorbance: &[f32]) {
        self.set_absorbed(specimen, slab, absorbance, |row, line| {
            let lit = row.iter().any(|a| *a != 0.0);
            if lit {
                absorbed(row, line);
            }
            lit
        });
    }

    /// Puts transmittances, 0 to 1, into a slab in place of what was there; its phase stays.
    ///
    /// # Panics
    ///
    /// As [`BrightField::set_absorbance`].
    pub fn set_transmittance(&self, specimen: &mut Specimen, slab: usize, transmittance: &[f32]) {
        self.set_absorbed(specimen, slab, transmittance, |row, line| {
            for (line, t) in line.iter_mut().zip(row) {
                *line = 1.0 - t;
            }
            row.iter().any(|t| *t != 1.0)
        });
    }

    /// Puts phases, by how many radians light is late, into a slab in place of those that were
    /// there; what it absorbs stays.
    ///
    /// # Panics
    ///
    /// As [`BrightField::set_absorbance`].
    pub fn set_phase(&self, specimen: &mut Specimen, slab: usize, phase_rad: &[f32]) {
        self.check(phase_rad);
        let Specimen { slabs, memory } = specimen;
        let spectrum = &mut slabs[slab].phase;
        spectrum.clear();
        self.transform(phase_rad, spectrum, memory, |row, line| {
            line.copy_from_slice(row);
            row.iter().any(|v| *v != 0.0)
        });
    }

    fn check(&self, samples: &[f32]) {
        assert_eq!(samples.len(), self.size[0] * self.size[1], "a slab has other samples than the object");
    }

    fn set_absorbed(
        &self,
        specimen: &mut Specimen,
        slab: usize,
        samples: &[f32],
        row: impl Fn(&[f32], &mut [f32]) -> bool,
    ) {
        self.check(samples);
        let Specimen { slabs, memory } = specimen;
        let spectra = &mut slabs[slab];
        for spectrum in [&mut spectra.absorbed, &mut spectra.amplitude, &mut spectra.correction] {
            spectrum.clear();
        }
        self.transform(samples, &mut spectra.absorbed, memory, &row);
        if self.is_corrected(slab) && !spectra.absorbed.is_empty() {
            self.transform(samples, &mut spectra.amplitude, memory, |samples, line| {
                let lit = row(samples, line);
                if lit {
                    absorbed_amplitude(line);
                }
                lit
            });
        }
    }

    /// The spectrum of what `row` makes of each row of samples; none if all are empty.
    fn transform(
        &self,
        samples: &[f32],
        spectrum: &mut Vec<Complex32>,
        memory: &mut Memory,
        row: impl Fn(&[f32], &mut [f32]) -> bool,
    ) {
        let [width, height] = self.size;
        let first = samples[0];
        if samples.iter().all(|v| *v == first) && !row(&samples[..width], &mut vec![0.0; width]) {
            return;
        }
        let fill = |y: usize, line: &mut [f32]| {
            line[width..].fill(0.0);
            y < height && row(&samples[y * width..(y + 1) * width], &mut line[..width])
        };
        self.object.forward(&self.support, fill, spectrum, &mut memory.line, &mut memory.plane);
    }

    /// The picture of a plane: the light of each pixel of the camera relative to that of empty slide, stray
    /// light included.
    ///
    /// # Panics
    ///
    /// If there is no such plane, or the specimen is another's.
    #[must_use]
    pub fn image(&self, specimen: &mut Specimen, plane: usize) -> Vec<f32> {
        let mut out = vec![0.0; self.image_width() * self.image_height()];
        self.image_into(specimen, plane, &mut out);
        out
    }

    /// The picture of a plane, into `out`. Gives the number of places where a slab would have let
    /// less than [`LEAST_LIGHT`] through, in pixels of the camera.
    ///
    /// # Panics
    ///
    /// If there is no such plane, the specimen is another's, or `out` has not
    /// [`image_width`](Self::image_width) · [`image_height`](Self::image_height) pixels.
    pub fn image_into(&self, specimen: &mut Specimen, plane: usize, out: &mut [f32]) -> usize {
        assert_eq!(out.len(), self.image_width() * self.image_height(), "the picture has another size");
        let Specimen { slabs, memory } = specimen;
        let filters = &self.planes[plane];
        assert_eq!(slabs.len(), filters.len(), "the specimen has other slabs");
        for (slab, filter) in slabs.iter_mut().zip(filters) {
            if filter.is_corrected && slab.correction.is_empty() && !slab.amplitude.is_empty() {
                self.correct(slab, memory);
            }
        }
        let oversampling = self.microscope.params().oversampling;
        let [width, height] = self.size;
        let mut floored = 0;
        let fine = slabs.iter().zip(filters).any(|(slab, filter)| filter.grid == Grid::Object && !slab.is_empty());
        if fine {
            let mut product = core::mem::take(&mut memory.product);
            product.clear();
            product.resize(width * height, 1.0);
            let samples = self.expose(Grid::Object, slabs, filters, &mut product, width, memory);
            floored = samples.div_ceil(oversampling * oversampling);
            mean_of_pixels(&product, width, oversampling, out);
            memory.product = product;
        } else {
            out.fill(1.0);
        }
        floored += self.expose(Grid::Camera, slabs, filters, out, self.image_width(), memory);
        let stray = self.microscope.params().stray_light;
        if stray > 0.0 {
            #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 pixels")]
            let (stray, rest) = (stray as f32, (1.0 - stray) as f32);
            for light in &mut *out {
                *light = stray + rest * *light;
            }
        }
        floored
    }

    /// The correction of the in-focus form, (1 − W₀ ⊗ a)² − W₀ ⊗ 10^(−A).
    fn correct(&self, slab: &mut Slab, memory: &mut Memory) {
        let (plane, support) = (&self.correction, &self.corrected);
        let norm = self.object.norm();
        let mut correction = core::mem::take(&mut memory.correction);
        correction.resize(plane.width * plane.height, 0.0);
        let parts = [(&slab.amplitude, squared as fn(&mut [f32], &[f32], f32)), (&slab.absorbed, added as _)];
        for (spectrum, accept) in parts {
            memory.start(support);
            let both = (support, &self.support);
            self.in_focus.add(Part::Absorption, spectrum, both, &self.positions, &mut memory.sum);
            let rows = |y: usize, row: &[f32]| {
                accept(&mut correction[y * plane.width..(y + 1) * plane.width], row, norm);
            };
            plane.inverse(support, &memory.sum, rows, &mut memory.line, &mut memory.plane);
        }
        // The sum over fewer samples weighs as much as one over all.
        let weight = plane.norm() / norm;
        let fill = |y: usize, line: &mut [f32]| {
            for (v, c) in line.iter_mut().zip(&correction[y * plane.width..(y + 1) * plane.width]) {
                *v = c * weight;
            }
            true
        };
        plane.forward(support, fill, &mut memory.sum, &mut memory.line, &mut memory.plane);
        slab.correction.clear();
        slab.correction.resize(self.support.len(), Complex32::ZERO);
        for (few, all) in support.runs(&self.support) {
            slab.correction[all].copy_from_slice(&memory.sum[few]);
        }
        memory.correction = correction;
    }

    /// Multiplies `product` by what the slabs that are computed on `grid` let through.
    fn expose(
        &self,
        grid: Grid,
        slabs: &[Slab],
        filters: &[Filter],
        product: &mut [f32],
        width: usize,
        memory: &mut Memory,
    ) -> usize {
        let norm = self.object.norm();
        let whole = (self.lattice(grid).1, &self.support);
        let here = || slabs.iter().zip(filters).filter(|(_, filter)| filter.grid == grid);
        let mut floored = 0;
        for (slab, filter) in here().filter(|(slab, _)| !slab.absorbed.is_empty()) {
            memory.start(whole.0);
            filter.add(Part::Absorption, &slab.absorbed, whole, &self.positions, &mut memory.sum);
            if filter.is_corrected {
                filter.add(Part::Correction, &slab.correction, whole, &self.positions, &mut memory.sum);
            }
            self.invert(grid, memory, |y, row| {
                if let Some(product) = product.get_mut(y * width..(y + 1) * width) {
                    floored += transmit(product, row, norm);
                }
            });
        }
        if here().any(|(slab, _)| !slab.phase.is_empty()) {
            memory.start(whole.0);
            for (slab, filter) in here().filter(|(slab, _)| !slab.phase.is_empty()) {
                filter.add(Part::Phase, &slab.phase, whole, &self.positions, &mut memory.sum);
            }
            self.invert(grid, memory, |y, row| {
                if let Some(product) = product.get_mut(y * width..(y + 1) * width) {
                    times_exp(product, row, -2.0 * norm);
                }
            });
        }
        floored
    }

    /// The image of the sum of spectra, row by row.
    fn invert(&self, grid: Grid, memory: &mut Memory, row: impl FnMut(usize, &[f32])) {
        let (plane, support) = self.lattice(grid);
        if grid == Grid::Camera {
            for (to, from) in support.runs(&self.support) {
                for (value, pixel) in memory.sum[to].iter_mut().zip(&self.pixel[from]) {
                    *value *= pixel;
                }
            }
        }
        plane.inverse(support, &memory.sum, row, &mut memory.line, &mut memory.plane);
    }
}

/// From 1 − T to 1 − √T.
#[multiversion(targets = "simd")]
fn absorbed_amplitude(line: &mut [f32]) {
    for v in line {
        // (1 − T)/(1 + √T) keeps the digits of little absorption.
        *v /= 1.0 + (1.0 - *v).max(0.0).sqrt();
    }
}

/// (1 − u)² − 1.
#[multiversion(targets = "simd")]
fn squared(to: &mut [f32], u: &[f32], norm: f32) {
    for (to, u) in to.iter_mut().zip(u) {
        let u = u * norm;
        *to = u * (u - 2.0);
    }
}

#[multiversion(targets = "simd")]
fn added(to: &mut [f32], v: &[f32], norm: f32) {
    for (to, v) in to.iter_mut().zip(v) {
        *to += v * norm;
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

/// The mean over the samples of each pixel.
fn mean_of_pixels(samples: &[f32], width: usize, oversampling: usize, out: &mut [f32]) {
    let n = oversampling;
    #[expect(clippy::cast_possible_truncation, reason = "at most 256 samples")]
    let weight = (1.0 / (n * n) as f64) as f32;
    for (out, rows) in out.chunks_exact_mut(width / n).zip(samples.chunks_exact(width * n)) {
        out.fill(0.0);
        for row in rows.chunks_exact(width) {
            for (out, samples) in out.iter_mut().zip(row.chunks_exact(n)) {
                *out += samples.iter().sum::<f32>();
            }
        }
        for out in out {
            *out *= weight;
        }
    }
}

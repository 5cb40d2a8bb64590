use multiversion::multiversion;
use portable_numerics::elementary::exp_f32;

use crate::Microscope;
use crate::filter::{Block, Filter, Lattice, Part};
use crate::lane_plane::{LANES, LanePlane, LanePlans, LaneScratch, LaneSupport, Lanes, STRIPE, ZERO};
use crate::pupil::turn;
use crate::transfer::Transfer;

/// Smallest transmittance of a factor. W ⊗ 10^(−A) undershoots to about −0.05 next to objects of A > 1; light cannot be
/// negative.
pub const MIN_TRANSMITTANCE: f32 = 1e-3;

/// A periodic rectangle of the slide with its object and camera lattices.
#[derive(Debug)]
pub(crate) struct Canvas {
    object: Raster,
    camera: Raster,
    /// Grid on which blurred amplitudes are squared.
    squares: LanePlane,
    /// Frequency step along x, in steps of the filters' tables.
    step_x: f32,
    /// Frequencies along y in these steps, per block.
    y: Vec<[f32; LANES]>,
    /// Transfer of the pixel mean along x and y.
    pixel: [PixelMean; 2],
}

/// A lattice and the frequencies that the microscope transfers.
#[derive(Debug)]
struct Raster {
    plane: LanePlane,
    support: LaneSupport,
}

/// Transfer of the pixel mean at frequencies 0, 1, … of one axis.
#[derive(Debug)]
struct PixelMean {
    /// Relative to the centre of the pixel.
    size: Vec<f32>,
    /// Relative to its first sample.
    moved: Vec<[f32; 2]>,
}

impl PixelMean {
    /// Computes complete blocks of frequencies. The mean is (1/n) ∑ₖ exp 2πi f k over the samples of a pixel, with f in
    /// cycles per sample: relative to its centre, and relative to its first sample, k = 0 … n − 1.
    #[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
    fn new(side: usize, n: usize) -> Self {
        let mean = |place: usize| {
            let f = place as f64 / side as f64;
            let (mut centred, mut moved) = (0.0, [0.0; 2]);
            for k in 0..n {
                let (c, s) = turn(f * k as f64);
                moved = [moved[0] + c / n as f64, moved[1] + s / n as f64];
                centred += turn(f * (k as f64 - 0.5 * (n - 1) as f64)).0 / n as f64;
            }
            (centred as f32, moved.map(|v| v as f32))
        };
        let (size, moved) = (0..(side / 2 + 1).next_multiple_of(LANES)).map(mean).unzip();
        Self { size, moved }
    }
}

/// Spectra of an object at one depth; empty vectors stand for zero.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectra {
    /// Spectrum of 1 − 10^(−A).
    pub(crate) absorbed: Vec<Lanes>,
    /// Spectrum of a = 1 − 10^(−A/2) if the correction needs it; later of 1 − 10^(−A) − 2a.
    pub(crate) amplitude: Vec<Lanes>,
    /// Spectrum of (1 − W₀ ⊗ a)² − W₀ ⊗ 10^(−A), computed on demand.
    pub(crate) correction: Vec<Lanes>,
    /// Spectrum of φ.
    pub(crate) phase: Vec<Lanes>,
}

impl Spectra {
    pub(crate) fn is_empty(&self) -> bool {
        self.absorbed.is_empty() && self.phase.is_empty()
    }

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

/// Samples per period of the finest transferred detail on the grid for squares. Three would avoid all aliases. With
/// fewer, products of two details finer than 0.7 of the cutoff alias; they are negligible.
const SQUARED_CUTOFFS: f64 = 2.4;

impl Canvas {
    /// Creates the lattices. `size` is in object samples, a multiple of the oversampling.
    pub(crate) fn new(microscope: &Microscope, size: [usize; 2], plans: &LanePlans) -> Self {
        let oversampling = microscope.params().oversampling;
        let pitch = microscope.pitch_um();
        let raster = |stride: usize| {
            let [width, height] = size.map(|side| side / stride);
            let support = LaneSupport::new(width, height, microscope.cutoff() * pitch * stride as f64);
            Raster { plane: LanePlane::new(width, height, plans), support }
        };
        // Three samples per four of the object's, if this is fine enough and the size is divisible.
        let is_fine = 0.75 >= SQUARED_CUTOFFS * microscope.cutoff() * pitch;
        let [width, height] = size.map(|side| if is_fine && side.is_multiple_of(4) { side / 4 * 3 } else { side });
        let steps = size.map(|side| 1.0 / (side as f64 * pitch * Transfer::step_of(microscope)));
        let object = raster(1);
        #[expect(clippy::cast_possible_truncation, reason = "tables use single precision")]
        let y = |block: usize| core::array::from_fn(|lane| (block * LANES + lane) as f32 * steps[1] as f32);
        Self {
            y: (0..object.support.blocks()).map(y).collect(),
            camera: raster(oversampling),
            squares: LanePlane::new(width, height, plans),
            object,
            #[expect(clippy::cast_possible_truncation, reason = "tables use single precision")]
            step_x: steps[0] as f32,
            pixel: size.map(|side| PixelMean::new(side, oversampling)),
        }
    }

    /// Computes the spectrum of an image on the object's lattice, or an empty one if the image is empty. `map` is
    /// applied to rows of `width` samples, placed at `offset` from the left and upper edge in `background`. `map` must
    /// return 0 for the background, and reports whether any value is not 0.
    pub(crate) fn transform(
        &self,
        image: Samples<'_>,
        map: impl Fn(&mut [f32]) -> bool,
        spectrum: &mut Vec<Lanes>,
        scratch: &mut LaneScratch,
    ) {
        let Samples { samples, width, offset, background } = image;
        let Raster { plane, support } = &self.object;
        let rows = offset..offset + samples.len() / width;
        let fill = |left: usize, stripe: &mut [Lanes]| {
            let (first, end) = (left.max(offset), (left + STRIPE).min(offset + width));
            if first >= end {
                return false;
            }
            stripe[..rows.start].fill(ZERO);
            stripe[rows.end..].fill(ZERO);
            let inside = &mut stripe[rows.clone()];
            for (stripe, row) in inside.iter_mut().zip(samples.chunks_exact(width)) {
                let (line, row) = (stripe.as_flattened_mut(), &row[first - offset..end - offset]);
                // Full stripes have a length known at compile time.
                match (line.first_chunk_mut::<STRIPE>(), row.first_chunk::<STRIPE>()) {
                    (Some(line), Some(row)) => *line = *row,
                    _ => {
                        line.fill(background);
                        line[first - left..end - left].copy_from_slice(row);
                    }
                }
            }
            map(inside.as_flattened_mut().as_flattened_mut())
        };
        plane.forward(support, fill, spectrum, scratch);
    }

    /// Adds a block of a spectrum times a response of a filter to `sum`.
    fn add(&self, (filter, part): (&Filter, Part), spectrum: &[Lanes], block: usize, reach: usize, sum: &mut [Lanes]) {
        let at = Block {
            step_x: self.step_x,
            y: &self.y[block],
            pixel_x: &self.pixel[0].size,
            pixel_y: &self.pixel[1].size.as_chunks().0[block],
        };
        filter.add(part, at, self.object.support.block(spectrum, block), reach, sum);
    }

    /// Computes the in-focus correction if it is missing. With 1 − T = 2a − a² it is (1 − W₀ ⊗ a)² − W₀ ⊗ T = (W₀ ⊗ a)²
    /// + W₀ ⊗ (1 − T − 2a).
    pub(crate) fn correct(&self, in_focus: &Filter, spectra: &mut Spectra, scratch: &mut LaneScratch) {
        let Spectra { absorbed, amplitude, correction, .. } = spectra;
        if !correction.is_empty() || amplitude.is_empty() {
            return;
        }
        let Raster { plane, support } = &self.object;
        // Scales of the image, and of its spectrum at the object's number of samples.
        let (norm, scale) = (plane.norm(), self.squares.norm() / plane.norm());
        let blurred = (in_focus, Part::Absorption);
        let fill = |block: usize, line: &mut [Lanes]| {
            self.add(blurred, amplitude, block, support.reach(block), line);
        };
        let square = |stripe: &mut [Lanes]| squared(stripe.as_flattened_mut().as_flattened_mut(), norm, scale);
        self.squares.mapped(support, fill, square, correction, scratch);
        twice_less(amplitude.as_flattened_mut().as_flattened_mut(), absorbed.as_flattened().as_flattened());
        for block in 0..support.blocks() {
            self.add(blurred, amplitude, block, support.reach(block), support.block_mut(correction, block));
        }
    }

    fn invert(
        &self,
        lattice: Lattice,
        mut add: impl FnMut(usize, usize, &mut [Lanes]),
        columns: usize,
        visit: impl FnMut(usize, &[Lanes]),
        scratch: &mut LaneScratch,
    ) {
        let Raster { plane, support } = match lattice {
            Lattice::Object => &self.object,
            Lattice::Camera => &self.camera,
        };
        let fill = |block: usize, line: &mut [Lanes]| {
            let reach = support.reach(block);
            add(block, reach, line);
            if lattice == Lattice::Camera {
                let [x, y] = &self.pixel;
                mean_over_pixels(line, &x.moved[..=reach], &y.moved.as_chunks().0[block]);
            }
        };
        plane.inverse(support, fill, columns, visit, scratch);
    }

    /// Multiplies `product`, in rows of `width`, by the transmittance of an object, or assigns it if `FIRST`. Returns
    /// the number of clipped values.
    pub(crate) fn transmit<const FIRST: bool>(
        &self,
        filter: &Filter,
        spectra: &Spectra,
        product: &mut [f32],
        width: usize,
        scratch: &mut LaneScratch,
    ) -> usize {
        let add = |block: usize, reach: usize, line: &mut [Lanes]| {
            self.add((filter, Part::Absorption), &spectra.absorbed, block, reach, line);
            if filter.is_corrected {
                self.add((filter, Part::Correction), &spectra.correction, block, reach, line);
            }
        };
        let (norm, mut clipped) = (self.object.plane.norm(), 0);
        let visit = |left: usize, stripe: &[Lanes]| {
            clipped += transmit::<FIRST>(product, width, left, stripe, norm);
        };
        self.invert(filter.lattice, add, width, visit, scratch);
        clipped
    }

    /// Multiplies `product`, in rows of `width`, by the effect of the phase delays of all objects on `lattice`.
    pub(crate) fn refract<'a>(
        &self,
        lattice: Lattice,
        parts: impl Iterator<Item = (&'a Filter, &'a Spectra)> + Clone,
        product: &mut [f32],
        width: usize,
        scratch: &mut LaneScratch,
    ) {
        let add = |block: usize, reach: usize, line: &mut [Lanes]| {
            for (filter, spectra) in parts.clone() {
                self.add((filter, Part::Phase), &spectra.phase, block, reach, line);
            }
        };
        let factor = -2.0 * self.object.plane.norm();
        let visit = |left: usize, stripe: &[Lanes]| delay(product, width, left, stripe, factor);
        self.invert(lattice, add, width, visit, scratch);
    }
}

/// Rows of samples in a canvas, with a margin of `offset` at the left and at the top.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Samples<'a> {
    pub(crate) samples: &'a [f32],
    pub(crate) width: usize,
    pub(crate) offset: usize,
    pub(crate) background: f32,
}

#[multiversion(targets = "simd")]
fn squared(values: &mut [f32], norm: f32, scale: f32) {
    for value in values {
        let u = *value * norm;
        *value = scale * (u * u);
    }
}

/// Replaces a by 1 − T − 2a.
#[multiversion(targets = "simd")]
fn twice_less(amplitude: &mut [f32], absorbed: &[f32]) {
    for (amplitude, absorbed) in amplitude.iter_mut().zip(absorbed) {
        *amplitude = absorbed - 2.0 * *amplitude;
    }
}

/// Multiplies a block by the transfer of the pixel mean, for kx = 0 … and … −1 at its end.
#[multiversion(targets = "simd")]
fn mean_over_pixels(line: &mut [Lanes], x: &[[f32; 2]], y: &[[f32; 2]; LANES]) {
    let (y_re, y_im) = (y.map(|y| y[0]), y.map(|y| y[1]));
    let len = line.len();
    for (k, &[x_re, x_im]) in x.iter().enumerate() {
        turn_lanes(&mut line[k], [x_re, x_im], &y_re, &y_im);
        if k > 0 {
            turn_lanes(&mut line[len - k], [x_re, -x_im], &y_re, &y_im);
        }
    }
}

/// Multiplies by x·y.
#[inline(always)]
fn turn_lanes(values: &mut Lanes, x: [f32; 2], y_re: &[f32; LANES], y_im: &[f32; LANES]) {
    for l in 0..LANES {
        let w = [x[0] * y_re[l] - x[1] * y_im[l], x[0] * y_im[l] + x[1] * y_re[l]];
        let (re, im) = (values[0][l], values[1][l]);
        values[0][l] = re * w[0] - im * w[1];
        values[1][l] = re * w[1] + im * w[0];
    }
}

/// Multiplies a stripe of columns of `product`, in rows of `width`, by 1 − absorbed light, or assigns it if `FIRST`.
/// Returns the number of clipped values.
#[multiversion(targets = "simd")]
fn transmit<const FIRST: bool>(product: &mut [f32], width: usize, left: usize, lost: &[Lanes], norm: f32) -> usize {
    let mut clipped = 0_u32;
    for (row, lost) in product.chunks_exact_mut(width).zip(lost) {
        for (product, lost) in row[left..].iter_mut().zip(lost.as_flattened()) {
            let light = 1.0 - lost * norm;
            clipped += u32::from(light < MIN_TRANSMITTANCE);
            let light = light.max(MIN_TRANSMITTANCE);
            *product = if FIRST { light } else { *product * light };
        }
    }
    clipped as usize
}

/// Multiplies a stripe by exp(factor · v).
#[multiversion(targets = "simd")]
fn delay(product: &mut [f32], width: usize, left: usize, phases: &[Lanes], factor: f32) {
    for (row, phases) in product.chunks_exact_mut(width).zip(phases) {
        for (product, v) in row[left..].iter_mut().zip(phases.as_flattened()) {
            *product *= exp_f32(factor * v);
        }
    }
}

/// Converts 1 − T to 1 − √T.
#[multiversion(targets = "simd")]
fn amplitude(line: &mut [f32]) {
    for v in line {
        // (1 − T)/(1 + √T) is accurate for small absorption.
        *v /= 1.0 + (1.0 - *v).max(0.0).sqrt();
    }
}

/// Converts absorbance A to 1 − T = 1 − 10^(−A) (Eq. 11). Returns whether any value is not 0.
#[multiversion(targets = "simd")]
pub(crate) fn absorbed(values: &mut [f32]) -> bool {
    let nonzero = is_nonzero(values);
    if nonzero {
        for value in values {
            *value = 1.0 - exp_f32(-*value * core::f32::consts::LN_10);
        }
    }
    nonzero
}

/// Converts T to 1 − T. Returns whether any value is not 0.
#[multiversion(targets = "simd")]
pub(crate) fn absorbed_of(values: &mut [f32]) -> bool {
    let mut nonzero = 0_u32;
    for value in values {
        *value = 1.0 - *value;
        nonzero |= value.to_bits();
    }
    nonzero != 0
}

/// Returns a conversion to 1 − √T, from one to 1 − T.
pub(crate) fn amplitude_of(absorbed: impl Fn(&mut [f32]) -> bool) -> impl Fn(&mut [f32]) -> bool {
    move |values| {
        let nonzero = absorbed(values);
        if nonzero {
            amplitude(values);
        }
        nonzero
    }
}

/// Returns whether any value is not 0.
#[multiversion(targets = "simd")]
pub(crate) fn is_nonzero(values: &mut [f32]) -> bool {
    values.iter().fold(0, |nonzero, value| nonzero | (value.to_bits() << 1)) != 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MicroscopeParams;

    #[test]
    fn squares_on_a_coarser_grid_are_accurate() {
        for (na, condenser_na) in [(0.95, 0.41), (0.65, 0.65), (0.9, 0.3)] {
            let params = MicroscopeParams { na, condenser_na, ..MicroscopeParams::default() };
            let (microscope, plans) = (Microscope::new(&params).unwrap(), LanePlans::default());
            let sparse = Canvas::new(&microscope, [240, 192], &plans);
            let mut full = Canvas::new(&microscope, [240, 192], &plans);
            assert_eq!(sparse.squares.width, 180);
            full.squares = full.object.plane.clone();
            // Sharp and nearly opaque: a disc, a bar and specks of one sample.
            let (width, height) = (160, 120);
            let sample = |i: usize| {
                let (x, y) = (i % width, i / width);
                let disc = x.abs_diff(50).pow(2) + y.abs_diff(60).pow(2) < 900;
                let bar = (x + y).is_multiple_of(7) && x > 110;
                let speck = x.is_multiple_of(11) && y.is_multiple_of(13);
                if disc || bar || speck { 0.02 } else { 0.8 }
            };
            let samples: Vec<f32> = (0..width * height).map(sample).collect();
            let samples = Samples { samples: &samples, width, offset: 32, background: 1.0 };
            let in_focus = Filter::in_focus(&microscope);
            for depth in [0.0, 0.9] {
                let transfer = Transfer::new(&microscope, depth, 0.0);
                let filter = Filter::new(&microscope, depth, 0.0, &transfer);
                let light = |canvas: &Canvas| {
                    let (mut spectra, mut scratch) = (Spectra::default(), LaneScratch::default());
                    canvas.transform(samples, absorbed_of, &mut spectra.absorbed, &mut scratch);
                    canvas.transform(samples, amplitude_of(absorbed_of), &mut spectra.amplitude, &mut scratch);
                    canvas.correct(&in_focus, &mut spectra, &mut scratch);
                    let mut product = vec![1.0; 240 * 192];
                    canvas.transmit::<false>(&filter, &spectra, &mut product, 240, &mut scratch);
                    product
                };
                let (found, expected) = (light(&sparse), light(&full));
                let error = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(error < 5e-4, "{na} {condenser_na} {depth}: {error}");
            }
        }
    }
}

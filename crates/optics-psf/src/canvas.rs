use multiversion::multiversion;
use portable_numerics::elementary::exp_f32;

use crate::Microscope;
use crate::filter::{Block, BlockSpectrum, Filter};
use crate::pupil::turn;
use crate::spectrum::{Grid, GridScratch, LANES, LanePlans, Lanes, Pixels, Spectrum, Support, ZERO};
use crate::transfer::Transfer;

/// Smallest transmittance of a factor. W ⊗ 10^(−A) undershoots to about −0.05 next to objects of A > 1; light cannot be
/// negative.
pub const MIN_TRANSMITTANCE: f32 = 1e-3;

/// A periodic rectangle of the slide: the lattice of an object, one or several samples per pixel, and that of the
/// camera.
#[derive(Debug)]
pub(crate) struct Canvas {
    object: Grid,
    /// Grid on which blurred amplitudes are squared.
    squares: Grid,
    camera: Grid,
    support: Support,
    /// Frequency step along x, in steps of the filters' tables.
    step_x: f32,
    /// Frequencies along y in these steps, per block.
    y: Vec<[f32; LANES]>,
    /// Transfer of the mean over the samples of a pixel along x and y.
    pixel: [PixelMean; 2],
    mean: Mean,
}

/// How the mean over the samples of a pixel is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mean {
    /// Each sample is that of a pixel.
    None,
    /// By the filter: one sample per pixel, at its centre, is the mean of several points.
    Centred,
    /// By a factor that moves the image from the first sample of a pixel to its centre.
    Moved,
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
    /// Computes complete blocks of frequencies. The mean is over `n` points per pixel and axis, of an image with
    /// `samples` per pixel and axis.
    ///
    /// If there are fewer samples than points, each sample is already the mean of its points, interpolated by
    /// Catmull–Rom cubics. That mean contains the images of the interpolation, which no lens transfers: the ratio of
    /// the responses without and with images removes them.
    #[expect(clippy::cast_possible_truncation, reason = "spectra use single precision")]
    fn new(side: usize, samples: usize, n: usize) -> Self {
        // Positions of the points relative to the centre of the first sample.
        let point = |k: usize| (k as f64 + 0.5) * samples as f64 / n as f64 - 0.5;
        let centre = 0.5 * (samples - 1) as f64;
        let mean = |place: usize| {
            let f = place as f64 / side as f64;
            let (mut centred, mut moved, mut cubic) = (0.0, [0.0; 2], [0.0; 2]);
            for k in 0..n {
                let (c, s) = turn(f * point(k));
                moved = [moved[0] + c / n as f64, moved[1] + s / n as f64];
                centred += turn(f * (point(k) - centre)).0 / n as f64;
                let [without, with] = cubic_responses(f, point(k));
                cubic = [cubic[0] + without, cubic[1] + with];
            }
            let ratio = if samples < n { cubic[0] / cubic[1] } else { 1.0 };
            ((ratio * centred) as f32, moved.map(|v| (ratio * v) as f32))
        };
        let (size, moved) = (0..(side / 2 + 1).next_multiple_of(LANES)).map(mean).unzip();
        Self { size, moved }
    }
}

/// Returns the response of Catmull–Rom interpolation to a frequency in cycles per sample, at a position in samples: the
/// wave itself, and together with its images at higher frequencies, relative to the wave at the position 0.
fn cubic_responses(f: f64, position: f64) -> [f64; 2] {
    let first = position.floor();
    let t = position - first;
    let weights = [
        ((-0.5 * t + 1.0) * t - 0.5) * t,
        (1.5 * t - 2.5) * t * t + 1.0,
        ((-1.5 * t + 2.0) * t + 0.5) * t,
        (0.5 * t - 0.5) * t * t,
    ];
    let mut responses = [0.0; 2];
    for (weight, neighbour) in weights.into_iter().zip([first - 1.0, first, first + 1.0, first + 2.0]) {
        responses[0] += weight * turn(f * (neighbour - position)).0;
        responses[1] += weight * turn(f * neighbour).0;
    }
    responses
}

/// Spectra of an object at one depth.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectra {
    /// Spectrum of absorbed light 1 − T, plus i times the phase delay if there is one.
    light: Spectrum,
    /// Spectrum of (W₀ ⊗ a)² − W₀ ⊗ a² for a = 1 − √T, computed on demand.
    correction: Spectrum,
}

impl Spectra {
    pub(crate) fn clear(&mut self) {
        self.light.clear();
        self.correction.clear();
    }
}

/// Samples of an object, in rows of `width`, with a margin of `offset` samples of empty slide at the left and at the
/// top.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Samples<'a> {
    /// Light absorbed by the object: transmittance without it minus transmittance with it.
    pub(crate) absorbed: &'a [f32],
    /// Transmittance without the object; empty if it is 1.
    pub(crate) behind: &'a [f32],
    /// Phase delay in radians; empty if there is none.
    pub(crate) phase: &'a [f32],
    pub(crate) width: usize,
    pub(crate) offset: usize,
}

/// Working memory of [`Canvas`].
#[derive(Debug, Clone, Default)]
pub(crate) struct CanvasScratch {
    grid: GridScratch,
    /// Amplitude a, and a².
    amplitude: Vec<f32>,
    square: Vec<f32>,
    spectra: [Spectrum; 2],
    block: Vec<Lanes>,
}

/// Samples per period of the finest transferred detail on the grid for squares. Three would avoid all aliases. With
/// fewer, products of two details finer than 0.7 of the cutoff alias; they are negligible.
const SQUARED_CUTOFFS: f64 = 2.4;

impl Canvas {
    /// Creates the lattices of a rectangle of `size_px`, with `samples` per pixel and axis.
    pub(crate) fn new(microscope: &Microscope, size_px: [usize; 2], samples: usize, plans: &LanePlans) -> Self {
        let pitch = microscope.params().pixel_um / samples as f64;
        let size = size_px.map(|side| side * samples);
        let support = Support::new(size, microscope.cutoff() * pitch);
        // Three samples per four of the object's, if this is fine enough and the size is divisible.
        let is_fine = 0.75 >= SQUARED_CUTOFFS * microscope.cutoff() * pitch;
        let squares = size.map(|side| if is_fine && side.is_multiple_of(4) { side / 4 * 3 } else { side });
        let steps = size.map(|side| 1.0 / (side as f64 * pitch * Transfer::step_of(microscope)));
        #[expect(clippy::cast_possible_truncation, reason = "tables use single precision")]
        let y = |block: usize| core::array::from_fn(|lane| (block * LANES + lane) as f32 * steps[1] as f32);
        Self {
            y: (0..support.blocks()).map(y).collect(),
            object: Grid::new(size, plans),
            squares: Grid::new(squares, plans),
            camera: Grid::new(size_px, plans),
            support,
            #[expect(clippy::cast_possible_truncation, reason = "tables use single precision")]
            step_x: steps[0] as f32,
            pixel: size.map(|side| PixelMean::new(side, samples, microscope.params().oversampling)),
            mean: match (samples, microscope.params().oversampling) {
                (_, 1) => Mean::None,
                (1, _) => Mean::Centred,
                _ => Mean::Moved,
            },
        }
    }

    /// Computes the spectrum of the light.
    pub(crate) fn load(&self, samples: Samples<'_>, spectra: &mut Spectra, scratch: &mut CanvasScratch) {
        let Samples { absorbed, phase, width, offset, .. } = samples;
        spectra.clear();
        if phase.is_empty() {
            self.transform(absorbed, width, offset, &mut spectra.light, &mut scratch.grid);
            return;
        }
        let fill = |left: usize, stripe: &mut [Lanes]| {
            fill(absorbed, width, offset, left, stripe, 0) && fill(phase, width, offset, left, stripe, 1)
        };
        self.object.forward(&self.support, Pixels::Complex, fill, &mut spectra.light, &mut scratch.grid);
    }

    /// Computes the spectrum of a real image.
    fn transform(
        &self,
        image: &[f32],
        width: usize,
        offset: usize,
        spectrum: &mut Spectrum,
        scratch: &mut GridScratch,
    ) {
        let fill = |left: usize, stripe: &mut [Lanes]| {
            let parts = [0, 1].map(|part| fill(image, width, offset, left + part * LANES, stripe, part));
            parts[0] || parts[1]
        };
        self.object.forward(&self.support, Pixels::Real, fill, spectrum, scratch);
    }

    /// Computes the in-focus correction if it is missing.
    ///
    /// In focus, the factor is the squared blurred amplitude (1 − W₀ ⊗ a)². It differs from the blurred transmittance
    /// W₀ ⊗ T = 1 − W₀ ⊗ (2a − a²) by (W₀ ⊗ a)² − W₀ ⊗ a². An object in front of others absorbs the amplitude a = √T₀
    /// − √T; the other terms are linear if T₀ varies slowly.
    pub(crate) fn correct(
        &self,
        in_focus: &Filter,
        samples: Samples<'_>,
        spectra: &mut Spectra,
        scratch: &mut CanvasScratch,
    ) {
        if !spectra.correction.is_empty() || spectra.light.is_empty() {
            return;
        }
        let Samples { absorbed, behind, width, offset, .. } = samples;
        let CanvasScratch { grid, amplitude, square, spectra: [of_amplitude, of_square], block: blurred } = scratch;
        amplitude.resize(absorbed.len(), 0.0);
        amplitudes(absorbed, behind, amplitude);
        self.transform(amplitude, width, offset, of_amplitude, grid);
        if behind.is_empty() {
            // a² = 2a − (1 − T).
            of_square.plus.resize(of_amplitude.plus.len(), ZERO);
            squares_of(&of_amplitude.plus, &spectra.light, &mut of_square.plus);
        } else {
            square.clear();
            square.extend(amplitude.iter().map(|a| a * a));
            self.transform(square, width, offset, of_square, grid);
        }
        // Scales of the image, and of its spectrum at the object's number of samples.
        let (norm, scale) = (self.object.norm(), self.squares.norm() / self.object.norm());
        let blur = |block: usize, plus: &mut [Lanes], _: &mut [Lanes]| {
            self.image(in_focus, of_amplitude, None, (block, false), plus, &mut []);
        };
        self.squares.squared(&self.support, blur, [norm, scale], &mut spectra.correction, grid);
        for block in 0..self.support.blocks() {
            let range = self.support.range(block);
            blurred.resize(range.len(), ZERO);
            self.image(in_focus, of_square, None, (block, false), blurred, &mut []);
            subtract(&mut spectra.correction.plus[range], blurred);
        }
    }

    /// Filters a block of a spectrum, with or without the pixel mean.
    fn image(
        &self,
        filter: &Filter,
        light: &Spectrum,
        correction: Option<&Spectrum>,
        (block, is_mean): (usize, bool),
        plus: &mut [Lanes],
        minus: &mut [Lanes],
    ) {
        let range = self.support.range(block);
        let at = Block {
            is_mean,
            step_x: self.step_x,
            y: &self.y[block],
            pixel_x: &self.pixel[0].size,
            pixel_y: &self.pixel[1].size.as_chunks().0[block],
        };
        let from = BlockSpectrum {
            plus: &light.plus[range.clone()],
            minus: if light.minus.is_empty() { &[] } else { &light.minus[range.clone()] },
            correction: correction.map(|correction| &correction.plus[range]),
        };
        filter.image(at, &from, plus, minus);
    }

    /// Computes the image of an object: the mean of the absorbed light over each pixel, and of the effect of phase
    /// delay.
    ///
    /// `visit` receives [`ImageStripe`]s that cover the first `width` columns.
    pub(crate) fn expose(
        &self,
        filter: &Filter,
        spectra: &Spectra,
        width: usize,
        mut visit: impl FnMut(ImageStripe<'_>),
        scratch: &mut CanvasScratch,
    ) {
        let Spectra { light, correction } = spectra;
        if light.is_empty() {
            return;
        }
        let correction = (!correction.is_empty()).then_some(correction);
        let fill = |block: usize, plus: &mut [Lanes], minus: &mut [Lanes]| {
            self.image(filter, light, correction, (block, self.mean == Mean::Centred), plus, minus);
            if self.mean == Mean::Moved {
                let [x, y] = &self.pixel;
                let (x, y) = (&x.moved[..=self.support.reach(block)], &y.moved.as_chunks().0[block]);
                mean_over_pixels::<false>(plus, x, y);
                if !light.minus.is_empty() {
                    mean_over_pixels::<true>(minus, x, y);
                }
            }
        };
        let norm = self.object.norm();
        let pixels = if light.minus.is_empty() { Pixels::Real } else { Pixels::Complex };
        let stripe = |left: usize, rows: &mut [Lanes]| visit(ImageStripe { left, pixels, rows, norm });
        self.camera.inverse(&self.support, pixels, fill, width, stripe, &mut scratch.grid);
    }
}

/// Columns of an image from `left` on, times 1/`norm`, with real and imaginary parts exchanged.
#[derive(Debug)]
pub(crate) struct ImageStripe<'a> {
    left: usize,
    pixels: Pixels,
    rows: &'a [Lanes],
    norm: f32,
}

impl ImageStripe<'_> {
    /// Adds the stripe to images of absorbed light and of phase effects, in rows of `width`. The first row of the
    /// stripe is added to the first row of the images, and its column 0 to column `at`. Columns from `end` on are left
    /// out.
    pub(crate) fn add_to(&self, absorbed: &mut [f32], phases: &mut [f32], width: usize, at: usize, end: usize) {
        self.write_to::<false>(absorbed, phases, width, at, end);
    }

    /// As [`add_to`](Self::add_to), but replaces the images, which have the columns of the stripes.
    pub(crate) fn store_in(&self, absorbed: &mut [f32], phases: &mut [f32], width: usize) {
        self.write_to::<true>(absorbed, phases, width, 0, width);
    }

    fn write_to<const STORE: bool>(
        &self,
        absorbed: &mut [f32],
        phases: &mut [f32],
        width: usize,
        at: usize,
        end: usize,
    ) {
        let columns = |left: usize| (at + left).min(end)..(at + left + LANES).min(end);
        let (first, second) = (columns(self.left), columns(self.left + LANES));
        match self.pixels {
            Pixels::Complex => {
                write_columns::<STORE>(absorbed, width, first.clone(), self.rows, 1, self.norm);
                write_columns::<STORE>(phases, width, first, self.rows, 0, self.norm);
            }
            Pixels::Real => {
                write_columns::<STORE>(absorbed, width, first, self.rows, 1, self.norm);
                write_columns::<STORE>(absorbed, width, second, self.rows, 0, self.norm);
            }
        }
    }
}

/// Writes a part of a stripe, times a factor, to columns of an image, or adds it.
#[multiversion(targets = "simd")]
fn write_columns<const STORE: bool>(
    image: &mut [f32],
    width: usize,
    columns: core::ops::Range<usize>,
    rows: &[Lanes],
    part: usize,
    norm: f32,
) {
    let write = |image: &mut f32, value: &f32| *image = if STORE { norm * value } else { *image + norm * value };
    for (image, row) in image.chunks_exact_mut(width).zip(rows) {
        let image = &mut image[columns.clone()];
        // Full stripes have a length known at compile time.
        if let Some(image) = image.first_chunk_mut::<LANES>() {
            image.iter_mut().zip(&row[part]).for_each(|(image, value)| write(image, value));
        } else {
            image.iter_mut().zip(&row[part]).for_each(|(image, value)| write(image, value));
        }
    }
}

/// Copies sixteen columns of an image, which has a margin of `offset`, to a part of a stripe. Returns whether the image
/// has any of them.
fn fill(image: &[f32], width: usize, offset: usize, left: usize, stripe: &mut [Lanes], part: usize) -> bool {
    let (first, end) = (left.max(offset), (left + LANES).min(offset + width));
    let rows = offset..offset + image.len() / width;
    for (y, row) in stripe.iter_mut().enumerate() {
        let row = &mut row[part];
        if !rows.contains(&y) || first >= end {
            *row = [0.0; LANES];
            continue;
        }
        let from = &image[(y - offset) * width..][first - offset..end - offset];
        // Full rows have a length known at compile time.
        match from.first_chunk() {
            Some(from) => *row = *from,
            None => {
                *row = [0.0; LANES];
                row[first - left..end - left].copy_from_slice(from);
            }
        }
    }
    first < end
}

/// Computes a = √T₀ − √T from T₀ − T and T₀, which is 1 if `behind` is empty.
#[multiversion(targets = "simd")]
pub(crate) fn amplitudes(absorbed: &[f32], behind: &[f32], amplitude: &mut [f32]) {
    // (T₀ − T)/(√T₀ + √T) is accurate for small absorption.
    if behind.is_empty() {
        for (amplitude, absorbed) in amplitude.iter_mut().zip(absorbed) {
            *amplitude = absorbed / (1.0 + (1.0 - absorbed).max(0.0).sqrt());
        }
        return;
    }
    for ((amplitude, absorbed), behind) in amplitude.iter_mut().zip(absorbed).zip(behind) {
        let sum = behind.sqrt() + (behind - absorbed).max(0.0).sqrt();
        *amplitude = absorbed / sum.max(f32::MIN_POSITIVE);
    }
}

/// Computes the spectrum of a² = 2a − (1 − T) from those of a = 1 − √T and of 1 − T + iφ.
#[multiversion(targets = "simd")]
fn squares_of(amplitude: &[Lanes], light: &Spectrum, square: &mut [Lanes]) {
    // (F(k) + F*(−k))/2, which is F(k) for a real image.
    let (minus, sign) = if light.minus.is_empty() { (&light.plus, 0.5) } else { (&light.minus, -0.5) };
    let factors = [[0.5; LANES], [sign; LANES]];
    for (((square, a), plus), minus) in square.iter_mut().zip(amplitude).zip(&light.plus).zip(minus) {
        let from = plus.as_flattened().iter().zip(minus.as_flattened()).zip(factors.as_flattened());
        let both = square.as_flattened_mut().iter_mut().zip(a.as_flattened());
        for ((square, a), ((plus, minus), factor)) in both.zip(from) {
            *square = 2.0 * a - (0.5 * plus + factor * minus);
        }
    }
}

#[multiversion(targets = "simd")]
fn subtract(from: &mut [Lanes], values: &[Lanes]) {
    for (from, value) in from.as_flattened_mut().as_flattened_mut().iter_mut().zip(values.as_flattened().as_flattened())
    {
        *from -= value;
    }
}

/// Multiplies a block, kx from −r to r, by the transfer of the pixel mean or by its conjugate.
#[multiversion(targets = "simd")]
fn mean_over_pixels<const CONJUGATE: bool>(block: &mut [Lanes], x: &[[f32; 2]], y: &[[f32; 2]; LANES]) {
    let sign = if CONJUGATE { -1.0 } else { 1.0 };
    let (y_re, y_im) = (y.map(|y| y[0]), y.map(|y| sign * y[1]));
    let reach = block.len() / 2;
    for (k, &[x_re, x_im]) in x.iter().enumerate() {
        turn_lanes(&mut block[reach + k], [x_re, sign * x_im], &y_re, &y_im);
        if k > 0 {
            turn_lanes(&mut block[reach - k], [x_re, -sign * x_im], &y_re, &y_im);
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

/// Converts absorbed light to transmittance, times exp(−2 · phase effect). `phases` may be empty. Returns the number of
/// clipped values.
#[multiversion(targets = "simd")]
pub(crate) fn transmit(light: &mut [f32], phases: &[f32]) -> usize {
    let mut clipped = 0_u32;
    for light in light.iter_mut() {
        let transmitted = 1.0 - *light;
        clipped += u32::from(transmitted < MIN_TRANSMITTANCE);
        *light = transmitted.max(MIN_TRANSMITTANCE);
    }
    for (light, phase) in light.iter_mut().zip(phases) {
        *light *= exp_f32(-2.0 * phase);
    }
    clipped as usize
}

/// Converts absorbance A to 1 − T = 1 − 10^(−A) (Eq. 11).
#[multiversion(targets = "simd")]
pub(crate) fn absorbed(absorbance: &[f32], absorbed: &mut Vec<f32>) {
    absorbed.clear();
    absorbed.extend(absorbance.iter().map(|a| 1.0 - exp_f32(-*a * core::f32::consts::LN_10)));
}

/// Returns whether any value is not 0.
#[multiversion(targets = "simd")]
pub(crate) fn is_nonzero(values: &[f32]) -> bool {
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
            let sparse = Canvas::new(&microscope, [120, 96], 2, &plans);
            let mut full = Canvas::new(&microscope, [120, 96], 2, &plans);
            assert_eq!(sparse.squares.width, 180);
            full.squares = full.object.clone();
            // Sharp and nearly opaque: a disc, a bar and specks of one sample.
            let (width, height) = (160, 120);
            let sample = |i: usize| {
                let (x, y) = (i % width, i / width);
                let disc = x.abs_diff(50).pow(2) + y.abs_diff(60).pow(2) < 900;
                let bar = (x + y).is_multiple_of(7) && x > 110;
                let speck = x.is_multiple_of(11) && y.is_multiple_of(13);
                if disc || bar || speck { 0.98 } else { 0.2 }
            };
            let absorbed: Vec<f32> = (0..width * height).map(sample).collect();
            let samples = Samples { absorbed: &absorbed, behind: &[], phase: &[], width, offset: 32 };
            let in_focus = Filter::in_focus(&microscope);
            for depth in [0.0, 0.9] {
                let transfer = Transfer::new(&microscope, depth, 0.0);
                let filter = Filter::new(&microscope, depth, 0.0, &transfer);
                let light = |canvas: &Canvas| {
                    let (mut spectra, mut scratch) = (Spectra::default(), CanvasScratch::default());
                    canvas.load(samples, &mut spectra, &mut scratch);
                    canvas.correct(&in_focus, samples, &mut spectra, &mut scratch);
                    let mut absorbed = vec![0.0; 120 * 96];
                    let add = |stripe: ImageStripe<'_>| stripe.add_to(&mut absorbed, &mut [], 120, 0, 120);
                    canvas.expose(&filter, &spectra, 120, add, &mut scratch);
                    absorbed
                };
                let (found, expected) = (light(&sparse), light(&full));
                let error = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(error < 5e-4, "{na} {condenser_na} {depth}: {error}");
            }
        }
    }
}

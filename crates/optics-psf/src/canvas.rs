use multiversion::multiversion;
use portable_numerics::elementary::exp_f32;

use crate::Microscope;
use crate::filter::{Block, Filter, Lattice, Part};
use crate::lane_plane::{LANES, LanePlane, LanePlans, LaneScratch, LaneSupport, Lanes, STRIPE, ZERO};
use crate::pupil::turn;
use crate::transfer::Transfer;

/// Least light that anything lets through: W ⊗ 10^(−A) undershoots to about −0.05 beside things of A > 1,
/// and there is no negative light.
pub const LEAST_LIGHT: f32 = 1e-3;

/// A periodic rectangle of the slide: the lattices on which what is in it is imaged.
#[derive(Debug)]
pub(crate) struct Canvas {
    object: Raster,
    camera: Raster,
    /// Where what the microscope transfers is squared.
    squares: LanePlane,
    /// Steps of the filters' tables from one frequency to the next along x.
    step_x: f32,
    /// Frequencies along y in those steps, block by block.
    y: Vec<[f32; LANES]>,
    /// What the mean over a pixel does to frequencies along x and y.
    pixel: [PixelMean; 2],
}

/// A lattice, and its frequencies that the microscope transfers.
#[derive(Debug)]
struct Raster {
    plane: LanePlane,
    support: LaneSupport,
}

/// What the mean over a pixel does to frequencies 0, 1, … of one axis.
#[derive(Debug)]
struct PixelMean {
    /// Around the middle of the pixel.
    size: Vec<f32>,
    /// From its first sample.
    moved: Vec<[f32; 2]>,
}

impl PixelMean {
    /// Whole blocks of frequencies. The mean is (1/n) ∑ₖ exp 2πi f k over the samples of a pixel, f in cycles per sample:
    /// around its middle, and from its first sample, k = 0 … n − 1.
    #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 spectra")]
    fn new(side: usize, n: usize) -> Self {
        let mean = |place: usize| {
            let f = place as f64 / side as f64;
            let (mut middle, mut moved) = (0.0, [0.0; 2]);
            for k in 0..n {
                let (c, s) = turn(f * k as f64);
                moved = [moved[0] + c / n as f64, moved[1] + s / n as f64];
                middle += turn(f * (k as f64 - 0.5 * (n - 1) as f64)).0 / n as f64;
            }
            (middle as f32, moved.map(|v| v as f32))
        };
        let (size, moved) = (0..(side / 2 + 1).next_multiple_of(LANES)).map(mean).unzip();
        Self { size, moved }
    }
}

/// Spectra of what is at one depth; empty where there is nothing.
#[derive(Debug, Clone, Default)]
pub(crate) struct Spectra {
    /// Of 1 − 10^(−A).
    pub(crate) absorbed: Vec<Lanes>,
    /// Of a = 1 − 10^(−A/2), if it is needed for the correction, and then of 1 − 10^(−A) − 2a.
    pub(crate) amplitude: Vec<Lanes>,
    /// Of (1 − W₀ ⊗ a)² − W₀ ⊗ 10^(−A), once it was needed.
    pub(crate) correction: Vec<Lanes>,
    /// Of φ.
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

/// Samples for each period of the finest detail that is transferred, where that is squared. Three would keep all that is
/// transferred of the square free of aliases; what comes in with fewer are products of two details both finer than
/// 0.7 of the cutoff, of which hardly anything is left.
const SQUARED_CUTOFFS: f64 = 2.4;

impl Canvas {
    /// `size` in samples of the object, multiples of the oversampling.
    pub(crate) fn new(microscope: &Microscope, size: [usize; 2], plans: &LanePlans) -> Self {
        let oversampling = microscope.params().oversampling;
        let pitch = microscope.pitch_um();
        let raster = |stride: usize| {
            let [width, height] = size.map(|side| side / stride);
            let support = LaneSupport::new(width, height, microscope.cutoff() * pitch * stride as f64);
            Raster { plane: LanePlane::new(width, height, plans), support }
        };
        // Three samples for four of the object's, if that is fine enough and comes out even.
        let is_fine = 0.75 >= SQUARED_CUTOFFS * microscope.cutoff() * pitch;
        let [width, height] = size.map(|side| if is_fine && side.is_multiple_of(4) { side / 4 * 3 } else { side });
        let steps = size.map(|side| 1.0 / (side as f64 * pitch * Transfer::step_of(microscope)));
        let object = raster(1);
        #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 tables")]
        let y = |block: usize| core::array::from_fn(|lane| (block * LANES + lane) as f32 * steps[1] as f32);
        Self {
            y: (0..object.support.blocks()).map(y).collect(),
            camera: raster(oversampling),
            squares: LanePlane::new(width, height, plans),
            object,
            #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 tables")]
            step_x: steps[0] as f32,
            pixel: size.map(|side| PixelMean::new(side, oversampling)),
        }
    }

    /// The spectrum of an image on the object's lattice, or an empty one if the image is empty. It is what `map` makes of
    /// rows of `width` samples, which lie `offset` samples from the left and the upper edge in `background`, and
    /// 0 around them: `map` makes 0 of the background, and says whether it made anything else.
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
                // Of a length that the compiler knows, almost always.
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

    /// Adds a block of a spectrum, times a response of a filter, to `sum`.
    fn add(&self, (filter, part): (&Filter, Part), spectrum: &[Lanes], block: usize, reach: usize, sum: &mut [Lanes]) {
        let at = Block {
            step_x: self.step_x,
            y: &self.y[block],
            pixel_x: &self.pixel[0].size,
            pixel_y: &self.pixel[1].size.as_chunks().0[block],
        };
        filter.add(part, at, self.object.support.block(spectrum, block), reach, sum);
    }

    /// The correction of the in-focus form, if that is not known yet. With 1 − T = 2a − a² it is
    /// (1 − W₀ ⊗ a)² − W₀ ⊗ T = (W₀ ⊗ a)² + W₀ ⊗ (1 − T − 2a).
    pub(crate) fn correct(&self, in_focus: &Filter, spectra: &mut Spectra, scratch: &mut LaneScratch) {
        let Spectra { absorbed, amplitude, correction, .. } = spectra;
        if !correction.is_empty() || amplitude.is_empty() {
            return;
        }
        let Raster { plane, support } = &self.object;
        // Of the picture, and of its spectrum, that of as many samples as the object has.
        let (norm, share) = (plane.norm(), self.squares.norm() / plane.norm());
        let blurred = (in_focus, Part::Absorption);
        let fill = |block: usize, line: &mut [Lanes]| {
            self.add(blurred, amplitude, block, support.reach(block), line);
        };
        let square = |stripe: &mut [Lanes]| squared(stripe.as_flattened_mut().as_flattened_mut(), norm, share);
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

    /// Multiplies `product`, rows of `width`, by what one thing lets through, or makes it that if it is the first; gives
    /// the number of values that were too low.
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
        let (norm, mut floored) = (self.object.plane.norm(), 0);
        let visit = |left: usize, stripe: &[Lanes]| {
            floored += transmit::<FIRST>(product, width, left, stripe, norm);
        };
        self.invert(filter.lattice, add, width, visit, scratch);
        floored
    }

    /// Multiplies `product`, rows of `width`, by the light that the phases of all that is imaged on `lattice` move.
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

/// Rows of samples in a canvas, with a margin of `offset` on the left and above.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Samples<'a> {
    pub(crate) samples: &'a [f32],
    pub(crate) width: usize,
    pub(crate) offset: usize,
    pub(crate) background: f32,
}

#[multiversion(targets = "simd")]
fn squared(values: &mut [f32], norm: f32, share: f32) {
    for value in values {
        let u = *value * norm;
        *value = share * (u * u);
    }
}

/// Makes of a what 1 − T − 2a is.
#[multiversion(targets = "simd")]
fn twice_less(amplitude: &mut [f32], absorbed: &[f32]) {
    for (amplitude, absorbed) in amplitude.iter_mut().zip(absorbed) {
        *amplitude = absorbed - 2.0 * *amplitude;
    }
}

/// Multiplies a block by what the mean over a pixel leaves of frequencies kx = 0 …, and … −1 at its end.
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

/// Multiplies a stripe of the columns of `product`, rows of `width`, by 1 − lost light, or makes it that; gives the number of
/// values that were too low.
#[multiversion(targets = "simd")]
fn transmit<const FIRST: bool>(product: &mut [f32], width: usize, left: usize, lost: &[Lanes], norm: f32) -> usize {
    let mut floored = 0_u32;
    for (row, lost) in product.chunks_exact_mut(width).zip(lost) {
        for (product, lost) in row[left..].iter_mut().zip(lost.as_flattened()) {
            let light = 1.0 - lost * norm;
            floored += u32::from(light < LEAST_LIGHT);
            let light = light.max(LEAST_LIGHT);
            *product = if FIRST { light } else { *product * light };
        }
    }
    floored as usize
}

/// Multiplies a stripe likewise by exp(factor · v).
#[multiversion(targets = "simd")]
fn delay(product: &mut [f32], width: usize, left: usize, phases: &[Lanes], factor: f32) {
    for (row, phases) in product.chunks_exact_mut(width).zip(phases) {
        for (product, v) in row[left..].iter_mut().zip(phases.as_flattened()) {
            *product *= exp_f32(factor * v);
        }
    }
}

/// From 1 − T to 1 − √T.
#[multiversion(targets = "simd")]
fn amplitude(line: &mut [f32]) {
    for v in line {
        // (1 − T)/(1 + √T) keeps the digits of little absorption.
        *v /= 1.0 + (1.0 - *v).max(0.0).sqrt();
    }
}

/// From absorbance A to 1 − T = 1 − 10^(−A) (Eq. 11); says whether there is anything.
#[multiversion(targets = "simd")]
pub(crate) fn absorbed(values: &mut [f32]) -> bool {
    let lit = is_lit(values);
    if lit {
        for value in values {
            *value = 1.0 - exp_f32(-*value * core::f32::consts::LN_10);
        }
    }
    lit
}

/// From T to 1 − T, likewise.
#[multiversion(targets = "simd")]
pub(crate) fn absorbed_of(values: &mut [f32]) -> bool {
    let mut lit = 0_u32;
    for value in values {
        *value = 1.0 - *value;
        lit |= value.to_bits();
    }
    lit != 0
}

/// To 1 − √T, likewise, from what `absorbed` makes 1 − T of.
pub(crate) fn amplitude_of(absorbed: impl Fn(&mut [f32]) -> bool) -> impl Fn(&mut [f32]) -> bool {
    move |values| {
        let lit = absorbed(values);
        if lit {
            amplitude(values);
        }
        lit
    }
}

/// Whether there is anything.
#[multiversion(targets = "simd")]
pub(crate) fn is_lit(values: &mut [f32]) -> bool {
    values.iter().fold(0, |lit, value| lit | (value.to_bits() << 1)) != 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MicroscopeParams;

    #[test]
    fn squares_need_fewer_samples() {
        for (na, condenser_na) in [(0.95, 0.41), (0.65, 0.65), (0.9, 0.3)] {
            let params = MicroscopeParams { na, condenser_na, ..MicroscopeParams::default() };
            let (microscope, plans) = (Microscope::new(&params).unwrap(), LanePlans::default());
            let sparse = Canvas::new(&microscope, [240, 192], &plans);
            let mut full = Canvas::new(&microscope, [240, 192], &plans);
            assert_eq!(sparse.squares.width, 180);
            full.squares = full.object.plane.clone();
            // Sharp and nearly black: a disc, a bar and specks of one sample.
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

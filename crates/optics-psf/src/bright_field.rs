use core::fmt;

use rustfft::num_complex::Complex32;

use crate::error::{Error, require_count};
use crate::fft::{Fft, LONGEST_SIDE, fast_length};
use crate::filter::{Filter, Grid, Position};
use crate::microscope::distance;
use crate::real_plane::{RealPlane, Support};
use crate::{Microscope, Specimen, Transfer};

/// Which object, cut into slabs, [`BrightField`] images, and at which planes.
#[derive(Debug, Clone, PartialEq)]
pub struct BrightFieldParams {
    /// Samples of the object from left to right, a multiple of [`oversampling`], to 32 768. Default
    /// 512, ours.
    ///
    /// [`oversampling`]: crate::MicroscopeParams::oversampling
    pub width: usize,
    /// Samples from top to bottom, likewise. Default 512, ours.
    pub height: usize,
    /// What lies outside. Default 64 samples of empty slide, ours.
    pub padding: Padding,
    /// Depths of the slabs below the focal plane of the stage at rest, each −1000 to 1000 µm, as
    /// for [`Microscope::transfer`]. Default one at 0, ours.
    pub depths_um: Vec<f64>,
    /// Travels of the stage at which pictures are taken, each −1000 to 1000 µm. Default one at 0,
    /// ours.
    pub stages_um: Vec<f64>,
    /// Where slabs far from focus are computed. Default [`Defocused::OnCamera`], ours.
    pub defocused: Defocused,
    /// Which FFT runs. Default [`Fft::Fastest`], ours.
    pub fft: Fft,
}

impl Default for BrightFieldParams {
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            padding: Padding::Clear { px: 64 },
            depths_um: vec![0.0],
            stages_um: vec![0.0],
            defocused: Defocused::OnCamera,
            fft: Fft::Fastest,
        }
    }
}

/// What lies outside of the object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Padding {
    /// The object again: its left edge continues its right one. Sides with large prime factors are
    /// slow.
    Periodic,
    /// Empty slide, at least so many samples of it, 0 to 16 384, between opposite edges.
    Clear {
        /// How many: less than twice the width of the blur lets light come in from the other side.
        px: usize,
    },
}

/// Where slabs that are far from focus are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Defocused {
    /// On the lattice of the object, as all others.
    OnObject,
    /// On that of the camera, as the mean over each pixel, from 2 µm of defocus on if little is
    /// left there of detail finer than the pixels. What is then lost are details that two slabs have in
    /// common within one pixel, below 0.1 % of the contrast.
    OnCamera,
}

/// Least defocus for the camera's lattice, µm of mountant: where the correction of the in-focus form
/// has ended.
const SMOOTH_UM: f64 = 2.0;

/// The transfer that may be left of detail finer than pixels, on the camera's lattice.
const SMOOTH_TRANSFER: f64 = 0.05;

/// Widest padding.
const MOST_PADDING: usize = 16_384;

/// Bright field: the image as a product of filtered transmittances, one factor for each slab of the
/// object.
///
/// I = ∏ⱼ (W_z ⊗ 10^(−A) + G_z ⊗ [(1 − W₀ ⊗ a)² − W₀ ⊗ 10^(−A)]) · exp(−2 ∑ⱼ H_P ⊗ φ)
///
/// for slabs of absorbance A and phase φ at distance z from focus, a = 1 − 10^(−A/2). W is the
/// transfer function H_A of [`Microscope::transfer`]: what light transmits, and not the absorbance,
/// is what a lens blurs linearly. In focus the bracket makes it (1 − W₀ ⊗ a)², the square of the
/// blurred amplitude; G_z is the disc that the condenser's cone cuts out of the plane in focus, and
/// the bracket fades out from 1 to 2 µm. Against [`Abbe`](crate::Abbe) the error is 1 % of the
/// contrast for one slab and 2 % for two that overlap.
///
/// Filters are computed once, here; a [`Specimen`] holds what is on the slide, and each picture of
/// it then costs one inverse FFT for each slab that is not empty.
///
/// # Differences from the paper
///
/// The paper blurs absorbance with Gaussians (Eqs. 11 to 14), which [`Gaussian`](crate::Gaussian)
/// and [`DepthOfFocus`](crate::DepthOfFocus) do; that is 8 to 87 % off from Abbe's image where this
/// is 1 % off.
pub struct BrightField {
    pub(crate) microscope: Microscope,
    pub(crate) size: [usize; 2],
    pub(crate) object: RealPlane,
    pub(crate) camera: RealPlane,
    /// Frequencies that the microscope transfers, and which of them the camera resolves.
    pub(crate) support: Support,
    pub(crate) coarse: Support,
    /// The lattice of the in-focus form's correction, and its frequencies.
    pub(crate) correction: RealPlane,
    pub(crate) corrected: Support,
    /// Places of the frequencies in the filters' tables.
    pub(crate) positions: Vec<Position>,
    /// What the mean over a pixel multiplies each frequency with.
    pub(crate) pixel: Vec<Complex32>,
    pub(crate) in_focus: Filter,
    /// For each plane, the filters of the slabs.
    pub(crate) planes: Vec<Vec<Filter>>,
}

impl fmt::Debug for BrightField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BrightField")
            .field("microscope", &self.microscope)
            .field("size", &self.size)
            .field("grid", &[self.object.width, self.object.height])
            .finish_non_exhaustive()
    }
}

impl BrightField {
    /// Plans the transforms and computes the filters.
    ///
    /// # Errors
    ///
    /// If a side or the padding is out of range or a side no multiple of the oversampling; if
    /// a depth or a travel of the stage is out of range.
    pub fn new(microscope: &Microscope, params: &BrightFieldParams) -> Result<Self, Error> {
        let oversampling = microscope.params().oversampling;
        let side = |field, value: usize| {
            let holds = (1..=LONGEST_SIDE).contains(&value) && value.is_multiple_of(oversampling);
            require_count(field, value, holds, "a multiple of the oversampling from 1 to 32768")
        };
        let size = [side("width", params.width)?, side("height", params.height)?];
        let grid = match params.padding {
            Padding::Periodic => size,
            Padding::Clear { px } => {
                require_count("padding.px", px, px <= MOST_PADDING, "a whole number from 0 to 16384")?;
                size.map(|side| oversampling * fast_length((side + px).div_ceil(oversampling)))
            }
        };
        for &depth in &params.depths_um {
            distance("depths_um", depth)?;
        }
        for &stage in &params.stages_um {
            distance("stages_um", stage)?;
        }
        let [width, height] = grid;
        let pitch = microscope.pitch_um();
        let support = Support::new(width, height, microscope.cutoff() * pitch);
        let frequencies: Vec<[f64; 2]> = support.frequencies(width, height).collect();
        let pixel = frequencies.iter().map(|f| mean_over_pixel(*f, oversampling)).collect();
        let frequencies: Vec<[f64; 2]> = frequencies.iter().map(|f| f.map(|f| f / pitch)).collect();
        let camera = grid.map(|side| side / oversampling);
        let coarse = Support::new(camera[0], camera[1], microscope.cutoff() * microscope.params().pixel_um);
        let is_smooth = |transfer: &Transfer, defocus: f64| {
            let nyquist = 0.5 / microscope.params().pixel_um;
            let allowed = oversampling > 1 && params.defocused == Defocused::OnCamera;
            allowed && defocus >= SMOOTH_UM && transfer.extent(SMOOTH_TRANSFER) <= nyquist
        };
        let plane = |&stage: &f64| {
            let filter = |&depth: &f64| Filter::new(microscope, depth, stage, &frequencies, is_smooth);
            params.depths_um.iter().map(filter).collect()
        };
        let step = Transfer::step_of(microscope);
        let position = |f: &[f64; 2]| Position::new((f[0] * f[0] + f[1] * f[1]).sqrt() / step);
        let stride = correction_stride(microscope);
        let correction = grid.map(|side| side / stride);
        Ok(Self {
            microscope: microscope.clone(),
            size,
            object: RealPlane::new(width, height, params.fft),
            camera: RealPlane::new(camera[0], camera[1], params.fft),
            support,
            coarse,
            correction: RealPlane::new(correction[0], correction[1], params.fft),
            corrected: Support::new(correction[0], correction[1], microscope.cutoff() * pitch * stride as f64),
            positions: frequencies.iter().map(position).collect(),
            pixel,
            in_focus: Filter::in_focus(microscope, &frequencies),
            planes: params.stages_um.iter().map(plane).collect(),
        })
    }

    /// An empty slide.
    #[must_use]
    pub fn specimen(&self) -> Specimen {
        Specimen::new(self.planes.first().map_or(0, Vec::len))
    }

    /// Width of a picture in pixels of the camera.
    #[must_use]
    pub fn image_width(&self) -> usize {
        self.size[0] / self.microscope.params().oversampling
    }

    /// Height of a picture in pixels of the camera.
    #[must_use]
    pub fn image_height(&self) -> usize {
        self.size[1] / self.microscope.params().oversampling
    }

    /// Whether some plane needs the correction of the in-focus form of a slab.
    pub(crate) fn is_corrected(&self, slab: usize) -> bool {
        self.planes.iter().any(|plane| plane[slab].is_corrected)
    }

    /// A lattice and its frequencies.
    pub(crate) fn lattice(&self, grid: Grid) -> (&RealPlane, &Support) {
        match grid {
            Grid::Object => (&self.object, &self.support),
            Grid::Camera => (&self.camera, &self.coarse),
        }
    }
}

/// The part of the cutoff that the lattice of the correction has to resolve. What the pupil lets through
/// of the rest is little, and the correction itself is at most 3 % of the light.
const CORRECTED_PART: f64 = 0.8;

/// Every how many samples of the object the correction is computed: a divisor of the oversampling.
fn correction_stride(microscope: &Microscope) -> usize {
    let params = microscope.params();
    let resolves = |n: usize| 0.5 / (microscope.pitch_um() * n as f64) >= CORRECTED_PART * microscope.cutoff();
    (1..=params.oversampling).rev().find(|&n| params.oversampling.is_multiple_of(n) && resolves(n)).unwrap_or(1)
}

/// ∏ (1/n) ∑ₖ exp 2πi f k over the samples of a pixel, k = 0 … n − 1, along x and y; f in cycles
/// per sample.
fn mean_over_pixel(f: [f64; 2], n: usize) -> Complex32 {
    let mean = |f: f64| {
        let mut sum = [0.0; 2];
        for k in 0..n {
            let (c, s) = crate::pupil::turn(f * k as f64);
            sum[0] += c / n as f64;
            sum[1] += s / n as f64;
        }
        sum
    };
    let ([a, b], [c, d]) = (mean(f[0]), mean(f[1]));
    #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 spectra")]
    Complex32::new((a * c - b * d) as f32, (a * d + b * c) as f32)
}

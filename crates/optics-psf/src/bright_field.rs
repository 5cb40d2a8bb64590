use crate::canvas::{Canvas, CanvasScratch, ImageStripe, Samples, Spectra, absorbed, is_nonzero, transmit};
use crate::error::{Error, require, within};
use crate::filter::Filter;
use crate::grid::{SIDES, fast_length};
use crate::light::{add_stray_light, times};
use crate::microscope::distance;
use crate::spectrum::LanePlans;
use crate::{Microscope, Transfer};

/// Parameters of [`BrightField`]: the grid, the depths of the object's slabs, and the stage positions.
#[derive(Debug, Clone, PartialEq)]
pub struct BrightFieldParams {
    /// Width of the object in samples, a multiple of [`oversampling`], up to 32 768. Default 512, ours.
    ///
    /// [`oversampling`]: crate::MicroscopeParams::oversampling
    pub width: usize,
    /// Height of the object in samples, a multiple of the oversampling, up to 32 768. Default 512, ours.
    pub height: usize,
    /// Surroundings of the object. Default 64 samples of empty slide, ours.
    pub padding: Padding,
    /// Depths of the slabs relative to the focal plane with the stage at rest, in µm, positive towards the objective,
    /// −1000 to 1000 (see [`Microscope::transfer`]). Default one slab at 0, ours.
    pub depths_um: Vec<f64>,
    /// Stage positions of the images, in µm, positive when lowered, −1000 to 1000. Default one at 0, ours.
    pub stages_um: Vec<f64>,
}

impl Default for BrightFieldParams {
    fn default() -> Self {
        Self { width: 512, height: 512, padding: Padding::Clear { px: 64 }, depths_um: vec![0.0], stages_um: vec![0.0] }
    }
}

/// Surroundings of the object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Padding {
    /// Periodic continuation of the object. Sizes with large prime factors are slow.
    Periodic,
    /// Empty slide of at least `px` samples, 0 to 16 384, between opposite edges.
    Clear {
        /// Number of samples. Values below twice the blur width allow wrap-around.
        px: usize,
    },
}

/// Bright-field imaging: the image is a product of filtered transmittances, one factor per slab of the object.
///
/// I = ∏ⱼ (W_z ⊗ 10^(−A) + G_z ⊗ [(1 − W₀ ⊗ a)² − W₀ ⊗ 10^(−A)]) · exp(−2 ∑ⱼ H_P ⊗ φ)
///
/// for slabs of absorbance A and phase delay φ at distance z from focus, with a = 1 − 10^(−A/2). W is the transfer
/// function H_A of [`Microscope::transfer`]: a lens blurs transmittance linearly, not absorbance. In focus the bracket
/// turns the factor into (1 − W₀ ⊗ a)², the square of the blurred amplitude. G_z is the disc of the condenser's cone in
/// the focal plane; the bracket fades out from 1 to 2 µm. The error against [`Abbe`](crate::Abbe) is 1 % of the
/// contrast for one slab and 2 % for two overlapping slabs.
///
/// `BrightField` computes its filters once. A [`Specimen`] holds the object; each image then costs one inverse FFT per
/// non-empty slab. Factors are means over pixels before they are multiplied, which loses products of details of two
/// slabs that are finer than pixels: below 0.1 % of the contrast, and nothing at an oversampling of 1. The paper's
/// Gaussians (Eqs. 11 to 14, [`Gaussian`](crate::Gaussian)) have errors of 8 to 87 % where this model has 1 %.
#[derive(Debug)]
pub struct BrightField {
    microscope: Microscope,
    size: [usize; 2],
    canvas: Canvas,
    in_focus: Filter,
    /// Filters of each slab, per stage position.
    planes: Vec<Vec<Filter>>,
}

/// The object: absorption and phase delay of each slab. [`BrightField::specimen`] creates it for one `BrightField`. It
/// also holds working memory: after the first image, nothing is allocated.
#[derive(Debug, Clone, Default)]
pub struct Specimen {
    slabs: Vec<Slab>,
    scratch: CanvasScratch,
    factor: Vec<f32>,
    phases: Vec<f32>,
}

/// Samples of a slab; empty vectors stand for zero. Its spectra are computed on demand.
#[derive(Debug, Clone, Default)]
struct Slab {
    absorbed: Vec<f32>,
    phase: Vec<f32>,
    spectra: Option<Spectra>,
}

impl Specimen {
    /// Clears all slabs.
    pub fn clear(&mut self) {
        self.slabs.iter_mut().for_each(|slab| *slab = Slab::default());
    }
}

impl BrightField {
    /// Plans the transforms and computes the filters.
    ///
    /// # Errors
    ///
    /// If a size or the padding is out of range, a size is not a multiple of the oversampling, or a depth or stage
    /// position is out of range.
    pub fn new(microscope: &Microscope, params: &BrightFieldParams) -> Result<Self, Error> {
        let oversampling = microscope.params().oversampling;
        let side = |field, value: usize| {
            let holds = SIDES.contains(&(value as f64)) && value.is_multiple_of(oversampling);
            require(field, value as f64, holds, "a multiple of the oversampling from 1 to 32768").map(|_| value)
        };
        let size = [side("width", params.width)?, side("height", params.height)?];
        let grid_px = match params.padding {
            Padding::Periodic => size.map(|side| side / oversampling),
            Padding::Clear { px } => {
                within("padding.px", px as f64, 0.0..=16_384.0, "a whole number from 0 to 16384")?;
                size.map(|side| fast_length((side + px).div_ceil(oversampling)))
            }
        };
        for (field, list) in [("depths_um", &params.depths_um), ("stages_um", &params.stages_um)] {
            list.iter().try_for_each(|&value| distance(field, value).map(drop))?;
        }
        let plane = |&stage: &f64| {
            let filter = |&depth: &f64| Filter::new(microscope, depth, stage, &Transfer::new(microscope, depth, stage));
            params.depths_um.iter().map(filter).collect()
        };
        Ok(Self {
            microscope: microscope.clone(),
            size,
            canvas: Canvas::new(microscope, grid_px, oversampling, &LanePlans::default()),
            in_focus: Filter::in_focus(microscope),
            planes: params.stages_um.iter().map(plane).collect(),
        })
    }

    /// Returns an empty specimen.
    #[must_use]
    pub fn specimen(&self) -> Specimen {
        let slabs = self.planes.first().map_or(0, Vec::len);
        Specimen { slabs: vec![Slab::default(); slabs], ..Specimen::default() }
    }

    /// Returns the width and height of an image in camera pixels.
    #[must_use]
    pub fn image_size(&self) -> [usize; 2] {
        self.size.map(|side| side / self.microscope.params().oversampling)
    }

    /// Sets the decadic absorbance, at least 0, of a slab. Its phase delay is kept.
    ///
    /// # Panics
    ///
    /// If the slab does not exist, or the number of samples differs from that of the object.
    pub fn set_absorbance(&self, specimen: &mut Specimen, slab: usize, absorbance: &[f32]) {
        self.check(absorbance);
        let slab = &mut specimen.slabs[slab];
        absorbed(absorbance, &mut slab.absorbed);
        slab.changed();
    }

    /// Sets the transmittance, 0 to 1, of a slab. Its phase delay is kept.
    ///
    /// # Panics
    ///
    /// See [`BrightField::set_absorbance`].
    pub fn set_transmittance(&self, specimen: &mut Specimen, slab: usize, transmittance: &[f32]) {
        self.check(transmittance);
        let slab = &mut specimen.slabs[slab];
        slab.absorbed.clear();
        slab.absorbed.extend(transmittance.iter().map(|t| 1.0 - t));
        slab.changed();
    }

    /// Sets the phase delay of a slab, in radians. Its absorption is kept.
    ///
    /// # Panics
    ///
    /// See [`BrightField::set_absorbance`].
    pub fn set_phase(&self, specimen: &mut Specimen, slab: usize, phase_rad: &[f32]) {
        self.check(phase_rad);
        let slab = &mut specimen.slabs[slab];
        slab.phase.clear();
        slab.phase.extend_from_slice(phase_rad);
        slab.changed();
    }

    fn check(&self, samples: &[f32]) {
        let [width, height] = self.size;
        assert_eq!(samples.len(), width * height, "a slab must have as many samples as the object");
    }

    /// Returns the image at a stage position: the intensity at each camera pixel relative to an empty slide, including
    /// stray light.
    ///
    /// # Panics
    ///
    /// If the plane does not exist, or the specimen belongs to another `BrightField`.
    #[must_use]
    pub fn image(&self, specimen: &mut Specimen, plane: usize) -> Vec<f32> {
        let mut out = vec![0.0; self.image_size().into_iter().product()];
        self.image_into(specimen, plane, &mut out);
        out
    }

    /// Writes the image at a stage position to `out`. Returns the number of values clipped at
    /// [`MIN_TRANSMITTANCE`](crate::MIN_TRANSMITTANCE), in camera pixels.
    ///
    /// # Panics
    ///
    /// If the plane does not exist, the specimen belongs to another `BrightField`, or `out` does not have
    /// [`image_size`](Self::image_size) pixels.
    pub fn image_into(&self, specimen: &mut Specimen, plane: usize, out: &mut [f32]) -> usize {
        let [image_width, image_height] = self.image_size();
        assert_eq!(out.len(), image_width * image_height, "`out` must have as many pixels as the image");
        let Specimen { slabs, scratch, factor, phases } = specimen;
        let filters = &self.planes[plane];
        assert_eq!(slabs.len(), filters.len(), "the specimen belongs to another BrightField");
        let mut clipped = 0;
        out.fill(1.0);
        for (slab, filter) in slabs.iter_mut().zip(filters) {
            if slab.absorbed.is_empty() && slab.phase.is_empty() {
                continue;
            }
            // Spectra of a phase delay need samples of absorbed light, too.
            slab.absorbed.resize(self.size[0] * self.size[1], 0.0);
            let Slab { absorbed, phase, spectra } = slab;
            let samples = Samples { absorbed, behind: &[], phase, width: self.size[0], offset: 0 };
            let spectra = spectra.get_or_insert_with(|| {
                let mut spectra = Spectra::default();
                self.canvas.load(samples, &mut spectra, scratch);
                spectra
            });
            if filter.is_corrected() {
                self.canvas.correct(&self.in_focus, samples, spectra, scratch);
            }
            for image in [&mut *factor, phases] {
                image.clear();
                image.resize(out.len(), 0.0);
            }
            let add = |stripe: ImageStripe<'_>| stripe.add_to(factor, phases, image_width, 0, image_width);
            self.canvas.expose(filter, spectra, image_width, add, scratch);
            clipped += transmit(factor, if phase.is_empty() { &[] } else { phases });
            times(out, factor);
        }
        add_stray_light(out, self.microscope.params().stray_light);
        clipped
    }
}

impl Slab {
    /// Prepares for new samples.
    fn changed(&mut self) {
        self.spectra = None;
        for samples in [&mut self.absorbed, &mut self.phase] {
            if !is_nonzero(samples) {
                samples.clear();
            }
        }
    }
}

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use multiversion::multiversion;

use crate::canvas::{Canvas, CanvasScratch, Samples, Spectra, amplitudes, is_nonzero, transmit};
use crate::filter::{Filter, incoherence};
use crate::grid::fast_length;
use crate::microscope::distance;
use crate::smooth::{SmoothCorrection, is_detailed};
use crate::spectrum::LanePlans;
use crate::transfer_cache::TransferCache;
use crate::{Error, Microscope};

/// Renders a slide patch by patch: each patch is at one depth and gives a transmission factor of the light around it.
#[derive(Debug)]
pub struct PatchImager {
    transfers: TransferCache,
    plans: Arc<LanePlans>,
    canvases: Mutex<BTreeMap<CanvasKey, Arc<Canvas>>>,
    in_focus: Filter,
    smooth: Option<SmoothCorrection>,
}

/// Size in pixels, and samples per pixel.
type CanvasKey = ([usize; 2], usize);

/// The imaging properties at one depth and stage position.
#[derive(Debug, Clone)]
pub struct Focus {
    filter: Arc<Filter>,
    margin_px: usize,
    defocus_um: f64,
    plans: Arc<LanePlans>,
}

impl Focus {
    /// Returns the margin in pixels around a patch that its light reaches. It depends only on the defocus, in steps.
    #[must_use]
    pub fn margin_px(&self) -> usize {
        self.margin_px
    }

    /// Returns the defocus in µm of mountant, positive below the focal plane.
    #[must_use]
    pub fn defocus_um(&self) -> f64 {
        self.defocus_um
    }
}

/// A part of an object on a [`Patch`], sampled once or several times per pixel.
///
/// The parts of one object are imaged together: their absorbed light is added before it is subtracted from the light of
/// the empty slide. A cell is smooth except in its nucleus: one sample per pixel for the cytoplasm and several for the
/// nucleus take a fraction of the time of several for both.
#[derive(Debug, Clone, Copy, Default)]
pub struct PatchLayer<'a> {
    /// Transmittance, 0 to 1, including that of `behind`, in rows from the top.
    pub transmittance: &'a [f32],
    /// Transmittance of other parts of the object at the same samples; empty if there are none.
    pub behind: &'a [f32],
    /// Phase delay in radians; empty if there is none.
    pub phase_rad: &'a [f32],
    /// Samples per row.
    pub width: usize,
    /// Samples per pixel and axis. If they are fewer than the oversampling, each must be the mean of the points in its
    /// square, interpolated by Catmull–Rom cubics from a smooth object.
    pub samples_per_pixel: usize,
    /// Upper left pixel in the patch.
    pub at_px: [usize; 2],
}

/// A small rectangle of the slide at one depth, with cached spectra for each margin.
#[derive(Debug, Clone, Default)]
pub struct Patch {
    size_px: [usize; 2],
    layers: Vec<LoadedLayer>,
    plans: Option<Arc<LanePlans>>,
    padded: Vec<f32>,
}

impl Patch {
    /// Returns the number of layers.
    #[must_use]
    pub fn layers(&self) -> usize {
        self.layers.len()
    }
}

/// A copy of a [`PatchLayer`], with its spectra.
#[derive(Debug, Clone, Default)]
struct LoadedLayer {
    absorbed: Vec<f32>,
    behind: Vec<f32>,
    phase: Vec<f32>,
    width: usize,
    samples_per_pixel: usize,
    at_px: [usize; 2],
    is_empty: bool,
    correction: Correction,
    /// Variance of the amplitude, for [`Correction::Added`].
    variance: Vec<f32>,
    padded: Vec<PaddedSpectra>,
    /// Number of entries of `padded` that belong to this layer; the others are left from earlier ones.
    fresh: usize,
}

impl LoadedLayer {
    fn size_px(&self) -> [usize; 2] {
        [self.width, self.absorbed.len() / self.width].map(|side| side / self.samples_per_pixel)
    }
}

/// How the in-focus correction of a layer is computed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Correction {
    /// It is negligible.
    #[default]
    None,
    /// Added to the absorbed light: see [`SmoothCorrection`].
    Added,
    /// From products of blurred images: see [`Canvas::correct`].
    Products,
}

#[derive(Debug, Clone, Default)]
struct PaddedSpectra {
    margin_px: usize,
    /// Weight of the variance that was added to the absorbed light.
    added: f32,
    spectra: Spectra,
}

/// Working memory of [`PatchImager`], one per thread.
#[derive(Debug, Clone, Default)]
pub struct PatchScratch {
    canvas: CanvasScratch,
    phases: Vec<f32>,
    absorbed: Vec<f32>,
    spectra: Spectra,
}

/// Transmission factor of a patch: light relative to an empty slide, as the mean over each camera pixel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Factor {
    /// Pixels per row: the patch with the margin on both sides.
    pub width: usize,
    /// Values in row-major order from the top.
    pub values: Vec<f32>,
    /// Margin on each side of the patch in camera pixels.
    pub margin_px: usize,
    /// Number of values clipped at [`MIN_TRANSMITTANCE`](crate::MIN_TRANSMITTANCE).
    pub clipped: usize,
}

/// Reach of the light: a multiple of the cone's radius plus a multiple of λ/NA, which grows with the condenser's
/// aperture. At most about a thousandth of the contrast lies outside, in the median two ten-thousandths.
const CONES: f64 = 1.4;
const FRINGES: f64 = 3.9;
const OPEN_FRINGES: f64 = 2.25;

impl PatchImager {
    /// Computes the data common to all depths.
    #[must_use]
    pub fn new(microscope: &Microscope) -> Self {
        let in_focus = Filter::in_focus(microscope);
        Self {
            transfers: TransferCache::new(microscope),
            plans: Arc::default(),
            canvases: Mutex::default(),
            smooth: SmoothCorrection::new(microscope, &in_focus),
            in_focus,
        }
    }

    /// Returns the microscope.
    #[must_use]
    pub fn microscope(&self) -> &Microscope {
        self.transfers.microscope()
    }

    /// Computes the imaging properties at a depth and stage position: see [`Microscope::transfer`].
    ///
    /// Up to a defocus of 15 µm, transfer functions are interpolated between a few depths, a third of a µm apart. Each
    /// takes about 0.1 ms and is cached per stage position; all else takes some 10 µs. The result does not depend on
    /// the state of the cache.
    ///
    /// # Errors
    ///
    /// If a number is not finite or beyond ±1000 µm.
    pub fn focus(&self, depth_um: f64, stage_um: f64) -> Result<Focus, Error> {
        let margin_px = self.margin_px(depth_um, stage_um)?;
        let transfer = self.transfers.transfer(depth_um, stage_um);
        Ok(Focus {
            filter: Arc::new(Filter::new(self.microscope(), depth_um, stage_um, &transfer)),
            margin_px,
            defocus_um: self.microscope().defocus_um(depth_um, stage_um),
            plans: Arc::clone(&self.plans),
        })
    }

    /// Returns a focus for an object whose transmittance was measured in an image in focus, which lens and pixels have
    /// already blurred once. In focus the object keeps its appearance.
    #[must_use]
    pub fn refocus(&self, focus: &Focus) -> Focus {
        let mut focus = focus.clone();
        Arc::make_mut(&mut focus.filter).restore(&self.in_focus);
        focus
    }

    /// Returns the margin of a patch ([`Focus::margin_px`]) without computing a [`Focus`].
    ///
    /// # Errors
    ///
    /// See [`PatchImager::focus`].
    pub fn margin_px(&self, depth_um: f64, stage_um: f64) -> Result<usize, Error> {
        let (depth, stage) = (distance("depth_um", depth_um)?, distance("stage_um", stage_um)?);
        let params = self.microscope().params();
        let cone = self.microscope().max_blur_radius_um(depth, stage);
        let fringes = FRINGES + OPEN_FRINGES * incoherence(params.condenser_na / params.na);
        let reach = CONES * cone + fringes * params.wavelength_um / params.na;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a distance in pixels")]
        let pixels = (reach / params.pixel_um).ceil() as usize;
        // Rounds up to 4, 5 or 6 times 2ⁿ, so that similar depths share spectra.
        let quarter = (pixels.next_power_of_two() / 8).max(1);
        Ok(quarter * if pixels > 6 * quarter { 8 } else { pixels.div_ceil(quarter) })
    }

    /// Loads an object with several samples per pixel into `patch`: transmittances, 0 to 1, and phase delays in
    /// radians. An empty `phase_rad` means no phase delay.
    ///
    /// # Panics
    ///
    /// If a size is 0 or not a multiple of the oversampling, or the slices differ in length.
    pub fn load(&self, transmittance: &[f32], phase_rad: &[f32], width: usize, patch: &mut Patch) {
        let samples_per_pixel = self.microscope().params().oversampling;
        let layer = PatchLayer { transmittance, phase_rad, width, samples_per_pixel, ..PatchLayer::default() };
        let size = [width, transmittance.len().checked_div(width).unwrap_or(0)];
        self.load_layers(size.map(|side| side / samples_per_pixel), &[layer], patch);
    }

    /// Loads an object in several layers into `patch`, which has `size_px` pixels.
    ///
    /// # Panics
    ///
    /// If a layer is empty, not within the patch, or has incomplete pixels, or its slices differ in length.
    pub fn load_layers(&self, size_px: [usize; 2], layers: &[PatchLayer<'_>], patch: &mut Patch) {
        patch.size_px = size_px;
        patch.plans = Some(Arc::clone(&self.plans));
        let oversampling = self.microscope().params().oversampling;
        patch.layers.resize_with(layers.len(), LoadedLayer::default);
        for (layer, loaded) in layers.iter().zip(&mut patch.layers) {
            let PatchLayer { transmittance, behind, phase_rad, width, samples_per_pixel: n, at_px } = *layer;
            let fits = |side: usize| n > 0 && side > 0 && side.is_multiple_of(n);
            let is_whole =
                fits(width) && transmittance.len().is_multiple_of(width) && fits(transmittance.len() / width);
            assert!(is_whole, "the size of a layer must be a multiple of the oversampling");
            let size = [width / n, transmittance.len() / width / n];
            let is_within = (0..2).all(|axis| at_px[axis] + size[axis] <= size_px[axis]);
            assert!(is_within, "a layer must be within the patch");
            let fits = |other: &[f32]| other.is_empty() || other.len() == transmittance.len();
            assert!(fits(phase_rad) && fits(behind), "transmittance and phase must have the same length");
            let copy = |to: &mut Vec<f32>, from: &[f32]| {
                to.clear();
                to.extend_from_slice(from);
            };
            copy(&mut loaded.behind, behind);
            copy(&mut loaded.phase, if is_nonzero(phase_rad) { phase_rad } else { &[] });
            loaded.absorbed.resize(transmittance.len(), 0.0);
            absorb(transmittance, behind, &mut loaded.absorbed);
            loaded.is_empty = loaded.phase.is_empty() && !is_nonzero(&loaded.absorbed);
            let is_smooth = n == 1 && n < oversampling && behind.is_empty();
            loaded.correction = match self.smooth.as_ref().filter(|_| is_smooth) {
                Some(smooth) => {
                    smooth.variance(&loaded.absorbed, width, &mut loaded.variance, &mut patch.padded);
                    Correction::Added
                }
                None => {
                    let amplitude = &mut patch.padded;
                    amplitude.resize(transmittance.len(), 0.0);
                    amplitudes(&loaded.absorbed, &loaded.behind, amplitude);
                    if is_detailed(amplitude, width) { Correction::Products } else { Correction::None }
                }
            };
            (loaded.width, loaded.samples_per_pixel, loaded.at_px, loaded.fresh) = (width, n, at_px, 0);
        }
    }

    /// Computes the transmission factor of a patch, including the margin of `focus`.
    ///
    /// # Panics
    ///
    /// If nothing was loaded, or the patch or the focus belong to another imager.
    pub fn expose(&self, patch: &mut Patch, focus: &Focus, scratch: &mut PatchScratch, factor: &mut Factor) {
        self.expose_with(patch, |_| focus, scratch, factor);
    }

    /// As [`expose`](Self::expose), with a focus for each layer. All must have the margin of the first.
    ///
    /// # Panics
    ///
    /// If nothing was loaded, or the patch or a focus belong to another imager, or margins differ.
    pub fn expose_with<'a>(
        &self,
        patch: &mut Patch,
        focus_of: impl Fn(usize) -> &'a Focus,
        scratch: &mut PatchScratch,
        factor: &mut Factor,
    ) {
        let own = |plans: &Arc<LanePlans>| Arc::ptr_eq(plans, &self.plans);
        let is_own = patch.plans.as_ref().is_some_and(own) && (0..patch.layers.len()).all(|i| own(&focus_of(i).plans));
        assert!(is_own, "the patch or the focus belongs to another imager");
        let margin_px = focus_of(0).margin_px;
        let [width, height] = patch.size_px.map(|side| side + 2 * margin_px);
        let PatchScratch { canvas: scratch, phases, absorbed: corrected, spectra: spare } = scratch;
        *factor = Factor { width, values: core::mem::take(&mut factor.values), margin_px, clipped: 0 };
        // A first layer that covers the patch is stored, and later ones are added.
        let is_stored = |layer: &LoadedLayer| !layer.is_empty && layer.size_px() == patch.size_px;
        let stored = patch.layers.first().filter(|layer| is_stored(layer));
        let has_phase = patch.layers.iter().any(|layer| !layer.phase.is_empty());
        for (image, is_used, is_stored) in [
            (&mut factor.values, true, stored.is_some()),
            (&mut *phases, has_phase, stored.is_some_and(|layer| !layer.phase.is_empty())),
        ] {
            if !is_stored {
                image.clear();
            }
            image.resize(if is_used { width * height } else { 0 }, 0.0);
        }
        let is_first_stored = stored.is_some();
        for (index, layer) in patch.layers.iter_mut().enumerate().filter(|(_, layer)| !layer.is_empty) {
            let focus = focus_of(index);
            assert!(focus.margin_px == margin_px, "layers must have the same margin");
            let [x, y] = layer.at_px;
            let [columns, rows] = layer.size_px().map(|side| side + 2 * margin_px);
            let has_phase = !layer.phase.is_empty();
            let (canvas, spectra) = self.padded_spectra(layer, focus, (corrected, spare), scratch);
            let absorbed = &mut factor.values[y * width..(y + rows) * width];
            let phases = if has_phase { &mut phases[y * width..(y + rows) * width] } else { &mut [] };
            canvas.expose(
                &focus.filter,
                spectra,
                columns,
                |stripe| match is_first_stored && index == 0 {
                    true => stripe.store_in(absorbed, phases, width),
                    false => stripe.add_to(absorbed, phases, width, x, x + columns),
                },
                scratch,
            );
        }
        factor.clipped = transmit(&mut factor.values, phases);
    }

    /// Returns the layer's canvas and spectra with the margin of a focus, and computes what is missing.
    ///
    /// Where the correction fades out, its weight differs between planes, and `spare` receives the spectra.
    fn padded_spectra<'a>(
        &self,
        layer: &'a mut LoadedLayer,
        focus: &Focus,
        (corrected, spare): (&mut Vec<f32>, &'a mut Spectra),
        scratch: &mut CanvasScratch,
    ) -> (Arc<Canvas>, &'a Spectra) {
        let (margin_px, size_px) = (focus.margin_px, layer.size_px());
        let LoadedLayer { absorbed, behind, phase, width, samples_per_pixel: n, padded, fresh, .. } = layer;
        let canvas = self.canvas(size_px, *n, margin_px);
        let samples = Samples { absorbed, behind, phase, width: *width, offset: margin_px * *n };
        let added = if layer.correction == Correction::Added { focus.filter.correction } else { 0.0 };
        let mut load = |spectra: &mut Spectra| {
            let mut samples = samples;
            if added > 0.0 {
                corrected.resize(absorbed.len(), 0.0);
                add_scaled(absorbed, &layer.variance, added, corrected);
                samples.absorbed = corrected;
            }
            canvas.load(samples, spectra, scratch);
        };
        if added > 0.0 && added < focus.filter.full_correction {
            load(spare);
            return (canvas, spare);
        }
        let is_same = |entry: &PaddedSpectra| entry.margin_px == margin_px && entry.added == added;
        let index = padded[..*fresh].iter().position(is_same).unwrap_or(*fresh);
        if index == *fresh {
            if index == padded.len() {
                padded.push(PaddedSpectra::default());
            }
            let entry = &mut padded[index];
            load(&mut entry.spectra);
            (entry.margin_px, entry.added) = (margin_px, added);
            *fresh += 1;
        }
        let spectra = &mut padded[index].spectra;
        if focus.filter.is_corrected() && layer.correction == Correction::Products {
            canvas.correct(&self.in_focus, samples, spectra, scratch);
        }
        (canvas, spectra)
    }

    /// Returns the canvas for a size in pixels with its margin.
    fn canvas(&self, size_px: [usize; 2], samples_per_pixel: usize, margin_px: usize) -> Arc<Canvas> {
        let size_px = size_px.map(|side| fast_length(side + 2 * margin_px));
        // The map stays valid if a thread panics.
        let mut canvases = self.canvases.lock().unwrap_or_else(PoisonError::into_inner);
        let make = || Arc::new(Canvas::new(self.microscope(), size_px, samples_per_pixel, &self.plans));
        Arc::clone(canvases.entry((size_px, samples_per_pixel)).or_insert_with(make))
    }
}

/// Computes absorbed light T₀ − T, where T₀ is 1 if `behind` is empty.
#[multiversion(targets = "simd")]
fn absorb(transmittance: &[f32], behind: &[f32], absorbed: &mut [f32]) {
    if behind.is_empty() {
        absorbed.iter_mut().zip(transmittance).for_each(|(absorbed, t)| *absorbed = 1.0 - t);
    } else {
        let pairs = transmittance.iter().zip(behind);
        absorbed.iter_mut().zip(pairs).for_each(|(absorbed, (t, behind))| *absorbed = behind - t);
    }
}

#[multiversion(targets = "simd")]
fn add_scaled(values: &[f32], others: &[f32], factor: f32, sums: &mut [f32]) {
    sums.iter_mut().zip(values.iter().zip(others)).for_each(|(sum, (value, other))| *sum = value + factor * other);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MicroscopeParams;

    #[test]
    fn planes_that_share_spectra_have_the_images_of_single_planes() {
        let imager = PatchImager::new(&Microscope::new(&MicroscopeParams::default()).unwrap());
        let (width, height) = (60, 50);
        let sample = |i: usize| {
            let [x, y] = [(i % width) as f32 - 30.0, (i / width) as f32 - 25.0];
            let r2 = x * x + y * y;
            0.6 / (1.0 + 1e-5 * r2 * r2 * r2)
        };
        let transmittance: Vec<f32> = (0..width * height).map(|i| 1.0 - sample(i)).collect();
        let phase: Vec<f32> = (0..width * height).map(|i| 3.0 * sample(i)).collect();
        let layer = PatchLayer {
            transmittance: &transmittance,
            phase_rad: &phase,
            width,
            samples_per_pixel: 1,
            ..PatchLayer::default()
        };
        let (mut shared, mut scratch) = (Patch::default(), PatchScratch::default());
        imager.load_layers([width, height], &[layer], &mut shared);
        let (mut found, mut expected) = (Factor::default(), Factor::default());
        for depth in [-7.0, -1.7, -1.2, -0.4, 0.0, 0.9, 1.4, 2.2, 5.0] {
            let focus = imager.focus(depth, 0.0).unwrap();
            let mut alone = Patch::default();
            imager.load_layers([width, height], &[layer], &mut alone);
            imager.expose(&mut shared, &focus, &mut scratch, &mut found);
            imager.expose(&mut alone, &focus, &mut scratch, &mut expected);
            assert_eq!(found, expected, "{depth}");
        }
        // Margins, and one of them with and without correction.
        let entries = shared.layers[0].padded.iter().map(|entry| (entry.margin_px, entry.added > 0.0));
        let entries: std::collections::BTreeSet<_> = entries.collect();
        assert_eq!(entries.len(), shared.layers[0].padded.len());
        assert!(entries.len() > 3 && entries.iter().any(|(_, is_corrected)| *is_corrected));
    }
}

use core::ops::RangeInclusive;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::canvas::{Canvas, Samples, Spectra, absorbed_of, amplitude_of, is_nonzero};
use crate::filter::{Filter, Lattice, incoherence};
use crate::grid::fast_length;
use crate::lane_plane::{LanePlans, LaneScratch};
use crate::microscope::distance;
use crate::{Error, Microscope, Transfer};

/// Renders a slide patch by patch: each patch is at one depth and gives a transmission factor of the light around it.
#[derive(Debug)]
pub struct PatchImager {
    transfers: TransferCache,
    plans: Arc<LanePlans>,
    canvases: Mutex<BTreeMap<[usize; 2], Arc<Canvas>>>,
    in_focus: Filter,
}

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

    /// Returns the sampling lattice of the factors.
    #[must_use]
    pub fn lattice(&self) -> Lattice {
        self.filter.lattice
    }
}

/// A small rectangle of the slide at one depth, with cached spectra for each margin.
#[derive(Debug, Clone, Default)]
pub struct Patch {
    width: usize,
    transmittance: Vec<f32>,
    phase_rad: Vec<f32>,
    plans: Option<Arc<LanePlans>>,
    padded: Vec<PaddedSpectra>,
    /// Number of entries of `padded` that belong to this patch; the others are left from earlier patches.
    fresh: usize,
}

#[derive(Debug, Clone)]
struct PaddedSpectra {
    margin_px: usize,
    canvas: Arc<Canvas>,
    spectra: Spectra,
}

/// Working memory of [`PatchImager`], one per thread.
#[derive(Debug, Clone, Default)]
pub struct PatchScratch(LaneScratch);

/// Transmission factor of a patch: light relative to an empty slide.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Factor {
    /// Sampling lattice of `values`.
    pub lattice: Lattice,
    /// Values per row: the patch with the margin on both sides.
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
const FRINGES: f64 = 3.75;
const OPEN_FRINGES: f64 = 2.25;

impl PatchImager {
    /// Computes the data common to all depths.
    #[must_use]
    pub fn new(microscope: &Microscope) -> Self {
        Self {
            transfers: TransferCache::new(microscope),
            plans: Arc::default(),
            canvases: Mutex::default(),
            in_focus: Filter::in_focus(microscope),
        }
    }

    /// Returns the microscope.
    #[must_use]
    pub fn microscope(&self) -> &Microscope {
        &self.transfers.microscope
    }

    /// Computes the imaging properties at a depth and stage position: see [`Microscope::transfer`].
    ///
    /// Transfer functions are interpolated between a few depths, a quarter of a µm apart. Each takes about 0.3 ms and
    /// is cached per stage position; all else takes some 10 µs. The result does not depend on the state of the cache.
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

    /// As [`focus`](Self::focus), for an object whose transmittance was measured in an image in focus, which lens and
    /// pixels have already blurred once. In focus the object keeps its appearance.
    ///
    /// # Errors
    ///
    /// See [`PatchImager::focus`].
    pub fn refocus(&self, depth_um: f64, stage_um: f64) -> Result<Focus, Error> {
        let mut focus = self.focus(depth_um, stage_um)?;
        Arc::make_mut(&mut focus.filter).restore(&self.in_focus);
        Ok(focus)
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
        // Rounds up to 2ⁿ or 3 · 2ⁿ.
        let twos = pixels.next_power_of_two();
        Ok(if 4 * pixels <= 3 * twos { 3 * twos / 4 } else { twos })
    }

    /// Loads a rectangle of the slide into `patch`: transmittances, 0 to 1, and phase delays in radians. An empty
    /// `phase_rad` means no phase delay.
    ///
    /// # Panics
    ///
    /// If a size is 0 or not a multiple of the oversampling, or the slices differ in length.
    pub fn load(&self, transmittance: &[f32], phase_rad: &[f32], width: usize, patch: &mut Patch) {
        let oversampling = self.microscope().params().oversampling;
        let fits = |side: usize| side > 0 && side.is_multiple_of(oversampling);
        let whole = fits(width) && transmittance.len().is_multiple_of(width) && fits(transmittance.len() / width);
        assert!(whole, "the patch size must be a multiple of the oversampling");
        let same = phase_rad.is_empty() || phase_rad.len() == transmittance.len();
        assert!(same, "transmittance and phase must have the same length");
        patch.width = width;
        patch.transmittance.clear();
        patch.transmittance.extend_from_slice(transmittance);
        patch.phase_rad.clear();
        patch.phase_rad.extend_from_slice(phase_rad);
        patch.plans = Some(Arc::clone(&self.plans));
        patch.fresh = 0;
    }

    /// Computes the transmission factor of a patch, including the margin of `focus`.
    ///
    /// # Panics
    ///
    /// If nothing was loaded, or the patch or the focus belong to another imager.
    pub fn expose(&self, patch: &mut Patch, focus: &Focus, scratch: &mut PatchScratch, factor: &mut Factor) {
        let own = |plans: &Arc<LanePlans>| Arc::ptr_eq(plans, &self.plans);
        assert!(
            patch.plans.as_ref().is_some_and(own) && own(&focus.plans),
            "the patch or the focus belongs to another imager"
        );
        let (filter, scratch) = (&*focus.filter, &mut scratch.0);
        let oversampling = self.microscope().params().oversampling;
        let [width, height] = [patch.width, patch.transmittance.len() / patch.width];
        let PaddedSpectra { canvas, spectra, .. } = self.padded_spectra(patch, focus, scratch);
        let (scale, stride) = match filter.lattice {
            Lattice::Object => (oversampling, 1),
            Lattice::Camera => (1, oversampling),
        };
        let outer = |side: usize| side / stride + 2 * focus.margin_px * scale;
        *factor = Factor {
            lattice: filter.lattice,
            width: outer(width),
            values: core::mem::take(&mut factor.values),
            margin_px: focus.margin_px,
            clipped: 0,
        };
        factor.values.resize(outer(width) * outer(height), 1.0);
        if spectra.absorbed.is_empty() {
            factor.values.fill(1.0);
        } else {
            factor.clipped = canvas.transmit::<true>(filter, spectra, &mut factor.values, factor.width, scratch);
        }
        if !spectra.phase.is_empty() {
            let part = core::iter::once((filter, &*spectra));
            canvas.refract(filter.lattice, part, &mut factor.values, factor.width, scratch);
        }
    }

    /// Returns the patch's spectra with the margin of a focus, and computes missing ones.
    fn padded_spectra<'a>(
        &self,
        patch: &'a mut Patch,
        focus: &Focus,
        scratch: &mut LaneScratch,
    ) -> &'a mut PaddedSpectra {
        let Patch { width, transmittance, phase_rad, padded, fresh, .. } = patch;
        let width = *width;
        let height = transmittance.len() / width;
        let offset = focus.margin_px * self.microscope().params().oversampling;
        let absorbing = Samples { samples: transmittance, width, offset, background: 1.0 };
        let phase = Samples { samples: phase_rad, width, offset, background: 0.0 };
        let cached = padded[..*fresh].iter().position(|entry| entry.margin_px == focus.margin_px);
        let index = cached.unwrap_or_else(|| {
            let canvas = self.canvas([width, height], focus.margin_px);
            if padded.len() == *fresh {
                padded.push(PaddedSpectra { margin_px: 0, canvas: Arc::clone(&canvas), spectra: Spectra::default() });
            }
            let entry = &mut padded[*fresh];
            entry.margin_px = focus.margin_px;
            entry.canvas = canvas;
            entry.spectra.clear();
            *fresh += 1;
            entry.canvas.transform(absorbing, absorbed_of, &mut entry.spectra.absorbed, scratch);
            if !phase_rad.is_empty() {
                entry.canvas.transform(phase, is_nonzero, &mut entry.spectra.phase, scratch);
            }
            *fresh - 1
        });
        let entry = &mut padded[index];
        if focus.filter.is_corrected {
            if entry.spectra.amplitude.is_empty() {
                entry.canvas.transform(absorbing, amplitude_of(absorbed_of), &mut entry.spectra.amplitude, scratch);
            }
            entry.canvas.correct(&self.in_focus, &mut entry.spectra, scratch);
        }
        entry
    }

    /// Returns the canvas for a patch size with its margin.
    fn canvas(&self, size: [usize; 2], margin_px: usize) -> Arc<Canvas> {
        let oversampling = self.microscope().params().oversampling;
        let size = size.map(|side| oversampling * fast_length(side / oversampling + 2 * margin_px));
        // The map stays valid if a thread panics.
        let mut canvases = self.canvases.lock().unwrap_or_else(PoisonError::into_inner);
        let make = || Arc::new(Canvas::new(self.microscope(), size, &self.plans));
        Arc::clone(canvases.entry(size).or_insert_with(make))
    }
}

/// Transfer functions of any depth, interpolated between equidistant depths. They are computed on demand.
///
/// As a function of depth, a transfer function has no frequency above (n − √(n² − NA²))/λ. Sampled a few times per
/// period, polynomial interpolation has an error below 0.001.
#[derive(Debug)]
struct TransferCache {
    microscope: Microscope,
    step_um: f64,
    /// Transfer functions by stage position and depth index.
    cached: Mutex<BTreeMap<(u64, i64), Arc<Transfer>>>,
}

/// Approximate samples per period.
const SAMPLES_PER_PERIOD: f64 = 6.7;

/// Interpolation nodes on each side of a depth.
const SIDE: i64 = 3;

/// Largest number of cached table entries.
const MOST_ENTRIES: usize = 1 << 20;

impl TransferCache {
    fn new(microscope: &Microscope) -> Self {
        let params = microscope.params();
        let n = params.mount_index;
        let fastest = (n - (n * n - params.na * params.na).sqrt()) / (params.wavelength_um - 0.5 * params.bandwidth_um);
        Self { microscope: microscope.clone(), step_um: 1.0 / (SAMPLES_PER_PERIOD * fastest), cached: Mutex::default() }
    }

    /// Returns the transfer function at a depth and stage position. The result does not depend on earlier calls.
    fn transfer(&self, depth_um: f64, stage_um: f64) -> Transfer {
        // Indices count away from the objective.
        let position = -depth_um / self.step_um;
        let below = position.floor();
        let t = position - below;
        #[expect(clippy::cast_possible_truncation, reason = "depths are at most 1000 µm")]
        let below = below as i64;
        if t == 0.0 {
            return (*self.samples(below..=below, stage_um)[0]).clone();
        }
        // Lagrange polynomials.
        let weight = |k: i64| {
            let others = (1 - SIDE..=SIDE).filter(|&j| j != k);
            others.map(|j| (t - j as f64) / (k - j) as f64).product::<f64>()
        };
        let samples = self.samples(below + 1 - SIDE..=below + SIDE, stage_um);
        Transfer::mixed(&samples.into_iter().zip((1 - SIDE..=SIDE).map(weight)).collect::<Vec<_>>())
    }

    fn samples(&self, numbers: RangeInclusive<i64>, stage_um: f64) -> Vec<Arc<Transfer>> {
        // The map stays valid if a thread panics.
        let lock = || self.cached.lock().unwrap_or_else(PoisonError::into_inner);
        let key = |number| (stage_um.to_bits(), number);
        let cached: Vec<Option<Arc<Transfer>>> = {
            let cached = lock();
            numbers.clone().map(|number| cached.get(&key(number)).cloned()).collect()
        };
        let make = |(number, cached): (i64, Option<Arc<Transfer>>)| {
            cached.unwrap_or_else(|| {
                let transfer = Arc::new(Transfer::new(&self.microscope, -(number as f64) * self.step_um, stage_um));
                let mut cached = lock();
                if cached.len() * transfer.table.len() >= MOST_ENTRIES {
                    cached.clear();
                }
                Arc::clone(cached.entry(key(number)).or_insert(transfer))
            })
        };
        numbers.zip(cached).map(make).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MicroscopeParams, Zernike};

    #[test]
    fn interpolated_transfer_functions_are_accurate() {
        let coma = Zernike { coma: [0.05, 0.02], ..Zernike::default() };
        let broad = MicroscopeParams { wavelength_um: 0.45, bandwidth_um: 0.08, ..MicroscopeParams::default() };
        let cases = [
            MicroscopeParams::default(),
            MicroscopeParams { condenser_na: 0.2, ..MicroscopeParams::default() },
            MicroscopeParams { condenser_na: 0.9, ..MicroscopeParams::default() },
            MicroscopeParams { zernike: coma, bandwidth_um: 0.0, ..MicroscopeParams::default() },
            broad,
        ];
        for params in cases {
            let microscope = Microscope::new(&params).unwrap();
            let transfers = TransferCache::new(&microscope);
            let depths: &[f64] = if params.zernike == coma { &[0.3] } else { &[0.0, 0.3, -1.1, 2.6, 5.2, -9.3] };
            for &depth in depths {
                for stage in [0.0, 2.0] {
                    let (found, exact) = (transfers.transfer(depth, stage), Transfer::new(&microscope, depth, stage));
                    for i in 0..150 {
                        let f = [0.02 * f64::from(i), 0.005 * f64::from(i)];
                        for (a, b) in [(found.absorption(f), exact.absorption(f)), (found.phase(f), exact.phase(f))] {
                            let error = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
                            assert!(error < 1e-3, "{depth} {stage} {f:?}: {error}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn transfer_functions_do_not_depend_on_earlier_calls() {
        let fresh = || TransferCache::new(&Microscope::new(&MicroscopeParams::default()).unwrap());
        let transfers = fresh();
        for (depth, stage) in [(1.2, 0.5), (1.4, 0.0), (1.3, 0.5)] {
            assert_eq!(transfers.transfer(depth, stage), fresh().transfer(depth, stage));
        }
    }
}

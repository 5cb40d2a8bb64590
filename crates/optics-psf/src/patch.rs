use core::ops::RangeInclusive;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::canvas::{Canvas, Samples, Spectra, absorbed_of, amplitude_of, is_lit};
use crate::filter::{Filter, Lattice, incoherence};
use crate::grid::fast_length;
use crate::lane_plane::{LanePlans, LaneScratch};
use crate::microscope::distance;
use crate::{Error, Microscope, Transfer};

/// Images what is on the slide patch by patch: each patch lies at one depth and gives a factor of the light around
/// it.
#[derive(Debug)]
pub struct PatchImager {
    ladder: Ladder,
    plans: Arc<LanePlans>,
    canvases: Mutex<BTreeMap<[usize; 2], Arc<Canvas>>>,
    in_focus: Filter,
}

/// How a microscope images what is at one depth, for one travel of the stage.
#[derive(Debug, Clone)]
pub struct Focus {
    filter: Arc<Filter>,
    margin_px: usize,
    defocus_um: f64,
    plans: Arc<LanePlans>,
}

impl Focus {
    /// How many pixels beyond a patch its light reaches: a function of the distance from focus alone, in steps.
    #[must_use]
    pub fn margin_px(&self) -> usize {
        self.margin_px
    }

    /// How far from focus it is, µm of mountant, positive below.
    #[must_use]
    pub fn defocus_um(&self) -> f64 {
        self.defocus_um
    }

    /// Which lattice factors are sampled on.
    #[must_use]
    pub fn lattice(&self) -> Lattice {
        self.filter.lattice
    }
}

/// What is in a small rectangle of the slide at one depth, and its spectra for each margin that was needed.
#[derive(Debug, Clone, Default)]
pub struct Patch {
    width: usize,
    transmittance: Vec<f32>,
    phase_rad: Vec<f32>,
    plans: Option<Arc<LanePlans>>,
    sheets: Vec<Sheet>,
    /// How many sheets are of this patch and not of earlier ones.
    fresh: usize,
}

#[derive(Debug, Clone)]
struct Sheet {
    margin_px: usize,
    canvas: Arc<Canvas>,
    spectra: Spectra,
}

/// Working memory of [`PatchImager`]: one for each thread.
#[derive(Debug, Clone, Default)]
pub struct PatchScratch(LaneScratch);

/// What a patch lets through of the light, relative to empty slide.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Factor {
    /// Which lattice `values` lie on.
    pub lattice: Lattice,
    /// Values from left to right: the patch and the margin on both sides.
    pub width: usize,
    /// Row after row from the top.
    pub values: Vec<f32>,
    /// Pixels of the camera on each side of the patch.
    pub margin_px: usize,
    /// At how many values less than [`LEAST_LIGHT`](crate::LEAST_LIGHT) would have been let through.
    pub floored: usize,
}

/// How far light is spread: in radii of the condenser's cone, beyond that in λ/NA, and in more of those as the condenser
/// is opened to the whole of the objective's aperture. What lies outside is at most about a thousandth of the contrast,
/// and two ten-thousandths in the middle of many cases.
const CONES: f64 = 1.4;
const FRINGES: f64 = 3.75;
const OPEN_FRINGES: f64 = 2.25;

impl PatchImager {
    /// Computes what all depths have in common.
    #[must_use]
    pub fn new(microscope: &Microscope) -> Self {
        Self {
            ladder: Ladder::new(microscope),
            plans: Arc::default(),
            canvases: Mutex::default(),
            in_focus: Filter::in_focus(microscope),
        }
    }

    /// The microscope.
    #[must_use]
    pub fn microscope(&self) -> &Microscope {
        &self.ladder.microscope
    }

    /// How what lies at that depth is imaged while the stage is there: see [`Microscope::transfer`].
    ///
    /// The transfer functions of a few depths around it, a quarter of a µm apart, are computed, if they have not been
    /// for the same travel of the stage, in about 0.3 ms each; all else takes some 10 µs. What was asked for before
    /// makes no difference.
    ///
    /// # Errors
    ///
    /// If a number is not finite or beyond ±1000 µm.
    pub fn focus(&self, depth_um: f64, stage_um: f64) -> Result<Focus, Error> {
        let margin_px = self.margin_px(depth_um, stage_um)?;
        let transfer = self.ladder.transfer(depth_um, stage_um);
        Ok(Focus {
            filter: Arc::new(Filter::new(self.microscope(), depth_um, stage_um, &transfer)),
            margin_px,
            defocus_um: self.microscope().defocus_um(depth_um, stage_um),
            plans: Arc::clone(&self.plans),
        })
    }

    /// The same for something whose transmittance was taken from an image in which it was in focus, and that the lens
    /// and the pixels have blurred once already. In focus it comes out as it was.
    ///
    /// # Errors
    ///
    /// As [`PatchImager::focus`].
    pub fn refocus(&self, depth_um: f64, stage_um: f64) -> Result<Focus, Error> {
        let mut focus = self.focus(depth_um, stage_um)?;
        Arc::make_mut(&mut focus.filter).restore(&self.in_focus);
        Ok(focus)
    }

    /// The margin that a patch needs at a focus ([`Focus::margin_px`]), without anything being computed for it.
    ///
    /// # Errors
    ///
    /// As [`PatchImager::focus`].
    pub fn margin_px(&self, depth_um: f64, stage_um: f64) -> Result<usize, Error> {
        let (depth, stage) = (distance("depth_um", depth_um)?, distance("stage_um", stage_um)?);
        let params = self.microscope().params();
        let cone = self.microscope().spread_um(depth, stage);
        let fringes = FRINGES + OPEN_FRINGES * incoherence(params.condenser_na / params.na);
        let reach = CONES * cone + fringes * params.wavelength_um / params.na;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a distance in pixels")]
        let pixels = (reach / params.pixel_um).ceil() as usize;
        // The next 2ⁿ or 3 · 2ⁿ.
        let twos = pixels.next_power_of_two();
        Ok(if 4 * pixels <= 3 * twos { 3 * twos / 4 } else { twos })
    }

    /// Puts into `patch` what is in a rectangle of the slide: transmittances, 0 to 1, and phases, by how many radians
    /// light is late, or an empty slice if there are none.
    ///
    /// # Panics
    ///
    /// If a side is 0 or no multiple of the oversampling, or the slices differ in length.
    pub fn load(&self, transmittance: &[f32], phase_rad: &[f32], width: usize, patch: &mut Patch) {
        let oversampling = self.microscope().params().oversampling;
        let fits = |side: usize| side > 0 && side.is_multiple_of(oversampling);
        let whole = fits(width) && transmittance.len().is_multiple_of(width) && fits(transmittance.len() / width);
        assert!(whole, "the patch is not whole pixels of the camera");
        let same = phase_rad.is_empty() || phase_rad.len() == transmittance.len();
        assert!(same, "transmittance and phase differ in size");
        patch.width = width;
        patch.transmittance.clear();
        patch.transmittance.extend_from_slice(transmittance);
        patch.phase_rad.clear();
        patch.phase_rad.extend_from_slice(phase_rad);
        patch.plans = Some(Arc::clone(&self.plans));
        patch.fresh = 0;
    }

    /// What the patch lets through of the light, on the patch and the focus' margin around it.
    ///
    /// # Panics
    ///
    /// If nothing was loaded, or the patch or the focus are of another imager.
    pub fn expose(&self, patch: &mut Patch, focus: &Focus, scratch: &mut PatchScratch, factor: &mut Factor) {
        let own = |plans: &Arc<LanePlans>| Arc::ptr_eq(plans, &self.plans);
        assert!(patch.plans.as_ref().is_some_and(own) && own(&focus.plans), "a patch or a focus of another imager");
        let (filter, scratch) = (&*focus.filter, &mut scratch.0);
        let oversampling = self.microscope().params().oversampling;
        let [width, height] = [patch.width, patch.transmittance.len() / patch.width];
        let Sheet { canvas, spectra, .. } = self.sheet(patch, focus, scratch);
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
            floored: 0,
        };
        factor.values.resize(outer(width) * outer(height), 1.0);
        if spectra.absorbed.is_empty() {
            factor.values.fill(1.0);
        } else {
            factor.floored = canvas.transmit::<true>(filter, spectra, &mut factor.values, factor.width, scratch);
        }
        if !spectra.phase.is_empty() {
            let part = core::iter::once((filter, &*spectra));
            canvas.refract(filter.lattice, part, &mut factor.values, factor.width, scratch);
        }
    }

    /// The patch's spectra with the margin of a focus, and all that this needs.
    fn sheet<'a>(&self, patch: &'a mut Patch, focus: &Focus, scratch: &mut LaneScratch) -> &'a mut Sheet {
        let Patch { width, transmittance, phase_rad, sheets, fresh, .. } = patch;
        let width = *width;
        let height = transmittance.len() / width;
        let offset = focus.margin_px * self.microscope().params().oversampling;
        let absorbing = Samples { samples: transmittance, width, offset, background: 1.0 };
        let late = Samples { samples: phase_rad, width, offset, background: 0.0 };
        let known = sheets[..*fresh].iter().position(|sheet| sheet.margin_px == focus.margin_px);
        let index = known.unwrap_or_else(|| {
            let canvas = self.canvas([width, height], focus.margin_px);
            if sheets.len() == *fresh {
                sheets.push(Sheet { margin_px: 0, canvas: Arc::clone(&canvas), spectra: Spectra::default() });
            }
            let sheet = &mut sheets[*fresh];
            sheet.margin_px = focus.margin_px;
            sheet.canvas = canvas;
            sheet.spectra.clear();
            *fresh += 1;
            sheet.canvas.transform(absorbing, absorbed_of, &mut sheet.spectra.absorbed, scratch);
            if !phase_rad.is_empty() {
                sheet.canvas.transform(late, is_lit, &mut sheet.spectra.phase, scratch);
            }
            *fresh - 1
        });
        let sheet = &mut sheets[index];
        if focus.filter.is_corrected {
            if sheet.spectra.amplitude.is_empty() {
                sheet.canvas.transform(absorbing, amplitude_of(absorbed_of), &mut sheet.spectra.amplitude, scratch);
            }
            sheet.canvas.correct(&self.in_focus, &mut sheet.spectra, scratch);
        }
        sheet
    }

    /// The canvas of a patch and the margin around it.
    fn canvas(&self, size: [usize; 2], margin_px: usize) -> Arc<Canvas> {
        let oversampling = self.microscope().params().oversampling;
        let size = size.map(|side| oversampling * fast_length(side / oversampling + 2 * margin_px));
        // A canvas is whole or absent, even if a thread has panicked.
        let mut canvases = self.canvases.lock().unwrap_or_else(PoisonError::into_inner);
        let make = || Arc::new(Canvas::new(self.microscope(), size, &self.plans));
        Arc::clone(canvases.entry(size).or_insert_with(make))
    }
}

/// Transfer functions of any depth, between those of a ladder of depths, which are computed when first asked for.
///
/// As a function of depth, a transfer function has no frequency above (n − √(n² − NA²))/λ: between rungs that are
/// close to that, a polynomial errs by less than 0.001.
#[derive(Debug)]
struct Ladder {
    microscope: Microscope,
    step_um: f64,
    /// By travel of the stage and rung.
    made: Mutex<BTreeMap<(u64, i64), Arc<Transfer>>>,
}

/// Rungs for each of those periods, about.
const RUNGS: f64 = 6.7;

/// Rungs on each side of a depth.
const SIDE: i64 = 3;

/// How many entries of tables are kept.
const MOST_ENTRIES: usize = 1 << 20;

impl Ladder {
    fn new(microscope: &Microscope) -> Self {
        let params = microscope.params();
        let n = params.mount_index;
        let fastest = (n - (n * n - params.na * params.na).sqrt()) / (params.wavelength_um - 0.5 * params.bandwidth_um);
        Self { microscope: microscope.clone(), step_um: 1.0 / (RUNGS * fastest), made: Mutex::default() }
    }

    /// The transfer function at a depth and travel of the stage, of whatever was asked for before.
    fn transfer(&self, depth_um: f64, stage_um: f64) -> Transfer {
        // Rungs are counted away from the objective.
        let position = -depth_um / self.step_um;
        let below = position.floor();
        let t = position - below;
        #[expect(clippy::cast_possible_truncation, reason = "depths are at most 1000 µm")]
        let below = below as i64;
        if t == 0.0 {
            return (*self.rungs(below..=below, stage_um)[0]).clone();
        }
        // Lagrange's polynomials.
        let weight = |k: i64| {
            let others = (1 - SIDE..=SIDE).filter(|&j| j != k);
            others.map(|j| (t - j as f64) / (k - j) as f64).product::<f64>()
        };
        let rungs = self.rungs(below + 1 - SIDE..=below + SIDE, stage_um);
        Transfer::mixed(&rungs.into_iter().zip((1 - SIDE..=SIDE).map(weight)).collect::<Vec<_>>())
    }

    fn rungs(&self, numbers: RangeInclusive<i64>, stage_um: f64) -> Vec<Arc<Transfer>> {
        // A transfer function is whole or absent, even if a thread has panicked.
        let lock = || self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let key = |number| (stage_um.to_bits(), number);
        let known: Vec<Option<Arc<Transfer>>> = {
            let made = lock();
            numbers.clone().map(|number| made.get(&key(number)).cloned()).collect()
        };
        let make = |(number, known): (i64, Option<Arc<Transfer>>)| {
            known.unwrap_or_else(|| {
                let transfer = Arc::new(Transfer::new(&self.microscope, -(number as f64) * self.step_um, stage_um));
                let mut made = lock();
                if made.len() * transfer.table.len() >= MOST_ENTRIES {
                    made.clear();
                }
                Arc::clone(made.entry(key(number)).or_insert(transfer))
            })
        };
        numbers.zip(known).map(make).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MicroscopeParams, Zernike};

    #[test]
    fn depths_between_rungs_are_near_the_integral() {
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
            let ladder = Ladder::new(&microscope);
            let depths: &[f64] = if params.zernike == coma { &[0.3] } else { &[0.0, 0.3, -1.1, 2.6, 5.2, -9.3] };
            for &depth in depths {
                for stage in [0.0, 2.0] {
                    let (found, exact) = (ladder.transfer(depth, stage), Transfer::new(&microscope, depth, stage));
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
    fn what_was_asked_before_makes_no_difference() {
        let fresh = || Ladder::new(&Microscope::new(&MicroscopeParams::default()).unwrap());
        let ladder = fresh();
        for (depth, stage) in [(1.2, 0.5), (1.4, 0.0), (1.3, 0.5)] {
            assert_eq!(ladder.transfer(depth, stage), fresh().transfer(depth, stage));
        }
    }
}

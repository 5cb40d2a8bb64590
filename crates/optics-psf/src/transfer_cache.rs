use core::ops::RangeInclusive;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::transfer::FAR_UM;
use crate::{Microscope, Transfer};

/// Transfer functions of any depth, interpolated between equidistant depths. They are computed on demand.
///
/// As a function of depth, a transfer function has no frequency above (n − √(n² − NA²))/λ. Sampled a few times per
/// period, polynomial interpolation has an error below 0.001. Far from the focal plane objects are few, and their
/// transfer functions are computed without interpolation.
#[derive(Debug)]
pub(crate) struct TransferCache {
    microscope: Microscope,
    step_um: f64,
    /// Transfer functions by stage position and depth index.
    cached: Mutex<BTreeMap<(u64, i64), Arc<Transfer>>>,
}

/// Approximate samples per period.
const SAMPLES_PER_PERIOD: f64 = 4.6;

/// Interpolation nodes on each side of a depth.
const SIDE: i64 = 5;

/// Largest number of cached table entries.
const MOST_ENTRIES: usize = 1 << 20;

impl TransferCache {
    pub(crate) fn new(microscope: &Microscope) -> Self {
        let params = microscope.params();
        let n = params.mount_index;
        let fastest = (n - (n * n - params.na * params.na).sqrt()) / (params.wavelength_um - 0.5 * params.bandwidth_um);
        Self { microscope: microscope.clone(), step_um: 1.0 / (SAMPLES_PER_PERIOD * fastest), cached: Mutex::default() }
    }

    pub(crate) fn microscope(&self) -> &Microscope {
        &self.microscope
    }

    /// Returns the transfer function at a depth and stage position. The result does not depend on earlier calls.
    pub(crate) fn transfer(&self, depth_um: f64, stage_um: f64) -> Transfer {
        if self.microscope.defocus_um(depth_um, stage_um).abs() > FAR_UM {
            return Transfer::new(&self.microscope, depth_um, stage_um);
        }
        // Indices count away from the objective.
        let position = -depth_um / self.step_um;
        let below = position.floor();
        let t = position - below;
        #[expect(clippy::cast_possible_truncation, reason = "depths are at most 1000 µm")]
        let below = below as i64;
        if t == 0.0 {
            return Transfer::mixed(&self.samples(below..=below, stage_um, |_| 1.0));
        }
        // Lagrange polynomials.
        let weight = |number: i64| {
            let k = number - below;
            let others = (1 - SIDE..=SIDE).filter(|&j| j != k);
            others.map(|j| (t - j as f64) / (k - j) as f64).product::<f64>()
        };
        Transfer::mixed(&self.samples(below + 1 - SIDE..=below + SIDE, stage_um, weight))
    }

    /// Returns transfer functions by depth index, with their weights for [`Transfer::mixed`].
    fn samples(
        &self,
        numbers: RangeInclusive<i64>,
        stage_um: f64,
        weight: impl Fn(i64) -> f64,
    ) -> Vec<(Arc<Transfer>, [f32; 2])> {
        // The map stays valid if a thread panics.
        let lock = || self.cached.lock().unwrap_or_else(PoisonError::into_inner);
        // Without aberrations, the wavefront changes its sign with depth and stage position, and the effect of phase
        // delay with it.
        let is_mirrored = |number: i64| {
            let is_below = stage_um < 0.0 || (stage_um == 0.0 && number < 0);
            is_below && self.microscope.is_mirrored()
        };
        let key = |number: i64| {
            let (stage_um, number) = if is_mirrored(number) { (0.0 - stage_um, -number) } else { (stage_um, number) };
            (stage_um.to_bits(), number)
        };
        let cached: Vec<Option<Arc<Transfer>>> = {
            let cached = lock();
            numbers.clone().map(|number| cached.get(&key(number)).cloned()).collect()
        };
        let make = |(number, cached): (i64, Option<Arc<Transfer>>)| {
            let transfer = cached.unwrap_or_else(|| {
                let (depth_um, stage_um) = (-(key(number).1 as f64) * self.step_um, f64::from_bits(key(number).0));
                let transfer = Arc::new(Transfer::new(&self.microscope, depth_um, stage_um));
                let mut cached = lock();
                if cached.len() * transfer.table.len() >= MOST_ENTRIES {
                    cached.clear();
                }
                Arc::clone(cached.entry(key(number)).or_insert(transfer))
            });
            #[expect(clippy::cast_possible_truncation, reason = "tables use single precision")]
            let weight = weight(number) as f32;
            (transfer, [weight, if is_mirrored(number) { -weight } else { weight }])
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
            let depths: &[f64] = if params.zernike == coma { &[0.3] } else { &[0.0, 0.3, -1.1, 2.6, 5.2, -9.3, 30.0] };
            for &depth in depths {
                for stage in [0.0, 2.0, -2.0] {
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

    #[test]
    fn transfer_functions_of_far_objects_are_exact() {
        let transfers = TransferCache::new(&Microscope::new(&MicroscopeParams::default()).unwrap());
        for (depth, stage) in [(FAR_UM + 5.0, 0.0), (-31.7, 0.5)] {
            assert_eq!(transfers.transfer(depth, stage), Transfer::new(&transfers.microscope, depth, stage));
        }
        assert!(transfers.cached.lock().unwrap().is_empty());
    }
}

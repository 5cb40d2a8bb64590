use core::ops::RangeInclusive;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::{Microscope, Transfer};

/// Transfer functions of any depth, between those of a ladder of depths, which are computed when first asked for.
///
/// As a function of depth, a transfer function has no frequency above (n − √(n² − NA²))/λ: between rungs that are
/// close to that, a polynomial errs by less than 0.001.
#[derive(Debug)]
pub(crate) struct Ladder {
    pub(crate) microscope: Microscope,
    step_um: f64,
    /// By travel of the stage and rung.
    made: Mutex<BTreeMap<(u64, i64), Arc<Transfer>>>,
}

/// Rungs for each of those periods, about.
const RUNGS: f64 = 6.7;

/// Rungs on each side of a depth.
const SIDE: i64 = 3;

/// How many numbers are kept.
const MOST_NUMBERS: usize = 1 << 22;

impl Ladder {
    pub(crate) fn new(microscope: &Microscope) -> Self {
        let params = microscope.params();
        let n = params.mount_index;
        let fastest = (n - (n * n - params.na * params.na).sqrt()) / (params.wavelength_um - 0.5 * params.bandwidth_um);
        Self { microscope: microscope.clone(), step_um: 1.0 / (RUNGS * fastest), made: Mutex::default() }
    }

    /// The transfer function at a depth and travel of the stage, of whatever was asked for before.
    pub(crate) fn transfer(&self, depth_um: f64, stage_um: f64) -> Transfer {
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
                if made.len() * transfer.shape.numbers().len() >= MOST_NUMBERS {
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

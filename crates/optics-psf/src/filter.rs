use core::f64::consts::TAU;

use rustfft::num_complex::Complex32;

use crate::Microscope;
use crate::real_plane::Support;
use crate::transfer::{Shape, Transfer};

/// Up to this distance from focus, and from that one on, µm of mountant: the correction of the
/// in-focus form is whole, and gone. It gains little at 1 µm and nothing from 2 µm on.
const CORRECTED_UM: [f64; 2] = [1.0, 2.0];

/// What one slab's spectra are multiplied with for one plane.
#[derive(Debug, Clone)]
pub(crate) struct Filter {
    /// Where the slab's factor of the light is computed.
    pub(crate) grid: Grid,
    /// Whether the correction of the in-focus form takes part.
    pub(crate) is_corrected: bool,
    response: Response,
}

/// Which lattice a slab's factor of the light is sampled on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Grid {
    /// That of the object.
    Object,
    /// That of the camera, each value the mean over its pixel.
    Camera,
}

#[derive(Debug, Clone)]
enum Response {
    /// (H_A, H_P, G) at multiples of a step, and two entries of zeros.
    Round(Vec<[f32; 3]>),
    /// The same for each place of the support.
    Sided(Vec<[Complex32; 3]>),
}

impl Filter {
    /// `frequencies` in cycles/µm, in the order of their places; `is_smooth` says whether the
    /// transfer function allows the camera's lattice.
    pub(crate) fn new(
        microscope: &Microscope,
        depth_um: f64,
        stage_um: f64,
        frequencies: &[[f64; 2]],
        is_smooth: impl FnOnce(&Transfer, f64) -> bool,
    ) -> Self {
        let transfer = Transfer::new(microscope, depth_um, stage_um);
        let params = microscope.params();
        let defocus = (depth_um + stage_um * params.mount_index / params.immersion_index).abs();
        let share = fade(defocus);
        let radius = microscope.cone_radius_um(depth_um, stage_um);
        let grid = if is_smooth(&transfer, defocus) { Grid::Camera } else { Grid::Object };
        let response = Response::new(&transfer, |f| share * pillbox(TAU * f * radius), frequencies);
        Self { grid, is_corrected: share > 0.0, response }
    }

    /// The in-focus transfer function alone.
    pub(crate) fn in_focus(microscope: &Microscope, frequencies: &[[f64; 2]]) -> Self {
        let response = Response::new(&Transfer::new(microscope, 0.0, 0.0), |_| 0.0, frequencies);
        Self { grid: Grid::Object, is_corrected: false, response }
    }

    /// Adds `spectrum` times one of the three responses to `sum`, at the places of `support`,
    /// which is part of `whole`, those of the spectrum. `positions` are those in the table.
    pub(crate) fn add(
        &self,
        part: Part,
        spectrum: &[Complex32],
        (support, whole): (&Support, &Support),
        positions: &[Position],
        sum: &mut [Complex32],
    ) {
        for (to, from) in support.runs(whole) {
            let sum = &mut sum[to];
            let values = &spectrum[from.clone()];
            let sign = part.sign();
            match &self.response {
                Response::Round(table) => {
                    for ((sum, &value), &position) in sum.iter_mut().zip(values).zip(&positions[from]) {
                        *sum += value * (sign * position.of(table, part as usize));
                    }
                }
                Response::Sided(table) => {
                    for ((sum, &value), response) in sum.iter_mut().zip(values).zip(&table[from]) {
                        *sum += value * (response[part as usize] * sign);
                    }
                }
            }
        }
    }
}

/// The three responses of a filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// H_A, of the absorbed light.
    Absorption,
    /// H_P, of the phase.
    Phase,
    /// G, of the correction of the in-focus form, which is light and not its lack.
    Correction,
}

impl Part {
    fn sign(self) -> f32 {
        if self == Self::Correction { -1.0 } else { 1.0 }
    }
}

impl Response {
    #[expect(clippy::cast_possible_truncation, reason = "f32 beside f32 spectra")]
    fn new(transfer: &Transfer, cone: impl Fn(f64) -> f64, frequencies: &[[f64; 2]]) -> Self {
        match transfer.shape() {
            Shape::Round(table) => {
                let entry = |(i, pair): (usize, &[f64; 2])| {
                    [pair[0] as f32, pair[1] as f32, cone(transfer.step() * i as f64) as f32]
                };
                let rows = table.iter().enumerate().map(entry).chain([[0.0; 3]; 2]);
                Self::Round(rows.collect())
            }
            Shape::Sided(_) => {
                let complex = |[re, im]: [f64; 2]| Complex32::new(re as f32, im as f32);
                let at = |&f: &[f64; 2]| {
                    let [absorption, phase] = transfer.at(f).map(complex);
                    let cone = cone((f[0] * f[0] + f[1] * f[1]).sqrt());
                    [absorption, phase, Complex32::new(cone as f32, 0.0)]
                };
                Self::Sided(frequencies.iter().map(at).collect())
            }
        }
    }
}

/// Where a frequency lies in a table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Position {
    entry: u32,
    /// The way from that entry to the next, 0 to 1.
    rest: f32,
}

impl Position {
    /// `steps` is the frequency in steps of the table.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positions lie in the table")]
    pub(crate) fn new(steps: f64) -> Self {
        let entry = steps as u32;
        Self { entry, rest: (steps - f64::from(entry)) as f32 }
    }

    #[inline(always)]
    fn of(self, table: &[[f32; 3]], part: usize) -> f32 {
        let (a, b) = (table[self.entry as usize][part], table[self.entry as usize + 1][part]);
        a + self.rest * (b - a)
    }
}

/// 1 near focus and 0 far from it.
fn fade(defocus_um: f64) -> f64 {
    let [whole, gone] = CORRECTED_UM;
    let t = ((defocus_um - whole) / (gone - whole)).clamp(0.0, 1.0);
    1.0 - t * t * (3.0 - 2.0 * t)
}

/// The spectrum of a disc, 2 J₁(q)/q.
pub(crate) fn pillbox(q: f64) -> f64 {
    if q < 1e-6 { 1.0 } else { 2.0 * libm::j1(q) / q }
}

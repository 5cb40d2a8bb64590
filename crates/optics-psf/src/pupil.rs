use core::f64::consts::TAU;

use crate::params::{MicroscopeParams, Zernike};

/// Refractive index of cover glasses at the sodium line. ISO 8255 specifies 1.5255 ± 0.0015; the difference to 1.515
/// changes the effect by less than 1 %.
const COVER_INDEX: f64 = 1.515;

/// Tolerance in cycles/µm: frequencies on the rim count as inside.
pub(crate) const RIM: f64 = 1e-9;

/// The objective's pupil for one wavelength, depth and stage position. Frequencies are in cycles/µm, phases in waves.
#[derive(Debug, Clone)]
pub(crate) struct Pupil {
    /// NA/λ of the objective, and of the condenser, limited to the objective's.
    pub(crate) objective: f64,
    pub(crate) condenser: f64,
    /// Optical paths: W = Σ t·γ.
    media: [OpticalPath; 4],
    has_stage: bool,
    has_cover: bool,
    zernike: Zernike,
    has_zernike: bool,
}

impl Pupil {
    /// Creates a pupil. `depth_um` is the depth of the object in the mountant relative to the focal plane, positive
    /// towards the objective. `stage_um` is the distance by which the stage was lowered.
    pub(crate) fn new(params: &MicroscopeParams, wavelength_um: f64, depth_um: f64, stage_um: f64) -> Self {
        let path = |length, index| OpticalPath::new(length, index, wavelength_um);
        // Gibson and Lanni, DOI 10.1364/JOSAA.8.001601: δ (γ_g − (n_i/n_g) γ_i), the excess glass and the immersion
        // layer it displaces after paraxial refocusing.
        let cover = params.cover_error_um;
        let media = [
            // The only change of sign: the path through the mountant is longer from below the focal plane.
            path(-depth_um, params.mount_index),
            path(stage_um, params.immersion_index),
            path(cover, COVER_INDEX),
            path(-cover * params.immersion_index / COVER_INDEX, params.immersion_index),
        ];
        let objective = params.na / wavelength_um;
        Self {
            objective,
            condenser: (params.condenser_na / wavelength_um).min(objective),
            media,
            has_stage: stage_um != 0.0,
            has_cover: cover != 0.0,
            zernike: params.zernike,
            has_zernike: params.zernike != Zernike::default(),
        }
    }

    pub(crate) fn cutoff(&self) -> f64 {
        self.objective + self.condenser
    }

    pub(crate) fn is_round(&self) -> bool {
        self.zernike.is_round()
    }

    /// Returns whether a squared frequency passes the pupil.
    pub(crate) fn passes(&self, f2: f64) -> bool {
        let rim = self.objective + RIM;
        f2 <= rim * rim
    }

    /// Returns depth·γ_n, the path through the mountant.
    #[inline]
    pub(crate) fn medium_waves(&self, f2: f64) -> f64 {
        self.media[0].waves(f2)
    }

    /// Returns W of the rotationally symmetric terms.
    #[inline(always)]
    pub(crate) fn round_waves(&self, f2: f64) -> f64 {
        let mut waves = self.media[0].waves(f2);
        // Square roots take most of the time of a transfer function.
        if self.has_stage {
            waves += self.media[1].waves(f2);
        }
        if self.has_cover {
            waves += self.media[2].waves(f2) + self.media[3].waves(f2);
        }
        if self.has_zernike {
            waves += self.zernike.round_waves(f2 / (self.objective * self.objective));
        }
        waves
    }

    /// Returns W of the rotationally symmetric terms in single precision.
    #[expect(clippy::cast_possible_truncation, reason = "single precision")]
    pub(crate) fn single_precision(&self) -> RoundWaves {
        let paths = self.media.map(|path| [path.length, path.k, path.k2].map(|value| value as f32));
        let count = if self.has_cover { paths.len() } else { 1 + usize::from(self.has_stage) };
        let rim2 = self.objective * self.objective;
        let zernike = [0.0, 1.0, 4.0].map(|r2| if self.has_zernike { self.zernike.round_waves(r2) } else { 0.0 });
        // The parabola a r² + b r⁴ through the values at 0, 1 and 4.
        let [one, four] = [zernike[1] - zernike[0], zernike[2] - zernike[0]];
        let b = (four - 4.0 * one) / 12.0;
        let powers = [(one - b) / rim2, b / (rim2 * rim2)].map(|value| value as f32);
        RoundWaves { paths, count, powers }
    }

    /// Returns the complete W at a frequency.
    #[inline]
    pub(crate) fn waves(&self, [x, y]: [f64; 2]) -> f64 {
        let round = self.round_waves(x * x + y * y);
        if self.is_round() {
            round
        } else {
            round + self.zernike.asymmetric_waves([x / self.objective, y / self.objective])
        }
    }

    /// Returns the approximate largest slope |dW/df| up to a frequency, in µm.
    pub(crate) fn steepest(&self, radius: f64) -> f64 {
        /// Samples along a radius.
        const POINTS: usize = 33;
        let step = radius / (POINTS - 1) as f64;
        let directions = if self.is_round() { &DIRECTIONS[..1] } else { &DIRECTIONS[..] };
        let slope = |[c, s]: [f64; 2], i: usize| {
            let at = |i: usize| self.waves([c * step * i as f64, s * step * i as f64]);
            (at(i + 1) - at(i)).abs() / step
        };
        let slopes = directions.iter().flat_map(|&direction| (0..POINTS - 1).map(move |i| slope(direction, i)));
        slopes.fold(0.0, f64::max)
    }

    /// Returns the slope |dW/df| of the media at the condenser's rim: the lateral displacement of its rays, in µm.
    pub(crate) fn cone_radius(&self) -> f64 {
        (self.media[0].slope(self.condenser) + self.media[1].slope(self.condenser)).abs()
    }
}

/// W of the rotationally symmetric terms, except a constant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RoundWaves {
    /// Length, k and k² of each path.
    paths: [[f32; 3]; 4],
    /// Number of paths that are used.
    count: usize,
    /// Factors of f² and f⁴.
    powers: [f32; 2],
}

impl RoundWaves {
    /// Returns W at squared frequencies.
    #[inline(always)]
    pub(crate) fn at<const N: usize>(&self, f2: &[f32; N]) -> [f32; N] {
        let mut waves = [0.0; N];
        for (wave, f2) in waves.iter_mut().zip(f2) {
            *wave = *f2 * (self.powers[0] + self.powers[1] * *f2);
        }
        for &[length, k, k2] in &self.paths[..self.count] {
            for (wave, f2) in waves.iter_mut().zip(f2) {
                *wave += length * ((k2 - *f2).max(0.0).sqrt() - k);
            }
        }
        waves
    }
}

/// Directions in which an aberration may be steepest.
const DIRECTIONS: [[f64; 2]; 8] = {
    const D: f64 = core::f64::consts::FRAC_1_SQRT_2;
    [[1.0, 0.0], [D, D], [0.0, 1.0], [-D, D], [-1.0, 0.0], [-D, -D], [0.0, -1.0], [D, -D]]
};

/// A path through a medium: its length in µm, n/λ and its square.
#[derive(Debug, Clone, Copy)]
struct OpticalPath {
    length: f64,
    k: f64,
    k2: f64,
}

impl OpticalPath {
    fn new(length: f64, index: f64, wavelength_um: f64) -> Self {
        let k = index / wavelength_um;
        Self { length, k, k2: k * k }
    }

    /// Returns t (γ(f) − γ(0)) with γ(f) = √(k² − f²).
    #[inline(always)]
    fn waves(self, f2: f64) -> f64 {
        self.length * ((self.k2 - f2).max(0.0).sqrt() - self.k)
    }

    /// Returns the slope along f.
    fn slope(self, f: f64) -> f64 {
        -self.length * f / (self.k2 - f * f).max(f64::MIN_POSITIVE).sqrt()
    }
}

/// Returns cos 2πx and sin 2πx.
///
/// Polynomials on an eighth of a turn, without branches, so that loops vectorise. The error is below 1e-14.
#[inline(always)]
pub(crate) fn turn(x: f64) -> (f64, f64) {
    /// Adding it rounds a double to an integer.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let x = x - ((x + WHOLE) - WHOLE);
    // x = quarter/4 + rest, |rest| <= 1/8.
    let quarter = (4.0 * x + WHOLE) - WHOLE;
    let t = TAU * (x - 0.25 * quarter);
    let t2 = t * t;
    let sin = t
        * (1.0
            + t2 * (-1.0 / 6.0
                + t2 * (1.0 / 120.0
                    + t2 * (-1.0 / 5040.0
                        + t2 * (1.0 / 362_880.0 + t2 * (-1.0 / 39_916_800.0 + t2 / 6_227_020_800.0))))));
    let cos = 1.0
        + t2 * (-0.5
            + t2 * (1.0 / 24.0
                + t2 * (-1.0 / 720.0
                    + t2 * (1.0 / 40_320.0
                        + t2 * (-1.0 / 3_628_800.0 + t2 * (1.0 / 479_001_600.0 - t2 / 87_178_291_200.0))))));
    // Quarters −2 … 2: cosines of whole quarter turns are 1 − q² on −1 … 1, and −1 at ±2.
    let half = quarter.abs() > 1.5;
    let c = if half { -1.0 } else { 1.0 - quarter * quarter };
    let s = if half { 0.0 } else { quarter };
    (cos * c - sin * s, sin * c + cos * s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turn_matches_cosine_and_sine() {
        for i in -40_000..40_000 {
            let x = f64::from(i) * 1.23e-3;
            let (c, s) = turn(x);
            // The library call rounds 2πx.
            assert!((c - libm::cos(TAU * x)).abs() < 3e-14 + 2e-16 * x.abs() * TAU, "{x}");
            assert!((s - libm::sin(TAU * x)).abs() < 3e-14 + 2e-16 * x.abs() * TAU, "{x}");
        }
    }
}

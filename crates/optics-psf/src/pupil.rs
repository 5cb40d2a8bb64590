use core::f64::consts::TAU;

use crate::params::{MicroscopeParams, Zernike};

/// Refractive index of cover glasses at the sodium line (ISO 8255 asks for 1.5255 ± 0.0015; that
/// and the mountant's 1.515 are the same to within 1 % of the effect).
const COVER_INDEX: f64 = 1.515;

/// Rounding at the rim: a frequency on it counts as inside, cycles/µm.
pub(crate) const RIM: f64 = 1e-9;

/// The objective's pupil for one wavelength, depth and travel of the stage; frequencies in
/// cycles/µm, phases in waves.
#[derive(Debug, Clone)]
pub(crate) struct Pupil {
    /// NA/λ, and the condenser's, at most the same.
    pub(crate) objective: f64,
    pub(crate) condenser: f64,
    /// The ways of the light: W = Σ t·γ.
    media: [Way; 4],
    has_cover: bool,
    zernike: Zernike,
    has_zernike: bool,
}

impl Pupil {
    /// `depth_um`: depth of the object about the focal plane, in the mountant, positive towards the objective; `stage_um`:
    /// how far the stage was lowered from the lens.
    pub(crate) fn new(params: &MicroscopeParams, wavelength_um: f64, depth_um: f64, stage_um: f64) -> Self {
        let way = |length, index| Way::new(length, index, wavelength_um);
        // Gibson and Lanni, DOI 10.1364/JOSAA.8.001601: δ (γ_g − (n_i/n_g) γ_i), the glass and the
        // immersion it displaces when paraxial rays are focused again.
        let cover = params.cover_error_um;
        let media = [
            // The only place where the sign turns: light's way through the mountant is longer from below the focal plane.
            way(-depth_um, params.mount_index),
            way(stage_um, params.immersion_index),
            way(cover, COVER_INDEX),
            way(-cover * params.immersion_index / COVER_INDEX, params.immersion_index),
        ];
        let objective = params.na / wavelength_um;
        Self {
            objective,
            condenser: (params.condenser_na / wavelength_um).min(objective),
            media,
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

    /// Whether light of this square of the frequency passes.
    pub(crate) fn passes(&self, f2: f64) -> bool {
        let rim = self.objective + RIM;
        f2 <= rim * rim
    }

    /// depth·γ_n alone: the way through the mountant.
    #[inline]
    pub(crate) fn medium_waves(&self, f2: f64) -> f64 {
        self.media[0].waves(f2)
    }

    /// W of the terms without direction.
    #[inline(always)]
    pub(crate) fn round_waves(&self, f2: f64) -> f64 {
        let mut waves = self.media[0].waves(f2) + self.media[1].waves(f2);
        if self.has_cover {
            waves += self.media[2].waves(f2) + self.media[3].waves(f2);
        }
        if self.has_zernike {
            waves += self.zernike.round_waves(f2 / (self.objective * self.objective));
        }
        waves
    }

    /// W, all of it, at a frequency.
    #[inline]
    pub(crate) fn waves(&self, [x, y]: [f64; 2]) -> f64 {
        let round = self.round_waves(x * x + y * y);
        if self.is_round() { round } else { round + self.zernike.sided_waves([x / self.objective, y / self.objective]) }
    }

    /// About the steepest slope |dW/df| up to a frequency, in µm.
    pub(crate) fn steepest(&self, radius: f64) -> f64 {
        /// Points along a radius.
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

    /// The slope |dW/df| of the media at the rim of the condenser: how far in µm its rays miss.
    pub(crate) fn cone_radius(&self) -> f64 {
        (self.media[0].slope(self.condenser) + self.media[1].slope(self.condenser)).abs()
    }
}

/// Directions in which an aberration may be steepest.
const DIRECTIONS: [[f64; 2]; 8] = {
    const D: f64 = core::f64::consts::FRAC_1_SQRT_2;
    [[1.0, 0.0], [D, D], [0.0, 1.0], [-D, D], [-1.0, 0.0], [-D, -D], [0.0, -1.0], [D, -D]]
};

/// A way through a medium: its length in µm and n/λ, with its square.
#[derive(Debug, Clone, Copy)]
struct Way {
    length: f64,
    k: f64,
    k2: f64,
}

impl Way {
    fn new(length: f64, index: f64, wavelength_um: f64) -> Self {
        let k = index / wavelength_um;
        Self { length, k, k2: k * k }
    }

    /// t (γ(f) − γ(0)) with γ(f) = √(k² − f²).
    #[inline(always)]
    fn waves(self, f2: f64) -> f64 {
        self.length * ((self.k2 - f2).max(0.0).sqrt() - self.k)
    }

    /// Its slope along f.
    fn slope(self, f: f64) -> f64 {
        -self.length * f / (self.k2 - f * f).max(f64::MIN_POSITIVE).sqrt()
    }
}

/// cos 2πx and sin 2πx.
///
/// Polynomials on an eighth of a turn, without branches so that loops over it become vector code;
/// the error is below 1e-14.
#[inline(always)]
pub(crate) fn turn(x: f64) -> (f64, f64) {
    /// Adding it leaves a double no digits after the point.
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
    fn turn_is_cosine_and_sine() {
        for i in -40_000..40_000 {
            let x = f64::from(i) * 1.23e-3;
            let (c, s) = turn(x);
            // 2πx of the library call is rounded.
            assert!((c - libm::cos(TAU * x)).abs() < 3e-14 + 2e-16 * x.abs() * TAU, "{x}");
            assert!((s - libm::sin(TAU * x)).abs() < 3e-14 + 2e-16 * x.abs() * TAU, "{x}");
        }
    }
}

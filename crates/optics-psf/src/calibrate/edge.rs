use core::f64::consts::PI;

use super::Window;
use crate::Error;

/// Steps of the Gauss–Newton method; it converges in five or six.
const ROUNDS: usize = 40;

/// Limits of the fitted σ, in pixels.
const NARROWEST_PX: f64 = 0.05;
const WIDEST_PX: f64 = 64.0;

/// Largest rotation of the edge in one step, in radians.
const MOST_TURN: f64 = 0.1;

/// Levenberg's damping. It limits the first steps and hardly slows the last.
const DAMPING: f64 = 1e-3;

/// A fitted straight edge: dark + (light − dark)·Φ((d − d₀)/σ) along its normal.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeFit {
    /// Total σ in pixels, including the blur of the pixel.
    pub sigma_px: f64,
    /// Intensity of the dark side.
    pub dark: f64,
    /// Intensity of the light side.
    pub light: f64,
    /// Unit vector from the dark to the light side, x to the right and y down.
    pub normal: [f64; 2],
    /// Root mean square of the residuals, in units of the image.
    pub rms_residual: f64,
}

/// Fits σ_xy of the image plane to a straight edge in a window ("Impulse response", Eq. 13; the paper fits by eye).
///
/// # Errors
///
/// If the window is not inside the image, or contains no edge.
///
/// # Panics
///
/// If the length of the image is not a multiple of `width`.
pub fn edge(image: &[f32], width: usize, window: Window) -> Result<EdgeFit, Error> {
    assert!(width > 0 && image.len().is_multiple_of(width), "the image length must be a multiple of the width");
    window.check(width, image.len() / width)?;
    let pixels: Vec<f32> = window.crop(image, width).collect();
    let nothing = Error::NothingToMeasure { what: "edge" };
    let angle = gradient_angle(&pixels, window.width).ok_or_else(|| nothing.clone())?;
    let [cx, cy] = [window.width, window.height].map(|side| (side as f64 - 1.0) / 2.0);
    let sample =
        |(i, &v): (usize, &f32)| [(i % window.width) as f64 - cx, (i / window.width) as f64 - cy, f64::from(v)];
    let samples: Vec<[f64; 3]> = pixels.iter().enumerate().map(sample).collect();
    let lowest = samples.iter().map(|s| s[2]).fold(f64::INFINITY, f64::min);
    let highest = samples.iter().map(|s| s[2]).fold(f64::NEG_INFINITY, f64::max);
    // Initial position of the edge, from the mean intensity.
    let mean = samples.iter().map(|s| s[2]).sum::<f64>() / samples.len() as f64;
    let reach = (cx * cx + cy * cy).sqrt();
    let shift = reach * (1.0 - 2.0 * (mean - lowest) / (highest - lowest));
    let mut fit = Model { dark: lowest, rise: highest - lowest, shift, sigma: 1.0, angle };
    for _ in 0..ROUNDS {
        let step = fit.step(&samples).ok_or_else(|| nothing.clone())?;
        fit.dark += step[0];
        fit.rise += step[1];
        fit.shift = (fit.shift + step[2]).clamp(-reach, reach);
        fit.sigma = (fit.sigma + step[3]).clamp(NARROWEST_PX, WIDEST_PX);
        fit.angle += step[4].clamp(-MOST_TURN, MOST_TURN);
    }
    let square: f64 = samples.iter().map(|s| fit.residual(s) * fit.residual(s)).sum();
    let rms_residual = (square / samples.len() as f64).sqrt();
    if fit.rise.is_nan() || fit.rise <= 2.0 * rms_residual || fit.sigma >= WIDEST_PX {
        return Err(nothing);
    }
    let normal = [libm::cos(fit.angle), libm::sin(fit.angle)];
    Ok(EdgeFit { sigma_px: fit.sigma, dark: fit.dark, light: fit.dark + fit.rise, normal, rms_residual })
}

/// dark + rise · Φ((d − shift)/σ), d along the direction `angle`.
struct Model {
    dark: f64,
    rise: f64,
    shift: f64,
    sigma: f64,
    angle: f64,
}

impl Model {
    /// Returns the distance from the edge in units of σ, and the position along the edge in pixels.
    fn edge_coordinates(&self, [x, y, _]: &[f64; 3]) -> [f64; 2] {
        let (c, s) = (libm::cos(self.angle), libm::sin(self.angle));
        [(c * x + s * y - self.shift) / self.sigma, c * y - s * x]
    }

    /// Returns the residual of a sample.
    fn residual(&self, sample: &[f64; 3]) -> f64 {
        sample[2] - self.dark - self.rise * normal_cdf(self.edge_coordinates(sample)[0])
    }

    /// Returns the Gauss–Newton step of the five parameters, or `None` if the system is singular.
    fn step(&self, samples: &[[f64; 3]]) -> Option<[f64; 5]> {
        let mut system = [[0.0; 6]; 5];
        for sample in samples {
            let [t, along] = self.edge_coordinates(sample);
            let slope = self.rise * libm::exp(-0.5 * t * t) / (2.0 * PI).sqrt() / self.sigma;
            let slopes = [1.0, normal_cdf(t), -slope, -slope * t, slope * along];
            let residual = self.residual(sample);
            for (row, a) in system.iter_mut().zip(slopes) {
                for (cell, b) in row.iter_mut().zip(slopes.into_iter().chain([residual])) {
                    *cell += a * b;
                }
            }
        }
        for (i, row) in system.iter_mut().enumerate() {
            row[i] *= 1.0 + DAMPING;
        }
        solve(system)
    }
}

/// Returns Φ(t), the standard normal distribution function.
fn normal_cdf(t: f64) -> f64 {
    0.5 * libm::erfc(-t / core::f64::consts::SQRT_2)
}

/// Returns the angle of the strongest intensity change, from the structure tensor, towards the light side, or `None`
/// for a uniform image.
fn gradient_angle(pixels: &[f32], width: usize) -> Option<f64> {
    let (mut xx, mut xy, mut yy, mut mean) = (0.0, 0.0, 0.0, [0.0; 2]);
    let height = pixels.len() / width;
    for i in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| y * width + x)) {
        let at = |i: usize| f64::from(pixels[i]);
        let (gx, gy) = (at(i + 1) - at(i - 1), at(i + width) - at(i - width));
        xx += gx * gx;
        xy += gx * gy;
        yy += gy * gy;
        mean = [mean[0] + gx, mean[1] + gy];
    }
    let angle = 0.5 * libm::atan2(2.0 * xy, xx - yy);
    let toward = libm::cos(angle) * mean[0] + libm::sin(angle) * mean[1];
    (xx + yy > 0.0 && (xx + yy).is_finite()).then_some(if toward < 0.0 { angle + PI } else { angle })
}

/// Solves a linear system by Gaussian elimination with partial pivoting.
fn solve(mut m: [[f64; 6]; 5]) -> Option<[f64; 5]> {
    for k in 0..5 {
        let pivot = (k..5).max_by(|&a, &b| m[a][k].abs().total_cmp(&m[b][k].abs()))?;
        m.swap(k, pivot);
        if m[k][k] == 0.0 || !m[k][k].is_finite() {
            return None;
        }
        let row = m[k];
        for below in &mut m[k + 1..] {
            let factor = below[k] / row[k];
            for (cell, value) in below.iter_mut().zip(row) {
                *cell -= factor * value;
            }
        }
    }
    let mut x = [0.0; 5];
    for k in (0..5).rev() {
        let known: f64 = (k + 1..5).map(|j| m[k][j] * x[j]).sum();
        x[k] = (m[k][5] - known) / m[k][k];
    }
    Some(x)
}

//! The spectrum of chromatin: a Matérn covariance in the object plane, fitted through the microscope.

use spectral_field::Spectrum;

use super::nucleus::Measured;

/// Lags at which the autocorrelation is compared, px.
pub(super) const LAGS: usize = 6;

/// Spread of the microscope that the material was imaged with, in µm: the paper's 0.9 px of 0.25 µm.
const SIGMA_UM: f64 = 0.225;

/// Smoothnesses that are tried.
const NUS: [f64; 3] = [0.5, 1.0, 1.5];

/// Mean autocorrelation at lags 1 to 6 px of textures from which a plane was subtracted.
pub(super) fn mean_autocorrelation(measured: &[Measured]) -> [f64; LAGS] {
    let mut sums = [0.0; LAGS];
    for nucleus in measured {
        let rest = detrended(nucleus);
        let variance = correlation(&rest, nucleus.width, 0);
        for (lag, sum) in sums.iter_mut().enumerate() {
            *sum += if variance > 0.0 { correlation(&rest, nucleus.width, lag + 1) / variance } else { 0.0 };
        }
    }
    sums.map(|sum| sum / measured.len().max(1) as f64)
}

/// Mean product of pixels that lie `lag` apart along rows or columns, both inside.
fn correlation(values: &[f64], width: usize, lag: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u32);
    for i in 0..values.len() {
        let right = (i % width + lag < width).then(|| values[i + lag]);
        let below = values.get(i + lag * width).copied();
        for other in [right, below].into_iter().flatten() {
            let product = values[i] * other;
            if !product.is_nan() {
                sum += product;
                count += 1;
            }
        }
    }
    if count == 0 { 0.0 } else { sum / f64::from(count) }
}

/// A texture without its mean and its slope: NaN outside the nucleus.
fn detrended(nucleus: &Measured) -> Vec<f64> {
    let width = nucleus.width;
    let inside: Vec<usize> = (0..nucleus.absorbance.len()).filter(|&i| !nucleus.absorbance[i].is_nan()).collect();
    let count = inside.len() as f64;
    let mean = |value: &dyn Fn(usize) -> f64| inside.iter().map(|&i| value(i)).sum::<f64>() / count;
    let (mx, my) = (mean(&|i| (i % width) as f64), mean(&|i| (i / width) as f64));
    let ma = mean(&|i| nucleus.absorbance[i]);
    let about = |i: usize| [(i % width) as f64 - mx, (i / width) as f64 - my, nucleus.absorbance[i] - ma];
    let [xx, xy, yy, xa, ya] = inside
        .iter()
        .map(|&i| about(i))
        .fold([0.0; 5], |s, [x, y, a]| [s[0] + x * x, s[1] + x * y, s[2] + y * y, s[3] + x * a, s[4] + y * a]);
    let determinant = xx * yy - xy * xy;
    let (bx, by) = if determinant.abs() > 1e-9 {
        ((xa * yy - ya * xy) / determinant, (ya * xx - xa * xy) / determinant)
    } else {
        (0.0, 0.0)
    };
    (0..nucleus.absorbance.len())
        .map(|i| {
            let [x, y, a] = about(i);
            a - bx * x - by * y
        })
        .collect()
}

/// The Matérn covariance whose image through the microscope comes nearest to an autocorrelation: (ν, length in µm).
///
/// Subtracting mean and slope takes the three slowest modes out of a nucleus of `area_um2`. Modes of a window of area a
/// lie 1/a apart in the frequency plane, so those three fill a disc of radius √(3/(π a)): the spectrum counts from there.
pub(super) fn fit_matern(measured: &[f64; LAGS], pixel_um: f64, area_um2: f64) -> (f64, f64) {
    let lowest = (3.0 / (core::f64::consts::PI * area_um2)).sqrt();
    let mut best = (f64::INFINITY, NUS[0], 0.5);
    for nu in NUS {
        // Lengths from 0.1 to 2.5 µm in steps of three per cent.
        let mut length = 0.1;
        while length < 2.5 {
            let model = imaged_autocorrelation(nu, length, pixel_um, lowest);
            let error: f64 = model.iter().zip(measured).map(|(rho, m)| (rho - m) * (rho - m)).sum();
            if error < best.0 {
                best = (error, nu, length);
            }
            length *= 1.03;
        }
    }
    (best.1, best.2)
}

/// Autocorrelation at lags 1 to 6 px of what is left of a Matérn field above a frequency (cycles per µm) after the
/// microscope's Gaussian.
fn imaged_autocorrelation(nu: f64, length_um: f64, pixel_um: f64, lowest: f64) -> [f64; LAGS] {
    const HIGHEST: f64 = 4.0;
    const STEPS: usize = 400;
    let spectrum = Spectrum::Matern { nu, length_px: length_um };
    let mut sums = [0.0; LAGS + 1];
    for step in 0..STEPS {
        let f = lowest + (HIGHEST - lowest) * (step as f64 + 0.5) / STEPS as f64;
        let spread = 2.0 * core::f64::consts::PI * SIGMA_UM * f;
        let power = spectrum.density(f) * f * libm::exp(-spread * spread);
        for (lag, sum) in sums.iter_mut().enumerate() {
            *sum += power * libm::j0(core::f64::consts::TAU * f * lag as f64 * pixel_um);
        }
    }
    core::array::from_fn(|lag| sums[lag + 1] / sums[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fit_finds_the_field_it_was_made_from() {
        for (nu, length) in [(0.5, 0.7), (1.0, 0.5)] {
            let lowest = (3.0 / (core::f64::consts::PI * 50.0)).sqrt();
            let (found_nu, found) = fit_matern(&imaged_autocorrelation(nu, length, 0.25, lowest), 0.25, 50.0);
            assert_eq!(found_nu, nu);
            assert!((found / length - 1.0).abs() < 0.05, "{found} for {length}");
        }
    }
}

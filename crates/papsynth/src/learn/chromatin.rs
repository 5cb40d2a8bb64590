//! The spectrum of chromatin: a Matérn covariance in the object plane, fitted to microscope images.

use spectral_field::Spectrum;

use super::nucleus::NucleusMeasurement;

/// Lags at which the autocorrelation is compared, px.
pub(super) const LAGS: usize = 6;

/// Blur of the microscope of the material, standard deviation in µm: the paper's 0.9 px of 0.25 µm.
const SIGMA_UM: f64 = 0.225;

/// Candidate values of the smoothness ν.
const NUS: [f64; 3] = [0.5, 1.0, 1.5];

/// Returns the mean autocorrelation at lags 1 to 6 px of textures after subtraction of a fitted plane.
pub(super) fn mean_autocorrelation(nuclei: &[NucleusMeasurement]) -> [f64; LAGS] {
    let mut sums = [0.0; LAGS];
    for nucleus in nuclei {
        let residual = detrended(nucleus);
        let variance = correlation(&residual, nucleus.width, 0);
        for (lag, sum) in sums.iter_mut().enumerate() {
            *sum += if variance > 0.0 { correlation(&residual, nucleus.width, lag + 1) / variance } else { 0.0 };
        }
    }
    sums.map(|sum| sum / nuclei.len().max(1) as f64)
}

/// Returns the mean product of pixels `lag` apart along rows or columns, both inside the nucleus.
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

/// Returns a texture minus a fitted plane; NaN outside the nucleus.
fn detrended(nucleus: &NucleusMeasurement) -> Vec<f64> {
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

/// Returns (ν, length in µm) of the Matérn covariance whose blurred autocorrelation is nearest to a measured one.
///
/// Subtracting mean and slope removes the three lowest modes of a nucleus of `area_um2`. A window of area a has one
/// mode per 1/a in the frequency plane, so these three fill a disc of radius √(3/(π a)), which is excluded from the
/// spectrum.
pub(super) fn fit_matern(measured: &[f64; LAGS], pixel_um: f64, area_um2: f64) -> (f64, f64) {
    let lowest = (3.0 / (core::f64::consts::PI * area_um2)).sqrt();
    let mut best = (f64::INFINITY, NUS[0], 0.5);
    for nu in NUS {
        // Lengths from 0.1 to 2.5 µm in steps of 3 %.
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

/// Returns the autocorrelation at lags 1 to 6 px of a Matérn field above a frequency (cycles per µm), blurred by the
/// microscope's Gaussian.
fn imaged_autocorrelation(nu: f64, length_um: f64, pixel_um: f64, lowest: f64) -> [f64; LAGS] {
    const HIGHEST: f64 = 4.0;
    const STEPS: usize = 400;
    let spectrum = Spectrum::Matern { nu, length_px: length_um };
    let mut sums = [0.0; LAGS + 1];
    for step in 0..STEPS {
        let f = lowest + (HIGHEST - lowest) * (step as f64 + 0.5) / STEPS as f64;
        let exponent = 2.0 * core::f64::consts::PI * SIGMA_UM * f;
        let power = spectrum.density(f) * f * libm::exp(-exponent * exponent);
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
    fn fit_recovers_the_parameters_of_a_field() {
        for (nu, length) in [(0.5, 0.7), (1.0, 0.5)] {
            let lowest = (3.0 / (core::f64::consts::PI * 50.0)).sqrt();
            let (found_nu, found) = fit_matern(&imaged_autocorrelation(nu, length, 0.25, lowest), 0.25, 50.0);
            assert_eq!(found_nu, nu);
            assert!((found / length - 1.0).abs() < 0.05, "{found} for {length}");
        }
    }
}

//! Workloads for complete images: blur, noise, background. Also the point spread function of Gibson and Lanni.

use std::hint::black_box;

use ccd_noise::{Camera, CameraParams, ReadNoise};
use optics_psf::{Border, Gaussian, GibsonLanni, GibsonLanniParams, Scratch};
use perlin_bg::{Perlin, PerlinParams, Window};

use crate::{Size, Workload, noise};

/// Blurs an image with a Gaussian.
#[must_use]
pub fn blur([width, height]: Size, sigma_px: f64) -> Workload {
    let gaussian = Gaussian::new(sigma_px).expect("the width is finite");
    let image = noise(width * height, 1);
    let (mut blurred, mut scratch) = (image.clone(), Scratch::new());
    Box::new(move || {
        gaussian.blur_into(&image, width, Border::Reflect, &mut blurred, &mut scratch);
        black_box(&blurred);
    })
}

/// Adds exact Poisson noise of 17 850 electrons per pixel and read noise, and converts to grey levels.
#[must_use]
pub fn exposure([width, height]: Size) -> Workload {
    // Headroom above the mean, so that no pixel saturates.
    let params = CameraParams {
        full_well_e: 20_000.0,
        gain_dn_per_e: 255.0 / 20_000.0,
        read_noise: ReadNoise::Same { e: 70.0 },
        ..CameraParams::default()
    };
    let camera = Camera::new(&params).expect("the parameters are valid");
    let electrons = vec![17_850.0; width * height];
    let mut grey = vec![0; width * height];
    let mut key = 0;
    Box::new(move || {
        key += 1;
        camera.expose_window(&electrons, width, [0, 0], key, &mut grey);
        black_box(&grey);
    })
}

/// Adds an octave of Perlin noise with cells of 64 pixels.
#[must_use]
pub fn perlin([width, height]: Size) -> Workload {
    let perlin = Perlin::new(&PerlinParams::default(), 7).expect("the defaults are valid");
    let window = Window::with_cell_px(64.0);
    let mut image = vec![0.0; width * height];
    Box::new(move || {
        perlin.add_into(&mut image, width, &window, 1e-3);
        black_box(&image);
    })
}

/// Point spread function: pixels on each side of the centre, number of planes, pixel size, distance of planes.
const HALF: usize = 63;
const PLANES: u32 = 21;
const PIXEL_UM: f64 = 0.05;
const STEP_UM: f64 = 0.2;

/// Samples per pixel side, for the mean over a pixel and for the radial profile, as in psfmodels.
const FINE: usize = 3;

/// Computes a point spread function of 127 x 127 x 21 pixels, each the mean of 3 x 3 samples.
#[must_use]
pub fn gibson_lanni() -> Workload {
    // The defaults of psfmodels.
    let params = GibsonLanniParams {
        na: 1.4,
        wavelength_um: 0.6,
        mount_index: 1.47,
        immersion_index: [1.515; 2],
        ..GibsonLanniParams::default()
    };
    let middle = f64::from(PLANES - 1) / 2.0;
    let z_um: Vec<f64> = (0..PLANES).map(|k| STEP_UM * (f64::from(k) - middle)).collect();
    Box::new(move || {
        let psf = GibsonLanni::new(&params).expect("the parameters are valid");
        black_box(volume(&psf, &z_um));
    })
}

/// The point spread function is rotationally symmetric: an eighth of a plane is computed, the rest mirrored.
fn volume(psf: &GibsonLanni, z_um: &[f64]) -> Vec<f32> {
    let side = 2 * HALF + 1;
    // Reaches the corner of the plane, plus one sample for interpolation.
    let radii = (HALF + 1) * FINE * 3 / 2 + 2;
    let r_um: Vec<f64> = (0..radii).map(|k| k as f64 * PIXEL_UM / FINE as f64).collect();
    let profile = psf.profile(&r_um, z_um).expect("the distances are small");
    let places = places();
    let mut volume = vec![0.0; side * side * z_um.len()];
    let mut eighth = vec![0.0; (HALF + 1) * (HALF + 1)];
    for (plane, row) in volume.chunks_exact_mut(side * side).zip(profile.chunks_exact(radii)) {
        for (i, points) in places.chunks_exact(FINE * FINE).enumerate() {
            let sum: f64 = points.iter().map(|&(k, part)| row[k] + part * (row[k + 1] - row[k])).sum();
            #[expect(clippy::cast_possible_truncation, reason = "intensities use single precision, as in psfmodels")]
            let sum = sum as f32;
            eighth[i] = sum / (FINE * FINE) as f32;
        }
        for (y, line) in plane.chunks_exact_mut(side).enumerate() {
            let y = y.abs_diff(HALF);
            for (x, value) in line.iter_mut().enumerate() {
                let x = x.abs_diff(HALF);
                let (far, near) = (x.max(y), x.min(y));
                *value = eighth[far * (far + 1) / 2 + near];
            }
        }
    }
    volume
}

/// Returns the profile index below each sample of an eighth of a plane, and the fraction above it.
fn places() -> Vec<(usize, f64)> {
    let mut places = Vec::new();
    let fine = |pixel: usize, k: usize| (pixel * FINE + k) as f64 - (FINE / 2) as f64;
    for far in 0..=HALF {
        for near in 0..=far {
            for k in 0..FINE * FINE {
                let (x, y) = (fine(far, k % FINE), fine(near, k / FINE));
                let r = (x * x + y * y).sqrt();
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small radius")]
                places.push((r as usize, r - r.floor()));
            }
        }
    }
    places
}

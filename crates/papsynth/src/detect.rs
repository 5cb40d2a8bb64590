//! Signal detection: from light to grey levels (Eq. 13), and how detectable an object is in them.

use ccd_noise::{Camera, CameraParams};
use multiversion::multiversion;

use crate::recipe::PhotonNoise;
use crate::scene::{Scene, SceneCamera};
use crate::truth::Run;

/// Electrons above which [`PhotonNoise::Normal`] draws one normal deviate: the skewness 1/√µ is below 0.05.
const NORMAL_ABOVE_E: f64 = 400.0;

/// How much more than the largest grey level stands for a pixel holds: the converter clips first, as in real cameras.
const WELL_MARGIN: f64 = 1.02;

/// The camera of a scene.
pub(crate) struct Detector {
    pub(crate) camera: Camera,
    scene: SceneCamera,
    gain: f64,
}

impl Detector {
    pub(crate) fn new(scene: &Scene) -> Result<Self, String> {
        let camera = scene.camera;
        let largest = libm::exp2(f64::from(camera.bits)) - 1.0;
        let gain = (largest - camera.offset_dn) / camera.full_well_e;
        let params = CameraParams {
            full_well_e: camera.full_well_e * WELL_MARGIN,
            gain_dn_per_e: gain,
            offset_dn: camera.offset_dn,
            read_noise_e: camera.read_noise_e,
            bit_depth: camera.bits,
            photon_noise: match camera.photon_noise {
                PhotonNoise::Exact => ccd_noise::PhotonNoise::Exact,
                PhotonNoise::Normal => ccd_noise::PhotonNoise::NormalAbove { mean_e: NORMAL_ABOVE_E },
                PhotonNoise::Off => ccd_noise::PhotonNoise::Off,
            },
        };
        Ok(Self { camera: Camera::new(&params).map_err(|e| format!("camera: {e}"))?, scene: camera, gain })
    }

    /// Light as a fraction of full scale becomes mean electrons.
    pub(crate) fn electrons(&self, light: &mut [f32]) {
        let scale = self.scene.full_well_e as f32;
        light.iter_mut().for_each(|v| *v *= scale);
    }

    /// The grey level expected from a number of electrons.
    pub(crate) fn expected_dn(&self, electrons: f64) -> f64 {
        self.scene.offset_dn + self.gain * electrons
    }

    /// Standard deviation of the grey level of a pixel that expects this many electrons.
    pub(crate) fn noise_dn(&self, electrons: f64) -> f64 {
        /// Variance of rounding to whole grey levels.
        const ROUNDING: f64 = 1.0 / 12.0;
        let shot = match self.scene.photon_noise {
            PhotonNoise::Off => 0.0,
            PhotonNoise::Exact | PhotonNoise::Normal => electrons,
        };
        let read = self.scene.read_noise_e * self.scene.read_noise_e;
        (self.gain * self.gain * (shot + read) + ROUNDING).sqrt()
    }
}

/// Sum of the pixels of these runs, as far as they lie in a tile of rows of `width` whose upper left pixel is pixel
/// `origin` of the image. The order of the additions is fixed.
#[multiversion(targets = "simd")]
pub(crate) fn sum_over(runs: &[Run], tile: &[f32], width: usize, origin: [i64; 2]) -> f64 {
    /// Sums that grow side by side.
    const LANES: usize = 16;
    let mut sums = [0.0_f64; LANES];
    let height = tile.len() / width;
    for run in runs {
        let Ok(y) = usize::try_from(i64::from(run.y) - origin[1]) else { continue };
        if y >= height {
            continue;
        }
        let clip = |x: u32| usize::try_from(i64::from(x) - origin[0]).unwrap_or(0).min(width);
        let mut blocks = tile[y * width + clip(run.x0)..y * width + clip(run.x1)].chunks_exact(LANES);
        for block in &mut blocks {
            for (sum, value) in sums.iter_mut().zip(block) {
                *sum += f64::from(*value);
            }
        }
        for (sum, value) in sums.iter_mut().zip(blocks.remainder()) {
            *sum += f64::from(*value);
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_is_that_of_the_pixels_in_the_tile() {
        let tile: Vec<f32> = (0..40 * 5).map(|i| i as f32 * 0.37).collect();
        let run = |y, x0, x1| Run { y, x0, x1 };
        let runs = [run(2, 0, 90), run(9, 0, 90), run(10, 25, 30), run(12, 3, 47), run(14, 59, 70), run(15, 20, 60)];
        let slow: f64 = runs
            .iter()
            .flat_map(|r| (r.x0..r.x1).map(|x| (x, r.y)))
            .filter(|(x, y)| (20..60).contains(x) && (10..15).contains(y))
            .map(|(x, y)| f64::from(tile[((y - 10) * 40 + x - 20) as usize]))
            .sum();
        let fast = sum_over(&runs, &tile, 40, [20, 10]);
        assert!((fast - slow).abs() < 1e-9 * slow, "{fast} {slow}");
        assert_eq!(sum_over(&[], &tile, 40, [20, 10]), 0.0);
    }
}

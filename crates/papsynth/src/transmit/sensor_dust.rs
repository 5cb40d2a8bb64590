//! Dust on the sensor: specks at the same pixels of every image of a camera.

use portable_numerics::rounding::round_to_count;

use crate::key::Key;
use crate::random;
use crate::scene::SceneCamera;

/// Fraction of the specks that are rings: those in front of the sensor, whose shadow is diffracted.
const RINGS: f64 = 0.4;
/// Radius of a ring, px: minimum, maximum.
const RADIUS_PX: [f64; 2] = [1.5, 2.8];
/// Standard deviation of the profile of a speck or of the line of a ring, px: minimum, maximum.
const WIDTH_PX: [f64; 2] = [0.5, 0.9];
/// Loss of light at the darkest place: median, standard deviation of the logarithm, maximum. By eye, from means over
/// twenty fields of two scanners.
const LOSS: [f64; 3] = [0.035, 0.6, 0.3];
/// Gain of light in the centre of a ring, relative to the loss on its line, and its standard deviation, px.
const CENTRE: [f64; 2] = [0.8, 0.7];
/// Distance beyond which a speck has no effect, px.
const REACH_PX: f64 = 7.0;

/// Adds the specks to the logarithm of the light of an image whose rows have `width` pixels.
pub(super) fn add(light_log10: &mut [f32], width: usize, camera: &SceneCamera) {
    let height = light_log10.len() / width.max(1);
    let count = round_to_count(camera.sensor_dust * light_log10.len() as f64 * 1e-6);
    let key = Key { seed: camera.serial, index: 0 };
    for number in 0..count as u64 {
        let rng = &mut key.stream("camera", number, "dust");
        let centre = [width, height].map(|size| random::between(0.0, size as f64, rng));
        let radius = if random::chance(RINGS, rng) { random::between(RADIUS_PX[0], RADIUS_PX[1], rng) } else { 0.0 };
        let line = random::between(WIDTH_PX[0], WIDTH_PX[1], rng);
        let loss = (LOSS[0] * libm::exp(LOSS[1] * random::normal(rng))).min(LOSS[2]);
        let gauss = |distance: f64, sd: f64| libm::exp(-0.5 * (distance / sd) * (distance / sd));
        let [columns, rows] = [(centre[0], width), (centre[1], height)].map(|(at, size)| {
            round_to_count((at - REACH_PX).max(0.0))..round_to_count((at + REACH_PX).min(size as f64))
        });
        for y in rows {
            for x in columns.clone() {
                let [dx, dy] = [x as f64 + 0.5 - centre[0], y as f64 + 0.5 - centre[1]];
                let distance = (dx * dx + dy * dy).sqrt();
                let gain = if radius > 0.0 { CENTRE[0] * gauss(distance, CENTRE[1]) } else { 0.0 };
                let light = 1.0 - loss * (gauss(distance - radius, line) - gain);
                light_log10[y * width + x] += libm::log10(light) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::model::Model;
    use crate::recipe::Preset;
    use crate::{Engine, Inputs};

    #[test]
    fn specks_are_at_the_same_pixels_of_each_image_and_belong_to_the_camera() {
        let specks = |index: u64, serial: u64, per_mpx: f64| {
            let mut recipe = Preset::ExtendedFocus.recipe();
            (recipe.camera.sensor_dust, recipe.camera.serial) = (per_mpx.into(), serial);
            let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap();
            let mut light = vec![0.0; 400 * 300];
            add(&mut light, 400, &engine.scene(Key { seed: 1, index }).unwrap().camera);
            light
        };
        let first = specks(0, 1, 500.0);
        assert_eq!(first, specks(3, 1, 500.0));
        assert_ne!(first, specks(0, 2, 500.0));
        assert!(specks(0, 1, 0.0).iter().all(|v| *v == 0.0));
        // 60 specks of about ten pixels each; the darkest lose several per cent of the light.
        let dark = first.iter().filter(|v| **v < -0.004).count();
        assert!((150..3000).contains(&dark), "{dark}");
        let darkest = first.iter().fold(0.0_f32, |least, v| least.min(*v));
        assert!((-0.4..-0.02).contains(&darkest), "{darkest}");
    }
}

//! Camera noise, saturation and compression in images of the engine.

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{
    Binning, Border, CameraPreset, Colour, Debris, FocusOutput, Illumination, LightSection, Mixing, PhotonNoise,
    Preset, Recipe, Rendition,
};
use papsynth::{Engine, Frame, Inputs};

/// Returns a recipe for an empty field with uniform illumination.
fn empty() -> Recipe {
    let mut recipe = Preset::Lbc.recipe();
    recipe.field.width_px = 160.0.into();
    recipe.field.height_px = 128.0.into();
    recipe.cells.clear();
    recipe.debris = Debris::none();
    recipe.background.illumination = Illumination::Border(Border { exponent: 0.0.into() });
    recipe.background.texture = 0.0.into();
    recipe.background.level = 0.8.into();
    recipe
}

fn frame(recipe: &Recipe, index: u64) -> Frame {
    Engine::new(recipe, &Model::builtin(), &Inputs::default()).unwrap().frame(Key { seed: 4, index }).unwrap()
}

/// Returns grey levels minus expected grey levels.
fn noise(frame: &Frame) -> Vec<f64> {
    let plane = &frame.planes[0];
    plane.grey.iter().zip(&plane.noise_free).map(|(grey, mean)| f64::from(*grey) - f64::from(*mean)).collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let sum = |f: &dyn Fn(usize) -> f64| (0..a.len()).map(f).sum::<f64>();
    let n = a.len() as f64;
    let (mean_a, mean_b) = (sum(&|i| a[i]) / n, sum(&|i| b[i]) / n);
    let both = sum(&|i| (a[i] - mean_a) * (b[i] - mean_b));
    both / (sum(&|i| (a[i] - mean_a) * (a[i] - mean_a)) * sum(&|i| (b[i] - mean_b) * (b[i] - mean_b))).sqrt()
}

#[test]
fn every_preset_has_the_noise_predicted_by_emva_1288() {
    for preset in CameraPreset::ALL {
        let mut recipe = empty();
        recipe.camera = preset.camera();
        let noise = noise(&frame(&recipe, 0));
        let n = noise.len() as f64;
        let mean = noise.iter().sum::<f64>() / n;
        let variance = noise.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n;
        let params = match preset {
            CameraPreset::Paper => ccd_noise::CameraParams::paper(),
            CameraPreset::Orca05g => ccd_noise::CameraParams::orca_05g(),
            CameraPreset::Scmos => ccd_noise::CameraParams::scmos(),
        };
        let camera = ccd_noise::Camera::new(&params).unwrap();
        let light = (f64::from(camera.max_dn()) * 0.8 - params.offset_dn * 0.8) * camera.electrons_per_dn();
        let [temporal, pattern] = [camera.temporal_noise_dn(light), camera.nonuniformity_dn(light)];
        let expected = temporal * temporal + pattern * pattern;
        // Four standard errors of the variance of n pixels.
        assert!((variance / expected - 1.0).abs() < 4.0 * (2.0 / n).sqrt(), "{}: {variance} {expected}", preset.name());
    }
}

#[test]
fn the_fixed_pattern_depends_on_the_camera_and_temporal_noise_on_the_image() {
    let mut recipe = empty();
    recipe.camera = CameraPreset::Orca05g.camera();
    recipe.camera.prnu = 0.03.into();
    let (a, b) = (noise(&frame(&recipe, 0)), noise(&frame(&recipe, 1)));
    assert!(correlation(&a, &b) > 0.8, "{}", correlation(&a, &b));
    recipe.camera.serial = 2;
    let other = noise(&frame(&recipe, 1));
    assert!(correlation(&a, &other).abs() < 0.05);
    recipe.camera.prnu = 0.0.into();
    recipe.camera.dsnu_e = 0.0.into();
    let (a, b) = (noise(&frame(&recipe, 0)), noise(&frame(&recipe, 1)));
    assert!(correlation(&a, &b).abs() < 4.0 / (a.len() as f64).sqrt());
}

#[test]
fn saturated_pixels_are_reported_with_and_without_blooming() {
    let mut recipe = empty();
    recipe.background.level = 1.0.into();
    for blooming in [0.0, 1.0] {
        recipe.camera.blooming = blooming.into();
        let frame = frame(&recipe, 0);
        let plane = &frame.planes[0];
        let top = plane.grey.iter().filter(|grey| **grey == 255).count() as u64;
        assert!(plane.saturated.area() >= top && top > 1000, "{top} {}", plane.saturated.area());
        let runs = plane.saturated.runs();
        assert!(runs.windows(2).all(|w| (w[0].y, w[0].x1) < (w[1].y, w[1].x0)), "runs are sorted and disjoint");
    }
    recipe.background.level = 0.5.into();
    assert!(frame(&recipe, 0).planes[0].saturated.is_empty());
}

#[test]
fn planes_for_fusion_have_the_levels_and_noise_of_the_camera() {
    for (bits, offset) in [(8.0, 0.0), (8.0, 20.0), (12.0, 100.0), (16.0, 0.0)] {
        let mut recipe = empty();
        recipe.background.level = 0.5.into();
        (recipe.camera.bits, recipe.camera.offset_dn) = (bits.into(), offset.into());
        let single = frame(&recipe, 0);
        (recipe.focus.output, recipe.focus.planes) = (FocusOutput::Edf, 3.0.into());
        let fused = frame(&recipe, 0);
        let mean = |frame: &Frame| {
            let levels = &frame.planes[0].noise_free;
            levels.iter().map(|v| f64::from(*v)).sum::<f64>() / levels.len() as f64
        };
        // The offset of planes is that of the image times 2⁸ instead of 65 535/255.
        assert!(
            (mean(&fused) / mean(&single) - 1.0).abs() < 1e-3,
            "{bits} {offset}: {} {}",
            mean(&fused),
            mean(&single)
        );
        let variance = |frame: &Frame| noise(frame).iter().map(|v| v * v).sum::<f64>() / noise(frame).len() as f64;
        let ratio = variance(&fused) / variance(&single);
        assert!((ratio - 1.0).abs() < 0.05, "{bits} {offset}: {ratio}");
    }
}

#[test]
fn saturated_pixels_of_edf_images_have_the_highest_level() {
    let mut recipe = empty();
    (recipe.focus.output, recipe.focus.planes) = (FocusOutput::Edf, 3.0.into());
    for level in [0.5, 1.0] {
        recipe.background.level = level.into();
        let frame = frame(&recipe, 0);
        let plane = &frame.planes[0];
        let top = plane.grey.iter().filter(|grey| **grey == 255).count() as u64;
        assert_eq!(plane.saturated.area(), top);
        assert_eq!(top > 0, level == 1.0);
        assert!(plane.noise_free.iter().all(|mean| *mean <= 255.0));
    }
}

#[test]
fn jpeg_is_the_last_step() {
    for colour in [false, true] {
        let mut recipe = empty();
        if colour {
            let (mixing, rendition) = (Mixing::Spectral, Rendition::Display);
            recipe.light =
                LightSection::Colour(Colour { lamp_k: 3200.0.into(), mixing, chromatic_um: 0.0.into(), rendition });
        }
        let plain = frame(&recipe, 0);
        recipe.camera.jpeg_quality = 60.0.into();
        let lossy = frame(&recipe, 0);
        assert_eq!(plain.planes[0].noise_free, lossy.planes[0].noise_free);
        let sum_of_squares = |frame: &Frame| noise(frame).iter().map(|v| v * v).sum::<f64>();
        assert!(sum_of_squares(&lossy) < 0.9 * sum_of_squares(&plain), "compression removes fine noise");
    }
}

#[test]
fn binning_reduces_noise() {
    let mut recipe = empty();
    recipe.camera = CameraPreset::Orca05g.camera();
    let variance = |recipe: &Recipe| {
        let noise = noise(&frame(recipe, 0));
        noise.iter().map(|v| v * v).sum::<f64>() / noise.len() as f64
    };
    let single = variance(&recipe);
    recipe.camera.binning_px = 2.0.into();
    for binning in [Binning::Charge, Binning::Digital] {
        recipe.camera.binning = binning;
        let four = variance(&recipe);
        // Shot noise and pattern dominate: a quarter of the variance.
        assert!((four / single - 0.25).abs() < 0.05, "{binning:?}: {single} {four}");
    }
}

#[test]
fn dark_current_raises_dark_levels_and_doubles_with_temperature() {
    let mut recipe = empty();
    recipe.camera = CameraPreset::Orca05g.camera();
    recipe.camera.photon_noise = PhotonNoise::Off;
    recipe.background.level = 0.01.into();
    let mut at = |temperature: f64, exposure: f64| {
        recipe.camera.dark_current_e_per_s = 100.0.into();
        recipe.camera.temperature_c = temperature.into();
        recipe.camera.exposure_s = exposure.into();
        f64::from(frame(&recipe, 0).planes[0].noise_free[0])
    };
    let [none, once, warm] = [at(25.0, 0.0), at(25.0, 1.0), at(33.0, 1.0)];
    assert!(once > none && ((warm - none) / (once - none) - 2.0).abs() < 1e-3, "{none} {once} {warm}");
}

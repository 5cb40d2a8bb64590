//! Matches of small fields.

use std::sync::atomic::{AtomicBool, Ordering};

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Colour, LightSection, Preset, Recipe};
use papsynth::{Engine, Inputs};
use papsynth_judge::{Control, Detail, FieldImage, NucleiAnnotation, NucleiFrom, Progress};
use papsynth_match::{
    Error, Fit, Level, Match, MatchParams, Origin, Parameter, ParameterFit, PixelSize, Sampler, Setting, recipe,
};

/// Coarse pixels: many cells in a small image, with empty slide.
const PIXEL_UM: f64 = 0.5;
const FIELD: [usize; 2] = [280, 210];

fn engine(recipe: &Recipe) -> Result<Engine, papsynth::Error> {
    Engine::new(recipe, &Model::builtin(), &Inputs::default())
}

fn setting(size_px: [usize; 2]) -> Setting {
    setting_of(Preset::Lbc.recipe().fused(), size_px)
}

fn setting_of(base: Recipe, size_px: [usize; 2]) -> Setting {
    Setting { base, size_px, pixel_um: PIXEL_UM, bits: 8, extended: true, seek_pixel: false }
}

/// Simulates fields of a recipe that differs from the preset, by `apart` in the logarithm of the number of cells
/// between fields.
fn fields(count: u64, from: NucleiFrom, apart: f64) -> Vec<FieldImage> {
    fields_of(&setting(FIELD), count, from, apart)
}

fn fields_of(setting: &Setting, count: u64, from: NucleiFrom, apart: f64) -> Vec<FieldImage> {
    let sampler = Sampler::new(setting.size_px, PIXEL_UM, from, Detail::Statistics).unwrap();
    let field = |index: u64| {
        let off = index as f64 - 0.5 * (count - 1) as f64;
        let engine = engine(&truth(setting, off, apart)).unwrap();
        sampler.simulate(&engine, None, Key { seed: 11, index }, &Control::NONE).unwrap()
    };
    (0..count).map(field).collect()
}

/// Returns the recipe of a field that is `off` from the mean in level and, times `apart`, in the logarithm of the
/// number of cells.
fn truth(setting: &Setting, off: f64, apart: f64) -> Recipe {
    let mut values = setting.base_values();
    for (parameter, value) in [
        (Parameter::Level, 0.8 + 0.01 * off),
        (Parameter::Noise, 3.0),
        (Parameter::NoiseCorrelationY, 0.3),
        (Parameter::Blur, 0.5),
        (Parameter::Cells, 400.0 * libm::exp(apart * off)),
    ] {
        values.set(parameter, value);
    }
    recipe(setting, &values, |_| true)
}

fn small(pixel: PixelSize, rounds: usize) -> Match {
    with(pixel, rounds, 60, 5)
}

fn with(pixel: PixelSize, rounds: usize, simulations: usize, seed: u64) -> Match {
    let params = MatchParams { pixel, simulations, rounds, refine: 0, seed };
    Match::new(&params, &Preset::Lbc.recipe()).unwrap()
}

fn on_threads(threads: usize, fields: &[FieldImage], matching: &Match) -> Fit {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| matching.run(fields, &engine, &Control::NONE)).unwrap()
}

fn of(fit: &Fit, parameter: Parameter) -> &ParameterFit {
    fit.parameters.iter().find(|a| a.parameter == parameter).unwrap()
}

#[test]
fn a_match_finds_the_parameters_and_does_not_depend_on_the_number_of_threads() {
    let fields = fields(4, NucleiFrom::Masks, 0.3);
    // With half as many simulations, the order of the fields depends on the draws.
    let with_seed = |seed: u64| with(PixelSize::Known(PIXEL_UM), 2, 120, seed);
    let matching = with_seed(5);
    let [one, two] = [1, 2].map(|threads| on_threads(threads, &fields, &matching));
    // Compared as text, because NaN differs from itself.
    let text = |fit: &Fit| serde_json::to_string(fit).unwrap();
    assert!(text(&one) == text(&two), "{}\n{}", one.to_toml(), two.to_toml());
    assert_eq!(one.to_toml(), two.to_toml());
    assert!(one.recipe.problems().is_empty(), "{:?}", one.recipe.problems());
    engine(&one.recipe).unwrap();
    assert!(one.extended && one.fields.len() == 4 && one.recipe.conditions.len() == 4);
    for (parameter, truth, origin) in [
        (Parameter::Level, 0.8, Origin::Measured),
        (Parameter::Noise, 3.0, Origin::Measured),
        (Parameter::Blur, 0.5, Origin::Simulated),
        (Parameter::Cells, 400.0, Origin::Simulated),
    ] {
        let answer = of(&one, parameter);
        assert_eq!(answer.origin, origin, "{answer:?}");
        assert!((answer.interval[0]..=answer.interval[1]).contains(&truth), "{answer:?}");
    }
    for answer in &one.parameters {
        let [low, high] = answer.interval;
        // EDF images have one blur.
        let differs = answer.parameter.prior().level == Level::Field && answer.parameter != Parameter::Blur;
        let count = if differs { 4 } else { 0 };
        if answer.origin == Origin::NotVisible {
            assert!(answer.value == answer.before && answer.fields.is_empty(), "{answer:?}");
        } else {
            assert!(low <= answer.value && answer.value <= high && answer.fields.len() == count, "{answer:?}");
        }
    }
    // The light of each field is that of its condition.
    let level = of(&one, Parameter::Level);
    assert!((level.fields[3] - level.fields[0] - 0.03).abs() < 0.015, "{level:?}");
    let cells = of(&one, Parameter::Cells);
    assert!(cells.fields[3] > 1.15 * cells.fields[0] && cells.spread > 0.08, "{cells:?}");
    // Fields of the true recipe are as far from these four as four and sixteen fields are. Both matches together remove
    // at least half of the rest of the distance; each depends on its draws.
    let other = on_threads(2, &fields, &with_seed(6));
    let floors = [5, 6].map(|seed| {
        let params = MatchParams { pixel: PixelSize::Known(PIXEL_UM), simulations: 60, rounds: 0, refine: 0, seed };
        on_threads(2, &fields, &Match::new(&params, &truth(&setting(FIELD), 0.0, 0.0)).unwrap()).distance.before
    });
    let distances = [one.distance, other.distance];
    let excess = |of: &dyn Fn(usize) -> f64| (0..2).map(|i| of(i) - floors[i]).sum::<f64>();
    let [before, after] = [excess(&|i| distances[i].before), excess(&|i| distances[i].after)];
    assert!(before > 0.2 && after < 0.5 * before, "{distances:?} {floors:?}");
    assert!(one.statistics.iter().any(|s| s.name == "log nuclei" && s.real.is_finite()));

    // The page compares the fields with simulated ones.
    let page = matching.compare(&fields, &one, &engine, &Control::NONE).unwrap();
    assert!(page.fields[0].len() == 4 && page.to_html().contains("<h2>Tests</h2>"), "{}", page.to_text());
}

#[test]
fn a_search_against_classifiers_holds_out_half_of_the_fields() {
    let fields = fields(4, NucleiFrom::Masks, 0.0);
    let params = MatchParams { pixel: PixelSize::Known(PIXEL_UM), simulations: 60, rounds: 1, refine: 2, seed: 5 };
    let matching = Match::new(&params, &Preset::Lbc.recipe()).unwrap();
    let found = matching.run(&fields, &engine, &Control::NONE).unwrap().refinement.unwrap();
    assert!(found.rounds == 2 && found.after.used <= found.before.used, "{found:?}");
    assert!(!found.kept || found.after.held_out <= found.before.held_out + 0.02, "{found:?}");
    let few = matching.run(&fields[..3], &engine, &Control::NONE).unwrap_err().to_string();
    assert!(few.starts_with("3 fields for a search against classifiers; expected 4 or more"), "{few}");
}

#[test]
fn the_pixel_size_is_estimated_on_request() {
    let fields = fields(6, NucleiFrom::Masks, 0.0);
    let fit = on_threads(2, &fields, &small(PixelSize::Sought(0.4), 1));
    let has = |parameter: Parameter| fit.parameters.iter().any(|a| a.parameter == parameter);
    assert!(has(Parameter::Pixel) && !has(Parameter::Size));
    let [low, high] = of(&fit, Parameter::Pixel).interval;
    assert!(low <= PIXEL_UM && PIXEL_UM <= high, "{low} to {high}");
}

#[test]
fn invalid_fields_and_parameters_are_errors_and_the_stop_flag_ends_a_match() {
    let flat = |name: &str, width: usize, of: &dyn Fn(usize) -> f32| FieldImage {
        name: name.to_owned(),
        group: String::new(),
        grey: (0..width * 120).map(of).collect(),
        width,
        full_scale: 255.0,
        nuclei: NucleiAnnotation::None,
        ..FieldImage::default()
    };
    let run = |fields: &[FieldImage]| {
        small(PixelSize::Known(PIXEL_UM), 0).run(fields, &engine, &Control::NONE).unwrap_err().to_string()
    };
    let noisy = |i: usize| 200.0 + (i * 7919 % 13) as f32 / 3.0;
    assert_eq!(run(&[]), Error::NoField.to_string());
    for (what, fields) in [
        ("constant", vec![flat("constant", 160, &|_| 180.0); 2]),
        ("tiny", vec![flat("tiny", 1, &noisy); 2]),
        ("NaN", vec![flat("NaN", 160, &|_| f32::NAN); 2]),
        ("black", vec![flat("black", 160, &|_| 0.0); 2]),
    ] {
        let message = run(&fields);
        assert!(message.contains(&format!("`{what}`")), "{what}: {message}");
    }
    let message = run(&[flat("a", 160, &noisy)]);
    assert!(message.starts_with("1 field for a match; expected 2 or more"), "{message}");
    // Noise without objects.
    let message = run(&[flat("a", 160, &noisy), flat("b", 160, &noisy)]);
    assert!(message.contains("nuclei") && message.contains("pixel"), "{message}");

    let base = Preset::Lbc.recipe();
    for params in [
        MatchParams { rounds: 101, ..MatchParams::default() },
        MatchParams { pixel: PixelSize::Known(f64::NAN), ..MatchParams::default() },
        MatchParams { pixel: PixelSize::Sought(0.0), ..MatchParams::default() },
        MatchParams { simulations: 59, ..MatchParams::default() },
    ] {
        assert!(
            matches!(Match::new(&params, &base), Err(Error::Judge(papsynth_judge::Error::Parameter { .. }))),
            "{params:?}"
        );
    }
    let fields = fields(4, NucleiFrom::Search, 0.0);
    let stop = AtomicBool::new(false);
    let after_three = |p: Progress| {
        // The count continues over all phases, so the time left is known from the start.
        assert_eq!(p.total, 2 * 4 + 60 + 2 * 16);
        if p.phase == "simulating fields" && p.done == 8 + 3 {
            stop.store(true, Ordering::Relaxed);
        }
    };
    let control = Control { stop: &stop, report: &after_three };
    assert_eq!(small(PixelSize::Known(PIXEL_UM), 0).run(&fields, &engine, &control), Err(Error::Stopped));
}

#[test]
fn the_stains_of_colour_fields_are_matched() {
    let mut base = Preset::Lbc.recipe();
    base.light = LightSection::Colour(Colour::default());
    // Far from the default, as a few small fields determine the hue of nuclei to about 0.1.
    (base.stain.nucleus.eosin_y, base.stain.cyanophilic.eosin_y) = (1.2, 1.0);
    let images = fields_of(&setting_of(base, [420, 320]), 4, NucleiFrom::Masks, 0.0);
    let fit = on_threads(2, &images, &small(PixelSize::Known(PIXEL_UM), 0));
    assert!(fit.colour && matches!(fit.recipe.light, LightSection::Colour(_)));
    let text = fit.to_toml();
    assert!(text.contains("mean colours of the fields"), "{text}");
    for kind in ["nuclei", "blue-green cytoplasm"] {
        let name = format!("red over green absorbance of {kind}");
        let found = fit.statistics.iter().find(|s| s.name == name).unwrap();
        let [before, after] = [found.before, found.after].map(|value| (value - found.real).abs());
        assert!(after < 0.6 * before, "{name}: {found:?}");
    }
    let mut grey = images;
    grey[2].red_blue = None;
    let fit = on_threads(2, &grey, &small(PixelSize::Known(PIXEL_UM), 0));
    assert!(!fit.colour && matches!(fit.recipe.light, LightSection::Monochrome(_)));
}

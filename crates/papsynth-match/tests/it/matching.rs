//! Matches of small fields.

use std::sync::atomic::{AtomicBool, Ordering};

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe};
use papsynth::{Engine, Inputs};
use papsynth_judge::{Control, FieldImage, NucleiAnnotation, NucleiFrom, Progress};
use papsynth_match::{
    Error, FieldSd, Fit, Match, MatchParams, Origin, PARAMETERS, Parameter, PixelSize, Plan, Regression, Setting,
    Source, Summary, TableParams, Values, WIDEST, WindowSampler, measure, recipe, unseen,
};
use rayon::prelude::*;

/// Coarse pixels: many cells in a small image, with empty slide.
const PIXEL_UM: f64 = 0.5;
const FIELD: [usize; 2] = [280, 210];

fn engine(recipe: &Recipe) -> Result<Engine, papsynth::Error> {
    Engine::new(recipe, &Model::builtin(), &Inputs::default())
}

fn setting(size_px: [usize; 2]) -> Setting {
    Setting {
        base: Preset::Lbc.recipe(),
        size_px,
        pixel_um: PIXEL_UM,
        bits: 8,
        extended: true,
        seek_pixel: false,
        field_sd: FieldSd::default(),
    }
}

/// Simulates fields of a recipe that differs from the preset.
fn fields(count: u64, from: NucleiFrom) -> Vec<FieldImage> {
    let view = WindowSampler::new(FIELD, PIXEL_UM, from).unwrap();
    let setting = setting(FIELD);
    let mut values = setting.base_values();
    for (parameter, value) in [
        (Parameter::Level, 0.8),
        (Parameter::LevelSd, 0.005),
        (Parameter::Noise, 3.0),
        (Parameter::NoiseCorrelationY, 0.3),
        (Parameter::Blur, 0.5),
        (Parameter::Cells, 400.0),
    ] {
        values.set(parameter, value);
    }
    let engine = engine(&recipe(&setting, &values, |_| true)).unwrap();
    (0..count).map(|index| view.simulate_field(&engine, Key { seed: 11, index }).unwrap()).collect()
}

fn small(pixel: PixelSize, rounds: usize) -> Match {
    let params = MatchParams { pixel, simulations: 60, windows: 2, rounds, seed: 5 };
    Match::new(&params, &Preset::Lbc.recipe()).unwrap()
}

fn on_threads(threads: usize, fields: &[FieldImage], matching: &Match) -> Fit {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| matching.run(fields, &engine, &Control::NONE)).unwrap()
}

#[test]
fn a_match_does_not_depend_on_the_number_of_threads() {
    let fields = fields(3, NucleiFrom::Masks);
    let matching = small(PixelSize::Known(PIXEL_UM), 2);
    let [one, two] = [1, 2].map(|threads| on_threads(threads, &fields, &matching));
    // Compared as text, because NaN differs from itself.
    let text = |fit: &Fit| serde_json::to_string(fit).unwrap();
    assert!(text(&one) == text(&two), "{}\n{}", one.to_toml(), two.to_toml());
    assert_eq!(one.to_toml(), two.to_toml());
    assert!(one.recipe.problems().is_empty(), "{:?}", one.recipe.problems());
    engine(&one.recipe).unwrap();
    assert!(one.extended && one.fields == 3 && one.windows == 3 && one.simulated == 30);
    let of = |parameter: Parameter| one.parameters.iter().find(|a| a.parameter == parameter).unwrap();
    for (parameter, truth) in [(Parameter::Level, 0.8), (Parameter::Noise, 3.0)] {
        let answer = of(parameter);
        assert_eq!(answer.origin, Origin::Measured, "{answer:?}");
        assert!((answer.interval[0]..=answer.interval[1]).contains(&truth), "{answer:?}");
    }
    for answer in &one.parameters {
        let [low, high] = answer.interval;
        match answer.origin {
            Origin::NotIdentified => assert_eq!(answer.value, answer.before, "{answer:?}"),
            _ => assert!(answer.width <= WIDEST && low <= answer.value && answer.value <= high, "{answer:?}"),
        }
    }
    let d = one.distance;
    assert!(d.after.is_finite() && d.after <= d.before + 0.1, "{d:?}");
    assert!(one.statistics.iter().any(|s| s.name == "log nuclei" && s.real.is_finite()));
}

#[test]
fn the_pixel_size_is_estimated_on_request() {
    let fields = fields(6, NucleiFrom::Masks);
    let fit = on_threads(2, &fields, &small(PixelSize::Sought(0.4), 0));
    let has = |parameter: Parameter| fit.parameters.iter().any(|a| a.parameter == parameter);
    assert!(has(Parameter::Pixel) && !has(Parameter::Size));
    let [low, high] = fit.parameters.iter().find(|a| a.parameter == Parameter::Pixel).unwrap().interval;
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
    };
    let run = |fields: &[FieldImage]| {
        small(PixelSize::Known(PIXEL_UM), 0).run(fields, &engine, &Control::NONE).unwrap_err().to_string()
    };
    let noisy = |i: usize| 200.0 + (i * 7919 % 13) as f32 / 3.0;
    assert_eq!(run(&[]), Error::NoField.to_string());
    for (what, fields) in [
        ("constant", vec![flat("constant", 160, &|_| 180.0)]),
        ("tiny", vec![flat("tiny", 1, &noisy)]),
        ("NaN", vec![flat("NaN", 160, &|_| f32::NAN)]),
        ("black", vec![flat("black", 160, &|_| 0.0)]),
    ] {
        let message = run(&fields);
        assert!(message.contains(&format!("`{what}`")), "{what}: {message}");
    }
    // Noise without objects.
    let message = run(&[flat("a", 160, &noisy), flat("b", 160, &noisy)]);
    assert!(message.contains("nuclei") && message.contains("pixel"), "{message}");

    let base = Preset::Lbc.recipe();
    for params in [
        MatchParams { rounds: 1001, ..MatchParams::default() },
        MatchParams { pixel: PixelSize::Known(f64::NAN), ..MatchParams::default() },
        MatchParams { pixel: PixelSize::Sought(0.0), ..MatchParams::default() },
        MatchParams { simulations: 59, ..MatchParams::default() },
        MatchParams { windows: 0, ..MatchParams::default() },
    ] {
        assert!(
            matches!(Match::new(&params, &base), Err(Error::Judge(papsynth_judge::Error::Parameter { .. }))),
            "{params:?}"
        );
    }
    let fields = fields(2, NucleiFrom::Search);
    let stop = AtomicBool::new(false);
    let after_three = |p: Progress| {
        if p.phase == "simulating fields" && p.done == 3 {
            assert_eq!(p.total, 60 + 4 * 2);
            stop.store(true, Ordering::Relaxed);
        }
    };
    let control = Control { stop: &stop, report: &after_three };
    assert_eq!(small(PixelSize::Known(PIXEL_UM), 0).run(&fields, &engine, &control), Err(Error::Stopped));
}

/// A small version of `examples/recover.rs`.
#[test]
fn parameters_of_held_out_recipes_are_recovered() {
    const TRIALS: usize = 8;
    const WINDOWS: usize = 2;
    const SEED: u64 = 71;
    let view = WindowSampler::new([256, 192], PIXEL_UM, NucleiFrom::Masks).unwrap();
    let setting = setting(view.simulated_px());
    let mut known = setting.base_values();
    known.set(Parameter::Pattern, 0.01);
    let params = TableParams { recipes: 80, windows: WINDOWS, seed: 3 };
    let plan = Plan::new(&setting, &known, &view, &engine, &params).unwrap();
    let sought = plan.sought().to_vec();
    assert!(sought.iter().all(|p| p.prior().source == Source::Simulated));
    let first = plan.row(0).unwrap();
    let table = plan.simulate(&Control::NONE).unwrap();
    assert!(table.places[0] == first.0 && format!("{:?}", table.statistics[0]) == format!("{:?}", first.1.values));
    let regression = Regression::new(&table.statistics, &table.places);
    let explained = |parameter: Parameter| regression.explained()[sought.iter().position(|p| *p == parameter).unwrap()];
    for parameter in [Parameter::Cells, Parameter::Blur] {
        assert!(explained(parameter) > 0.4, "{parameter:?}: {}", explained(parameter));
    }

    let drawn = unseen(TRIALS, SEED);
    let run = |row: usize, values: &Values| -> Vec<FieldImage> {
        let engine = engine(&recipe(&setting, values, |_| true)).unwrap();
        let key = |k: usize| Key { seed: SEED, index: (row * WINDOWS + k) as u64 };
        (0..WINDOWS).map(|k| view.simulate_field(&engine, key(k)).unwrap()).collect()
    };
    // Number of pairs and of covered pairs: simulated, measured.
    let counts: Vec<[[usize; 2]; 2]> = (0..TRIALS)
        .into_par_iter()
        .map(|row| {
            let mut values = known.clone();
            sought.iter().for_each(|p| values.set(*p, p.prior().value(drawn[row][p.index()])));
            let cut: Vec<FieldImage> = run(row, &values).iter().flat_map(|f| view.windows(f)).collect();
            let summary = Summary::of(&cut, &view).unwrap();
            assert_eq!(summary.names, table.names);
            let estimates = regression.estimate(&summary.values);
            let inside =
                |(p, e): (&Parameter, &papsynth_match::Estimate)| (e.low..=e.high).contains(&drawn[row][p.index()]);
            let of_table = sought.iter().zip(&estimates).filter(|pair| inside(*pair)).count();
            let lit = measure(&run(row, &Values::at(&drawn[row])), PIXEL_UM).unwrap();
            let holds = |(p, e): &&(Parameter, papsynth_match::Estimate)| {
                (e.low..=e.high).contains(&p.prior().value(drawn[row][p.index()]))
            };
            let of_light = lit.estimates.iter().filter(holds).count();
            [[sought.len(), of_table], [lit.estimates.len(), of_light]]
        })
        .collect();
    let part = |which: usize| {
        let sum = |k: usize| counts.iter().map(|c| c[which][k]).sum::<usize>() as f64;
        (sum(0), sum(1) / sum(0))
    };
    // 95 % minus three standard errors. The parameters of a trial are correlated, so a third of the pairs count.
    for which in [0, 1] {
        let (pairs, held) = part(which);
        assert!(held > 0.95 - 3.0 * (0.95 * 0.05 / (pairs / 3.0)).sqrt(), "{which}: {held} of {pairs}");
    }
    assert!(PARAMETERS.len() > sought.len());
}

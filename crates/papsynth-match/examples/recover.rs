//! Recovers the parameters of recipes it has not seen, and counts how often the stated intervals hold them.
//!
//! `cargo run --release -p papsynth-match --example recover -- [RECIPES] [TRIALS] [WINDOWS] [FOLDER]`
//!
//! The table of simulated recipes is shared by all trials: they are of one size, one preset and fused alike. What was
//! simulated is kept in FOLDER and used again.

#![expect(clippy::print_stdout, reason = "it is a program")]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::Preset;
use papsynth::{Engine, Inputs};
use papsynth_judge::{NucleiFrom, Picture};
use papsynth_match::{
    Estimate, PARAMETERS, Parameter, Regression, Setting, Source, Spreads, Step, Summary, Table, TableParams, Values, View, measure,
    recipe, unseen,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

const PIXEL_UM: f64 = 0.33;

/// What was seen of an unseen recipe.
#[derive(Serialize, Deserialize)]
struct Trial {
    places: Vec<f64>,
    statistics: Vec<Option<f64>>,
    measured: Vec<(Parameter, Estimate)>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let argument = |i: usize, default: &str| std::env::args().nth(i).unwrap_or_else(|| default.to_owned());
    let (recipes, trials, windows): (usize, usize, usize) = (argument(1, "300").parse()?, argument(2, "40").parse()?, argument(3, "8").parse()?);
    let folder = PathBuf::from(argument(4, "target/recover"));
    std::fs::create_dir_all(&folder)?;

    let view = View::new([640, 480], PIXEL_UM, NucleiFrom::Search)?;
    let setting = Setting {
        base: Preset::Lbc.recipe(),
        size_px: view.simulated_px(),
        pixel_um: PIXEL_UM,
        bits: 8,
        extended: true,
        seek_pixel: false,
        spreads: Spreads::default(),
    };
    let sought: Vec<Parameter> = PARAMETERS.into_iter().filter(|p| setting.seeks(*p)).collect();
    let model = Model::builtin();
    let make = |recipe: &papsynth::recipe::Recipe| Engine::new(recipe, &model, &Inputs::default());

    let table: Table = kept(&folder.join(format!("table-{recipes}-{windows}.json")), || {
        let params = TableParams { recipes, windows, seed: 1 };
        let tell = |step: Step| {
            if let Step::Simulated(done, of) = step
                && done % 10 == 0
            {
                println!("table: {done} of {of}");
            }
            true
        };
        Ok(Table::simulate(&setting, &setting.base_values(), &sought, &view, &make, &params, &tell)?)
    })?;
    let tried: Vec<Trial> = kept(&folder.join(format!("trials-{trials}-{windows}.json")), || {
        let done = AtomicUsize::new(0);
        let one = |(i, places): (usize, [f64; PARAMETERS.len()])| {
            let engine = make(&recipe(&setting, &Values::at(&places), |_| true)).map_err(|e| e.to_string())?;
            let field = |k: usize| view.simulate_field(&engine, Key { seed: 77, index: (i * windows + k) as u64 }).map_err(|e| e.to_string());
            let fields: Vec<Picture> = (0..windows).map(field).collect::<Result<_, String>>()?;
            let measured = measure(&fields, PIXEL_UM).map_err(|e| e.to_string())?.estimates;
            let cut: Vec<Picture> = fields.iter().flat_map(|f| view.windows(f)).collect();
            let summary = Summary::of(&cut, &view).map_err(|e| e.to_string())?;
            println!("trial: {} of {trials}", done.fetch_add(1, Ordering::Relaxed) + 1);
            Ok(Trial { places: places.to_vec(), statistics: summary.values.into_iter().map(|v| v.is_finite().then_some(v)).collect(), measured })
        };
        let all: Vec<(usize, [f64; PARAMETERS.len()])> = unseen(trials, 99).into_iter().enumerate().collect();
        let made: Vec<Result<Trial, String>> = all.into_par_iter().map(one).collect();
        Ok(made.into_iter().filter_map(|t| t.map_err(|e| println!("left out: {e}")).ok()).collect())
    })?;

    let regression = Regression::new(&table.statistics, &table.places);
    let estimates: Vec<Vec<Estimate>> = tried.iter().map(|t| regression.estimate(&t.statistics.iter().map(|v| v.unwrap_or(f64::NAN)).collect::<Vec<_>>())).collect();
    println!("{:<26} {:>8} {:>9} {:>8} {:>8}", "parameter", "source", "explained", "covered", "width");
    let (mut pairs, mut covered, mut widths, mut lost) = (0, 0, Vec::new(), Vec::new());
    for (i, parameter) in table.sought.iter().enumerate() {
        let prior = parameter.prior();
        let of = |(trial, found): (&Trial, &Vec<Estimate>)| match prior.source {
            Source::Simulated => Some(found[i]),
            Source::Measured => trial.measured.iter().find(|(p, _)| p == parameter).map(|(_, e)| {
                let [value, low, high] = [e.value, e.low, e.high].map(|v| prior.place(v));
                Estimate { value, low, high }
            }),
        };
        let found: Vec<(f64, Estimate)> =
            tried.iter().zip(&estimates).filter_map(|pair| of(pair).map(|e| (pair.0.places[parameter.index()], e))).collect();
        let inside = found.iter().filter(|(t, e)| *t >= e.low - 1e-9 && *t <= e.high + 1e-9).count();
        let width = median(found.iter().map(|(_, e)| e.high - e.low).collect());
        let bias = found.iter().map(|(t, e)| e.value - t).sum::<f64>() / found.len() as f64;
        let source = if prior.source == Source::Measured { "measured" } else { "sim" };
        let explained = regression.explained()[i];
        println!("{:<26} {source:>8} {explained:>9.3} {:>4}/{:<3} {width:>8.3} bias {bias:+.3}", parameter.name(), inside, found.len());
        if width <= 0.5 {
            pairs += found.len();
            covered += inside;
            widths.extend(found.iter().map(|(_, e)| e.high - e.low));
        } else {
            lost.push(parameter.name());
        }
    }
    println!("{pairs} pairs of recipe and parameter: {:.1} % covered, median width {:.3} of the range", 100.0 * covered as f64 / pairs as f64, median(widths));
    println!("not identified ({}): {}", lost.len(), lost.join(", "));
    Ok(())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Reads what was simulated before, or simulates it and keeps it.
fn kept<T: Serialize + for<'de> Deserialize<'de>>(path: &Path, make: impl FnOnce() -> Result<T, Box<dyn Error>>) -> Result<T, Box<dyn Error>> {
    if let Ok(text) = std::fs::read_to_string(path) {
        return Ok(serde_json::from_str(&text)?);
    }
    let made = make()?;
    std::fs::write(path, serde_json::to_string(&made)?)?;
    Ok(made)
}

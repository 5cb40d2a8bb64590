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
    Estimate, MakeEngine, PARAMETERS, Parameter, Regression, Setting, Source, Spreads, Step, Summary, Table,
    TableParams, Values, View, measure, recipe, unseen,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

const PIXEL_UM: f64 = 0.33;

/// What is wider is not claimed.
const WIDEST: f64 = papsynth_match::WIDEST;

/// What was seen of an unseen recipe.
#[derive(Serialize, Deserialize)]
struct Trial {
    places: Vec<f64>,
    statistics: Vec<Option<f64>>,
    measured: Vec<(Parameter, Estimate)>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let argument = |i: usize, default: &str| std::env::args().nth(i).unwrap_or_else(|| default.to_owned());
    let (recipes, trials, windows): (usize, usize, usize) =
        (argument(1, "300").parse()?, argument(2, "40").parse()?, argument(3, "8").parse()?);
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
    // What is measured is known when the table is made: it stays as it is in the table, and differs in trials of its own.
    let mut known = setting.base_values();
    for (parameter, value) in
        [(Parameter::Noise, 2.2), (Parameter::Pattern, 0.01), (Parameter::Across, 0.24), (Parameter::Down, 0.41)]
    {
        known.set(parameter, value);
    }
    let of = |source: Source| PARAMETERS.into_iter().filter(move |p| p.prior().source == source);
    let sought: Vec<Parameter> = of(Source::Simulated).filter(|p| setting.seeks(*p)).collect();
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
        Ok(Table::simulate(&setting, &known, &sought, &view, &make, &params, &tell)?)
    })?;
    let bench = Bench { view: &view, setting: &setting, make: &make, windows };
    let drawn = unseen(trials, 99);
    let tried: Vec<Trial> = kept(&folder.join(format!("trials-{trials}-{windows}.json")), || {
        bench.run("trial", &drawn, |places| {
            let mut values = known.clone();
            sought.iter().for_each(|p| values.set(*p, p.prior().value(places[p.index()])));
            values
        })
    })?;
    let lit: Vec<Trial> =
        kept(&folder.join(format!("lights-{trials}-{windows}.json")), || bench.run("light", &drawn, Values::at))?;

    let regression = Regression::new(&table.statistics, &table.places);
    let estimates: Vec<Vec<Estimate>> = tried.iter().map(|t| regression.estimate(&t.known_statistics())).collect();
    let mut tally = Tally::default();
    println!("{:<26} {:>10} {:>10} {:>8} {:>7}", "parameter", "claimed", "explained", "covered", "width");
    for parameter in of(Source::Measured) {
        let found = |t: &Trial| t.measured.iter().find(|(p, _)| *p == parameter).map(|(_, e)| in_range(parameter, e));
        let pairs = lit.iter().filter_map(|t| found(t).map(|e| (t.places[parameter.index()], e)));
        tally.add(parameter, None, &pairs.collect::<Vec<_>>());
    }
    for (i, parameter) in table.sought.iter().enumerate() {
        let pairs = tried.iter().zip(&estimates).map(|(t, e)| (t.places[parameter.index()], e[i]));
        tally.add(*parameter, Some(regression.explained()[i]), &pairs.collect::<Vec<_>>());
    }
    tally.tell();
    Ok(())
}

impl Trial {
    fn known_statistics(&self) -> Vec<f64> {
        self.statistics.iter().map(|v| v.unwrap_or(f64::NAN)).collect()
    }
}

/// Where trials are made.
struct Bench<'a> {
    view: &'a View,
    setting: &'a Setting,
    make: &'a MakeEngine<'a>,
    windows: usize,
}

impl Bench<'_> {
    fn run(
        &self,
        what: &str,
        drawn: &[[f64; PARAMETERS.len()]],
        values: impl Fn(&[f64; PARAMETERS.len()]) -> Values + Sync,
    ) -> Result<Vec<Trial>, Box<dyn Error>> {
        let done = AtomicUsize::new(0);
        let one = |(i, places): (usize, &[f64; PARAMETERS.len()])| -> Result<Trial, String> {
            let engine = (self.make)(&recipe(self.setting, &values(places), |_| true)).map_err(|e| e.to_string())?;
            let key = |k: usize| Key { seed: 77, index: (i * self.windows + k) as u64 };
            let field = |k: usize| self.view.simulate_field(&engine, key(k)).map_err(|e| e.to_string());
            let fields: Vec<Picture> = (0..self.windows).map(field).collect::<Result<_, String>>()?;
            let measured = measure(&fields, PIXEL_UM).map_err(|e| e.to_string())?.estimates;
            let cut: Vec<Picture> = fields.iter().flat_map(|f| self.view.windows(f)).collect();
            let summary = Summary::of(&cut, self.view).map_err(|e| e.to_string())?;
            println!("{what}: {} of {}", done.fetch_add(1, Ordering::Relaxed) + 1, drawn.len());
            let statistics = summary.values.into_iter().map(|v| v.is_finite().then_some(v)).collect();
            Ok(Trial { places: places.to_vec(), statistics, measured })
        };
        let made: Vec<Result<Trial, String>> = drawn.par_iter().enumerate().map(one).collect();
        Ok(made.into_iter().filter_map(|t| t.map_err(|e| println!("left out: {e}")).ok()).collect())
    }
}

fn in_range(parameter: Parameter, e: &Estimate) -> Estimate {
    let prior = parameter.prior();
    let [value, low, high] = [e.value, e.low, e.high].map(|v| prior.place(v));
    Estimate { value, low, high }
}

/// What is claimed, and how much of it is true.
#[derive(Default)]
struct Tally {
    pairs: usize,
    covered: usize,
    widths: Vec<f64>,
    never: Vec<String>,
}

impl Tally {
    /// True places and estimates of a parameter.
    fn add(&mut self, parameter: Parameter, explained: Option<f64>, found: &[(f64, Estimate)]) {
        let holds = |(t, e): &&(f64, Estimate)| *t >= e.low - 1e-9 && *t <= e.high + 1e-9;
        let claimed: Vec<(f64, Estimate)> = found.iter().filter(|(_, e)| e.high - e.low <= WIDEST).copied().collect();
        let inside = claimed.iter().filter(holds).count();
        let all = found.iter().filter(holds).count();
        let width = median(found.iter().map(|(_, e)| e.high - e.low).collect());
        let explained = explained.map_or(String::from("measured"), |e| format!("{e:.3}"));
        let share = |a: usize, b: usize| format!("{a}/{b}");
        println!(
            "{:<26} {:>10} {explained:>10} {:>8} {width:>7.3}   all {}",
            parameter.name(),
            share(claimed.len(), found.len()),
            share(inside, claimed.len()),
            share(all, found.len())
        );
        if claimed.is_empty() {
            self.never.push(parameter.name());
        }
        self.pairs += claimed.len();
        self.covered += inside;
        self.widths.extend(claimed.iter().map(|(_, e)| e.high - e.low));
    }

    fn tell(self) {
        let part = 100.0 * self.covered as f64 / self.pairs as f64;
        println!(
            "{} pairs claimed: {part:.1} % covered, median width {:.3} of the range",
            self.pairs,
            median(self.widths)
        );
        println!("never claimed: {}", self.never.join(", "));
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Reads what was simulated before, or simulates it and keeps it.
fn kept<T: Serialize + for<'de> Deserialize<'de>>(
    path: &Path,
    make: impl FnOnce() -> Result<T, Box<dyn Error>>,
) -> Result<T, Box<dyn Error>> {
    if let Ok(text) = std::fs::read_to_string(path) {
        return Ok(serde_json::from_str(&text)?);
    }
    let made = make()?;
    std::fs::write(path, serde_json::to_string(&made)?)?;
    Ok(made)
}

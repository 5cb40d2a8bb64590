//! Estimates the parameters of held-out recipes, and counts how often the intervals contain the true values.
//!
//! `cargo run --release -p papsynth-match --example recover -- [RECIPES] [TRIALS] [WINDOWS] [FOLDER] [SEED]`
//!
//! All trials share the table of simulated recipes, with one size, one preset and fused images. Simulated rows are
//! saved in FOLDER, line by line, so an interrupted run continues.

#![expect(clippy::print_stdout, reason = "a program prints")]

use std::error::Error;
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe};
use papsynth::{Engine, Inputs};
use papsynth_judge::{FieldImage, NucleiFrom};
use papsynth_match::{
    Estimate, FieldSd, MakeEngine, PARAMETERS, Parameter, Plan, Regression, Setting, Source, Summary, TableParams,
    Values, WIDEST, WindowSampler, measure, recipe, unseen,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

const PIXEL_UM: f64 = 0.33;

/// Seed of the recipes of the trials. No choice depended on them.
const SEED: u64 = 20_261_123;

/// Seed of the table.
const TABLE_SEED: u64 = 1;

/// A simulated recipe, or an error.
#[derive(Serialize, Deserialize)]
struct Row {
    row: usize,
    made: Result<Made, String>,
}

/// Results of a recipe.
#[derive(Serialize, Deserialize)]
struct Made {
    places: Vec<f64>,
    statistics: Vec<Option<f64>>,
    measured: Vec<(Parameter, Estimate)>,
}

impl Made {
    fn new(places: &[f64], summary: Summary, measured: Vec<(Parameter, Estimate)>) -> Self {
        // JSON has no NaN.
        let statistics = summary.values.into_iter().map(|v| v.is_finite().then_some(v)).collect();
        Self { places: places.to_vec(), statistics, measured }
    }

    fn statistics(&self) -> Vec<f64> {
        self.statistics.iter().map(|v| v.unwrap_or(f64::NAN)).collect()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let argument = |i: usize, default: &str| std::env::args().nth(i).unwrap_or_else(|| default.to_owned());
    let (recipes, trials, windows): (usize, usize, usize) =
        (argument(1, "300").parse()?, argument(2, "40").parse()?, argument(3, "8").parse()?);
    let folder = PathBuf::from(argument(4, "target/recover"));
    let seed: u64 = argument(5, &SEED.to_string()).parse()?;
    std::fs::create_dir_all(&folder)?;

    let view = WindowSampler::new([640, 480], PIXEL_UM, NucleiFrom::Search)?;
    let setting = Setting {
        base: Preset::Lbc.recipe(),
        size_px: view.simulated_px(),
        pixel_um: PIXEL_UM,
        bits: 8,
        extended: true,
        seek_pixel: false,
        field_sd: FieldSd::default(),
    };
    // Measured parameters are constant in the table, and vary in separate trials.
    let mut known = setting.base_values();
    for (parameter, value) in [
        (Parameter::Noise, 2.2),
        (Parameter::Pattern, 0.01),
        (Parameter::NoiseCorrelationX, 0.24),
        (Parameter::NoiseCorrelationY, 0.41),
    ] {
        known.set(parameter, value);
    }
    let model = Model::builtin();
    let make = |recipe: &Recipe| Engine::new(recipe, &model, &Inputs::default());

    let params = TableParams { recipes, windows, seed: TABLE_SEED };
    let plan = Plan::new(&setting, &known, &view, &make, &params)?;
    let table = saved(&folder.join(format!("table-{recipes}-{windows}.jsonl")), recipes, |row| {
        let (places, summary) = plan.row(row).map_err(|e| e.to_string())?;
        Ok(Made::new(&places, summary, Vec::new()))
    })?;
    let (rows, places): (Vec<Vec<f64>>, Vec<Vec<f64>>) =
        table.iter().map(|made| (made.statistics(), made.places.clone())).unzip();
    let regression = Regression::new(&rows, &places);
    println!("explained fraction of the variance, on held-out recipes of the table:");
    for (parameter, part) in plan.sought().iter().zip(regression.explained()) {
        println!("    {:<24} {part:.3}", parameter.name());
    }

    let trials_of = Trials { view: &view, setting: &setting, make: &make, windows, seed };
    let drawn = unseen(trials, seed);
    let file = |what: &str| folder.join(format!("{what}-{seed}-{windows}.jsonl"));
    let tried = saved(&file("trials"), trials, |row| {
        let mut values = known.clone();
        plan.sought().iter().for_each(|p| values.set(*p, p.prior().value(drawn[row][p.index()])));
        trials_of.run(row, &drawn[row], &values)
    })?;
    let lit = saved(&file("lights"), trials, |row| trials_of.run(row, &drawn[row], &Values::at(&drawn[row])))?;

    let estimates: Vec<Vec<Estimate>> = tried.iter().map(|t| regression.estimate(&t.statistics())).collect();
    let mut tally = Tally::default();
    println!("| parameter | explained | identified | covered | median width |\n|---|---|---|---|---|");
    for parameter in PARAMETERS.into_iter().filter(|p| p.prior().source == Source::Measured) {
        let found = |t: &Made| t.measured.iter().find(|(p, _)| *p == parameter).map(|(_, e)| in_range(parameter, e));
        let pairs = lit.iter().filter_map(|t| found(t).map(|e| (t.places[parameter.index()], e)));
        tally.add(parameter, None, &pairs.collect::<Vec<_>>(), trials);
    }
    tally.print("measured");
    for (i, parameter) in plan.sought().iter().enumerate() {
        let pairs = tried.iter().zip(&estimates).map(|(t, e)| (t.places[parameter.index()], e[i]));
        tally.add(*parameter, Some(regression.explained()[i]), &pairs.collect::<Vec<_>>(), trials);
    }
    tally.print("all");
    tally.draw(&folder.join("recovered.png"))?;
    Ok(())
}

/// Settings of the trials.
struct Trials<'a> {
    view: &'a WindowSampler,
    setting: &'a Setting,
    make: &'a MakeEngine<'a>,
    windows: usize,
    seed: u64,
}

impl Trials<'_> {
    fn run(&self, row: usize, places: &[f64], values: &Values) -> Result<Made, String> {
        let engine = (self.make)(&recipe(self.setting, values, |_| true)).map_err(|e| e.to_string())?;
        let key = |k: usize| Key { seed: self.seed, index: (row * self.windows + k) as u64 };
        let field = |k: usize| self.view.simulate_field(&engine, key(k)).map_err(|e| e.to_string());
        let fields: Vec<FieldImage> = (0..self.windows).map(field).collect::<Result<_, String>>()?;
        let measured = measure(&fields, PIXEL_UM).map_err(|e| e.to_string())?.estimates;
        let cut: Vec<FieldImage> = fields.iter().flat_map(|f| self.view.windows(f)).collect();
        let summary = Summary::of(&cut, self.view).map_err(|e| e.to_string())?;
        Ok(Made::new(places, summary, measured))
    }
}

fn in_range(parameter: Parameter, e: &Estimate) -> Estimate {
    let prior = parameter.prior();
    let [value, low, high] = [e.value, e.low, e.high].map(|v| prior.place(v));
    Estimate { value, low, high }
}

/// Counts of identified parameters and of their coverage.
#[derive(Default)]
struct Tally {
    identified: Vec<(f64, Estimate)>,
    never: Vec<String>,
    panels: Vec<Vec<(f64, Estimate)>>,
}

fn holds((t, e): &(f64, Estimate)) -> bool {
    *t >= e.low - 1e-9 && *t <= e.high + 1e-9
}

impl Tally {
    /// Adds the true positions and the estimates of a parameter.
    fn add(&mut self, parameter: Parameter, explained: Option<f64>, found: &[(f64, Estimate)], trials: usize) {
        let identified: Vec<(f64, Estimate)> =
            found.iter().filter(|(_, e)| e.high - e.low <= WIDEST).copied().collect();
        let inside = identified.iter().filter(|p| holds(p)).count();
        let explained = explained.map_or(String::from("measured"), |e| format!("{:.0} %", 100.0 * e));
        println!(
            "| {} | {explained} | {}/{trials} | {inside} | {:.2} |",
            parameter.name(),
            identified.len(),
            median(identified.iter().map(|(_, e)| e.high - e.low).collect())
        );
        if identified.is_empty() {
            self.never.push(parameter.name());
        } else {
            self.panels.push(identified.clone());
        }
        self.identified.extend(identified);
    }

    fn print(&self, what: &str) {
        let covered = self.identified.iter().filter(|p| holds(p)).count();
        let widths = self.identified.iter().map(|(_, e)| e.high - e.low).collect();
        println!(
            "{what}: {} pairs identified, {covered} ({:.1} %) covered, median width {:.3} of the range; never identified: {}",
            self.identified.len(),
            100.0 * covered as f64 / self.identified.len() as f64,
            median(widths),
            self.never.join(", ")
        );
    }

    /// Draws one panel per identified parameter: true value horizontally, estimate vertically, intervals as lines.
    fn draw(&self, path: &Path) -> Result<(), Box<dyn Error>> {
        const PANEL: usize = 110;
        const SIDE: usize = 96;
        const ACROSS: usize = 7;
        let down = self.panels.len().div_ceil(ACROSS).max(1);
        let (wide, high) = (ACROSS * PANEL, down * PANEL);
        let mut grey = vec![255_u8; wide * high];
        for (i, panel) in self.panels.iter().enumerate() {
            let [left, top] = [i % ACROSS, i / ACROSS].map(|k| k * PANEL + (PANEL - SIDE) / 2);
            let mut put = |x: f64, y: f64, ink: u8| {
                let at = |v: f64| (0..SIDE).rev().find(|k| *k as f64 <= v * (SIDE - 1) as f64).unwrap_or(0);
                let pixel = &mut grey[(top + SIDE - 1 - at(y)) * wide + left + at(x)];
                *pixel = ink.min(*pixel);
            };
            for k in 0..SIDE {
                let t = k as f64 / (SIDE - 1) as f64;
                put(t, t, 170);
                [(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)].into_iter().for_each(|(x, y)| put(x, y, 120));
            }
            for (truth, e) in panel {
                for k in 0..SIDE {
                    put(*truth, e.low + (e.high - e.low) * k as f64 / (SIDE - 1) as f64, 110);
                }
                for (dx, dy) in [(0.0, 0.0), (0.012, 0.0), (-0.012, 0.0), (0.0, 0.012), (0.0, -0.012)] {
                    put(truth + dx, e.value + dy, 0);
                }
            }
        }
        let mut encoder = png::Encoder::new(File::create(path)?, u32::try_from(wide)?, u32::try_from(high)?);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_compression(png::Compression::High);
        encoder.write_header()?.write_image_data(&grey)?;
        println!("{}", path.display());
        Ok(())
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Reads saved rows, and computes and saves the missing ones.
fn saved(
    path: &Path,
    count: usize,
    make: impl Fn(usize) -> Result<Made, String> + Sync,
) -> Result<Vec<Made>, Box<dyn Error>> {
    let mut rows: Vec<Option<Row>> = (0..count).map(|_| None).collect();
    if path.exists() {
        for line in BufReader::new(File::open(path)?).lines() {
            // An incomplete line is computed again.
            if let Ok(row) = serde_json::from_str::<Row>(&line?)
                && row.row < count
            {
                let at = row.row;
                rows[at] = Some(row);
            }
        }
    }
    let file = Mutex::new(OpenOptions::new().create(true).append(true).open(path)?);
    let missing: Vec<usize> = (0..count).filter(|i| rows[*i].is_none()).collect();
    let one = |row: &usize| -> Result<Row, String> {
        let row = Row { row: *row, made: make(*row) };
        let line = serde_json::to_string(&row).map_err(|e| e.to_string())?;
        let mut file = file.lock().map_err(|e| e.to_string())?;
        writeln!(file, "\n{line}").map_err(|e| e.to_string())?;
        Ok(row)
    };
    let made: Vec<Row> = missing.par_iter().map(one).collect::<Result<_, _>>()?;
    let mut left_out = 0;
    let all = rows.into_iter().flatten().chain(made);
    let mut all: Vec<Row> = all.collect();
    all.sort_by_key(|row| row.row);
    let made = all.into_iter().filter_map(|row| row.made.map_err(|e| (left_out += 1, println!("failed: {e}"))).ok());
    let made = made.collect();
    println!("{}: {count} rows, {left_out} failed", path.display());
    Ok(made)
}

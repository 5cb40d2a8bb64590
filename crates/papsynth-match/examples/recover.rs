//! Recovers the parameters of recipes it has not seen, and counts how often the stated intervals hold them.
//!
//! `cargo run --release -p papsynth-match --example recover -- [RECIPES] [TRIALS] [WINDOWS] [FOLDER] [SEED]`
//!
//! The table of simulated recipes is shared by all trials: they are of one size, one preset and fused alike. What was
//! simulated is kept in FOLDER, line by line, and used again: what was broken off goes on.

#![expect(clippy::print_stdout, reason = "it is a program")]

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

/// Of the recipes of the trials. Nothing was chosen by looking at these.
const SEED: u64 = 20_261_123;

/// Of the table.
const TABLE_SEED: u64 = 1;

/// A recipe that was simulated, or why it was not.
#[derive(Serialize, Deserialize)]
struct Row {
    row: usize,
    made: Result<Made, String>,
}

/// What was seen of a recipe.
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
    // What is measured is known when the table is made: it stays as it is in the table, and differs in trials of its own.
    let mut known = setting.base_values();
    for (parameter, value) in
        [(Parameter::Noise, 2.2), (Parameter::Pattern, 0.01), (Parameter::Across, 0.24), (Parameter::Down, 0.41)]
    {
        known.set(parameter, value);
    }
    let model = Model::builtin();
    let make = |recipe: &Recipe| Engine::new(recipe, &model, &Inputs::default());

    let params = TableParams { recipes, windows, seed: TABLE_SEED };
    let plan = Plan::new(&setting, &known, &view, &make, &params)?;
    let table = kept(&folder.join(format!("table-{recipes}-{windows}.jsonl")), recipes, |row| {
        let (places, summary) = plan.row(row).map_err(|e| e.to_string())?;
        Ok(Made::new(&places, summary, Vec::new()))
    })?;
    let (rows, places): (Vec<Vec<f64>>, Vec<Vec<f64>>) =
        table.iter().map(|made| (made.statistics(), made.places.clone())).unzip();
    let regression = Regression::new(&rows, &places);
    println!("part of the variance that unseen recipes of the table were told:");
    for (parameter, part) in plan.sought().iter().zip(regression.explained()) {
        println!("    {:<24} {part:.3}", parameter.name());
    }

    let bench = Bench { view: &view, setting: &setting, make: &make, windows, seed };
    let drawn = unseen(trials, seed);
    let file = |what: &str| folder.join(format!("{what}-{seed}-{windows}.jsonl"));
    let tried = kept(&file("trials"), trials, |row| {
        let mut values = known.clone();
        plan.sought().iter().for_each(|p| values.set(*p, p.prior().value(drawn[row][p.index()])));
        bench.run(row, &drawn[row], &values)
    })?;
    let lit = kept(&file("lights"), trials, |row| bench.run(row, &drawn[row], &Values::at(&drawn[row])))?;

    let estimates: Vec<Vec<Estimate>> = tried.iter().map(|t| regression.estimate(&t.statistics())).collect();
    let mut tally = Tally::default();
    println!("| parameter | explained | claimed | covered | median width |\n|---|---|---|---|---|");
    for parameter in PARAMETERS.into_iter().filter(|p| p.prior().source == Source::Measured) {
        let found = |t: &Made| t.measured.iter().find(|(p, _)| *p == parameter).map(|(_, e)| in_range(parameter, e));
        let pairs = lit.iter().filter_map(|t| found(t).map(|e| (t.places[parameter.index()], e)));
        tally.add(parameter, None, &pairs.collect::<Vec<_>>(), trials);
    }
    tally.tell("measured");
    for (i, parameter) in plan.sought().iter().enumerate() {
        let pairs = tried.iter().zip(&estimates).map(|(t, e)| (t.places[parameter.index()], e[i]));
        tally.add(*parameter, Some(regression.explained()[i]), &pairs.collect::<Vec<_>>(), trials);
    }
    tally.tell("all");
    tally.draw(&folder.join("recovered.png"))?;
    Ok(())
}

/// Where trials are made.
struct Bench<'a> {
    view: &'a WindowSampler,
    setting: &'a Setting,
    make: &'a MakeEngine<'a>,
    windows: usize,
    seed: u64,
}

impl Bench<'_> {
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

/// What is claimed, and how much of it is true.
#[derive(Default)]
struct Tally {
    claimed: Vec<(f64, Estimate)>,
    never: Vec<String>,
    panels: Vec<Vec<(f64, Estimate)>>,
}

fn holds((t, e): &(f64, Estimate)) -> bool {
    *t >= e.low - 1e-9 && *t <= e.high + 1e-9
}

impl Tally {
    /// True places and estimates of a parameter.
    fn add(&mut self, parameter: Parameter, explained: Option<f64>, found: &[(f64, Estimate)], trials: usize) {
        let claimed: Vec<(f64, Estimate)> = found.iter().filter(|(_, e)| e.high - e.low <= WIDEST).copied().collect();
        let inside = claimed.iter().filter(|p| holds(p)).count();
        let explained = explained.map_or(String::from("measured"), |e| format!("{:.0} %", 100.0 * e));
        println!(
            "| {} | {explained} | {}/{trials} | {inside} | {:.2} |",
            parameter.name(),
            claimed.len(),
            median(claimed.iter().map(|(_, e)| e.high - e.low).collect())
        );
        if claimed.is_empty() {
            self.never.push(parameter.name());
        } else {
            self.panels.push(claimed.clone());
        }
        self.claimed.extend(claimed);
    }

    fn tell(&self, what: &str) {
        let covered = self.claimed.iter().filter(|p| holds(p)).count();
        let widths = self.claimed.iter().map(|(_, e)| e.high - e.low).collect();
        println!(
            "{what}: {} pairs claimed, {covered} ({:.1} %) covered, median width {:.3} of the range; never claimed: {}",
            self.claimed.len(),
            100.0 * covered as f64 / self.claimed.len() as f64,
            median(widths),
            self.never.join(", ")
        );
    }

    /// A panel a parameter that was claimed: the truth to the right, what was found upwards, intervals as lines.
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

/// Rows that were made before are read, the others made and added to the file as they are done.
fn kept(
    path: &Path,
    count: usize,
    make: impl Fn(usize) -> Result<Made, String> + Sync,
) -> Result<Vec<Made>, Box<dyn Error>> {
    let mut rows: Vec<Option<Row>> = (0..count).map(|_| None).collect();
    if path.exists() {
        for line in BufReader::new(File::open(path)?).lines() {
            // A line that was broken off is made again.
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
    let made = all.into_iter().filter_map(|row| row.made.map_err(|e| (left_out += 1, println!("left out: {e}"))).ok());
    let made = made.collect();
    println!("{}: {count} rows, {left_out} left out", path.display());
    Ok(made)
}

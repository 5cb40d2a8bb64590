//! Trains a small network on synthetic and on real fields, and tests it on other real fields.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::realism::{GRADES, halves, program};
use crate::workspace::Workspace;
use crate::{dataset, python, realism, shell};

/// Packages of the network.
const PACKAGES: &str = "numpy\npillow\nscikit-image\nscipy\n\
    tensorflow-cpu; sys_platform == 'linux' and platform_machine == 'x86_64'\n\
    tensorflow; sys_platform != 'linux' or platform_machine != 'x86_64'\n";

/// Number of fields generated for each of [`GRADES`] and each of [`LEUKOCYTES`]: twice as many normal ones
/// (docs/WORTH.md).
const FRAMES: [&str; 3] = ["80", "40", "40"];

/// Changes of the matched recipes for training, beside `--widen`: more variety of cells (docs/WORTH.md).
const VARIETY: [&str; 6] = [
    "cytoplasm.degeneration={ log_normal = [0.3, 1], max = 2 }",
    "cytoplasm.clouds={ uniform = [0.03, 0.25] }",
    "cytoplasm.elongation={ log_normal = [1.2, 0.45], min = 0.4, max = 4 }",
    "cytoplasm.folds.folded_over=0.12",
    "nucleus.rim={ uniform = [0, 0.5] }",
    "stain.nucleus_variation=1.3",
];

/// Changes of the leukocytes, which look like nuclei: clusters, and more that lie alone on the empty slide.
const LEUKOCYTES: [(&str, &[&str]); 2] = [
    ("clusters", &["debris.leukocytes.clusters.per_mm2.uniform=[10,120]"]),
    (
        "single",
        &[
            "debris.leukocytes.clusters.per_mm2.uniform=[30,250]",
            "debris.leukocytes.per_cluster={ log_normal = [1, 0.6], max = 12 }",
            "debris.leukocytes.on_cells=0.2",
        ],
    ),
];

/// Factor of `papsynth generate --widen`.
const WIDEN: &str = "1.5";

/// Version of `nucleus_net.py` and of its sets: results of another version are kept apart.
const METHOD: u32 = 9;

/// Version of `overlap_net.py` and of its sets: results of another version are kept apart.
const OVERLAP_METHOD: u32 = 3;

/// Presets of the overlapping cells on which networks are trained: name, number of fields and seed.
const OVERLAP_TRAINING: [(&str, &str, &str); 3] =
    [("lbc", "300", "1"), ("dense", "80", "2"), ("high-grade", "100", "3")];

/// Presets of the overlapping cells on which networks are tested.
const OVERLAP_TESTS: [(&str, &str, &str); 2] = [("extended-focus", "60", "4"), ("lsil", "40", "5")];

/// Trains a small network on synthetic and on real fields, and tests it on other real fields
///
/// Needs PAPSYNTH_REFERENCE. `papsynth match` fits a recipe to every second real field of each grade; a U-Net is
/// trained on fields of the three recipes, on those real fields, or on both, and finds the nuclei of the other half.
/// The mean of the first two networks is tested too. Then the halves change places. Every training and its weights are
/// written to target/worth, where an interrupted run continues; a table is printed. Delete target/worth after a change
/// of papsynth. Each training takes eight minutes on one core; all of them take six hours. docs/WORTH.md tells what was
/// measured.
///
/// With --overlap: trains networks on complete masks of overlapping cells, and tests them on synthetic fields of other
/// presets. Prints the Dice coefficients of found cells and the share of missed cells. Needs no real fields.
#[derive(clap::Args)]
pub(crate) struct Worth {
    /// Trainings with other random numbers
    #[arg(long, value_name = "N", default_value_t = 3)]
    seeds: u32,
    /// Steps of a training
    #[arg(long, value_name = "N", default_value = "3000", default_value_if("overlap", "true", "3600"))]
    steps: u32,
    /// Outlines overlapping cells of synthetic fields instead
    #[arg(long, conflicts_with_all = ["widen", "other", "only"])]
    overlap: bool,
    /// Factor of `papsynth generate --widen`
    #[arg(long, value_name = "FACTOR", default_value = WIDEN)]
    widen: String,
    /// Also trains on another set: a data set of papsynth, or a folder of PNG files and CSV files with centres (y, x);
    /// repeatable
    #[arg(long, value_name = "NAME=FOLDER", value_parser = parse_other)]
    other: Vec<(String, PathBuf)>,
    /// Only trains these networks, such as `synthetic`; the table has all that are trained so far
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
}

fn parse_other(text: &str) -> Result<(String, PathBuf), String> {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    match text.split_once('=') {
        Some((name, folder)) if !name.is_empty() && name.chars().all(word) && Path::new(folder).is_dir() => {
            Ok((name.to_owned(), PathBuf::from(folder)))
        }
        _ => Err("expected NAME=FOLDER, with a name of letters, digits and _, and a folder that exists".to_owned()),
    }
}

pub(crate) fn run(workspace: &Workspace, options: &Worth) -> Result<()> {
    if options.overlap {
        return overlap(workspace, options);
    }
    let reference = realism::reference()?;
    let python = python::environment(workspace, "worth", PACKAGES)?;
    let folder = workspace.target.join("worth");
    let results = folder.join(format!("results-{METHOD}-{}-steps", options.steps));
    shell::make(&results)?;
    let halves = halves(&reference.join("cervix93"), &folder)?;
    let result = |arm: &str, half: usize, seed: u32| results.join(format!("{arm}-{half}-{seed}.json"));
    let synthetic = |half: usize| folder.join(format!("synthetic-{METHOD}-{half}-{}", options.widen));
    let mut trainings = Vec::new();
    for half in [0, 1] {
        let [synthetic, real] = [&synthetic(half), &halves[half]].map(|set| set.display().to_string());
        let name = match options.widen.as_str() {
            WIDEN => "synthetic".to_owned(),
            factor => format!("synthetic_widened_{}", factor.replace('.', "_")),
        };
        // The training sets of each row of the table.
        let mut arms = vec![
            (name.clone(), vec![synthetic.clone()]),
            ("real".to_owned(), vec![real.clone()]),
            ("2_real".to_owned(), vec![format!("{real}:2")]),
            ("4_real".to_owned(), vec![format!("{real}:4")]),
            (format!("{name}_and_2_real"), vec![synthetic.clone(), format!("{real}:2")]),
            (format!("{name}_and_4_real"), vec![synthetic.clone(), format!("{real}:4")]),
            (format!("{name}_and_real"), vec![synthetic, real]),
        ];
        arms.extend(options.other.iter().map(|(name, folder)| (name.clone(), vec![folder.display().to_string()])));
        for seed in 0..options.seeds {
            let train = |sets: &Vec<String>| [vec!["--train".to_owned()], sets.clone()].concat();
            trainings.extend(arms.iter().map(|(arm, sets)| (seed, half, arm.clone(), train(sets))));
            let weights = |arm: &str| weights(&result(arm, half, seed)).display().to_string();
            let mean = vec!["--mean".to_owned(), weights(&name), weights("real")];
            trainings.push((seed, half, format!("mean_of_{name}_and_real"), mean));
        }
    }
    let arms: BTreeSet<&str> = trainings.iter().map(|(_, _, arm, _)| arm.as_str()).collect();
    if let Some(unknown) = options.only.iter().find(|name| !arms.contains(name.as_str())) {
        bail!("--only {unknown}: no such network; expected one of {}", Vec::from_iter(arms).join(", "));
    }
    // The first seed of everything comes first, so that an interrupted run has a complete table.
    trainings.sort_by_key(|(seed, ..)| *seed);
    trainings.retain(|(_, _, arm, _)| options.only.is_empty() || options.only.contains(arm));
    let count = trainings.len();
    for (number, (seed, half, arm, arguments)) in trainings.into_iter().enumerate() {
        let result = result(&arm, half, seed);
        if result.exists() {
            continue;
        }
        let set = synthetic(half);
        if arguments.contains(&set.display().to_string()) && !set.exists() {
            generate(workspace, &folder, &halves[half], half, &options.widen, &set)?;
        }
        println!("training {} of {count}: {arm}, half {}, seed {seed}", number + 1, half + 1);
        let mut command = Command::new(&python);
        command.arg(workspace.root.join("xtask/python/nucleus_net.py")).args(arguments);
        command.arg("--test").arg(&halves[1 - half]).arg("--out").arg(&result);
        command.args(["--seed", &seed.to_string(), "--steps", &options.steps.to_string(), "--weights"]);
        command.arg(weights(&result)).arg("--mask");
        command.args(["extended_focus.png", "nuclei.png"].map(|name| reference.join("focus_stack").join(name)));
        shell::run(&mut command)?;
    }
    let mut command = Command::new(&python);
    let table = shell::output(command.arg(workspace.root.join("xtask/python/worth_table.py")).arg(&results))?;
    shell::write(&folder.join("table.md"), &table)?;
    println!("\n{table}\nTrainings: {}", workspace.shown(&results));
    Ok(())
}

/// Returns the file with the weights of a training.
fn weights(result: &Path) -> PathBuf {
    result.with_extension("weights.h5")
}

/// Trains networks on complete masks of cells, and tests them on synthetic fields of other presets.
fn overlap(workspace: &Workspace, options: &Worth) -> Result<()> {
    let python = python::environment(workspace, "worth", PACKAGES)?;
    let folder = workspace.target.join("worth/overlap");
    let results = folder.join(format!("results-{OVERLAP_METHOD}-{}-steps", options.steps));
    shell::make(&results)?;
    for (preset, frames, seed) in OVERLAP_TRAINING.into_iter().chain(OVERLAP_TESTS) {
        let mut generate = program(workspace);
        generate.args(["generate", "--preset", preset, "--frames", frames, "--seed", seed, "--out"]);
        generate.arg(folder.join(preset)).args(["--set", "slide.fields_per_slide=1"]);
        shell::run(generate.args(["--without", "noise-free,layers,labels,contact-sheet"]))?;
    }
    for seed in 0..options.seeds {
        let result = results.join(format!("{seed}.json"));
        if result.exists() {
            continue;
        }
        println!("training {} of {}", seed + 1, options.seeds);
        let mut command = Command::new(&python);
        command.arg(workspace.root.join("xtask/python/overlap_net.py"));
        command.arg("--train").args(OVERLAP_TRAINING.map(|(preset, ..)| folder.join(preset)));
        command.arg("--test").args(OVERLAP_TESTS.map(|(preset, ..)| folder.join(preset)));
        command.args(["--seed", &seed.to_string(), "--steps", &options.steps.to_string(), "--out"]);
        shell::run(command.arg(&result).arg("--weights").arg(result.with_extension("")))?;
    }
    let mut command = Command::new(&python);
    let table = shell::output(command.arg(workspace.root.join("xtask/python/overlap_table.py")).arg(&results))?;
    shell::write(&folder.join("table.md"), &table)?;
    println!("\n{table}\nTrainings: {}", workspace.shown(&results));
    Ok(())
}

/// Writes a folder with two data sets of synthetic fields for each grade, matched to a half of the real ones.
fn generate(workspace: &Workspace, folder: &Path, real: &Path, half: usize, widen: &str, out: &Path) -> Result<()> {
    let partial = folder.join("partial");
    shell::remove(&partial)?;
    shell::make(&partial)?;
    for (number, ((grade, _, preset), frames)) in GRADES.into_iter().zip(FRAMES).enumerate() {
        let recipe = folder.join(format!("matched-{METHOD}-{grade}-{half}.toml"));
        if !recipe.exists() {
            shell::run(&mut realism::fit(workspace, grade, preset, real, &recipe))?;
        }
        for (set, (name, leukocytes)) in LEUKOCYTES.into_iter().enumerate() {
            // With one seed for all, the data sets would have the same scenes.
            let seed = (GRADES.len() * (2 * set + half) + number).to_string();
            let words = ["--frames", frames, "--seed", &seed, "--widen", widen, "--set", "slide.fields_per_slide=1"];
            let words = words.into_iter().chain(["--without", "noise-free,layers,contact-sheet"]);
            let sets = VARIETY.iter().chain(leukocytes).flat_map(|set| ["--set", *set]);
            let words = words.chain(sets).map(PathBuf::from);
            let set = partial.join(format!("{grade}-{name}"));
            dataset::generate(program(workspace), &set, [recipe.clone()].into_iter().chain(words))?;
        }
    }
    std::fs::rename(&partial, out).with_context(|| format!("cannot write {}", out.display()))
}

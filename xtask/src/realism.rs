//! Matches recipes to each half of the real fields, and compares their fields with both halves.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::shell::{self, Skipped, skipped};
use crate::workspace::Workspace;
use crate::{dataset, python};

/// Pixel size of the real fields, µm.
const PIXEL_UM: &str = "0.33";

/// Number of fields generated for each comparison.
const FRAMES: &str = "16";

/// Sets of features of the judge: the first one stays the same, so that its results can be compared with older ones.
const FEATURES: [&str; 2] = ["1", "2"];

/// Packages of the random forest.
const FOREST: &str = "numpy\npillow\npycocotools\nscikit-learn\nscipy\n";

/// Grades of the real fields: code, name and preset.
pub(crate) const GRADES: [(&str, &str, &str); 3] =
    [("N", "negative", "extended-focus"), ("L", "low-grade lesion", "lsil"), ("H", "high-grade lesion", "high-grade")];

pub(crate) fn run(workspace: &Workspace, quick: bool) -> Result<()> {
    let reference = reference()?;
    let folder = workspace.target.join("realism");
    shell::make(&folder)?;
    let halves = halves(&reference.join("cervix93"), &folder)?;
    let matched = |grade: &str, half: usize| folder.join(format!("matched-{grade}-{half}.toml"));
    let mut table = String::from("fields | recipe | judged | AUC (95 %) | between real halves\n---|---|---|---|---\n");
    for (grade, name, preset) in GRADES {
        for half in [0, 1] {
            let matched = matched(grade, half);
            let mut fit = fit(workspace, grade, preset, &halves[half], &matched);
            if quick {
                fit.arg("--quick");
            }
            shell::run(fit.arg("--force"))?;
            let mut recipes = vec![("matched", vec![matched])];
            if half == 0 {
                recipes.push(("preset", vec!["--preset".into(), preset.into()]));
            }
            for (what, recipe) in recipes {
                let fields = folder.join(format!("fields-{what}-{grade}-{half}"));
                // The real fields are of many slides.
                let words = ["--frames", FRAMES, "--set", "slide.fields_per_slide=1"].map(PathBuf::from);
                dataset::generate(program(workspace), &fields, recipe.into_iter().chain(words))?;
                for (judged, against) in [(half, "fitted half"), (1 - half, "other half")] {
                    for features in FEATURES {
                        let report = folder.join(format!("report-{what}-{grade}-{half}-{judged}-{features}"));
                        let mut judge = program(workspace);
                        judge.arg("judge").arg(&halves[judged]).arg(&fields).arg("--out").arg(&report);
                        judge.args(["--pixel-um", PIXEL_UM, "--group", grade, "--features", features]);
                        shell::run(&mut judge)?;
                        let recipe = format!("{what}, half {}, features {features}", half + 1);
                        table += &judgements(&report, &format!("{name}, {against}"), &recipe)?;
                    }
                }
            }
        }
    }
    for (what, recipe) in [("default", None), ("matched", Some(matched("N", 0)))] {
        shell::write(&folder.join("table.md"), &table)?;
        table += &match python::environment(workspace, "forest", FOREST) {
            Ok(python) => forest(workspace, &python, &reference, &folder, what, recipe)?,
            Err(reason) if reason.is::<Skipped>() => {
                format!("a real field | {what} | random forest | skipped: {reason} |\n")
            }
            Err(error) => return Err(error),
        };
    }
    shell::write(&folder.join("table.md"), &table)?;
    println!("\n{table}\nReports: {}", workspace.shown(&folder));
    Ok(())
}

/// Returns the program in release mode.
pub(crate) fn program(workspace: &Workspace) -> Command {
    let mut command = workspace.cargo();
    command.args(["run", "--release", "--package", "papsynth-cli", "--"]);
    command
}

/// Returns the folder of the real fields.
pub(crate) fn reference() -> Result<PathBuf> {
    let folder = std::env::var_os("PAPSYNTH_REFERENCE").map(PathBuf::from);
    folder.ok_or_else(|| skipped("PAPSYNTH_REFERENCE is not set, so there are no real fields"))
}

/// Returns the command that matches a recipe to the fields of a grade in a folder.
pub(crate) fn fit(workspace: &Workspace, grade: &str, preset: &str, fields: &Path, recipe: &Path) -> Command {
    let mut command = program(workspace);
    command.args(["match", "--pixel-um", PIXEL_UM, "--group", grade, "--preset", preset, "--out"]);
    command.arg(recipe).arg(fields);
    command
}

/// Writes two folders, each with every second field of each grade and its annotations.
pub(crate) fn halves(fields: &Path, folder: &Path) -> Result<[PathBuf; 2]> {
    let text = shell::read(&fields.join("frames.csv"))?;
    let halves = ["half-1", "half-2"].map(|name| folder.join(name));
    for (which, half) in halves.iter().enumerate() {
        shell::remove(half)?;
        shell::make(half)?;
        let mut list = String::from("frame,grade\n");
        for (grade, ..) in GRADES {
            let of_grade = text.lines().filter_map(|line| line.split_once(',')).filter(|(_, g)| g.trim() == grade);
            for (frame, _) in of_grade.skip(which).step_by(2) {
                for file in [format!("{frame}.png"), format!("{frame}.csv")] {
                    shell::copy(&fields.join(&file), &half.join(&file))?;
                }
                list += &format!("{frame},{grade}\n");
            }
        }
        shell::write(&half.join("frames.csv"), &list)?;
    }
    Ok(halves)
}

/// Returns the lines of the table for a report.
fn judgements(report: &Path, fields: &str, recipe: &str) -> Result<String> {
    let file = report.join("report.json");
    let report: Value =
        serde_json::from_str(&shell::read(&file)?).with_context(|| format!("{} is not valid JSON", file.display()))?;
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let mut lines = String::new();
    for test in list(&report["two_sample"]) {
        let (name, result) = (test["name"].as_str().unwrap_or_default(), &test["result"]);
        let Some(auc) = result["auc"].as_f64() else { continue };
        let [low, high] = [0, 1].map(|i| result["interval"][i].as_f64().unwrap_or(f64::NAN));
        let mut null: Vec<f64> = list(&result["null"]).iter().filter_map(Value::as_f64).collect();
        null.sort_by(f64::total_cmp);
        let null = match &null[..] {
            [least, .., most] => format!("{least:.2} to {most:.2}"),
            _ => "-".to_owned(),
        };
        lines.push_str(&format!("{fields} | {recipe} | {name} | {auc:.3} ({low:.3} to {high:.3}) | {null}\n"));
    }
    for test in list(&report["moments"]) {
        let name = test["name"].as_str().unwrap_or_default();
        let descriptors = list(&test["result"]["descriptors"]);
        let (within, of) = (descriptors.iter().filter(|d| d["within"] == true).count(), descriptors.len());
        let slopes: Vec<f64> = descriptors.iter().filter_map(|d| d["slope"][1].as_f64()).collect();
        let [least, most] = slopes.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], s| [a.min(*s), b.max(*s)]);
        lines += &format!(
            "{fields} | {recipe} | {name} | {within} of {of} Q-Q slopes and shifts within the band, slopes {least:.2} to {most:.2} |\n"
        );
    }
    let scalars = list(&report["field_comparison"]["scalars"]);
    let outside: Vec<&str> =
        scalars.iter().filter(|s| s["within"] == false).filter_map(|s| s["name"].as_str()).collect();
    let (within, of) = (scalars.len() - outside.len(), scalars.len());
    let outside = if outside.is_empty() { "-".to_owned() } else { outside.join(", ") };
    lines += &format!(
        "{fields} | {recipe} | field statistics | {within} of {of} medians within the real 10th to 90th percentile; not: {outside} |\n"
    );
    Ok(lines)
}

/// Trains a random forest on pixels of synthetic fields, and segments the nuclei of a real field.
fn forest(
    workspace: &Workspace,
    python: &Path,
    reference: &Path,
    folder: &Path,
    what: &str,
    recipe: Option<PathBuf>,
) -> Result<String> {
    let stack = reference.join("focus_stack");
    let fields = folder.join(format!("fields-forest-{what}"));
    // As sharp as the default, with the number of fused planes and about the pixel size of the real field.
    let settings = [
        "field.pixel_um=0.31",
        "field.width_px=800",
        "field.height_px=700",
        "focus.output=edf",
        "focus.planes=11",
        "focus.step_um=1.0",
        "slide.fields_per_slide=1",
    ];
    let words = ["--frames", "26"].into_iter().chain(settings.iter().flat_map(|setting| ["--set", setting]));
    dataset::generate(program(workspace), &fields, recipe.into_iter().chain(words.map(PathBuf::from)))?;
    let mut command = Command::new(python);
    command.arg(workspace.root.join("xtask/python/pixel_forest.py")).arg(&fields);
    command.arg(stack.join("extended_focus.png")).arg(stack.join("nuclei.png"));
    let found: Value = serde_json::from_str(&shell::output(&mut command)?).context("the output of pixel_forest.py")?;
    Ok(format!(
        "a real field | {what}, extended focus | nuclei by a random forest of {} fields | Dice {} (on synthetic fields {}) |\n",
        found["fields"], found["dice_real"], found["dice_synthetic"]
    ))
}

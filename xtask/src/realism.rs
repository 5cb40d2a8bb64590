//! How far synthetic fields are from real ones that nothing was fitted to.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::python::Python;
use crate::workspace::Workspace;
use crate::{dataset, shell};

pub(crate) const CHORE: Chore = Chore {
    name: "realism",
    usage: "[--quick]",
    about: "fits recipes to one half of the real fields and has the other half judge what they make",
    details: "Needs PAPSYNTH_REFERENCE; without it a line says so. Every other field of each grade is matched, the others judge: \
              the default recipes and the matched ones, grade by grade. A pixel forest trained on synthetic fields looks for the nuclei \
              of a real one (scikit-learn). Reports are written to target/realism; the table is printed and written there too. Takes about \
              half an hour on 2 cores, --quick a third of that.",
    run,
};

/// Size of the real fields' pixels, µm.
const PIXEL_UM: &str = "0.33";

/// Fields that are generated for each judgement.
const FRAMES: &str = "16";

/// Packages of the pixel forest.
const FOREST: &str = "numpy\npillow\npycocotools\nscikit-learn\nscipy\n";

/// A grade of the real fields, and the preset that shows such slides.
const GRADES: [(&str, &str, &str); 3] =
    [("N", "negative", "lbc"), ("L", "low-grade lesion", "lsil"), ("H", "high-grade lesion", "high-grade")];

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    let words = arguments.rest();
    let quick = match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        ["--quick"] => true,
        _ => anyhow::bail!("`{}` is not known here; expected --quick or nothing", words.join(" ")),
    };
    let Some(reference) = std::env::var_os("PAPSYNTH_REFERENCE").map(PathBuf::from) else {
        return Outcome::skipped_unless_ci(
            "PAPSYNTH_REFERENCE is not set, so there are no real fields to judge by".to_owned(),
        );
    };
    let folder = workspace.target.join("realism");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let halves = halves(&reference.join("cervix93"), &folder)?;
    let mut table = String::from("fields | recipe | judged | AUC (95 %) | between real halves\n---|---|---|---|---\n");
    let scanner = folder.join("extended-focus.toml");
    begin(workspace, "extended-focus", &scanner)?;
    for (grade, name, preset) in GRADES {
        let matched = folder.join(format!("matched-{grade}.toml"));
        let mut fit = program(workspace);
        fit.args(["match", "--pixel-um", PIXEL_UM, "--group", grade, "--preset", preset, "--out"]).arg(&matched);
        fit.arg(&halves[0]);
        if quick {
            fit.arg("--quick");
        }
        shell::run(&mut fit)?;
        let init = folder.join(format!("default-{grade}.toml"));
        begin(workspace, preset, &init)?;
        let mut recipes = vec![("default", &init), ("matched", &matched)];
        if grade == "N" {
            recipes.push(("extended-focus", &scanner));
        }
        for (what, recipe) in recipes {
            let fields = folder.join(format!("fields-{what}-{grade}"));
            // Few real fields are of one slide.
            let words: [OsString; 5] =
                [recipe.into(), "--frames".into(), FRAMES.into(), "--set".into(), "slide.fields=1".into()];
            dataset::generate(program(workspace), &fields, words)?;
            let report = folder.join(format!("report-{what}-{grade}"));
            let mut judge = program(workspace);
            judge.arg("judge").arg(&halves[1]).arg(&fields).arg("--out").arg(&report);
            judge.args(["--pixel-um", PIXEL_UM, "--group", grade]);
            shell::run(&mut judge)?;
            table.push_str(&judgements(&report, name, what)?);
        }
    }
    let matched = folder.join("matched-N.toml");
    for (what, recipe) in [("default", None), ("matched", Some(&matched))] {
        table.push_str(&forest(workspace, &reference, &folder, what, recipe)?);
    }
    let file = folder.join("table.md");
    fs::write(&file, &table).with_context(|| format!("cannot write {}", file.display()))?;
    println!("\n{table}\nReports: {}", workspace.shown(&folder));
    Ok(Outcome::Done)
}

fn program(workspace: &Workspace) -> Command {
    let mut command = workspace.cargo();
    command.args(["run", "--release", "--package", "papsynth-cli", "--"]);
    command
}

/// Writes the recipe of a preset anew.
fn begin(workspace: &Workspace, preset: &str, file: &Path) -> Result<()> {
    let _ = fs::remove_file(file);
    shell::run(program(workspace).args(["init", "--preset", preset, "--out"]).arg(file))
}

/// Two folders with every other field of each grade, and what is known of them.
fn halves(fields: &Path, folder: &Path) -> Result<[PathBuf; 2]> {
    let list = fields.join("frames.csv");
    let text = fs::read_to_string(&list).with_context(|| format!("cannot read {}", list.display()))?;
    let halves = ["fit", "judge"].map(|name| folder.join(name));
    let mut lists = [0, 1].map(|_| String::from("frame,grade\n"));
    for half in &halves {
        let _ = fs::remove_dir_all(half);
        fs::create_dir_all(half).with_context(|| format!("cannot make {}", half.display()))?;
    }
    for (grade, ..) in GRADES {
        let of_grade = text.lines().filter_map(|line| line.split_once(',')).filter(|(_, g)| g.trim() == grade);
        for (index, (frame, _)) in of_grade.enumerate() {
            for ending in ["png", "csv"] {
                let file = format!("{frame}.{ending}");
                let from = fields.join(&file);
                fs::copy(&from, halves[index % 2].join(&file))
                    .with_context(|| format!("cannot copy {}", from.display()))?;
            }
            lists[index % 2].push_str(&format!("{frame},{grade}\n"));
        }
    }
    for (half, list) in halves.iter().zip(&lists) {
        fs::write(half.join("frames.csv"), list).with_context(|| format!("cannot write to {}", half.display()))?;
    }
    Ok(halves)
}

/// Lines of the table, of a report.
fn judgements(report: &Path, fields: &str, recipe: &str) -> Result<String> {
    let file = report.join("report.json");
    let text = fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
    let report: Value = serde_json::from_str(&text).with_context(|| format!("{} is no JSON", file.display()))?;
    let mut lines = String::new();
    for test in report["two_sample"].as_array().into_iter().flatten() {
        let (name, result) = (test["name"].as_str().unwrap_or_default(), &test["result"]);
        let Some(auc) = result["auc"].as_f64() else { continue };
        let [low, high] = [0, 1].map(|i| result["interval"][i].as_f64().unwrap_or(f64::NAN));
        let mut null: Vec<f64> = result["null"].as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
        null.sort_by(f64::total_cmp);
        let null = match &null[..] {
            [least, .., most] => format!("{least:.2} to {most:.2}"),
            _ => "-".to_owned(),
        };
        lines.push_str(&format!("{fields} | {recipe} | {name} | {auc:.3} ({low:.3} to {high:.3}) | {null}\n"));
    }
    for test in report["moments"].as_array().into_iter().flatten() {
        let name = test["name"].as_str().unwrap_or_default();
        let descriptors: Vec<&Value> = test["result"]["descriptors"].as_array().into_iter().flatten().collect();
        let (within, of) = (descriptors.iter().filter(|d| d["within"] == true).count(), descriptors.len());
        let slopes: Vec<f64> = descriptors.iter().filter_map(|d| d["slope"][1].as_f64()).collect();
        let [least, most] = slopes.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], s| [a.min(*s), b.max(*s)]);
        lines.push_str(&format!(
            "{fields} | {recipe} | {name} | {within} of {of} Q-Q slopes and shifts within the band, slopes {least:.2} to {most:.2} |\n"
        ));
    }
    let scalars: Vec<&Value> = report["beside"]["scalars"].as_array().into_iter().flatten().collect();
    let outside: Vec<&str> =
        scalars.iter().filter(|s| s["within"] == false).filter_map(|s| s["name"].as_str()).collect();
    lines.push_str(&format!(
        "{fields} | {recipe} | field statistics | {} of {} medians within the real 10th to 90th percentile; not: {} |\n",
        scalars.len() - outside.len(),
        scalars.len(),
        if outside.is_empty() { "-".to_owned() } else { outside.join(", ") }
    ));
    Ok(lines)
}

/// Trains a pixel forest on synthetic fields and has it find the nuclei of a real one.
fn forest(
    workspace: &Workspace,
    reference: &Path,
    folder: &Path,
    what: &str,
    recipe: Option<&PathBuf>,
) -> Result<String> {
    let python = match Python::environment(workspace, "forest", FOREST)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => {
            Outcome::skipped_unless_ci(reason.clone())?;
            return Ok(format!("a real field | {what} | pixel forest | skipped: {reason} |\n"));
        }
    };
    let script = workspace.root.join("xtask/python/pixel_forest.py");
    ensure!(script.exists(), "{} is missing", workspace.shown(&script));
    let stack = reference.join("focus_stack");
    let fields = folder.join(format!("fields-forest-{what}"));
    // As sharp as the default, of as many planes as that field was fused of, in pixels of about the same size.
    let settings = [
        "field.pixel_um=0.31",
        "field.width_px=800",
        "field.height_px=700",
        "focus.picture=extended",
        "focus.planes=11",
        "focus.step_um=1.0",
        "slide.fields=1",
    ];
    let words = ["--frames", "26"].into_iter().chain(settings.iter().flat_map(|setting| ["--set", setting]));
    let recipe = recipe.map(OsString::from);
    dataset::generate(program(workspace), &fields, recipe.into_iter().chain(words.map(OsString::from)))?;
    let mut command = Command::new(&python);
    command.arg(&script).arg(&fields).arg(stack.join("extended_focus.png")).arg(stack.join("nuclei.png"));
    let output = command.output().with_context(|| format!("cannot run {}", workspace.shown(&script)))?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).context("the pixel forest gave no JSON")?;
    Ok(format!(
        "a real field | {what}, extended focus | nuclei by a pixel forest of {} fields | Dice {} (on its own kind {}) |\n",
        found["fields"], found["dice_real"], found["dice_synthetic"]
    ))
}

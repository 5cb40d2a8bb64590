//! The paper's figures with our own material, a picture book of cells and debris, and the effects of all parameters.

use anyhow::{Result, ensure};
use clap::builder::PossibleValuesParser;

use crate::shell;
use crate::workspace::Workspace;

/// What every parameter of a section does, low, as it is, high: figures of the example `effects`.
const EFFECTS: [&str; 13] = [
    "effects-cells",
    "effects-cytoplasm",
    "effects-nucleus",
    "effects-stain",
    "effects-slide",
    "effects-layout",
    "effects-debris",
    "effects-background",
    "effects-light",
    "effects-optics",
    "effects-focus",
    "effects-field",
    "effects-camera",
];

/// All other figures: the number in the paper or the name, what it shows, the package and its example program that draws it, and an
/// argument before the path.
const FIGURES: [(&str, &str, &str, &str, &str); 13] = [
    ("1", "bacilli, leukocytes, speckles, objects out of focus", "papsynth", "figures", "1"),
    ("3", "drawn outlines", "fsd-shape", "sheet", ""),
    ("4", "patches and their overlaps", "quilt-texture", "nucleus", ""),
    ("5", "a nucleus and its three donors", "papsynth", "figures", "5"),
    ("6", "the sheet in its outline", "cloth-verlet", "figure", ""),
    ("7", "levels of detail of a cytoplasm", "papsynth", "figures", "7"),
    ("8", "weight maps and what they scatter", "papsynth", "figures", "8"),
    ("9", "a cluster of leukocytes, step by step", "papsynth", "figures", "9"),
    ("10", "blur with depth", "optics-psf", "depth", ""),
    ("12", "a whole field", "papsynth", "figures", "12"),
    ("13", "high-grade cells", "papsynth", "figures", "13"),
    ("cells", "every class of cell with its name", "papsynth", "picture_book", "cells"),
    ("debris", "every kind of debris with its name", "papsynth", "picture_book", "debris"),
];

/// Whatever can be asked for.
pub(crate) fn names() -> PossibleValuesParser {
    FIGURES.map(|figure| figure.0).into_iter().chain(EFFECTS).collect::<Vec<_>>().into()
}

pub(crate) fn run(workspace: &Workspace, wanted: &[String]) -> Result<()> {
    let folder = workspace.target.join("figures");
    shell::make(&folder)?;
    let shows = "what every parameter of a section does, low, as it is, high";
    let effects = EFFECTS.map(|name| (name, shows, "papsynth", "effects", name.trim_start_matches("effects-")));
    let mut table = String::new();
    for (name, shows, package, example, argument) in FIGURES.into_iter().chain(effects) {
        if !wanted.is_empty() && !wanted.iter().any(|word| word == name) {
            continue;
        }
        let path = folder.join(format!("fig-{name:0>2}.png"));
        let mut command = workspace.cargo();
        command.args(["run", "--release", "--package", package, "--example", example, "--"]);
        shell::run(command.args(argument.split_whitespace()).arg(&path))?;
        ensure!(path.exists(), "example `{example}` of `{package}` did not write {}", path.display());
        let own = format!("{argument} {}", workspace.shown(&path));
        let own = own.trim_start();
        table +=
            &format!("Fig. {name:<18} {shows:<60} cargo run --release -p {package} --example {example} -- {own}\n");
    }
    print!("{table}");
    Ok(())
}

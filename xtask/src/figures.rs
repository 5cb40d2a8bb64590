//! Draws our versions of the paper's figures, overviews of cells and debris, and the effects of all parameters.

use anyhow::{Result, ensure};
use clap::builder::PossibleValuesParser;

use crate::shell;
use crate::workspace::Workspace;

/// Figures of the example `effects`: every parameter of a section at a low, its default and a high value.
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

/// Other figures: number in the paper or name, contents, package and example that draw it, and an argument before the
/// path.
const FIGURES: [(&str, &str, &str, &str, &str); 15] = [
    ("1", "bacilli, leukocytes, speckles, objects out of focus", "papsynth", "figures", "1"),
    ("3", "drawn outlines", "fsd-shape", "sheet", ""),
    ("4", "patches and their overlaps", "quilt-texture", "nucleus", ""),
    ("5", "a nucleus and its three source textures", "papsynth", "figures", "5"),
    ("6", "the sheet in its outline", "cloth-verlet", "figure", ""),
    ("7", "levels of detail of a cytoplasm", "papsynth", "figures", "7"),
    ("8", "density maps and drawn positions", "papsynth", "figures", "8"),
    ("9", "a cluster of leukocytes, step by step", "papsynth", "figures", "9"),
    ("10", "blur with depth", "optics-psf", "depth", ""),
    ("12", "a complete field", "papsynth", "figures", "12"),
    ("13", "high-grade cells", "papsynth", "figures", "13"),
    ("cells", "every class of cell with its name", "papsynth", "picture_book", "cells"),
    ("debris", "every kind of debris with its name", "papsynth", "picture_book", "debris"),
    ("spectra", "absorbance of the dyes, weights of the colour channels", "dye-spectra", "spectra", ""),
    ("transfer", "transfer functions in and out of focus", "optics-psf", "transfer", ""),
];

/// Figures of curves, which are SVG; the others are PNG.
const CURVES: [&str; 2] = ["spectra", "transfer"];

/// Returns the parser of figure names.
pub(crate) fn names() -> PossibleValuesParser {
    FIGURES.map(|figure| figure.0).into_iter().chain(EFFECTS).collect::<Vec<_>>().into()
}

pub(crate) fn run(workspace: &Workspace, wanted: &[String]) -> Result<()> {
    let folder = workspace.target.join("figures");
    shell::make(&folder)?;
    let shows = "every parameter of a section: low, default, high";
    let effects = EFFECTS.map(|name| (name, shows, "papsynth", "effects", name.trim_start_matches("effects-")));
    let mut table = String::new();
    for (name, shows, package, example, argument) in FIGURES.into_iter().chain(effects) {
        if !wanted.is_empty() && !wanted.iter().any(|word| word == name) {
            continue;
        }
        let ending = if CURVES.contains(&name) { "svg" } else { "png" };
        let path = folder.join(format!("fig-{name:0>2}.{ending}"));
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

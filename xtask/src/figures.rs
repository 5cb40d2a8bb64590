//! The paper's figures with our own material, a picture book of cells and debris, and the effects of all parameters.

use std::fs;

use anyhow::{Context, Result, ensure};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::shell;
use crate::workspace::Workspace;

pub(crate) const CHORE: Chore = Chore {
    name: "figures",
    usage: "[FIGURE …]",
    about: "redraws the paper's Figs. 1, 3-10, 12 and 13 with our own material, a picture book of cells and debris, and the effect of every parameter",
    details: "Writes target/figures/fig-01.png and so on, the picture book as fig-cells.png and fig-debris.png, the effects as fig-effects-cytoplasm.png and so on; all of them, or those that are given.",
    run,
};

/// A figure, and the example program that draws it to the path it is given.
struct Figure {
    /// Its number in the paper, or its name.
    name: &'static str,
    shows: &'static str,
    package: &'static str,
    example: &'static str,
    /// Arguments before the path.
    arguments: &'static [&'static str],
}

const fn engine(name: &'static str, shows: &'static str, arguments: &'static [&'static str]) -> Figure {
    Figure { name, shows, package: "papsynth", example: "figures", arguments }
}

const fn effects(name: &'static str, arguments: &'static [&'static str]) -> Figure {
    let shows = "what every parameter of a section does, low, as it is, high";
    Figure { name, shows, package: "papsynth", example: "effects", arguments }
}

const FIGURES: [Figure; 26] = [
    engine("1", "bacilli, leukocytes, speckles, objects out of focus", &["1"]),
    Figure { name: "3", shows: "drawn outlines", package: "fsd-shape", example: "sheet", arguments: &[] },
    Figure {
        name: "4",
        shows: "patches and their overlaps",
        package: "quilt-texture",
        example: "nucleus",
        arguments: &[],
    },
    engine("5", "a nucleus and its three donors", &["5"]),
    Figure { name: "6", shows: "the sheet in its outline", package: "cloth-verlet", example: "figure", arguments: &[] },
    engine("7", "levels of detail of a cytoplasm", &["7"]),
    engine("8", "weight maps and what they scatter", &["8"]),
    engine("9", "a cluster of leukocytes, step by step", &["9"]),
    Figure { name: "10", shows: "blur with depth", package: "optics-psf", example: "depth", arguments: &[] },
    engine("12", "a whole field", &["12"]),
    engine("13", "high-grade cells", &["13"]),
    Figure {
        name: "cells",
        shows: "every class of cell with its name",
        package: "papsynth",
        example: "picture_book",
        arguments: &["cells"],
    },
    Figure {
        name: "debris",
        shows: "every kind of debris with its name",
        package: "papsynth",
        example: "picture_book",
        arguments: &["debris"],
    },
    effects("effects-cells", &["cells"]),
    effects("effects-cytoplasm", &["cytoplasm"]),
    effects("effects-nucleus", &["nucleus"]),
    effects("effects-stain", &["stain"]),
    effects("effects-slide", &["slide"]),
    effects("effects-layout", &["layout"]),
    effects("effects-debris", &["debris"]),
    effects("effects-background", &["background"]),
    effects("effects-light", &["light"]),
    effects("effects-optics", &["optics"]),
    effects("effects-focus", &["focus"]),
    effects("effects-field", &["field"]),
    effects("effects-camera", &["camera"]),
];

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    let wanted = arguments.rest().into_iter().map(|word| {
        let figure = FIGURES.iter().find(|figure| figure.name == word).map(|figure| figure.name);
        figure.with_context(|| {
            let known: Vec<&str> = FIGURES.iter().map(|figure| figure.name).collect();
            format!("`{word}` is no figure that is redrawn; expected one of {}", known.join(", "))
        })
    });
    let wanted: Vec<&str> = wanted.collect::<Result<_>>()?;
    let folder = workspace.target.join("figures");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let mut table = String::new();
    for figure in FIGURES.iter().filter(|figure| wanted.is_empty() || wanted.contains(&figure.name)) {
        let Figure { name, shows, package, example, arguments } = figure;
        let path = folder.join(format!("fig-{name:0>2}.png"));
        let mut command = workspace.cargo();
        command
            .args(["run", "--release", "--package", package, "--example", example, "--"])
            .args(*arguments)
            .arg(&path);
        shell::run(&mut command)?;
        ensure!(path.exists(), "example `{example}` of `{package}` did not write {}", path.display());
        let own = arguments.iter().map(|word| format!("{word} ")).collect::<String>();
        let place = workspace.shown(&path);
        table.push_str(&format!(
            "Fig. {name:<18} {shows:<60} cargo run --release -p {package} --example {example} -- {own}{place}\n"
        ));
    }
    print!("{table}");
    Ok(Outcome::Done)
}

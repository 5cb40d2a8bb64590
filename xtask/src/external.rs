//! Whether other people's programs read what we write.

use std::path::Path;
use std::process::Command;

use anyhow::{Result, ensure};

use crate::arguments::Arguments;
use crate::outcome::Outcome;
use crate::python::Python;
use crate::workspace::Workspace;
use crate::{Chore, dataset, shell};

pub(crate) const CHORE: Chore = Chore {
    name: "external",
    usage: "",
    about: "has other people's programs read what we write, and judge our camera",
    details: "tifffile, ome-types, pycocotools and Pillow read small data sets; the reference implementation of EMVA 1288 measures \
              frames of the camera presets; libjpeg compresses what our JPEG did. Left out, with a sentence, where there is no Python or its packages cannot be had; a failure where CI is set.",
    run,
};

/// Readers that are not ours.
const PACKAGES: &str = "numpy\npillow\ntifffile\nimagecodecs\nome-types\npycocotools\n";

/// Those who measure cameras.
const MEASURERS: &str = "numpy\npillow\nemva1288==1.0.2\n";

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    let script = workspace.root.join("crates/papsynth-dataset/tests/external.py");
    ensure!(script.exists(), "{} is missing", workspace.shown(&script));
    let python = match Python::environment(workspace, "external", PACKAGES)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let folder = workspace.target.join("external");
    let small = ["--set", "field.width_px=400", "--set", "field.height_px=300"];
    let colour = ["--frames", "1", "--set", "light.kind=colour"];
    for (name, own) in [
        ("fields", ["--frames", "2"].as_slice()),
        ("stack", &["--frames", "1", "--set", "focus.planes=5"]),
        ("colour", &colour),
        ("colour-stack", &[colour.as_slice(), &["--set", "focus.planes=3"]].concat()),
        ("sixteen-bits", &["--frames", "1", "--camera", "scmos"]),
    ] {
        let out = folder.join(name);
        dataset::generate(workspace, &out, own.iter().chain(&small))?;
        shell::run(Command::new(&python).arg(&script).arg(&out))?;
    }
    measure(workspace)
}

/// Has our camera measured.
fn measure(workspace: &Workspace) -> Result<Outcome> {
    let python = match Python::environment(workspace, "emva", MEASURERS)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let tests = workspace.root.join("crates/ccd-noise/tests");
    let folder = workspace.target.join("external");
    let example = |name: &str, arguments: &[&Path]| {
        let mut cargo = workspace.cargo();
        cargo.args(["run", "--quiet", "--release", "--package", "ccd-noise", "--example", name, "--"]).args(arguments);
        shell::run(&mut cargo)
    };
    let cameras = ["orca-05g", "scmos"];
    for camera in cameras {
        example("emva1288", &[Path::new(camera), &folder.join(camera)])?;
    }
    let folders = cameras.map(|camera| folder.join(camera));
    shell::run(Command::new(&python).arg(tests.join("external_emva.py")).args(&folders))?;
    let jpeg = folder.join("jpeg");
    example("jpeg", &[&jpeg])?;
    shell::run(Command::new(&python).arg(tests.join("external_jpeg.py")).arg(&jpeg))?;
    Ok(Outcome::Done)
}

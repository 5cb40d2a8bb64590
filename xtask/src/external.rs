//! Whether other people's programs read what we write.

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
    about: "writes a small data set and has tifffile, ome-types, pycocotools and Pillow read it",
    details: "Left out, with a sentence, where there is no Python or its packages cannot be had; a failure where CI is set.",
    run,
};

/// Readers that are not ours.
const PACKAGES: &str = "numpy\npillow\ntifffile\nimagecodecs\nome-types\npycocotools\n";

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
    for (name, own) in
        [("fields", ["--frames", "2"].as_slice()), ("stack", &["--frames", "1", "--set", "focus.planes=5"])]
    {
        let out = folder.join(name);
        dataset::generate(workspace, &out, own.iter().chain(&small))?;
        shell::run(Command::new(&python).arg(&script).arg(&out))?;
    }
    Ok(Outcome::Done)
}

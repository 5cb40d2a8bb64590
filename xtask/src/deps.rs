//! Allowed dependencies between the crates of the workspace.

use anyhow::{Result, ensure};

use crate::workspace::{HEAVY_CRATES, Workspace};

/// Numerics with the same bits on every machine.
const NUMERICS: &[&str] = &["portable-numerics"];

const TECHNIQUES: &[&str] = &[
    "fsd-shape",
    "quilt-texture",
    "cloth-verlet",
    "voronoi-cytoskeleton",
    "perlin-bg",
    "spectral-field",
    "steerable-texture",
    "optics-psf",
    "dye-spectra",
    "ccd-noise",
];

const ENGINE: &[&str] = &["papsynth"];

/// Crates and their allowed dependencies within the workspace, including those of tests, from the bottom up. A new
/// crate needs a line here and a reason in ARCHITECTURE.md.
const RULES: [(&[&str], &[&[&str]]); 17] = [
    (NUMERICS, &[]),
    (TECHNIQUES, &[NUMERICS]),
    (ENGINE, &[NUMERICS, TECHNIQUES]),
    // Independent of the contents of the files.
    (&["papsynth-zarr"], &[]),
    (&["papsynth-dataset"], &[ENGINE, &["papsynth-zarr"]]),
    // The judge must be independent of the engine.
    (&["papsynth-judge"], &[NUMERICS]),
    // Shows files from any source.
    (&["papsynth-study"], &[NUMERICS, &["papsynth-dataset"]]),
    // Fits with the techniques, finds regions like the reader of label images, and writes sections of recipes.
    (&["papsynth-calibrate"], &[NUMERICS, TECHNIQUES, ENGINE, &["papsynth-dataset"]]),
    // Simulates with the engine and measures with the judge.
    (&["papsynth-match"], &[NUMERICS, ENGINE, &["papsynth-judge", "dye-spectra"]]),
    // Shows files and a study; the workbench shows images of the engine and their match to images of the user.
    (&["papsynth-web"], &[ENGINE, &["papsynth-dataset", "papsynth-judge", "papsynth-match", "papsynth-study"]]),
    // Passes requests of a page without a server to the workbench.
    (&["papsynth-wasm"], &[ENGINE, &["papsynth-web"]]),
    // Translates errors of the techniques to options of `papsynth calibrate`.
    (&["papsynth-cli"], &[TECHNIQUES, ENGINE, FRONT, &["papsynth-match", "papsynth-study", "papsynth-web"]]),
    // The same for Python.
    (&["papsynth-python"], &[TECHNIQUES, ENGINE, FRONT, &["papsynth-match"]]),
    // Measures public functions.
    (&["papsynth-benches"], &[TECHNIQUES, ENGINE, &["papsynth-dataset"]]),
    // Runs without files and threads; the engine does not use all techniques.
    (&["papsynth-hashes"], &[TECHNIQUES, ENGINE]),
    // Reads files only, and runs the program.
    (&["papsynth-site"], &[]),
    (&["xtask"], &[]),
];

/// Crates that both the program and the Python package expose.
const FRONT: &[&str] = &["papsynth-dataset", "papsynth-judge", "papsynth-calibrate"];

/// Returns the names of the crates without files and threads.
pub(crate) fn pure_crates() -> impl Iterator<Item = &'static str> {
    [NUMERICS, TECHNIQUES, ENGINE].concat().into_iter()
}

pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    let mut problems = Vec::new();
    for name in RULES.iter().flat_map(|(crates, _)| *crates) {
        let package = workspace.packages.iter().find(|package| package.name == *name);
        let allowed = package.map(|package| Vec::from_iter(package.members()).join(", ")).unwrap_or_default();
        println!("{name:<22} depends on {}", if allowed.is_empty() { "-" } else { &allowed });
    }
    for package in &workspace.packages {
        let name = &package.name;
        problems.extend(package.members().into_iter().filter_map(|member| problem(name, member)));
        if !RULES.iter().any(|(crates, _)| crates.contains(&name.as_str())) {
            problems.push(format!("crate `{name}` has no rule: add one to xtask/src/deps.rs"));
        }
        if package.folder().starts_with(workspace.root.join("crates")) {
            // The default members are all crates except the heavy ones.
            match (HEAVY_CRATES.contains(&name.as_str()), workspace.usual.contains(&package.id)) {
                (true, true) => {
                    problems.push(format!("`{name}` is heavy: remove it from the default-members in Cargo.toml"))
                }
                (false, false) => {
                    problems.push(format!("`{name}` is not heavy: add it to the default-members in Cargo.toml"))
                }
                _ => {}
            }
        }
    }
    ensure!(problems.is_empty(), "{}", problems.join("\n       "));
    Ok(())
}

/// Returns a message if a crate must not depend on another.
fn problem(name: &str, member: &str) -> Option<String> {
    let rule = RULES.iter().find(|(crates, _)| crates.contains(&name));
    let is_allowed = rule.is_some_and(|(_, allowed)| allowed.iter().any(|crates| crates.contains(&member)));
    (!is_allowed).then(|| format!("`{name}` must not depend on `{member}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crates_depend_only_on_crates_below_them() {
        for (name, member) in [("papsynth", "ccd-noise"), ("papsynth-cli", "papsynth-dataset")] {
            assert_eq!(problem(name, member), None);
        }
        for (name, member) in [
            ("ccd-noise", "optics-psf"),
            ("papsynth", "papsynth-dataset"),
            ("papsynth-dataset", "papsynth-cli"),
            ("xtask", "papsynth"),
            ("papsynth-unknown", "papsynth"),
        ] {
            assert_eq!(problem(name, member), Some(format!("`{name}` must not depend on `{member}`")));
        }
    }
}

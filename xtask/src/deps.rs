//! Who may know whom.

use anyhow::{Result, ensure};

use crate::workspace::{HEAVY_CRATES, Workspace};

/// What has the same bits everywhere: functions, random draws, transforms.
const NUMERICS: &[&str] = &["portable-numerics"];

const TECHNIQUES: &[&str] = &[
    "fsd-shape",
    "quilt-texture",
    "cloth-verlet",
    "voronoi-cytoskeleton",
    "perlin-bg",
    "spectral-field",
    "optics-psf",
    "dye-spectra",
    "ccd-noise",
];

const ENGINE: &[&str] = &["papsynth"];

/// Which crates may depend on which others, tests included, from the bottom up. Every crate has its place here; a new one needs a line,
/// and a reason in ARCHITECTURE.md.
const RULES: [(&[&str], &[&[&str]]); 15] = [
    (NUMERICS, &[]),
    (TECHNIQUES, &[NUMERICS]),
    (ENGINE, &[NUMERICS, TECHNIQUES]),
    // It knows how a kind of file is laid out, and nothing of what lies in it.
    (&["papsynth-zarr"], &[]),
    (&["papsynth-dataset"], &[ENGINE, &["papsynth-zarr"]]),
    // Who judges must not know what is judged.
    (&["papsynth-judge"], &[NUMERICS]),
    // It shows files, whoever made them.
    (&["papsynth-study"], &[NUMERICS, &["papsynth-dataset"]]),
    // It fits with techniques, finds regions as label images are read, and writes sections of recipes.
    (&["papsynth-calibrate"], &[NUMERICS, TECHNIQUES, ENGINE, &["papsynth-dataset"]]),
    // It shows files and a study, and groups of truth are the engine's.
    (&["papsynth-web"], &[ENGINE, &["papsynth-dataset", "papsynth-study"]]),
    // It simulates with the one and measures with the other.
    (&["papsynth-match"], &[NUMERICS, ENGINE, &["papsynth-judge"]]),
    // Errors of the techniques name options of its calibration.
    (&["papsynth-cli"], &[TECHNIQUES, ENGINE, FRONT, &["papsynth-match", "papsynth-study", "papsynth-web"]]),
    // Another front: what the program is to a shell.
    (&["papsynth-python"], &[TECHNIQUES, ENGINE, FRONT]),
    // They time what is called from outside.
    (&["papsynth-benches"], &[TECHNIQUES, ENGINE, &["papsynth-dataset"]]),
    // It must run where files and threads do not.
    (&["papsynth-hashes"], &[ENGINE]),
    (&["xtask"], &[]),
];

/// What both fronts give to their users.
const FRONT: &[&str] = &["papsynth-dataset", "papsynth-judge", "papsynth-calibrate"];

/// The crates that know techniques alone, for chores that build them without the rest.
pub(crate) fn pure_crates() -> impl Iterator<Item = &'static str> {
    [NUMERICS, TECHNIQUES, ENGINE].concat().into_iter()
}

pub(crate) fn run(workspace: &Workspace) -> Result<()> {
    let mut faults = Vec::new();
    for name in RULES.iter().flat_map(|(crates, _)| *crates) {
        let package = workspace.packages.iter().find(|package| package.name == *name);
        let known = package.map(|package| Vec::from_iter(package.members()).join(", ")).unwrap_or_default();
        println!("{name:<22} knows {}", if known.is_empty() { "-" } else { &known });
    }
    for package in &workspace.packages {
        let name = &package.name;
        faults.extend(package.members().into_iter().filter_map(|member| fault(name, member)));
        if !RULES.iter().any(|(crates, _)| crates.contains(&name.as_str())) {
            faults.push(format!("crate `{name}` has no place in the house yet: xtask/src/deps.rs"));
        }
        if package.folder().starts_with(workspace.root.join("crates")) {
            // Cargo builds all crates unasked but the heavy ones.
            match (HEAVY_CRATES.contains(&name.as_str()), workspace.usual.contains(&package.id)) {
                (true, true) => {
                    faults.push(format!("`{name}` is heavy and must not be among the default-members: Cargo.toml"))
                }
                (false, false) => faults.push(format!("`{name}` must be among the default-members: Cargo.toml")),
                _ => {}
            }
        }
    }
    ensure!(faults.is_empty(), "{}", faults.join("\n       "));
    Ok(())
}

/// Why a crate must not depend on another, if it must not.
fn fault(name: &str, member: &str) -> Option<String> {
    let rule = RULES.iter().find(|(crates, _)| crates.contains(&name));
    let is_fine = rule.is_some_and(|(_, known)| known.iter().any(|crates| crates.contains(&member)));
    (!is_fine).then(|| format!("`{name}` must not depend on `{member}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crates_know_those_below_them_alone() {
        for (name, member) in [("papsynth", "ccd-noise"), ("papsynth-cli", "papsynth-dataset")] {
            assert_eq!(fault(name, member), None);
        }
        for (name, member) in [
            ("ccd-noise", "optics-psf"),
            ("papsynth", "papsynth-dataset"),
            ("papsynth-dataset", "papsynth-cli"),
            ("xtask", "papsynth"),
            ("papsynth-stranger", "papsynth"),
        ] {
            assert_eq!(fault(name, member), Some(format!("`{name}` must not depend on `{member}`")));
        }
    }
}

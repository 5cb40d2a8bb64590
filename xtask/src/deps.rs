//! Who may know whom.

use anyhow::{Result, bail};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::workspace::{HEAVY, Package, Workspace};

pub(crate) const CHORE: Chore = Chore {
    name: "deps",
    usage: "",
    about: "checks who depends on whom in the workspace, and draws it",
    details: "The numerics know no one here, technique crates the numerics alone, the engine knows both, the data set the engine and kinds of files, which know \
              no one, the study and the calibration the data set, the pages the data set and the study, the judge nobody, who reads recipes the engine, the program and the Python package all of them, the benches what they time, the hashes the engine, the chores nobody. Dependencies of tests count too, so \
              that every crate can be taken, tested and published alone.",
    run,
};

/// The place of a crate in the house.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    /// What has the same bits everywhere: functions, random draws, transforms.
    Numerics,
    Technique,
    Engine,
    /// Knows how a kind of file is laid out, and nothing of what is in it.
    Container,
    Dataset,
    Judge,
    Match,
    Study,
    /// Pages in a browser on the same machine.
    Web,
    /// Measures microscopes and cameras.
    Calibrate,
    Program,
    /// Another front: what the program is to a shell.
    Python,
    Benches,
    Hashes,
    Chores,
}

/// Every crate has its place here; a new one needs a line, and a reason in ARCHITECTURE.md.
const PLACES: [(&str, Role); 23] = [
    ("portable-numerics", Role::Numerics),
    ("fsd-shape", Role::Technique),
    ("quilt-texture", Role::Technique),
    ("cloth-verlet", Role::Technique),
    ("voronoi-cytoskeleton", Role::Technique),
    ("perlin-bg", Role::Technique),
    ("spectral-field", Role::Technique),
    ("optics-psf", Role::Technique),
    ("dye-spectra", Role::Technique),
    ("ccd-noise", Role::Technique),
    ("papsynth", Role::Engine),
    ("papsynth-zarr", Role::Container),
    ("papsynth-dataset", Role::Dataset),
    ("papsynth-judge", Role::Judge),
    ("papsynth-study", Role::Study),
    ("papsynth-calibrate", Role::Calibrate),
    ("papsynth-web", Role::Web),
    ("papsynth-match", Role::Match),
    ("papsynth-cli", Role::Program),
    ("papsynth-python", Role::Python),
    ("papsynth-benches", Role::Benches),
    ("papsynth-hashes", Role::Hashes),
    ("xtask", Role::Chores),
];

impl Role {
    fn of(name: &str) -> Option<Self> {
        PLACES.iter().find(|(crate_name, _)| *crate_name == name).map(|(_, role)| *role)
    }

    /// Whom a crate in this place may depend on.
    fn may_know(self) -> &'static [Self] {
        match self {
            // Who judges must not know what is judged, nor a kind of file what lies in it.
            Self::Numerics | Self::Container | Self::Chores => &[],
            Self::Technique | Self::Judge => &[Self::Numerics],
            Self::Engine => &[Self::Numerics, Self::Technique],
            // It must run where files and threads do not.
            Self::Hashes => &[Self::Engine],
            Self::Dataset => &[Self::Engine, Self::Container],
            // It simulates with the one and measures with the other.
            Self::Match => &[Self::Numerics, Self::Engine, Self::Judge],
            // It shows files, whoever made them.
            Self::Study => &[Self::Numerics, Self::Dataset],
            // It shows files and a study, and groups of truth are the engine's.
            Self::Web => &[Self::Engine, Self::Dataset, Self::Study],
            // It fits with techniques, finds regions as label images are read, and writes sections of recipes.
            Self::Calibrate => &[Self::Numerics, Self::Technique, Self::Engine, Self::Dataset],
            // They time what is called from outside.
            Self::Benches => &[Self::Technique, Self::Engine, Self::Dataset],
            // Errors of the techniques name options of its calibration.
            Self::Program => &[
                Self::Technique,
                Self::Engine,
                Self::Dataset,
                Self::Judge,
                Self::Match,
                Self::Calibrate,
                Self::Study,
                Self::Web,
            ],
            Self::Python => &[Self::Technique, Self::Engine, Self::Dataset, Self::Calibrate, Self::Judge],
        }
    }
}

/// The crates that know techniques alone, for chores that build them without the rest.
pub(crate) fn pure_crates(workspace: &Workspace) -> impl Iterator<Item = &str> {
    let names = workspace.packages.iter().map(|package| package.name.as_str());
    names.filter(|name| matches!(Role::of(name), Some(Role::Numerics | Role::Technique | Role::Engine)))
}

fn run(workspace: &Workspace, arguments: Arguments) -> Result<Outcome> {
    arguments.finish()?;
    print!("{}", picture(&workspace.packages));
    let mut faults = faults(&workspace.packages);
    faults.extend(unusual(workspace));
    if !faults.is_empty() {
        bail!("{}", faults.join("\n       "));
    }
    Ok(Outcome::Done)
}

/// Where the members that Cargo builds unasked are not all crates but the heavy ones.
fn unusual(workspace: &Workspace) -> impl Iterator<Item = String> {
    let crates = workspace.root.join("crates");
    workspace.packages.iter().filter(move |package| package.folder.starts_with(&crates)).filter_map(|package| {
        let name = &package.name;
        let is_heavy = HEAVY.iter().any(|heavy| heavy.package == Some(name));
        match (is_heavy, workspace.usual.contains(name)) {
            (true, true) => Some(format!("`{name}` is heavy and must not be among the default-members: Cargo.toml")),
            (false, false) => Some(format!("`{name}` must be among the default-members: Cargo.toml")),
            _ => None,
        }
    })
}

/// Everything that is against the rules.
fn faults(packages: &[Package]) -> Vec<String> {
    let mut faults = Vec::new();
    for package in packages {
        let Some(role) = Role::of(&package.name) else {
            faults.push(format!("crate `{}` has no place in the house yet: xtask/src/deps.rs", package.name));
            continue;
        };
        for member in &package.members {
            if !Role::of(member).is_some_and(|known| role.may_know().contains(&known)) {
                faults.push(format!("`{}` ({role:?}) must not depend on `{member}`", package.name));
            }
        }
    }
    faults
}

/// The crates from the bottom up, each with those it depends on.
fn picture(packages: &[Package]) -> String {
    let mut lines = String::new();
    for (name, _) in PLACES {
        if let Some(package) = packages.iter().find(|package| package.name == name) {
            let known = if package.members.is_empty() { "-".to_owned() } else { package.members.join(", ") };
            lines.push_str(&format!("{name:<22} knows {known}\n"));
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package(name: &str, members: &[&str]) -> Package {
        let members = members.iter().map(|&member| member.to_owned()).collect();
        Package {
            name: name.to_owned(),
            id: name.to_owned(),
            features: Vec::new(),
            folder: "/".into(),
            members,
            targets: Vec::new(),
        }
    }

    #[test]
    fn a_dependency_downwards_is_fine() {
        let packages = [
            package("ccd-noise", &[]),
            package("papsynth", &["ccd-noise"]),
            package("papsynth-dataset", &["papsynth"]),
            package("papsynth-cli", &["papsynth", "papsynth-dataset"]),
        ];
        assert!(faults(&packages).is_empty());
    }

    #[test]
    fn a_dependency_upwards_or_sideways_and_a_stranger_are_named() {
        let packages = [
            package("ccd-noise", &["optics-psf"]),
            package("papsynth", &["papsynth-dataset"]),
            package("papsynth-dataset", &["papsynth-cli"]),
            package("xtask", &["papsynth"]),
            package("papsynth-stranger", &[]),
        ];
        let faults = faults(&packages);
        assert_eq!(faults.len(), 5, "{faults:?}");
        assert!(faults[0].contains("`ccd-noise` (Technique) must not depend on `optics-psf`"));
        assert!(faults[4].contains("`papsynth-stranger` has no place"));
    }
}

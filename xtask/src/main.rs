//! Chores of the workspace: `cargo xtask` lists them, `cargo xtask CHORE --help` explains one.
//!
//! Cargo and rustc do all the work. Nothing here knows what a cell is.

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "a program that talks to whoever called it")]

mod bench;
mod browser;
mod ci;
mod dataset;
mod deps;
mod equations;
mod external;
mod figures;
mod hashes;
mod package;
mod peers;
mod python;
mod realism;
mod shell;
mod supply;
mod test;
mod workspace;

use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;

use crate::shell::Skipped;
use crate::workspace::Workspace;

/// Chores of the papsynth workspace
#[derive(Parser)]
#[command(bin_name = "cargo xtask", max_term_width = 100)]
#[command(
    after_help = "What needs something that a machine lacks and cannot install (Python and its packages, Chromium, Node, valgrind, \
                        Slurm, a target of rustc) is left out, with a sentence; where CI is set, that is a failure."
)]
enum Chore {
    /// Writes eight labelled fields and one focus stack of the default recipe, and says where to look
    ///
    /// Builds the program `papsynth` in release, without what data sets do not need (judge, study, viewer, calibration), and writes to
    /// target/dataset, anew each time: fields of 1376 x 1038 pixels, and a stack of 11 planes, 0.8 µm apart.
    Dataset,
    /// Runs the whole test suite: laws, oracles, golden images, doc tests, programs
    ///
    /// Tests run with cargo-nextest if it is installed, otherwise with `cargo test`. Both take a part of a name
    /// (`cargo xtask test golden::`) and select targets (`cargo xtask test --lib`). With arguments, doc tests do not run. Examples are
    /// not built: the lints check them. Without PAPSYNTH_REFERENCE, the folder of the real material, the tests that need it are left
    /// out and say so. Crates that take long to build are left to `cargo xtask ci --full`.
    Test {
        /// Arguments of `cargo test`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Compares the golden images of every stage in fixtures/golden, or writes them anew
    Golden {
        /// Writes the images: what they show is then what is right, so look at them, and give the change a line under Results in
        /// CHANGELOG.md
        #[arg(long)]
        bless: bool,
    },
    /// Compares hashes of what small recipes give with fixtures/hashes.txt, or writes them anew
    ///
    /// Pixels, light, labels, truth and scenes of twenty recipes, made by the program papsynth-hashes on this machine, with and without
    /// the instructions for which its C library has other functions; `cargo xtask wasm` has the same made in wasm32.
    Hashes {
        /// Writes them: for changes of what a recipe gives, which have a line under Results in CHANGELOG.md
        #[arg(long)]
        bless: bool,
        /// Also compiles for the plainest, a usual and the newest processor, and for aarch64, which qemu-user runs
        #[arg(long, conflicts_with = "bless")]
        full: bool,
    },
    Bench(bench::Bench),
    /// Redraws the paper's Figs. 1, 3-10, 12 and 13 with our own material, a picture book of cells and debris, and the effect of every
    /// parameter: all, or those that are given, as target/figures/fig-01.png and so on
    Figures {
        #[arg(value_name = "FIGURE", value_parser = figures::names())]
        wanted: Vec<String>,
    },
    /// Fits recipes to one half of the real fields and has the other half judge what they make
    ///
    /// Needs PAPSYNTH_REFERENCE. Every other field of each grade is matched, the others judge: the default recipes and the matched ones,
    /// grade by grade. A pixel forest trained on synthetic fields looks for the nuclei of a real one (scikit-learn). Reports are written
    /// to target/realism; the table is printed and written there too. Takes about half an hour on 2 cores.
    Realism {
        /// Fits less long: a third of the time
        #[arg(long)]
        quick: bool,
    },
    /// Lists the equations of the paper, each at its item, and fails if one is cited nowhere
    ///
    /// Read from the documentation of every item in crates/*/src: "Eq. 4", "Eqs. 1, 2", "Eqs. 8 to 10". Comments are the lines that
    /// compute the equation. Fields of structs are parameters and do not count, nor does an equation of another source, which has its
    /// DOI before it.
    Equations,
    /// Checks who depends on whom in the workspace, tests included, and draws it
    ///
    /// The rules stand in xtask/src/deps.rs, the reasons in ARCHITECTURE.md.
    Deps,
    /// Has other people's programs read what we write, and judge our camera
    ///
    /// tifffile, ome-types, pycocotools, webdataset, shapely and Pillow read small data sets, one of them in every format, and the
    /// Python of docs/formats runs; the reference implementation of EMVA 1288 measures frames of the camera presets; libjpeg compresses
    /// what our JPEG did.
    External {
        /// Also mlcroissant, pyarrow, datasets, OpenCV, zarr-python, tensorstore, ome-zarr-models, ome-zarr, the loaders of Cellpose and
        /// StarDist and, where there is a Java, Bio-Formats; the bill of materials is held against the schema of CycloneDX, too
        #[arg(long)]
        full: bool,
    },
    /// Goes through `papsynth study` and `papsynth view` in headless Chromium, with keyboard and mouse
    ///
    /// The study shortened, with the page and the program started anew in the middle; holds results against what was clicked, and looks
    /// that nothing left loopback and no answer was in what was sent. The viewer on a focus stack: what is on the canvas is held against
    /// its pixels and its tables. Screenshots go to target/browser. Root on Debian installs Chromium where it is missing.
    Browser,
    /// Checks the transforms, the technique crates and the engine for wasm32, and compares hashes of what they give there, run by Node
    Wasm,
    /// Packs every crate and builds it from its package, as a publication would; publishes nothing
    Publish,
    /// Checks licences, sources and duplicate versions of dependencies against deny.toml
    ///
    /// Runs cargo-deny, which is installed to target/tools. Without arguments it runs `cargo deny check bans licenses sources`, which
    /// needs no other files than those of Cargo; `cargo xtask deny advisories` downloads the database of advisories.
    Deny {
        /// Arguments of `cargo deny check`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Writes the bill of materials of the program, as CycloneDX, to the target folder
    ///
    /// CycloneDX 1.5 in JSON, by cargo-cyclonedx, which is installed to target/tools: every crate that `papsynth` is built of, on any
    /// platform, with version, licence, SHA-256 and what it depends on. It holds no dates, serial numbers or paths: the same Cargo.lock
    /// gives the same bytes.
    Sbom,
    /// Builds the Python package, installs it where nothing else is, and holds what it gives against what the command line writes
    ///
    /// The wheel goes to target/wheels.
    Python,
    /// Makes one data set with Ray, Dask, Slurm and in an object store, whose workers, drivers and daemons are killed
    ///
    /// The root hash must be that of one process. The object store is one on this machine that refuses requests and loses answers. Slurm
    /// is installed by root on Debian, started by the test itself below /tmp, and ended.
    Cluster,
    /// Builds what is given away, in target/releases: a wheel for glibc 2.28 and a static program, and tries both
    ///
    /// The program depends on no library of the system (x86_64-unknown-linux-musl); what it writes must be what the wheel makes. By
    /// hand, before a release: both are built from nothing. Linux on x86-64 alone.
    Releases,
    /// Everything that has to pass before a change is taken, at most 20 minutes on 2 cores from nothing
    ///
    /// Formatting, lints, the test suite with its golden images, documentation, the rules of this workspace, instruction counts, a data
    /// set, other people's readers, the study and the viewer in a browser, wasm32. All steps run even if one fails; each tells its time.
    Ci {
        /// Also the crates that take long to build, every reader there is, licences, packages, Python, clusters, and what other
        /// processors give: required before a release and after a change to a file that it covers. Every run without --full ends with
        /// the names of the covered files that differ from the commit at which --full last passed, which is recorded in the target
        /// folder
        #[arg(long)]
        full: bool,
    },
    /// What takes too long for every change: kills, turned bits, a full disk, changed inputs, memory, cut slides, a million draws
    ///
    /// A thousand bits of a data set in every format are turned over, one at a time, it is cut a hundred times and loses each of its
    /// files, and all must be found. Every field of a recipe gets whatever it cannot be. Estimates of memory are held against what is
    /// needed. By hand, before a release: with the usual numbers it takes three quarters of an hour on 2 cores.
    Torture(test::Torture),
}

fn main() -> ExitCode {
    let Err(error) = run(Chore::parse()) else { return ExitCode::SUCCESS };
    if error.is::<Skipped>() {
        println!("skipped: {error}");
        return ExitCode::SUCCESS;
    }
    eprintln!("error: {error:#}");
    ExitCode::FAILURE
}

fn run(chore: Chore) -> Result<()> {
    let workspace = &Workspace::load()?;
    // For programs that understand them themselves, a `--` among them.
    let words: Vec<String> = std::env::args().skip(2).collect();
    match chore {
        Chore::Dataset => dataset::run(workspace),
        Chore::Test { .. } => test::suite(workspace, Workspace::cargo_light, &words),
        Chore::Golden { bless } => test::golden(workspace, bless),
        Chore::Hashes { bless, full } => hashes::run(workspace, bless, full),
        Chore::Bench(arguments) => bench::run(workspace, arguments),
        Chore::Figures { wanted } => figures::run(workspace, &wanted),
        Chore::Realism { quick } => realism::run(workspace, quick),
        Chore::Equations => equations::run(workspace),
        Chore::Deps => deps::run(workspace),
        Chore::External { full } => external::run(workspace, full),
        Chore::Browser => browser::run(workspace),
        Chore::Wasm => hashes::wasm(workspace),
        Chore::Publish => supply::publish(workspace),
        Chore::Deny { .. } => supply::deny(workspace, &words),
        Chore::Sbom => supply::sbom(workspace),
        Chore::Python => package::run(workspace),
        Chore::Cluster => package::cluster(workspace),
        Chore::Releases => package::releases(workspace),
        Chore::Ci { full } => ci::run(workspace, full),
        Chore::Torture(numbers) => test::torture(workspace, &numbers),
    }
}

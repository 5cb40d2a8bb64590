//! `papsynth calibrate`: a user's own images in, numbers of their microscope and camera out.

mod edge;
mod find;
mod flat;
mod fragment;
mod plot;
mod record;
mod stack;

use std::path::Path;

use optics_psf::{Error, Microscope, MicroscopeParams};
use papsynth_dataset::write_file;

use crate::args::Calibrate;
use crate::exit::{self, Complaint, Failure};
use crate::text_file::may_replace;
use record::{Instrument, Record};

const RECORD: &str = "calibration.json";

/// Files that may be written, and how those begin that may be replaced.
const FILES: [(&str, &[u8], &str); 7] = [
    ("focus.svg", plot::BEGINS, "an older plot"),
    ("edge.svg", plot::BEGINS, "an older plot"),
    ("photon-transfer.svg", plot::BEGINS, "an older plot"),
    ("optics.toml", fragment::BEGINS, "an older calibration"),
    ("optics-gaussian.toml", fragment::BEGINS, "an older calibration"),
    ("camera.toml", fragment::BEGINS, "an older calibration"),
    (RECORD, record::BEGINS, "an older calibration"),
];

pub(crate) fn run(args: &Calibrate) -> Result<(), Failure> {
    for (name, begins, what) in FILES {
        may_replace(&args.out.join(name), begins, what)?;
    }
    if args.out.exists() && !args.out.is_dir() {
        let message = format!("--out {}: there is a file of this name; expected a folder", args.out.display());
        return Err(Failure::input(Complaint::new(message)));
    }
    let instrument = instrument(args)?;
    let older = Record::load(&args.out.join(RECORD))?;
    if let Some(older) = &older {
        same_microscope(instrument.as_ref(), older, &args.out)?;
    }
    let mut record = Record::new();
    record.microscope = instrument;
    let mut files: Vec<(&str, String)> = Vec::new();
    let mut report = Vec::new();
    if !args.stack.is_empty() {
        let found = stack::measure(args, record.microscope.as_ref())?;
        report.push(stack::table(&found, args.pixel_um));
        files.push(("focus.svg", plot::focus(&found, args.pixel_um)));
        record.focus = Some(found);
    }
    if let Some(path) = &args.edge {
        let found = edge::measure(args, path)?;
        report.push(edge::table(&found.record, args.pixel_um));
        files.push(("edge.svg", plot::edge(&found, args.pixel_um)));
        record.edge = Some(found.record);
    }
    if let Some(folder) = &args.flat {
        let found = flat::measure(args, folder)?;
        report.push(flat::table(&found));
        files.push(("photon-transfer.svg", plot::photon_transfer(&found)));
        record.camera = Some(found);
    }
    if let Some(older) = older {
        record.keep(older);
    }
    files.extend(fragment::bright_field(&record)?.map(|text| ("optics.toml", text)));
    files.extend(fragment::gaussian(&record).map(|text| ("optics-gaussian.toml", text)));
    files.extend(fragment::camera(&record).map(|text| ("camera.toml", text)));
    files.push((RECORD, record.to_json()));
    report.push(written(args, &files));
    for (name, text) in &files {
        write_file(&args.out.join(name), text.as_bytes())?;
    }
    exit::print(&report.join("\n"))
}

/// What is known of the microscope; nothing where the size of a pixel is not.
fn instrument(args: &Calibrate) -> Result<Option<Instrument>, Failure> {
    let default = MicroscopeParams::default();
    let instrument = Instrument {
        na: args.na,
        wavelength_um: args.wavelength_um,
        mount_index: args.mount_index,
        immersion_index: args.immersion_index,
        pixel_um: args.pixel_um.unwrap_or(default.pixel_um),
    };
    let na = default.condenser_na.min(instrument.na);
    match Microscope::new(&instrument.params(na)) {
        Ok(_) => Ok(args.pixel_um.map(|_| instrument)),
        Err(Error::OutOfRange { field, value, accepted }) => {
            let accepted = accepted.replace('_', "-");
            let message = format!("--{} is {value}; it must be {accepted}", field.replace('_', "-"));
            Err(Failure::input(Complaint::new(message)))
        }
        Err(other) => Err(Failure::input(Complaint::new(other.to_string()))),
    }
}

/// One folder is of one microscope: what it holds from before must fit.
fn same_microscope(instrument: Option<&Instrument>, older: &Record, out: &Path) -> Result<(), Failure> {
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
            let message =
                format!("{}: was measured with {option} {old}; this command has {new}", out.join(RECORD).display());
            let help = format!("give {option} {old}, or another folder with --out");
            Err(Failure::input(Complaint::new(message).help(help)))
        }
    }
}

/// What was written, and what could not be for want of a length.
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
            "Not in micrometres, so not all could go into a recipe: give {}\n",
            missing.join(" and ")
        ));
    }
    text
}

//! `--flat`: gain, noise and non-uniformity of a camera, by photon transfer.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use ccd_noise::Error;
use ccd_noise::calibrate::{Calibration, CalibrationParams, Level, Light, PhotonTransfer, Saturation, Shading};
use papsynth_dataset::read::{GreyImage, Limits, image_files, natural_order};

use super::record::{CameraRecord, LevelRecord, SaturationRecord};
use crate::args::Calibrate;
use crate::exit::{Complaint, Failure};

/// The subfolder of dark frames.
const DARK: &str = "dark";

/// Side of the square whose mean is taken for shading, px; frames must be larger.
const SHADING_PX: usize = 15;

/// How much lighter than the dark the brightest flat must be, as a part of all grey levels: below it, noise of the
/// measurement would pass for a gain.
const LEAST_LIGHT: f64 = 0.01;

/// Frames that make a level.
const PAIR: usize = 2;

/// Files of one level of light.
struct Exposure {
    name: String,
    files: Vec<PathBuf>,
    light: Light,
}

pub(super) fn measure(args: &Calibrate, folder: &Path) -> Result<CameraRecord, Failure> {
    let exposures = exposures(folder, args.dark.as_deref())?;
    let refuse = |message: String, help: &str| Failure::input(Complaint::new(message).help(help));
    let mut transfer: Option<PhotonTransfer> = None;
    let mut size = None;
    let mut levels = Vec::new();
    let mut bits = 0;
    for Exposure { name, files, light } in &exposures {
        // One level at a time: nobody's memory holds them all.
        let frames =
            files.iter().map(|file| GreyImage::read(file, &Limits::default())).collect::<Result<Vec<_>, _>>()?;
        for (file, frame) in files.iter().zip(&frames) {
            let found = [frame.width, frame.height()];
            let [width, height] = *size.get_or_insert(found);
            if found != [width, height] {
                let message =
                    format!("{}: {} x {} pixels, others {width} x {height}", file.display(), found[0], found[1]);
                return Err(refuse(message, "all flats and darks must be of one size"));
            }
            if width.min(height) <= SHADING_PX {
                let message = format!("{}: {width} x {height} pixels", file.display());
                return Err(refuse(message, "flats must be more than 15 pixels wide and high"));
            }
        }
        let transfer = match &mut transfer {
            Some(transfer) => transfer,
            none => {
                bits = depth(args, frames.first().map_or(u16::MAX, |frame| frame.white), folder)?;
                let params = CalibrationParams {
                    bit_depth: bits,
                    shading: Shading::Removed { side_px: SHADING_PX },
                    ..CalibrationParams::default()
                };
                none.insert(
                    PhotonTransfer::new(&params).map_err(|error| refuse(format!("--bits: {error}"), "8 to 16"))?,
                )
            }
        };
        let slices: Vec<&[u16]> = frames.iter().map(|frame| frame.grey.as_slice()).collect();
        let width = size.map_or(1, |[width, _]| width);
        match transfer.add(&slices, width, *light) {
            Ok(level) => levels.push(record(name, level)),
            Err(Error::OutOfRange { field: "frames", value, .. }) => {
                let message = format!("--bits is {bits}, but {name} holds the grey level {value}");
                return Err(refuse(message, "give the bits of the camera's converter, 8 to 16"));
            }
            Err(error) => {
                return Err(refuse(format!("{name}: {error}"), "a level is two frames or more of the same light"));
            }
        }
    }
    let found = transfer.map_or(Err(Error::NoDark), |transfer| transfer.calibration());
    let calibration = found.map_err(|error| {
        let help = match error {
            Error::NoDark => "give their folder with --dark, or name it `dark` inside that of --flat",
            Error::Saturated { .. } => "take flats from near dark to the brightest, each level two frames or more",
            _ => "the levels of flats must lie well above the dark, at different brightness",
        };
        refuse(format!("--flat {}: {error}", folder.display()), help)
    })?;
    let full = (f64::from(u16::MAX >> (u16::BITS - bits)) - calibration.offset_dn).max(0.0);
    let brightest = levels.iter().map(|level| level.mean_dn - calibration.offset_dn).fold(0.0, f64::max);
    if brightest < LEAST_LIGHT * full {
        let message = format!(
            "--flat {}: the brightest level is {brightest:.1} grey levels above the dark; expected at least 1 % of all, \
             {:.0}",
            folder.display(),
            LEAST_LIGHT * full
        );
        return Err(refuse(message, "take flats from near dark to the brightest"));
    }
    levels.sort_by(|a, b| a.mean_dn.total_cmp(&b.mean_dn));
    Ok(camera(&calibration, levels))
}

/// The folder's levels of light, dark first.
fn exposures(folder: &Path, dark: Option<&Path>) -> Result<Vec<Exposure>, Failure> {
    let refuse = |message: String, help: &str| Failure::input(Complaint::new(message).help(help));
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder).map_err(|error| Failure::file("read", folder, &error))? {
        let path = entry.map_err(|error| Failure::file("read", folder, &error))?.path();
        if path.is_dir() && !name(&path).starts_with('.') {
            folders.push(path);
        }
    }
    folders.sort_by(|a, b| natural_order(&name(a), &name(b)));
    let inside = folders.iter().position(|path| name(path).eq_ignore_ascii_case(DARK)).map(|at| folders.remove(at));
    let dark = match (dark, inside) {
        (Some(given), None) => given.to_owned(),
        (None, Some(inside)) => inside,
        (Some(_), Some(inside)) => {
            let message = format!("--dark: the folder of --flat has dark frames of its own, {}", inside.display());
            return Err(refuse(message, "leave out --dark, or take that folder away"));
        }
        (None, None) => {
            let message = format!("--flat {}: {}", folder.display(), Error::NoDark);
            return Err(refuse(message, "give their folder with --dark, or name it `dark` inside that of --flat"));
        }
    };
    let mut exposures = vec![Exposure { name: dark.display().to_string(), files: files(&dark)?, light: Light::Dark }];
    for path in &folders {
        exposures.push(Exposure { name: path.display().to_string(), files: files(path)?, light: Light::Unknown });
    }
    if folders.is_empty() {
        let all = files(folder)?;
        if !all.len().is_multiple_of(PAIR) {
            let message = format!("--flat {}: {} files; expected pairs of the same light", folder.display(), all.len());
            return Err(refuse(
                message,
                "two files after one another, by name, are a pair; or make a subfolder for each exposure",
            ));
        }
        for pair in all.chunks(PAIR) {
            let name = format!("{} and {}", pair[0].display(), name(&pair[1]));
            exposures.push(Exposure { name, files: pair.to_vec(), light: Light::Unknown });
        }
    }
    match exposures.iter().find(|exposure| exposure.files.len() < PAIR) {
        None => Ok(exposures),
        Some(Exposure { name, .. }) => Err(refuse(
            format!("{name}: 1 frame; expected 2 or more"),
            "noise is measured on the differences of frames of the same light",
        )),
    }
}

/// The images of a folder, in the order of the numbers in their names.
fn files(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut files: Vec<PathBuf> = image_files(folder)?.into_values().collect();
    files.sort_by(|a, b| natural_order(&name(a), &name(b)));
    Ok(files)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Bits of the camera: a file of 16 bits does not tell them.
fn depth(args: &Calibrate, white: u16, folder: &Path) -> Result<u32, Failure> {
    match args.bits {
        Some(bits) => Ok(bits),
        None if white == u16::from(u8::MAX) => Ok(u8::BITS),
        None => {
            let message = format!("--flat {}: files of 16 bits do not tell those of the camera", folder.display());
            Err(Failure::input(Complaint::new(message).help("give them with --bits, 8 to 16: often 12 or 14")))
        }
    }
}

fn record(name: &str, level: &Level) -> LevelRecord {
    LevelRecord {
        name: name.to_owned(),
        dark: level.light == Light::Dark,
        frames: level.frames,
        mean_dn: level.mean_dn,
        variance_dn2: level.variance_dn2,
        spatial_dn2: level.spatial_dn2,
        at_highest: level.at_highest,
    }
}

fn camera(found: &Calibration, levels: Vec<LevelRecord>) -> CameraRecord {
    let highest = libm::exp2(f64::from(found.bit_depth)) - 1.0;
    CameraRecord {
        bits: found.bit_depth,
        gain_dn_per_e: found.gain_dn_per_e,
        full_scale_e: (highest - found.offset_dn) / found.gain_dn_per_e,
        offset_dn: found.offset_dn,
        dark_noise_e: found.dark_noise_e,
        dsnu_e: found.dsnu_e,
        prnu: found.prnu,
        saturation: match found.saturation {
            Saturation::Reached { dn, e } => SaturationRecord { reached: true, dn, e },
            Saturation::Above { dn, e } => SaturationRecord { reached: false, dn, e },
        },
        levels,
    }
}

/// The table on standard output.
pub(super) fn table(record: &CameraRecord) -> String {
    let mut out = String::from("photon transfer (EMVA 1288)\n");
    // Writing to a string cannot fail.
    let mut line = |text: String| {
        let _ = writeln!(out, "{}", text.trim_end());
    };
    line(format!("{:>8}{:>12}{:>14}{:>12}  level", "frames", "mean dn", "variance dn2", "at highest"));
    for level in &record.levels {
        line(format!(
            "{:>8}{:>12.2}{:>14.3}{:>10.2} %  {}",
            level.frames,
            level.mean_dn,
            level.variance_dn2,
            100.0 * level.at_highest,
            level.name
        ));
    }
    line(format!(
        "gain          {:.5} dn per electron, {:.2} electrons per dn",
        record.gain_dn_per_e,
        1.0 / record.gain_dn_per_e
    ));
    line(format!("full scale    {:.0} electrons in {} bits", record.full_scale_e, record.bits));
    let SaturationRecord { reached, dn, e } = &record.saturation;
    let from = if *reached { "" } else { "not reached: above " };
    line(format!("saturation    {from}{e:.0} electrons, {dn:.1} dn above the dark"));
    line(format!("offset        {:.2} dn", record.offset_dn));
    line(format!("dark noise    {:.2} electrons", record.dark_noise_e));
    line(format!("DSNU          {:.2} electrons", record.dsnu_e));
    line(format!("PRNU          {:.2} %", 100.0 * record.prnu));
    out
}

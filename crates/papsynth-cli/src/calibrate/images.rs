//! Reads and measures the images of `papsynth calibrate`.

use std::fs;
use std::path::{Path, PathBuf};

use ccd_noise::Error::{NoDark, Saturated};
use optics_psf::Error::FocusAtStackEnd;
use papsynth_calibrate::{
    Camera, Edge, EdgeAt, Error, Flats, Focus, FocusParams, Frame, Instrument, LightLevel, NucleiAt,
};
use papsynth_dataset::read::{GreyImage, Limits, Stack, image_files, natural_order};

use crate::args::Calibrate;
use crate::exit::ExitError;

const DARK: &str = "dark";

/// Frames per level of light.
const PAIR: usize = 2;

/// Limits on the images. JPEG is an error, because its compression changes noise and edges.
fn lossless() -> Limits {
    Limits { allow_lossy: false, ..Limits::default() }
}

pub(super) fn focus(args: &Calibrate, instrument: Option<&Instrument>) -> Result<Focus, ExitError> {
    let stack = Stack::read(&args.stack, &lossless())?;
    let planes: Vec<&[f32]> = stack.planes.iter().map(Vec::as_slice).collect();
    let nuclei = if args.window.is_empty() { NucleiAt::Detected } else { NucleiAt::Windows(args.window.clone()) };
    let params = FocusParams { nuclei, step_um: args.step_um, instrument: instrument.cloned() };
    Focus::measure(&planes, stack.width, &params).map_err(|error| {
        let name = args.stack.first().map(|path| path.display().to_string()).unwrap_or_default();
        let help = match &error {
            Error::Planes { .. } => {
                "give planes on both sides of focus: a TIFF with several pages, a folder, or several images"
            }
            Error::NoNucleus => {
                "give planes only, no masks, or give the window of a nucleus in pixels with --window X,Y,W,H"
            }
            Error::Window { source: FocusAtStackEnd { .. }, .. } => {
                "give only planes, numbered from below focus to above focus, without masks or images with extended depth \
                 of field"
            }
            Error::Window { .. } => {
                "expected --window X,Y,W,H inside the image, in pixels, with width and height of at least 8"
            }
            _ => return ExitError::input(format!("--stack {name}: {error}")),
        };
        ExitError::with_help(format!("--stack {name}: {error}"), help)
    })
}

/// Measures `--edge`. Also returns the distance from the edge and the grey level of each pixel.
pub(super) fn edge(args: &Calibrate, path: &Path) -> Result<(Edge, Vec<[f64; 2]>), ExitError> {
    let image = Stack::read(&[path.to_owned()], &lossless())?;
    let name = path.display();
    let [pixels] = image.planes.as_slice() else {
        let message = format!("--edge {name}: {} images; expected 1", image.planes.len());
        return Err(ExitError::with_help(message, "give the image in which the edge is in focus"));
    };
    let at = args.line.map_or(EdgeAt::Detected, EdgeAt::Line);
    let edge = Edge::measure(pixels, image.width, at).map_err(|error| {
        let help = match &error {
            Error::NoEdge => "give a line across or along a straight edge, in pixels: --line X0,Y0,X1,Y1",
            _ => {
                "expected --line X0,Y0,X1,Y1 across or along a straight edge, at least 8 pixels long; the square of this \
                 side around its centre must be inside the image"
            }
        };
        ExitError::with_help(format!("--edge {name}: {error}"), help)
    })?;
    let profile = edge.profile(pixels, image.width);
    Ok((edge, profile))
}

pub(super) fn camera(args: &Calibrate, folder: &Path) -> Result<Camera, ExitError> {
    let exposures = exposures(folder, args.dark.as_deref())?;
    let bits = depth(args, &exposures[0].files[0], folder)?;
    let mut flats =
        Flats::new(bits).map_err(|_| ExitError::input(format!("--bits: {bits} is out of range: expected 8 to 16")))?;
    for Exposure { name, files, light } in &exposures {
        // Memory holds one level at a time.
        let images = files.iter().map(|file| GreyImage::read(file, &lossless())).collect::<Result<Vec<_>, _>>()?;
        let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        let frames: Vec<Frame> = (names.iter().zip(&images))
            .map(|(name, image)| Frame { name, grey: &image.grey, width: image.width })
            .collect();
        flats.add(name, &frames, *light).map_err(|error| match &error {
            Error::Sizes { .. } => ExitError::with_help(error, "all flats and darks need the same size"),
            Error::Bits { .. } => {
                ExitError::with_help(format!("--bits {bits}: {error}"), "give the bit depth of the camera, 8 to 16")
            }
            Error::Level { .. } => {
                ExitError::with_help(error, "a level consists of 2 or more frames of the same light")
            }
            _ => ExitError::input(error),
        })?;
    }
    flats.camera().map_err(|error| {
        let help = match error {
            Error::Camera(NoDark) => {
                "give the folder of dark frames with --dark, or name it `dark` inside the folder of --flat"
            }
            Error::Camera(Saturated { .. }) => "record flats from near dark to bright, 2 or more frames per level",
            Error::TooDark { .. } => "record flats from near dark to bright",
            _ => "flats need different levels, well above the dark level",
        };
        ExitError::with_help(format!("--flat {}: {error}", folder.display()), help)
    })
}

struct Exposure {
    name: String,
    files: Vec<PathBuf>,
    light: LightLevel,
}

/// The levels of light in a folder, dark first, each of 2 or more files.
fn exposures(folder: &Path, dark: Option<&Path>) -> Result<Vec<Exposure>, ExitError> {
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder).map_err(|error| ExitError::file("read", folder, &error))? {
        let path = entry.map_err(|error| ExitError::file("read", folder, &error))?.path();
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
            let message = format!("--dark: the folder of --flat already holds dark frames: {}", inside.display());
            return Err(ExitError::with_help(message, "remove --dark, or that folder"));
        }
        (None, None) => {
            let message = format!("--flat {}: {}", folder.display(), NoDark);
            return Err(ExitError::with_help(
                message,
                "give the folder of dark frames with --dark, or name it `dark` inside the folder of --flat",
            ));
        }
    };
    let mut exposures =
        vec![Exposure { name: dark.display().to_string(), files: files(&dark)?, light: LightLevel::Dark }];
    for path in &folders {
        exposures.push(Exposure { name: path.display().to_string(), files: files(path)?, light: LightLevel::Unknown });
    }
    if folders.is_empty() {
        let all = files(folder)?;
        if !all.len().is_multiple_of(PAIR) {
            let message = format!("--flat {}: {} files; expected an even number", folder.display(), all.len());
            return Err(ExitError::with_help(
                message,
                "two consecutive files, by name, are a pair of the same light; or use a subfolder for each exposure",
            ));
        }
        for pair in all.chunks(PAIR) {
            let name = format!("{} and {}", pair[0].display(), name(&pair[1]));
            exposures.push(Exposure { name, files: pair.to_vec(), light: LightLevel::Unknown });
        }
    }
    match exposures.iter().find(|exposure| exposure.files.len() < PAIR) {
        None => Ok(exposures),
        Some(Exposure { name, .. }) => Err(ExitError::with_help(
            format!("{name}: 1 frame; expected 2 or more"),
            "noise is measured on differences between frames of the same light",
        )),
    }
}

/// The images of a folder, in natural order of their names.
fn files(folder: &Path) -> Result<Vec<PathBuf>, ExitError> {
    let mut files: Vec<PathBuf> = image_files(folder)?.into_values().collect();
    files.sort_by(|a, b| natural_order(&name(a), &name(b)));
    Ok(files)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The bit depth of the camera, from `--bits` or from files of 8 bits.
fn depth(args: &Calibrate, first: &Path, folder: &Path) -> Result<u32, ExitError> {
    if let Some(bits) = args.bits {
        return Ok(bits);
    }
    if GreyImage::read(first, &lossless())?.white == u16::from(u8::MAX) {
        return Ok(u8::BITS);
    }
    let message = format!("--flat {}: the bit depth of the camera is unknown for 16-bit files", folder.display());
    Err(ExitError::with_help(message, "give it with --bits, 8 to 16; common values are 12 and 14"))
}

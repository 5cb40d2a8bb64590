//! The images that the command line names, read and measured; what is wrong with them, and which option would help.

use std::fs;
use std::path::{Path, PathBuf};

use ccd_noise::Error::{NoDark, Saturated};
use optics_psf::Error::NoFocusInside;
use papsynth_calibrate::{Camera, Edge, EdgeAt, Error, Flats, Focus, FocusParams, Frame, Instrument, Light, NucleiAt};
use papsynth_dataset::read::{GreyImage, Limits, Stack, image_files, natural_order};

use crate::args::Calibrate;
use crate::exit::Failure;

const DARK: &str = "dark";

/// Frames that make a level.
const PAIR: usize = 2;

/// Limits on the images. JPEG is an error, because its compression changes noise and edges.
fn lossless() -> Limits {
    Limits { allow_lossy: false, ..Limits::default() }
}

pub(super) fn focus(args: &Calibrate, instrument: Option<&Instrument>) -> Result<Focus, Failure> {
    let stack = Stack::read(&args.stack, &lossless())?;
    let planes: Vec<&[f32]> = stack.planes.iter().map(Vec::as_slice).collect();
    let nuclei = if args.window.is_empty() { NucleiAt::Found } else { NucleiAt::Windows(args.window.clone()) };
    let params = FocusParams { nuclei, step_um: args.step_um, instrument: instrument.cloned() };
    Focus::measure(&planes, stack.width, &params).map_err(|error| {
        let name = args.stack.first().map(|path| path.display().to_string()).unwrap_or_default();
        let help = match &error {
            Error::Planes { .. } => {
                "give a TIFF of several pages, a folder, or several images: planes on both sides of focus"
            }
            Error::NoNucleus => {
                "give planes alone, no masks among them, or name the window of a nucleus with --window X,Y,W,H, in pixels"
            }
            Error::Window { source: NoFocusInside { .. }, .. } => {
                "take the planes from below focus to above it, in the order of their numbers, and nothing else: \
                 no mask and no extended focus"
            }
            Error::Window { .. } => {
                "--window X,Y,W,H: left and top from 0, width and height from 8 pixels, inside the image"
            }
            _ => return Failure::input(format!("--stack {name}: {error}")),
        };
        Failure::wrong(format!("--stack {name}: {error}"), help)
    })
}

/// `--edge`; with the distance of each pixel from the edge, and its grey level.
pub(super) fn edge(args: &Calibrate, path: &Path) -> Result<(Edge, Vec<[f64; 2]>), Failure> {
    let image = Stack::read(&[path.to_owned()], &lossless())?;
    let name = path.display();
    let [pixels] = image.planes.as_slice() else {
        let message = format!("--edge {name}: {} images; expected one", image.planes.len());
        return Err(Failure::wrong(message, "give the image in which the edge is in focus"));
    };
    let at = args.line.map_or(EdgeAt::Found, EdgeAt::Line);
    let edge = Edge::measure(pixels, image.width, at).map_err(|error| {
        let help = match &error {
            Error::NoEdge => "name a straight edge with --line X0,Y0,X1,Y1, across it or along it, in pixels",
            _ => {
                "--line X0,Y0,X1,Y1: across a straight edge or along it, at least 8 pixels long, with a square \
                 of that side around its middle inside the image"
            }
        };
        Failure::wrong(format!("--edge {name}: {error}"), help)
    })?;
    let profile = edge.profile(pixels, image.width);
    Ok((edge, profile))
}

pub(super) fn camera(args: &Calibrate, folder: &Path) -> Result<Camera, Failure> {
    let exposures = exposures(folder, args.dark.as_deref())?;
    let bits = depth(args, &exposures[0].files[0], folder)?;
    let mut flats = Flats::new(bits).map_err(|error| Failure::wrong(format!("--bits: {error}"), "8 to 16"))?;
    for Exposure { name, files, light } in &exposures {
        // One level at a time, so that memory never holds them all.
        let images =
            files.iter().map(|file| GreyImage::read(file, &lossless())).collect::<Result<Vec<_>, _>>()?;
        let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        let frames: Vec<Frame> = (names.iter().zip(&images))
            .map(|(name, image)| Frame { name, grey: &image.grey, width: image.width })
            .collect();
        flats.add(name, &frames, *light).map_err(|error| match &error {
            Error::Sizes { .. } => Failure::wrong(error, "all flats and darks must be of one size"),
            Error::Bits { .. } => Failure::wrong(
                format!("--bits is {bits}, but {error}"),
                "give the bits of the camera's converter, 8 to 16",
            ),
            Error::Level { .. } => Failure::wrong(error, "a level is two frames or more of the same light"),
            _ => Failure::input(error),
        })?;
    }
    flats.camera().map_err(|error| {
        let help = match error {
            Error::Camera(NoDark) => "give their folder with --dark, or name it `dark` inside that of --flat",
            Error::Camera(Saturated { .. }) => {
                "take flats from near dark to the brightest, each level two frames or more"
            }
            Error::TooDark { .. } => "take flats from near dark to the brightest",
            _ => "the levels of flats must lie well above the dark, at different brightness",
        };
        Failure::wrong(format!("--flat {}: {error}", folder.display()), help)
    })
}

struct Exposure {
    name: String,
    files: Vec<PathBuf>,
    light: Light,
}

/// The folder's levels of light, dark first, each of two files or more.
fn exposures(folder: &Path, dark: Option<&Path>) -> Result<Vec<Exposure>, Failure> {
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
            return Err(Failure::wrong(message, "leave out --dark, or take that folder away"));
        }
        (None, None) => {
            let message = format!("--flat {}: {}", folder.display(), NoDark);
            return Err(Failure::wrong(
                message,
                "give their folder with --dark, or name it `dark` inside that of --flat",
            ));
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
            return Err(Failure::wrong(
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
        Some(Exposure { name, .. }) => Err(Failure::wrong(
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
fn depth(args: &Calibrate, first: &Path, folder: &Path) -> Result<u32, Failure> {
    if let Some(bits) = args.bits {
        return Ok(bits);
    }
    if GreyImage::read(first, &lossless())?.white == u16::from(u8::MAX) {
        return Ok(u8::BITS);
    }
    let message = format!("--flat {}: files of 16 bits do not tell those of the camera", folder.display());
    Err(Failure::wrong(message, "give them with --bits, 8 to 16: often 12 or 14"))
}

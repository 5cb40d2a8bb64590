//! A microscope and its camera, measured on images.

use papsynth_calibrate::{
    Calibration, Edge, EdgeAt, Flats, Focus, FocusParams, Frame, Instrument, Light, NucleiAt, Window,
};
use pyo3::prelude::*;
use serde_json::Value;

use crate::array::{Given, nth, pixels, pixels_within};
use crate::error::wrong;
use crate::pool;

/// What `papsynth.calibrate_microscope` gives, where what is given is described, as JSON.
#[pyfunction]
#[pyo3(signature = (stack=None, edge=None, *, step_um=None, windows=None, line=None, pixel_um=None, na=None, wavelength_um=None, mount_index=None, immersion_index=None, threads=0))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn calibrate_microscope(
    py: Python<'_>,
    stack: Option<Vec<Given<'_>>>,
    edge: Option<Given<'_>>,
    step_um: Option<f64>,
    windows: Option<Vec<[usize; 4]>>,
    line: Option<[f64; 4]>,
    pixel_um: Option<f64>,
    na: Option<f64>,
    wavelength_um: Option<f64>,
    mount_index: Option<f64>,
    immersion_index: Option<f64>,
    threads: usize,
) -> PyResult<String> {
    if stack.is_none() && edge.is_none() {
        return Err(wrong("stack, edge: none is given; expected at least one"));
    }
    let usual = Instrument::default();
    let instrument = Instrument {
        na: na.unwrap_or(usual.na),
        wavelength_um: wavelength_um.unwrap_or(usual.wavelength_um),
        mount_index: mount_index.unwrap_or(usual.mount_index),
        immersion_index: immersion_index.unwrap_or(usual.immersion_index),
        pixel_um: pixel_um.unwrap_or(usual.pixel_um),
    };
    instrument.check().map_err(wrong)?;
    if step_um.is_some_and(|step| !(step > 0.0 && step.is_finite())) {
        return Err(wrong(format!("step_um: {}; expected more than 0", step_um.unwrap_or_default())));
    }
    let planes = planes(stack.as_deref().unwrap_or_default())?;
    let edge = edge.map(|edge| pixels("edge", &edge)).transpose()?;
    let windows = windows.map(|windows| {
        windows.into_iter().map(|[left, top, width, height]| Window { left, top, width, height }).collect()
    });
    let instrument = pixel_um.map(|_| instrument);
    let nuclei = windows.map_or(NucleiAt::Detected, NucleiAt::Windows);
    let params = FocusParams { nuclei, step_um, instrument: instrument.clone() };
    let pool = pool::of(py, threads)?;
    let measured = py.detach(|| {
        pool.install(|| {
            let mut found = Calibration { microscope: instrument, ..Calibration::default() };
            if let Some((planes, width)) = &planes {
                let planes: Vec<&[f32]> = planes.iter().map(Vec::as_slice).collect();
                let focus = Focus::measure(&planes, *width, &params);
                found.focus = Some(focus.map_err(|error| format!("stack: {error}"))?);
            }
            if let Some((image, width)) = &edge {
                let edge = Edge::measure(image, *width, line.map_or(EdgeAt::Detected, EdgeAt::Line));
                found.edge = Some(edge.map_err(|error| format!("edge: {error}"))?);
            }
            let recipe = found.bright_field_toml().map_err(|error| format!("edge: {error}"))?;
            let gaussian = found.gaussian_toml();
            Ok::<_, String>((found, recipe, gaussian))
        })
    });
    let (found, recipe, gaussian) = measured.map_err(wrong)?;
    told(&found, [("recipe", recipe), ("recipe_gaussian", gaussian)])
}

/// What `papsynth.calibrate_camera` gives, where what is given is described, as JSON.
#[pyfunction]
pub(crate) fn calibrate_camera(
    py: Python<'_>,
    flats: Vec<Vec<Given<'_>>>,
    darks: Vec<Given<'_>>,
    bits: u32,
) -> PyResult<String> {
    let mut levels = vec![("darks".to_owned(), frames("darks", &darks)?, Light::Dark)];
    for (number, level) in flats.iter().enumerate() {
        let name = nth("flats", number);
        let frames = frames(&name, level)?;
        levels.push((name, frames, Light::Unknown));
    }
    let camera = py.detach(|| {
        let mut measured = Flats::new(bits)?;
        for (name, frames, light) in &levels {
            let frames: Vec<Frame<'_>> =
                frames.iter().map(|(name, grey, width)| Frame { name, grey, width: *width }).collect();
            measured.add(name, &frames, *light)?;
        }
        measured.camera()
    });
    let found = Calibration { camera: Some(camera.map_err(wrong)?), ..Calibration::default() };
    told(&found, [("recipe", found.camera_toml())])
}

/// Planes of one size, and their width; nothing if there is none.
fn planes(stack: &[Given<'_>]) -> PyResult<Option<(Vec<Vec<f32>>, usize)>> {
    let mut all = Vec::with_capacity(stack.len());
    let mut first = None;
    for (number, plane) in stack.iter().enumerate() {
        let name = nth("stack", number);
        let (values, width) = pixels(&name, plane)?;
        let size = [values.len() / width, width];
        let expected = *first.get_or_insert(size);
        if size != expected {
            return Err(wrong(format!("{name}: has the shape {size:?}; expected that of stack[0], {expected:?}")));
        }
        all.push(values);
    }
    Ok(first.map(|[_, width]| (all, width)))
}

/// Frames with their names, grey levels and widths.
fn frames(name: &str, frames: &[Given<'_>]) -> PyResult<Vec<(String, Vec<u16>, usize)>> {
    let one = |(number, frame): (usize, &Given<'_>)| {
        let name = nth(name, number);
        let (values, width) = pixels_within(&name, frame, [0.0, f32::from(u16::MAX)])?;
        if values.iter().any(|value| value.fract() != 0.0) {
            return Err(wrong(format!("{name}: expected grey levels as the camera gives them, whole numbers")));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole numbers from 0 to 65535")]
        let grey = values.into_iter().map(|value| value as u16).collect();
        Ok((name, grey, width))
    };
    frames.iter().enumerate().map(one).collect()
}

/// A calibration as JSON, with sections of recipes, as far as there are any.
fn told<const N: usize>(found: &Calibration, recipes: [(&str, Option<String>); N]) -> PyResult<String> {
    let mut value = serde_json::to_value(found).map_err(wrong)?;
    for (name, text) in recipes {
        value[name] = match text {
            Some(text) => serde_json::to_value(toml::from_str::<toml::Table>(&text).map_err(wrong)?).map_err(wrong)?,
            None => Value::Null,
        };
    }
    Ok(value.to_string())
}

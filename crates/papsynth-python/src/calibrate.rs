//! Calibration of a microscope and its camera.

use papsynth_calibrate::{
    Calibration, Edge, EdgeAt, Flats, Focus, FocusParams, Frame, Instrument, LightLevel, NucleiAt, Window,
};
use pyo3::prelude::*;
use serde_json::Value;

use crate::array::{ArrayLike, nth, pixels, pixels_within};
use crate::error::wrong;
use crate::pool;

/// Returns the result of `papsynth.calibrate_microscope` as JSON.
#[pyfunction]
#[pyo3(signature = (stack=None, edge=None, *, step_um=None, windows=None, line=None, pixel_um=None, na=None, wavelength_um=None, mount_index=None, immersion_index=None, threads=0))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn calibrate_microscope(
    py: Python<'_>,
    stack: Option<Vec<ArrayLike<'_>>>,
    edge: Option<ArrayLike<'_>>,
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
        return Err(wrong("stack, edge: expected at least one of these"));
    }
    let default = Instrument::default();
    let instrument = Instrument {
        na: na.unwrap_or(default.na),
        wavelength_um: wavelength_um.unwrap_or(default.wavelength_um),
        mount_index: mount_index.unwrap_or(default.mount_index),
        immersion_index: immersion_index.unwrap_or(default.immersion_index),
        pixel_um: pixel_um.unwrap_or(default.pixel_um),
    };
    instrument.check().map_err(wrong)?;
    if step_um.is_some_and(|step| !(step > 0.0 && step.is_finite())) {
        return Err(wrong(format!("step_um: {} is out of range: expected more than 0", step_um.unwrap_or_default())));
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
    to_json(&found, [("recipe", recipe), ("recipe_gaussian", gaussian)])
}

/// Returns the result of `papsynth.calibrate_camera` as JSON.
#[pyfunction]
pub(crate) fn calibrate_camera(
    py: Python<'_>,
    flats: Vec<Vec<ArrayLike<'_>>>,
    darks: Vec<ArrayLike<'_>>,
    bits: u32,
) -> PyResult<String> {
    let mut levels = vec![("darks".to_owned(), frames("darks", &darks)?, LightLevel::Dark)];
    for (number, level) in flats.iter().enumerate() {
        let name = nth("flats", number);
        let frames = frames(&name, level)?;
        levels.push((name, frames, LightLevel::Unknown));
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
    to_json(&found, [("recipe", found.camera_toml())])
}

/// Returns planes of equal size and their width, or nothing without planes.
fn planes(stack: &[ArrayLike<'_>]) -> PyResult<Option<(Vec<Vec<f32>>, usize)>> {
    let mut all = Vec::with_capacity(stack.len());
    let mut first = None;
    for (number, plane) in stack.iter().enumerate() {
        let name = nth("stack", number);
        let (values, width) = pixels(&name, plane)?;
        let size = [values.len() / width, width];
        let expected = *first.get_or_insert(size);
        if size != expected {
            return Err(wrong(format!("{name}: expected the shape of stack[0], {expected:?}, found {size:?}")));
        }
        all.push(values);
    }
    Ok(first.map(|[_, width]| (all, width)))
}

/// Returns names, grey levels and widths of frames.
fn frames(name: &str, frames: &[ArrayLike<'_>]) -> PyResult<Vec<(String, Vec<u16>, usize)>> {
    let one = |(number, frame): (usize, &ArrayLike<'_>)| {
        let name = nth(name, number);
        let (values, width) = pixels_within(&name, frame, [0.0, f32::from(u16::MAX)])?;
        if values.iter().any(|value| value.fract() != 0.0) {
            return Err(wrong(format!("{name}: expected integer grey levels")));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "integers from 0 to 65535")]
        let grey = values.into_iter().map(|value| value as u16).collect();
        Ok((name, grey, width))
    };
    frames.iter().enumerate().map(one).collect()
}

/// Returns a calibration as JSON, with the available recipe sections.
fn to_json<const N: usize>(found: &Calibration, recipes: [(&str, Option<String>); N]) -> PyResult<String> {
    let mut value = serde_json::to_value(found).map_err(wrong)?;
    for (name, text) in recipes {
        value[name] = match text {
            Some(text) => serde_json::to_value(toml::from_str::<toml::Table>(&text).map_err(wrong)?).map_err(wrong)?,
            None => Value::Null,
        };
    }
    Ok(value.to_string())
}

//! `--stack`: σ against focus offset, and the condenser's aperture.

use std::collections::BTreeMap;
use std::fmt::Write;

use optics_psf::calibrate::{self, FocusCurve, Line, Window};
use optics_psf::{Error, MicroscopeParams};
use papsynth_dataset::read::{Limits, Stack};
use rayon::prelude::*;

use super::find;
use super::record::{Bound, CondenserRecord, FocusRecord, Instrument, NucleusRecord, OffsetRecord, Side, numbers};
use crate::args::Calibrate;
use crate::exit::{Complaint, Failure};

/// σ at which the search of [`calibrate::focus`] ends, px, less a step of it: what reaches it may be wider.
const WIDEST_PX: f64 = 15.8;

/// Distances from focus that both lines go by at least, where there are so many on both sides.
const LEAST_COMMON: usize = 3;

/// Nuclei that make a median: fewer are no fair sample of many.
const LEAST_NUCLEI: usize = 5;

/// Nuclei from which the condenser is sought, planes on each side that are compared, and the blur of the last of them:
/// each nucleus takes as long as all the rest, and more no longer help.
const MOST_FOR_CONDENSER: usize = 5;
const PLANES_FOR_CONDENSER: usize = 4;
const BLUR_FOR_CONDENSER_PX: f64 = 4.0;

/// Pairs of planes, one on each side, from which it is sought where there is one nucleus alone.
const MOST_PAIRS: usize = 5;

/// Apertures at the ends of what [`calibrate::condenser`] tries, as parts of the objective's.
const FIRST_TRIED: f64 = 0.1;
const LAST_TRIED: f64 = 1.0;

/// How well it is known between two apertures that are tried, as a part of the objective's: a tenth of their distance.
const BETWEEN_TRIED: f64 = 0.005;

/// A nucleus that could be measured.
struct Measured {
    window: Window,
    curve: FocusCurve,
}

pub(super) fn measure(args: &Calibrate, instrument: Option<&Instrument>) -> Result<FocusRecord, Failure> {
    let stack = Stack::read(&args.stack, &Limits::default())?;
    let planes: Vec<&[f32]> = stack.planes.iter().map(Vec::as_slice).collect();
    let name = || args.stack.iter().map(|p| p.display().to_string()).take(1).collect::<String>();
    let refuse = |message: String, help: &str| Failure::input(Complaint::new(message).help(help));
    if planes.len() < 3 {
        let help = "give a TIFF of several pages, a folder, or several images: planes on both sides of focus";
        return Err(refuse(format!("--stack {}: {} planes; expected 3 or more", name(), planes.len()), help));
    }
    let asked = !args.window.is_empty();
    let windows = if asked { args.window.clone() } else { find::nuclei(&planes, stack.width, args.pixel_um) };
    if windows.is_empty() {
        let help =
            "give planes alone, no masks among them, or name the window of a nucleus with --window X,Y,W,H, in pixels";
        return Err(refuse(format!("--stack {}: no dark, compact thing was found in it", name()), help));
    }
    let curves: Vec<Result<FocusCurve, Error>> =
        windows.par_iter().map(|window| calibrate::focus(&planes, stack.width, *window)).collect();
    let mut measured = Vec::new();
    let mut refused = None;
    for (window, curve) in windows.into_iter().zip(curves) {
        match curve {
            Ok(curve) => measured.push(Measured { window, curve }),
            // A window that was asked for must be good; of those that were found, others may be.
            Err(error) if asked => return Err(complaint(&name(), window, &error)),
            Err(error) => refused = refused.or(Some((window, error))),
        }
    }
    match refused {
        Some((window, error)) if measured.is_empty() => Err(complaint(&name(), window, &error)),
        _ => {
            let mut record = law(&measured, args.step_um);
            if let (Some(step_um), Some(instrument)) = (args.step_um, instrument) {
                record.condenser = Some(condenser(&planes, stack.width, &measured, step_um, instrument)?);
            }
            Ok(record)
        }
    }
}

/// What a window has against it, with the options that would help.
fn complaint(name: &str, window: Window, error: &Error) -> Failure {
    let [x, y, w, h] = numbers(window);
    let help = match error {
        Error::NoFocusInside { .. } => {
            "take the planes from below focus to above it, in the order of their numbers, and nothing else: \
             no mask and no extended focus"
        }
        _ => "--window X,Y,W,H: left and top from 0, width and height from 8 pixels, inside the image",
    };
    Failure::input(Complaint::new(format!("--stack {name}, window {x},{y},{w},{h}: {error}")).help(help))
}

/// The lines through the medians of all nuclei.
fn law(measured: &[Measured], step_um: Option<f64>) -> FocusRecord {
    let mut by_offset: BTreeMap<i64, Vec<f64>> = BTreeMap::new();
    for Measured { curve, .. } in measured {
        for (i, sigma) in curve.sigma_px.iter().enumerate() {
            by_offset.entry(offset(i, curve)).or_default().push(*sigma);
        }
    }
    let mut offsets: Vec<OffsetRecord> = by_offset
        .into_iter()
        .map(|(planes, mut sigmas)| {
            sigmas.sort_by(f64::total_cmp);
            let [low, sigma_px, high] = [0.25, 0.5, 0.75].map(|part| quantile(&sigmas, part));
            let enough = LEAST_NUCLEI.min(measured.len().div_ceil(2));
            let fitted = planes != 0 && sigmas.len() >= enough && high < WIDEST_PX;
            OffsetRecord { planes, nuclei: sigmas.len(), sigma_px, quartiles_px: [low, high], fitted }
        })
        .collect();
    // Blur is no exact line: the same distances on both sides, or their slopes could not be compared.
    let good: Vec<i64> = offsets.iter().filter(|o| o.fitted).map(|o| o.planes).collect();
    let common: Vec<i64> = good.iter().copied().filter(|n| good.contains(&-n)).collect();
    if common.len() >= 2 * LEAST_COMMON {
        offsets.iter_mut().for_each(|o| o.fitted = common.contains(&o.planes));
    }
    let fitted = |planes: i64| offsets.iter().any(|o| o.planes == planes && o.fitted);
    let side = |sign: i64| {
        let points = offsets.iter().filter(|o| o.fitted && o.planes * sign > 0);
        Side::through(&points.map(|o| [(o.planes * sign) as f64, o.sigma_px]).collect::<Vec<_>>())
    };
    let (before, after) = (side(-1), side(1));
    let proportional_px = 0.5 * (before.proportional_px + after.proportional_px);
    let of_each: Vec<f64> = match measured {
        // One nucleus: each plane has its say.
        [_] => offsets.iter().filter(|o| o.fitted).map(|o| o.sigma_px / o.planes.abs() as f64).collect(),
        many => many
            .iter()
            .map(|m| m.curve.sigma_px.iter().enumerate().map(|(i, sigma)| (offset(i, &m.curve), *sigma)))
            .map(|points| {
                points.filter(|(n, _)| fitted(*n)).map(|(n, sigma)| [n.abs() as f64, sigma]).collect::<Vec<_>>()
            })
            .map(|points| Line::through(&points).proportional_px)
            .collect(),
    };
    let steepest = 0.5 * (before.slope_px + after.slope_px);
    FocusRecord {
        step_um,
        nuclei: measured
            .iter()
            .map(|Measured { window, curve }| NucleusRecord {
                window: numbers(*window),
                focused: curve.focused,
                sigma_px: curve.sigma_px.clone(),
            })
            .collect(),
        offsets,
        before,
        after,
        proportional_px,
        proportional_error_px: standard_error(&of_each),
        asymmetry: if steepest > 0.0 { (before.slope_px - after.slope_px).abs() / steepest } else { 0.0 },
        condenser: None,
    }
}

/// Planes from focus.
fn offset(plane: usize, curve: &FocusCurve) -> i64 {
    plane.cast_signed() as i64 - curve.focused.cast_signed() as i64
}

/// The condenser's aperture, from the sharpest nuclei.
fn condenser(
    planes: &[&[f32]],
    width: usize,
    measured: &[Measured],
    step_um: f64,
    instrument: &Instrument,
) -> Result<CondenserRecord, Failure> {
    let params = instrument.params(MicroscopeParams::default().condenser_na);
    let seek = |planes: &[&[f32]], window, step_um| {
        calibrate::condenser(planes, width, window, step_um, &params)
            .map(|fit| fit.condenser_na)
            .map_err(|error| Failure::input(Complaint::new(format!("--stack: the condenser's aperture: {error}"))))
    };
    let chosen = &measured[..measured.len().min(MOST_FOR_CONDENSER)];
    let mut all: Vec<f64> = chosen
        .par_iter()
        .map(|m| {
            let (some, stride) = some_planes(planes, &m.curve);
            seek(&some, m.window, step_um * stride as f64)
        })
        .collect::<Result<_, _>>()?;
    let error = match chosen {
        [one] => {
            // Pairs of planes at the same distance are stacks of their own.
            let focused = one.curve.focused;
            let farthest = focused.min(planes.len() - 1 - focused).min(MOST_PAIRS);
            let pairs: Vec<f64> = (1..=farthest)
                .into_par_iter()
                .map(|n| {
                    seek(&[planes[focused - n], planes[focused], planes[focused + n]], one.window, step_um * n as f64)
                })
                .collect::<Result<_, _>>()?;
            standard_error(&pairs)
        }
        _ => standard_error(&all),
    };
    let between = BETWEEN_TRIED * instrument.na;
    let error = (error * error + between * between).sqrt();
    all.sort_by(f64::total_cmp);
    let na = quantile(&all, 0.5);
    let bound = match na / instrument.na {
        part if part <= FIRST_TRIED + f64::EPSILON => Bound::AtMost,
        part if part >= LAST_TRIED - f64::EPSILON => Bound::AtLeast,
        _ => Bound::Inside,
    };
    Ok(CondenserRecord { na, error, bound })
}

/// A few planes at equal distances around focus, up to where detail is gone, and that distance in planes.
fn some_planes<'a>(planes: &[&'a [f32]], curve: &FocusCurve) -> (Vec<&'a [f32]>, usize) {
    let focused = curve.focused;
    let sides = [focused, planes.len() - 1 - focused];
    let blurred = |n: usize| {
        let at = [focused.checked_sub(n), Some(focused + n)].into_iter().flatten();
        at.filter_map(|i| curve.sigma_px.get(i)).copied().fold(0.0, f64::max)
    };
    let reach = (1..=sides[0].max(sides[1])).take_while(|n| blurred(*n) <= BLUR_FOR_CONDENSER_PX).last().unwrap_or(1);
    let stride = (reach / PLANES_FOR_CONDENSER).clamp(1, sides[0].min(sides[1]));
    let [before, after] = sides.map(|side| (side / stride).min(PLANES_FOR_CONDENSER));
    let first = focused - before * stride;
    ((0..=before + after).map(|i| planes[first + i * stride]).collect(), stride)
}

/// A quantile of sorted numbers, between the two nearest.
fn quantile(sorted: &[f64], part: f64) -> f64 {
    let at = part * (sorted.len() - 1) as f64;
    let low = at.floor();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
    let i = low as usize;
    let next = sorted[(i + 1).min(sorted.len() - 1)];
    sorted[i] + (at - low) * (next - sorted[i])
}

/// The standard error of a mean; of one number alone nothing is known, and it is 0.
fn standard_error(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    if values.len() < 2 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / count;
    let square: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    (square / (count - 1.0) / count).sqrt()
}

/// The table on standard output.
pub(super) fn table(record: &FocusRecord, pixel_um: Option<f64>) -> String {
    let mut out = String::new();
    // Writing to a string cannot fail.
    let mut line = |text: String| {
        let _ = writeln!(out, "{}", text.trim_end());
    };
    line("blur against focus offset (Fig. 10)".to_owned());
    for nucleus in &record.nuclei {
        let [x, y, w, h] = nucleus.window;
        line(format!("  window {x},{y},{w},{h}: in focus in plane {}", nucleus.focused));
    }
    let um = |known: bool, name: &str| if known { format!("{name:>10}") } else { String::new() };
    line(format!(
        "{:>8}{}{:>8}{:>10}{}{:>16}{:>10}",
        "planes",
        um(record.step_um.is_some(), "um"),
        "nuclei",
        "sigma px",
        um(pixel_um.is_some(), "sigma um"),
        "quartiles px",
        "line px"
    ));
    for o in &record.offsets {
        let n = o.planes.abs() as f64;
        let side = if o.planes < 0 { &record.before } else { &record.after };
        let fit = if o.fitted { format!("{:.2}", side.at(n)) } else { "-".to_owned() };
        line(format!(
            "{:>+8}{}{:>8}{:>10.2}{}{:>16}{:>10}",
            o.planes,
            record.step_um.map_or_else(String::new, |step| format!("{:>+10.2}", o.planes as f64 * step)),
            o.nuclei,
            o.sigma_px,
            pixel_um.map_or_else(String::new, |pixel| format!("{:>10.3}", o.sigma_px * pixel)),
            format!("{:.2} to {:.2}", o.quartiles_px[0], o.quartiles_px[1]),
            fit
        ));
    }
    for (name, side) in [("before focus", &record.before), ("after focus", &record.after)] {
        line(format!(
            "{name:<14}{:.3} px a plane, {:+.2} px in focus, R2 {:.4}; through 0: {:.3} px a plane",
            side.slope_px, side.intercept_px, side.r_squared, side.proportional_px
        ));
    }
    line(format!("symmetry      the slopes differ by {:.1} %", 100.0 * record.asymmetry));
    let (k, error) = (record.proportional_px, record.proportional_error_px);
    line(format!("blur          {k:.3} +- {error:.3} px a plane"));
    if let Some(step) = record.step_um {
        line(format!("              {:.3} +- {:.3} px for each um of travel", k / step, error / step));
    }
    if let (Some(step), Some(pixel)) = (record.step_um, pixel_um) {
        let scale = pixel / step;
        line(format!("              {:.3} +- {:.3} um for each um of travel", k * scale, error * scale));
    }
    if let Some(CondenserRecord { na, error, bound }) = &record.condenser {
        let words = match bound {
            Bound::Inside => "",
            Bound::AtMost => "at most ",
            Bound::AtLeast => "at least ",
        };
        line(format!("condenser NA  {words}{na:.3} +- {error:.3}"));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_lie_between_their_neighbours() {
        assert_eq!(quantile(&[3.0], 0.25), 3.0);
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.5), 2.0);
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), 3.0);
        assert_eq!(standard_error(&[3.0]), 0.0);
        assert!((standard_error(&[1.0, 3.0]) - 1.0).abs() < 1e-12);
    }
}

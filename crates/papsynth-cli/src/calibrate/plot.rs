//! Plots of measurements as SVG.

use papsynth_calibrate::{Camera, Edge, Focus, Level};
use papsynth_judge::svg::{COLOURS, Plot};

pub(super) const BEGINS: &[u8] = b"<svg ";

const SIZE: [f64; 2] = [720.0, 480.0];

/// Colours of the measurements and of the fit.
const POINTS: &str = COLOURS[0];
const FIT: &str = COLOURS[1];

/// σ against focus offset: quartiles and medians of all nuclei, and the fitted line on each side.
pub(super) fn focus(record: &Focus, pixel_um: Option<f64>) -> String {
    let (scale, unit) = record.step_um.map_or((1.0, "planes"), |step| (step, "µm of travel"));
    let largest = record.offsets.iter().map(|o| o.quartiles_px[1]).fold(1.0, f64::max);
    let reach = record.offsets.iter().map(|o| o.planes.abs()).max().unwrap_or(1) as f64 + 0.5;
    let sides = [(-1.0, &record.before), (1.0, &record.after)];
    let per = |slope: f64| match (record.step_um, pixel_um) {
        (Some(step), Some(pixel)) => format!("{:.3} µm per µm", slope * pixel / step),
        (Some(step), None) => format!("{:.3} px per µm", slope / step),
        (None, _) => format!("{slope:.3} px per plane"),
    };
    let [before, after] = [&record.before, &record.after].map(|side| per(side.slope_px));
    let nuclei = record.nuclei.len();
    let title = format!("Blur against focus offset: {before} before focus, {after} after (nuclei: {nuclei})");
    let x_name = format!("distance from focus, {unit}");
    let mut plot =
        Plot::sized(SIZE, &title, &x_name, "σ, pixels", [-reach * scale, reach * scale], [0.0, 1.1 * largest]);
    for o in &record.offsets {
        let x = o.planes as f64 * scale;
        plot.line(o.quartiles_px.iter().map(|sigma| [x, *sigma]), POINTS);
        // Points outside the fit are hollow.
        let point = [[x, o.sigma_px]].into_iter();
        if o.fitted || o.planes == 0 { plot.dots(point, POINTS) } else { plot.rings(point, POINTS) }
    }
    for (sign, side) in sides {
        let fitted = record.offsets.iter().filter(|o| o.fitted && o.planes as f64 * sign > 0.0);
        let last = fitted.map(|o| o.planes.abs()).max().unwrap_or(0) as f64;
        plot.line([0.0, last].into_iter().map(|n| [sign * n * scale, side.at(n)]), FIT);
    }
    plot.document()
}

/// The pixels around an edge, and the fit.
pub(super) fn edge(record: &Edge, profile: &[[f64; 2]], pixel_um: Option<f64>) -> String {
    /// Points of the fit on each side.
    const FINE: i32 = 200;
    let lowest = profile.iter().map(|p| p[1]).fold(record.dark, f64::min);
    let highest = profile.iter().map(|p| p[1]).fold(record.light, f64::max);
    let reach = profile.iter().map(|p| p[0].abs()).fold(1.0, f64::max);
    let margin = 0.05 * (highest - lowest);
    let um = pixel_um.map_or_else(String::new, |pixel| format!(" = {:.4} µm", record.sigma_px * pixel));
    let title = format!("Edge: σ = {:.3} ± {:.3} px{um}", record.sigma_px, record.error_px);
    let x_name = "distance from the edge, pixels";
    let mut plot =
        Plot::sized(SIZE, &title, x_name, "grey level", [-reach, reach], [lowest - margin, highest + margin]);
    plot.dots(profile.iter().copied(), POINTS);
    let distances = (-FINE..=FINE).map(|i| reach * f64::from(i) / f64::from(FINE));
    plot.line(distances.map(|d| [d, record.at(d)]), FIT);
    plot.document()
}

/// Variance against mean, both above the dark level, and the line with the gain as slope.
pub(super) fn photon_transfer(record: &Camera) -> String {
    let dark = record.levels.iter().find(|level| level.dark);
    let [dark_mean, dark_variance] = dark.map_or([0.0; 2], |level| [level.mean_dn, level.variance_dn2]);
    let above = |level: &Level| [level.mean_dn - dark_mean, level.variance_dn2 - dark_variance];
    let [right, top] = record.levels.iter().map(above).fold([0.0_f64; 2], |[x, y], p| [x.max(p[0]), y.max(p[1])]);
    let (gain, noise, prnu) = (record.gain_dn_per_e, record.dark_noise_e, 100.0 * record.prnu);
    let title = format!("Photon transfer: {gain:.4} DN per electron, dark noise {noise:.2} e, PRNU {prnu:.2} %");
    let (x_name, y_name) = ("mean above dark, DN", "variance above dark, DN²");
    let mut plot = Plot::sized(SIZE, &title, x_name, y_name, [0.0, 1.05 * right], [0.0, 1.1 * top]);
    // The line ends at the border of the plot.
    let last = right.min(1.1 * top / record.gain_dn_per_e);
    plot.line([0.0, last].into_iter().map(|mean| [mean, mean * record.gain_dn_per_e]), FIT);
    // Levels with saturated pixels are hollow.
    let (hollow, full): (Vec<&Level>, Vec<&Level>) = record.levels.iter().partition(|level| level.at_highest > 0.0);
    plot.dots(full.into_iter().map(above), POINTS);
    plot.rings(hollow.into_iter().map(above), POINTS);
    plot.document()
}

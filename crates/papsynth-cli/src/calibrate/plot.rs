//! Measurements as drawings: SVG with plain text.

use std::error::Error;
use std::ops::Range;

use plotters::prelude::*;
use plotters::style::RelativeSize;

use super::edge::{Measured, edge_at};
use super::record::{CameraRecord, FocusRecord, LevelRecord};

/// How every drawing begins.
pub(super) const BEGINS: &[u8] = b"<svg ";

const SIZE: (u32, u32) = (720, 480);
const FONT: &str = "sans-serif";
const TEXT: RGBColor = RGBColor(64, 64, 64);
const GRID: RGBColor = RGBColor(232, 232, 232);
const POINTS: RGBColor = RGBColor(31, 119, 180);
const FIT: RGBColor = RGBColor(214, 39, 40);

type Drawn<T> = Result<T, Box<dyn Error>>;
type Chart<'a, 'b> = ChartContext<
    'a,
    SVGBackend<'b>,
    Cartesian2d<plotters::coord::types::RangedCoordf64, plotters::coord::types::RangedCoordf64>,
>;

/// What the axes are.
struct Axes {
    title: String,
    x: String,
    y: String,
    x_range: Range<f64>,
    y_range: Range<f64>,
}

/// σ against focus offset: quartiles and medians of all nuclei, and the line on each side.
pub(super) fn focus(record: &FocusRecord, pixel_um: Option<f64>) -> String {
    let (scale, unit) = record.step_um.map_or((1.0, "planes"), |step| (step, "µm of travel"));
    let largest = record.offsets.iter().map(|o| o.quartiles_px[1]).fold(1.0, f64::max);
    let reach = record.offsets.iter().map(|o| o.planes.abs()).max().unwrap_or(1) as f64 + 0.5;
    let sides = [(-1.0, &record.before), (1.0, &record.after)];
    let per = |slope: f64| match (record.step_um, pixel_um) {
        (Some(step), Some(pixel)) => format!("{:.3} µm per µm", slope * pixel / step),
        (Some(step), None) => format!("{:.3} px per µm", slope / step),
        (None, _) => format!("{slope:.3} px a plane"),
    };
    let title = format!(
        "Blur against focus offset: {} before focus, {} after (nuclei: {})",
        per(record.before.slope_px),
        per(record.after.slope_px),
        record.nuclei.len()
    );
    let axes = Axes {
        title,
        x: format!("distance from focus, {unit}"),
        y: "σ, pixels".to_owned(),
        x_range: -reach * scale..reach * scale,
        y_range: 0.0..1.1 * largest,
    };
    draw(&axes, |chart| {
        for o in &record.offsets {
            let [low, high] = o.quartiles_px;
            let x = o.planes as f64 * scale;
            chart.draw_series([PathElement::new([(x, low), (x, high)], POINTS.stroke_width(2))])?;
            // What the lines do not go by is hollow.
            let style = if o.fitted || o.planes == 0 { POINTS.filled() } else { POINTS.stroke_width(1) };
            chart.draw_series([Circle::new((x, o.sigma_px), 4, style)])?;
        }
        for (sign, side) in sides {
            let fitted = record.offsets.iter().filter(|o| o.fitted && o.planes as f64 * sign > 0.0);
            let last = fitted.map(|o| o.planes.abs()).max().unwrap_or(0) as f64;
            let ends = [0.0, last].map(|n| (sign * n * scale, side.at(n)));
            chart.draw_series([PathElement::new(ends, FIT.stroke_width(2))])?;
        }
        Ok(())
    })
}

/// Every pixel around an edge, and the fit.
pub(super) fn edge(measured: &Measured, pixel_um: Option<f64>) -> String {
    let record = &measured.record;
    let lowest = measured.profile.iter().map(|p| p[1]).fold(record.dark, f64::min);
    let highest = measured.profile.iter().map(|p| p[1]).fold(record.light, f64::max);
    let reach = measured.profile.iter().map(|p| p[0].abs()).fold(1.0, f64::max);
    let margin = 0.05 * (highest - lowest);
    let um = pixel_um.map_or_else(String::new, |pixel| format!(" = {:.4} µm", record.sigma_px * pixel));
    let axes = Axes {
        title: format!("Edge: σ = {:.3} ± {:.3} px{um}", record.sigma_px, record.error_px),
        x: "distance from the edge, pixels".to_owned(),
        y: "grey level".to_owned(),
        x_range: -reach..reach,
        y_range: lowest - margin..highest + margin,
    };
    draw(&axes, |chart| {
        chart.draw_series(measured.profile.iter().map(|p| Circle::new((p[0], p[1]), 2, POINTS.filled())))?;
        let at = |i: i32| {
            let d = reach * f64::from(i) / 200.0;
            (d, edge_at(record.dark, record.light, record.sigma_px, d))
        };
        chart.draw_series([PathElement::new((-200..=200).map(at).collect::<Vec<_>>(), FIT.stroke_width(2))])?;
        Ok(())
    })
}

/// Variance against mean, both above the dark's, and the gain as the slope between them.
pub(super) fn photon_transfer(record: &CameraRecord) -> String {
    let dark = record.levels.iter().find(|level| level.dark);
    let [dark_mean, dark_variance] = dark.map_or([0.0; 2], |level| [level.mean_dn, level.variance_dn2]);
    let above = |level: &LevelRecord| (level.mean_dn - dark_mean, level.variance_dn2 - dark_variance);
    let points: Vec<_> = record.levels.iter().map(|level| (above(level), level.at_highest)).collect();
    let [right, top] = points.iter().fold([0.0_f64; 2], |[x, y], (point, _)| [x.max(point.0), y.max(point.1)]);
    let axes = Axes {
        title: format!(
            "Photon transfer: {:.4} dn per electron, dark noise {:.2} e, PRNU {:.2} %",
            record.gain_dn_per_e,
            record.dark_noise_e,
            100.0 * record.prnu
        ),
        x: "mean above the dark, grey levels".to_owned(),
        y: "variance above the dark's, squared grey levels".to_owned(),
        x_range: 0.0..1.05 * right,
        y_range: 0.0..1.1 * top,
    };
    draw(&axes, |chart| {
        // As far as the drawing goes.
        let last = right.min(1.1 * top / record.gain_dn_per_e);
        chart
            .draw_series([PathElement::new([(0.0, 0.0), (last, last * record.gain_dn_per_e)], FIT.stroke_width(2))])?;
        chart.draw_series(points.iter().map(|(point, at_highest)| {
            // What has pixels at the highest level is hollow.
            let style = if *at_highest > 0.0 { POINTS.stroke_width(1) } else { POINTS.filled() };
            Circle::new(*point, 4, style)
        }))?;
        Ok(())
    })
}

/// Axes, and on them what `fill` draws.
fn draw(axes: &Axes, fill: impl FnOnce(&mut Chart<'_, '_>) -> Drawn<()>) -> String {
    let mut svg = String::new();
    // A drawing in memory cannot fail.
    let _ = try_draw(axes, fill, &mut svg);
    svg
}

fn try_draw(axes: &Axes, fill: impl FnOnce(&mut Chart<'_, '_>) -> Drawn<()>, svg: &mut String) -> Drawn<()> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption(&axes.title, (FONT, 15).into_font().color(&TEXT))
        .margin(14)
        .x_label_area_size(46)
        .y_label_area_size(60)
        .build_cartesian_2d(axes.x_range.clone(), axes.y_range.clone())?;
    chart
        .configure_mesh()
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .axis_style(TEXT)
        .label_style((FONT, 12).into_font().color(&TEXT))
        .axis_desc_style((FONT, 14).into_font().color(&TEXT))
        .x_desc(&axes.x)
        .y_desc(&axes.y)
        .set_all_tick_mark_size(RelativeSize::Smaller(0.008))
        .draw()?;
    fill(&mut chart)?;
    area.present()?;
    Ok(())
}

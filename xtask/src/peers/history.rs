//! What was found at which commit: a file of lines, and its picture.

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::process::Command;

use anyhow::{Context, Result, anyhow};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde_json::{Value, json};

use super::race::Found;
use super::rows::Source;
use super::table::Line;
use crate::shell;
use crate::workspace::Workspace;

const FILE: &str = "benches/history.jsonl";
const PICTURE: &str = "docs/performance.svg";

/// Appends a line and draws the picture anew.
pub(super) fn record(workspace: &Workspace, lines: &[Line]) -> Result<()> {
    let git = |words: &[&str]| shell::output(Command::new("git").args(words).current_dir(&workspace.root));
    let commit = git(&["rev-parse", "--short", "HEAD"])?.trim().to_owned();
    let changed = !git(&["status", "--porcelain", "--untracked-files=no"])?.trim().is_empty();
    let rows: BTreeMap<&str, Value> =
        lines.iter().filter_map(|(row, found)| Some((row.name, value(row.source, found)?))).collect();
    let line =
        json!({ "commit": commit, "changed": changed, "machine": machine(), "noise": "exact Poisson", "rows": rows });
    let path = workspace.root.join(FILE);
    let mut file =
        OpenOptions::new().create(true).append(true).open(&path).with_context(|| format!("cannot open {FILE}"))?;
    writeln!(file, "{line}").with_context(|| format!("cannot write {FILE}"))?;
    let history = fs::read_to_string(&path).with_context(|| format!("cannot read {FILE}"))?;
    let history = history.lines().map(serde_json::from_str).collect::<Result<Vec<Value>, _>>().context(FILE)?;
    let picture = draw(&history).map_err(|error| anyhow!("cannot draw {PICTURE}: {error}"))?;
    fs::write(workspace.root.join(PICTURE), picture).with_context(|| format!("cannot write {PICTURE}"))?;
    println!("{FILE} has a line more, {PICTURE} was drawn anew.");
    Ok(())
}

/// What is kept of a row.
fn value(source: Source, found: &Found) -> Option<Value> {
    let Found::Figures(figures) = found else {
        return None;
    };
    // Six digits are more than any machine repeats.
    let short = |value: f64| format!("{value:.5e}").parse::<f64>().unwrap_or(value);
    let unit = match source {
        Source::Memory(_) => "MB",
        Source::Growth(_) => "exponent",
        _ => "ms",
    };
    Some(json!({ "unit": unit, "peer": figures.peer.map(short), "ours": short(figures.ours) }))
}

/// The name of the processor.
fn machine() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

const SIZE: (u32, u32) = (960, 600);
const TEXT_PX: u32 = 16;
const LABEL_PX: i32 = 17;
const COLOURS: [RGBColor; 6] = [
    RGBColor(31, 119, 180),
    RGBColor(214, 39, 40),
    RGBColor(44, 140, 44),
    RGBColor(148, 80, 170),
    RGBColor(200, 110, 10),
    RGBColor(90, 90, 90),
];

/// How many times as much the peer needs, over commits: a line a row, its name at its end.
fn draw(history: &[Value]) -> Result<String, Box<dyn std::error::Error>> {
    let mut series: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for (place, line) in history.iter().enumerate() {
        for (name, row) in line.get("rows").and_then(Value::as_object).into_iter().flatten() {
            let number = |key| row.get(key).and_then(Value::as_f64).filter(|value| *value > 0.0);
            if let (Some(peer), Some(ours)) = (number("peer"), number("ours")) {
                series.entry(name).or_default().push((place as f64, peer / ours));
            }
        }
    }
    let ratios = || series.values().flatten().map(|(_, ratio)| *ratio);
    let (low, high) = (ratios().fold(0.9, f64::min), ratios().fold(100.0, f64::max));
    // The last commit lies at the right, beside the names.
    let last = history.len().saturating_sub(1) as f64;
    let room = 0.04 * last.max(1.0);
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .caption("The peer's time or memory over ours", ("sans-serif", TEXT_PX + 2))
        .margin(12)
        .margin_right(160)
        .x_label_area_size(44)
        .y_label_area_size(56)
        .build_cartesian_2d(-room..last + room, (0.8 * low..1.2 * high).log_scale())?;
    let commit = |place: &f64| {
        let line = history.iter().enumerate().find(|(k, _)| (place - *k as f64).abs() < 1e-6);
        line.and_then(|(_, line)| line.get("commit")).and_then(Value::as_str).unwrap_or_default().to_owned()
    };
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.2))
        .x_labels(history.len().min(12))
        .x_label_formatter(&commit)
        .y_label_formatter(&|ratio| format!("{ratio}"))
        .x_desc("commit")
        .label_style(("sans-serif", TEXT_PX))
        .draw()?;
    let mut labels = Vec::new();
    for ((name, points), colour) in series.iter().zip(COLOURS.iter().cycle()) {
        chart.draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))?;
        chart.draw_series(points.iter().map(|point| Circle::new(*point, 3, colour.filled())))?;
        if let Some(end) = points.last() {
            labels.push((chart.backend_coord(end), format!("{name} {:.1}", end.1), colour));
        }
    }
    // Names that would lie on each other move apart.
    labels.sort_by_key(|((_, y), ..)| *y);
    let mut free = i32::MIN;
    for ((x, y), text, colour) in labels {
        let at = y.max(free);
        free = at + LABEL_PX;
        let style =
            ("sans-serif", TEXT_PX).into_text_style(&area).color(colour).pos(Pos::new(HPos::Left, VPos::Center));
        let right = i32::try_from(SIZE.0)? - 154;
        area.draw(&PathElement::new([(x, y), (right - 4, at)], colour.mix(0.4)))?;
        area.draw_text(&text, &style, (right, at))?;
    }
    area.present()?;
    drop(chart);
    drop(area);
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_row_with_a_peer_has_its_line_and_every_commit_its_place() {
        let line = |commit: &str, ours: f64| {
            json!({ "commit": commit, "rows": {
                "noise": { "unit": "ms", "peer": 57.0, "ours": ours },
                "growth": { "unit": "exponent", "peer": null, "ours": 1.0 },
            } })
        };
        let picture = draw(&[line("aaaa", 5.7), line("bbbb", 2.85)]).unwrap();
        for word in ["aaaa", "bbbb", "noise 20.0"] {
            assert!(picture.contains(word), "{word} is missing");
        }
        assert!(!picture.contains("growth"));
        assert!(draw(&[line("aaaa", 5.7)]).is_ok());
    }
}

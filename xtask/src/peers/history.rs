//! The history of benchmark results, as a file of JSON lines and a chart.

use std::collections::BTreeMap;
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::race::Found;
use super::rows::Source;
use super::table::Line;
use crate::shell;
use crate::workspace::Workspace;

const FILE: &str = "benches/history.jsonl";
const CHART: &str = "docs/performance.svg";

/// Appends a line and redraws the chart.
pub(super) fn record(workspace: &Workspace, lines: &[Line]) -> Result<()> {
    let git = |words: &[&str]| shell::output(Command::new("git").args(words).current_dir(&workspace.root));
    let commit = git(&["rev-parse", "--short", "HEAD"])?.trim().to_owned();
    let changed = !git(&["status", "--porcelain", "--untracked-files=no"])?.trim().is_empty();
    let rows: BTreeMap<&str, Value> =
        lines.iter().filter_map(|(row, found)| Some((row.name, value(row.source, found)?))).collect();
    let line =
        json!({ "commit": commit, "changed": changed, "machine": machine(), "noise": "exact Poisson", "rows": rows });
    let path = workspace.root.join(FILE);
    let history = format!("{}{line}\n", shell::read(&path)?);
    shell::write(&path, &history)?;
    let history = history.lines().map(serde_json::from_str).collect::<Result<Vec<Value>, _>>().context(FILE)?;
    shell::write(&workspace.root.join(CHART), &draw(&history))?;
    println!("Appended to {FILE}, and redrew {CHART}.");
    Ok(())
}

/// Returns the recorded values of a row.
fn value(source: Source, found: &Found) -> Option<Value> {
    let figures = found.as_ref().ok()?;
    // Six digits exceed the reproducibility of any machine.
    let short = |value: f64| format!("{value:.5e}").parse::<f64>().unwrap_or(value);
    let unit = match source {
        Source::Memory(_) => "MB",
        Source::Growth(_) => "exponent",
        _ => "ms",
    };
    Some(json!({ "unit": unit, "peer": figures.peer.map(short), "ours": short(figures.ours) }))
}

/// Returns the name of the processor.
fn machine() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| std::env::consts::ARCH.to_owned(), |(_, name)| name.trim().to_owned())
}

const SIZE: [f64; 2] = [960.0, 600.0];
/// Corners of the chart; names are on its right.
const LEFT_TOP: [f64; 2] = [56.0, 40.0];
const RIGHT_BOTTOM: [f64; 2] = [790.0, 540.0];
const LABEL_PX: f64 = 17.0;
const COLOURS: [&str; 6] = ["#1f77b4", "#d62728", "#2c8c2c", "#9450aa", "#c86e0a", "#5a5a5a"];

/// Draws the ratio of the peer's and our figures over commits: a line for each row, on a logarithmic axis.
#[expect(clippy::disallowed_methods, reason = "only for a chart")]
fn draw(history: &[Value]) -> String {
    let mut series: BTreeMap<&str, Vec<(usize, f64)>> = BTreeMap::new();
    for (place, line) in history.iter().enumerate() {
        for (name, row) in line.get("rows").and_then(Value::as_object).into_iter().flatten() {
            let number = |key| row.get(key).and_then(Value::as_f64).filter(|value| *value > 0.0);
            if let (Some(peer), Some(ours)) = (number("peer"), number("ours")) {
                series.entry(name).or_default().push((place, peer / ours));
            }
        }
    }
    let ratios = || series.values().flatten().map(|(_, ratio)| *ratio);
    let (low, high) = (0.8 * ratios().fold(0.9, f64::min), 1.2 * ratios().fold(100.0, f64::max));
    let ([left, top], [right, bottom]) = (LEFT_TOP, RIGHT_BOTTOM);
    let last = history.len().saturating_sub(1).max(1) as f64;
    let x = |place: usize| left + (right - left) * (0.04 + 0.92 * place as f64 / last);
    let y = |ratio: f64| bottom + (top - bottom) * (ratio / low).ln() / (high / low).ln();
    let [width, height] = SIZE;
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' font-family='sans-serif' font-size='15'>\n\
         <rect width='100%' height='100%' fill='white'/>\n<g text-anchor='middle'>\n\
         <text x='{:.0}' y='24'>Time or memory of the peer relative to ours</text>\n<text x='{:.0}' y='588'>commit</text>\n",
        width / 2.0,
        (left + right) / 2.0
    );
    let every = history.len().div_ceil(12).max(1);
    for (place, line) in history.iter().enumerate().step_by(every) {
        let commit = line.get("commit").and_then(Value::as_str).unwrap_or_default();
        svg += &format!("<text x='{:.1}' y='{:.0}'>{commit}</text>\n", x(place), bottom + 20.0);
    }
    svg += "</g>\n<g stroke='#ccc' text-anchor='end'>\n";
    let ticks = (-2..6).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10_f64.powi(power)));
    for tick in ticks.filter(|tick| (low..high).contains(tick)) {
        let y = y(tick);
        svg += &format!(
            "<path d='M{left} {y:.1}H{right}'/><text x='{}' y='{:.1}' stroke='none'>{tick}</text>\n",
            left - 8.0,
            y + 5.0
        );
    }
    svg += "</g>\n";
    let mut labels = Vec::new();
    for ((name, points), colour) in series.iter().zip(COLOURS.iter().cycle()) {
        let points: Vec<_> = points.iter().map(|&(place, ratio)| (x(place), y(ratio), ratio)).collect();
        let path: Vec<String> = points.iter().map(|(x, y, _)| format!("{x:.1},{y:.1}")).collect();
        svg += &format!("<polyline points='{}' fill='none' stroke='{colour}' stroke-width='2'/>\n", path.join(" "));
        for (x, y, _) in &points {
            svg += &format!("<circle cx='{x:.1}' cy='{y:.1}' r='3' fill='{colour}'/>\n");
        }
        labels.extend(points.last().map(|(x, y, ratio)| (*x, *y, format!("{name} {ratio:.1}"), colour)));
    }
    // Moves overlapping names apart.
    labels.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut free = 0.0;
    for (x, y, text, colour) in labels {
        let at = y.max(free);
        free = at + LABEL_PX;
        svg += &format!("<path d='M{x:.1} {y:.1}L{} {at:.1}' stroke='{colour}' stroke-opacity='0.4'/>", right + 12.0);
        svg += &format!("<text x='{}' y='{:.1}' fill='{colour}'>{text}</text>\n", right + 16.0, at + 5.0);
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chart_contains_every_commit_and_every_row_with_a_peer() {
        let line = |commit: &str, ours: f64| {
            json!({ "commit": commit, "rows": {
                "noise": { "unit": "ms", "peer": 57.0, "ours": ours },
                "growth": { "unit": "exponent", "peer": null, "ours": 1.0 },
            } })
        };
        let chart = draw(&[line("aaaa", 5.7), line("bbbb", 2.85)]);
        for word in ["aaaa", "bbbb", "noise 20.0"] {
            assert!(chart.contains(word), "{word} is missing");
        }
        assert!(!chart.contains("growth"));
        assert!(!draw(&[line("aaaa", 5.7)]).contains("NaN"));
    }
}

//! Prints the table.

use super::race::{Figures, Found};
use super::rows::{Row, Source};

/// A row and its figures.
pub(super) type Line = (&'static Row, Found);

/// Formats a number.
type Text = fn(f64) -> String;

const HEAD: [&str; 9] = ["name", "work", "peer", "theirs", "ours", "ratio", "required", "desired", ""];

/// Returns the table as text.
pub(super) fn text(lines: &[Line]) -> String {
    let mut cells = vec![HEAD.map(str::to_owned)];
    cells.extend(lines.iter().map(|(row, found)| cells_of(row, found)));
    let width = |column: usize| cells.iter().map(|line| line[column].len()).max().unwrap_or(0);
    let widths: [usize; 9] = std::array::from_fn(width);
    let mut text = String::new();
    for line in &cells {
        let mut words = String::new();
        for (column, (cell, width)) in line.iter().zip(widths).enumerate() {
            // Text is left-aligned, figures right-aligned.
            words += &if (3..8).contains(&column) { format!("{cell:>width$}  ") } else { format!("{cell:<width$}  ") };
        }
        text = text + words.trim_end() + "\n";
    }
    text
}

fn cells_of(row: &Row, found: &Found) -> [String; 9] {
    let (wanted, shown): (Text, Text) = match row.source {
        Source::Memory(_) => (|value| format!("{value:.0} MB"), |value| format!("{value:.1} MB")),
        Source::Growth(_) => (|value| format!("{value:.2}"), |value| format!("{value:.3}")),
        _ => (fraction, milliseconds),
    };
    let or_dash = |value: Option<f64>, text: Text| value.map_or("-".to_owned(), text);
    let figures = found.as_ref().ok();
    [
        row.name.to_owned(),
        row.work.to_owned(),
        row.peer.to_owned(),
        or_dash(figures.and_then(|figures| figures.peer), shown),
        or_dash(figures.map(|figures| figures.ours), shown),
        or_dash(figures.and_then(Figures::ratio), fraction),
        wanted(row.at_most),
        or_dash(row.try_for, wanted),
        match found {
            Ok(figures) => reached(row, figures).to_owned(),
            Err(reason) => format!("skipped: {reason}"),
        },
    ]
}

/// Compares a figure with its targets.
fn reached(row: &Row, figures: &Figures) -> &'static str {
    let figure = match row.source {
        Source::Memory(_) | Source::Growth(_) => Some(figures.ours),
        _ => figures.ratio(),
    };
    let within = |limit: f64| figure.is_some_and(|figure| figure <= limit);
    if row.try_for.is_some_and(within) {
        "desired"
    } else if within(row.at_most) {
        "required"
    } else {
        "MISSED"
    }
}

/// Formats a ratio: 1/24 or 0.83.
fn fraction(ratio: f64) -> String {
    match ratio {
        r if r >= 0.3 => format!("{r:.2}"),
        r if r > 0.2 => format!("1/{:.2}", 1.0 / r),
        r => {
            let times = format!("{:.1}", 1.0 / r);
            format!("1/{}", times.strip_suffix(".0").unwrap_or(&times))
        }
    }
}

fn milliseconds(value: f64) -> String {
    match value {
        v if v >= 100.0 => format!("{v:.0} ms"),
        v if v >= 10.0 => format!("{v:.1} ms"),
        v if v >= 1.0 => format!("{v:.2} ms"),
        v => format!("{v:.3} ms"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::rows::ROWS;
    use super::*;

    #[test]
    fn ratios_are_fractions_or_decimals() {
        assert_eq!(
            [0.9, 0.5, 1.0 / 24.0, 0.01, 0.1, 1.0 / 0.95].map(fraction),
            ["0.90", "0.50", "1/24", "1/100", "1/10", "1.05"]
        );
    }

    #[test]
    fn rows_state_the_target_that_is_reached() {
        let frame = &ROWS[0];
        let at = |ours| reached(frame, &Figures { peer: Some(100.0), ours });
        assert_eq!([at(2.0), at(4.0), at(6.0)], ["desired", "required", "MISSED"]);
        let text = text(&[(frame, Err("the peer is not installed".to_owned()))]);
        assert!(text.contains("1/20") && text.contains("skipped: the peer is not installed"), "{text}");
    }
}

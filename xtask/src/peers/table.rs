//! The table.

use super::race::{Figures, Found};
use super::rows::{Row, Source};

/// A row with what was found of it.
pub(crate) type Line = (&'static Row, Found);

const HEAD: [&str; 8] = ["name", "work", "peer", "peer's", "ours", "ratio", "at most", "try for"];

/// How far a figure got.
#[derive(Debug, PartialEq, Eq)]
enum Reached {
    Tried,
    Wanted,
    Nothing,
}

/// The whole table as text.
pub(crate) fn text(lines: &[Line]) -> String {
    let mut cells: Vec<Vec<String>> = vec![HEAD.iter().map(|&word| word.to_owned()).chain([String::new()]).collect()];
    cells.extend(lines.iter().map(|(row, found)| cells_of(row, found)));
    let width = |column: usize| cells.iter().map(|line| line.get(column).map_or(0, String::len)).max().unwrap_or(0);
    let widths: Vec<usize> = (0..=HEAD.len()).map(width).collect();
    let mut text = String::new();
    for line in cells {
        let mut words = String::new();
        for (column, (cell, width)) in line.iter().zip(&widths).enumerate() {
            // Words stand to the left, figures to the right.
            let cell = if (3..8).contains(&column) { format!("{cell:>width$}") } else { format!("{cell:<width$}") };
            words.push_str(&cell);
            words.push_str("  ");
        }
        text.push_str(words.trim_end());
        text.push('\n');
    }
    text
}

fn cells_of(row: &Row, found: &Found) -> Vec<String> {
    let wanted = |value: f64| match row.source {
        Source::Memory(_) => format!("{value:.0} MB"),
        Source::Growth(_) => format!("{value:.2}"),
        _ => fraction(value),
    };
    let mut cells = vec![row.name.to_owned(), row.work.to_owned(), row.peer.to_owned()];
    match found {
        Found::Missing(reason) => {
            cells.extend(["-", "-", "-"].map(str::to_owned));
            cells.extend([wanted(row.at_most), row.try_for.map_or("-".to_owned(), wanted)]);
            cells.push(format!("skipped: {reason}"));
        }
        Found::Figures(figures) => {
            let shown = |value: f64| match row.source {
                Source::Memory(_) => format!("{value:.1} MB"),
                Source::Growth(_) => format!("{value:.3}"),
                _ => milliseconds(value),
            };
            cells.push(figures.peer.map_or("-".to_owned(), shown));
            cells.push(shown(figures.ours));
            cells.push(figures.ratio().map_or("-".to_owned(), fraction));
            cells.extend([wanted(row.at_most), row.try_for.map_or("-".to_owned(), wanted)]);
            let words = match reached(row, *figures) {
                Reached::Tried => "what is tried for",
                Reached::Wanted => "what is wanted",
                Reached::Nothing => "NOT YET",
            };
            cells.push(words.to_owned());
        }
    }
    cells
}

fn reached(row: &Row, figures: Figures) -> Reached {
    let figure = match row.source {
        Source::Memory(_) | Source::Growth(_) => Some(figures.ours),
        _ => figures.ratio(),
    };
    let within = |limit: f64| figure.is_some_and(|figure| figure <= limit);
    if row.try_for.is_some_and(within) {
        Reached::Tried
    } else if within(row.at_most) {
        Reached::Wanted
    } else {
        Reached::Nothing
    }
}

/// A ratio as people say it: 1/24 or .83.
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
    fn ratios_read_as_people_say_them() {
        assert_eq!(
            [0.9, 0.5, 1.0 / 24.0, 0.01, 0.1, 1.0 / 0.95].map(fraction),
            ["0.90", "0.50", "1/24", "1/100", "1/10", "1.05"]
        );
    }

    #[test]
    fn a_row_says_how_far_it_got() {
        let frame = &ROWS[0];
        let at = |ours| reached(frame, Figures { peer: Some(100.0), ours });
        assert_eq!([at(2.0), at(4.0), at(6.0)], [Reached::Tried, Reached::Wanted, Reached::Nothing]);
        let text = text(&[(frame, Found::Missing("no peer".to_owned()))]);
        assert!(text.contains("1/20") && text.contains("skipped: no peer"), "{text}");
    }
}

//! Outlines as a table of points.

use std::path::Path;

use super::file::{Limits, parse};
use crate::error::{Error, Problem};

const COLUMNS: [&str; 4] = ["outline", "k", "x_px", "y_px"];

/// A closed outline of fewer points has no area.
const MIN_POINTS: usize = 3;

/// A closed outline.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// What its table calls it.
    pub name: String,
    /// Its points, pixels; the last is joined to the first.
    pub points: Vec<[f64; 2]>,
}

/// Parses a CSV table with the columns `outline` (a name), `k` (0, 1, 2, … along each outline), `x_px` and `y_px`, in any
/// order of columns. The points of an outline stand together.
///
/// # Errors
/// If a column is missing, a number cannot be read or is not finite, points are missing or out of order, or an outline
/// has fewer than three; with the line.
pub fn outlines(bytes: &[u8]) -> Result<Vec<Outline>, Problem> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let header = reader.headers().map_err(broken)?;
    let mut places = [0; 4];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place = header.iter().position(|h| h.trim_start_matches('\u{feff}') == name).ok_or_else(|| Problem::Row {
            line: 1,
            message: format!("there is no column `{name}`; wanted are {}", COLUMNS.join(",")),
        })?;
    }
    let mut outlines: Vec<Outline> = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(broken)? {
        let line = record.position().map_or(0, csv::Position::line);
        let [name, k, x, y] = places.map(|place| record.get(place).unwrap_or_default());
        let wrong = |message: String| Problem::Row { line, message };
        let number = |column: &str, text: &str| match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(wrong(format!("{column} is `{text}`; a finite number is wanted"))),
        };
        let point = [number("x_px", x)?, number("y_px", y)?];
        if outlines.last().is_none_or(|last| last.name != name) {
            outlines.push(Outline { name: name.to_owned(), points: Vec::new() });
        }
        let Some(last) = outlines.last_mut() else { continue };
        if k.parse() != Ok(last.points.len()) {
            return Err(wrong(format!(
                "k is `{k}`; {} is wanted, the next point of outline `{name}`",
                last.points.len()
            )));
        }
        last.points.push(point);
    }
    match outlines.iter().find(|o| o.points.len() < MIN_POINTS) {
        Some(Outline { name, points }) => {
            let message = format!("outline `{name}` has {} points; at least {MIN_POINTS} are wanted", points.len());
            Err(Problem::broken("CSV", message))
        }
        None if outlines.is_empty() => Err(Problem::broken("CSV", "it has no outline")),
        None => Ok(outlines),
    }
}

/// Reads a CSV table as [`outlines`] parses it.
///
/// # Errors
/// If the file cannot be read, or as [`outlines`].
pub fn read_outlines(path: &Path, limits: &Limits) -> Result<Vec<Outline>, Error> {
    parse(path, limits, outlines)
}

fn broken(error: csv::Error) -> Problem {
    match error.position() {
        Some(position) => Problem::Row { line: position.line(), message: error.to_string() },
        None => Problem::broken("CSV", error),
    }
}

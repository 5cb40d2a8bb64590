//! Tables of outline points.

use std::path::Path;

use super::file::{Limits, parse};
use crate::error::{Error, InputError};

const COLUMNS: [&str; 4] = ["outline", "k", "x_px", "y_px"];

/// Fewest points of a closed outline with an area.
const MIN_POINTS: usize = 3;

/// A closed outline.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// Name in the table.
    pub name: String,
    /// Points, pixels; the last is joined to the first.
    pub points: Vec<[f64; 2]>,
}

/// Parses a CSV table with the columns `outline` (a name), `k` (0, 1, 2, … along each outline), `x_px` and `y_px`.
/// Columns may be in any order; the rows of an outline are consecutive.
///
/// # Errors
/// If a column is missing, a number is invalid or not finite, points are missing or out of order, or an outline has
/// fewer than three points. The error gives the line.
pub fn outlines(bytes: &[u8]) -> Result<Vec<Outline>, InputError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let header = reader.headers().map_err(broken)?;
    let mut places = [0; 4];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place =
            header.iter().position(|h| h.trim_start_matches('\u{feff}') == name).ok_or_else(|| InputError::Row {
                line: 1,
                message: format!("the column `{name}` is missing; expected the columns {}", COLUMNS.join(",")),
            })?;
    }
    let mut outlines: Vec<Outline> = Vec::new();
    let mut record = csv::StringRecord::new();
    while reader.read_record(&mut record).map_err(broken)? {
        let line = record.position().map_or(0, csv::Position::line);
        let [name, k, x, y] = places.map(|place| record.get(place).unwrap_or_default());
        let wrong = |message: String| InputError::Row { line, message };
        let number = |column: &str, text: &str| match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(wrong(format!("{column} is `{text}`; expected a finite number"))),
        };
        let point = [number("x_px", x)?, number("y_px", y)?];
        if outlines.last().is_none_or(|last| last.name != name) {
            outlines.push(Outline { name: name.to_owned(), points: Vec::new() });
        }
        let Some(last) = outlines.last_mut() else { continue };
        if k.parse() != Ok(last.points.len()) {
            return Err(wrong(format!(
                "k is `{k}`; expected {}, the next point of outline `{name}`",
                last.points.len()
            )));
        }
        last.points.push(point);
    }
    match outlines.iter().find(|o| o.points.len() < MIN_POINTS) {
        Some(Outline { name, points }) => {
            let message = format!(
                "outline `{name}` has {} point{}; expected at least {MIN_POINTS}",
                points.len(),
                if points.len() == 1 { "" } else { "s" }
            );
            Err(InputError::broken("CSV", message))
        }
        None if outlines.is_empty() => Err(InputError::broken("CSV", "the table has no outline")),
        None => Ok(outlines),
    }
}

/// Reads a CSV file and parses it with [`outlines`].
///
/// # Errors
/// If the file cannot be read; see also [`outlines`].
pub fn read_outlines(path: &Path, limits: &Limits) -> Result<Vec<Outline>, Error> {
    parse(path, limits, outlines)
}

fn broken(error: csv::Error) -> InputError {
    match error.position() {
        Some(position) => InputError::Row { line: position.line(), message: error.to_string() },
        None => InputError::broken("CSV", error),
    }
}

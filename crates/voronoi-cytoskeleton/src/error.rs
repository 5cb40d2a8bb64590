use thiserror::Error;

/// Invalid parameters, points or polygons.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is out of range.
    #[error("{field} = {value} is out of range: expected {accepted}")]
    OutOfRange {
        /// Name of the field.
        field: &'static str,
        /// The value.
        value: f64,
        /// The accepted range.
        accepted: &'static str,
    },
    /// A coordinate is NaN, infinite, or too large.
    #[error("{what} {index} = [{}, {}]: expected coordinates from -1e9 to 1e9", point[0], point[1])]
    Coordinate {
        /// Kind of the point: `site`, `window corner` or `outline point`.
        what: &'static str,
        /// Its index.
        index: usize,
        /// Its coordinates.
        point: [f64; 2],
    },
    /// A polygon has fewer than three points or no area.
    #[error("the {what} of {count} points has area {area}: expected at least 3 points and an area above 0")]
    Flat {
        /// The polygon: `window` or `outline`.
        what: &'static str,
        /// Number of points.
        count: usize,
        /// Its area.
        area: f64,
    },
    /// A window is not convex, or its winding number is greater than 1.
    #[error("the window is not convex: corner {corner} is outside side {side}")]
    NotConvex {
        /// Index of the corner.
        corner: usize,
        /// Index of the side.
        side: usize,
    },
    /// A site is outside the window.
    #[error("site {index} at [{}, {}] is outside the window", point[0], point[1])]
    SiteOutside {
        /// Index of the site.
        index: usize,
        /// Its coordinates.
        point: [f64; 2],
    },
    /// There is no site, or sites coincide.
    #[error(
        "sites: {given}, different positions: {distinct}; expected at least one site, and no two at the same position"
    )]
    Sites {
        /// Number of sites.
        given: usize,
        /// Number of different positions.
        distinct: usize,
    },
}

/// Returns `value` if it is finite and `holds`, otherwise an error.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<f64, Error> {
    if value.is_finite() && holds { Ok(value) } else { Err(Error::OutOfRange { field, value, accepted }) }
}

/// Rejects coordinates whose products have too large rounding errors.
pub(crate) fn require_coordinates(what: &'static str, points: &[[f64; 2]]) -> Result<(), Error> {
    const LARGEST: f64 = 1e9;
    let bad = |point: &[f64; 2]| !point.iter().all(|c| c.abs() <= LARGEST);
    match points.iter().position(bad) {
        Some(index) => Err(Error::Coordinate { what, index, point: points[index] }),
        None => Ok(()),
    }
}

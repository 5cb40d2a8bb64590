use thiserror::Error;

/// Why parameters, points or polygons were refused.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// One number lies outside the range its field allows.
    #[error("{field} is {value}; it must be {accepted}")]
    OutOfRange {
        /// The field.
        field: &'static str,
        /// What it held.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// A coordinate is NaN, infinite, or too large to reckon with.
    #[error("{what} {index} is [{}, {}]; coordinates must lie between -1e9 and 1e9", point[0], point[1])]
    Coordinate {
        /// What the point belongs to: `site`, `window corner` or `outline point`.
        what: &'static str,
        /// Its index.
        index: usize,
        /// Its coordinates.
        point: [f64; 2],
    },
    /// A polygon has fewer than three points or no area.
    #[error("the {what} of {count} points has area {area}; it must have at least 3 points and an area above zero")]
    Flat {
        /// The polygon: `window` or `outline`.
        what: &'static str,
        /// Number of points given.
        count: usize,
        /// Its area.
        area: f64,
    },
    /// A window is not convex, or winds around more than once.
    #[error("the window is not convex: corner {corner} lies outside side {side}")]
    NotConvex {
        /// Index of a corner on the wrong side.
        corner: usize,
        /// Index of the side it lies outside of.
        side: usize,
    },
    /// A site lies outside the window.
    #[error("site {index} at [{}, {}] lies outside the window", point[0], point[1])]
    SiteOutside {
        /// Index of the site.
        index: usize,
        /// Its coordinates.
        point: [f64; 2],
    },
    /// No site at all, or two in the same place.
    #[error("{given} sites lie in {distinct} different places; there must be at least one, and no two in one place")]
    Sites {
        /// Number of sites given.
        given: usize,
        /// Number of different places among them.
        distinct: usize,
    },
}

/// `value`, if it is finite and `holds`.
pub(crate) fn require(field: &'static str, value: f64, holds: bool, accepted: &'static str) -> Result<f64, Error> {
    if value.is_finite() && holds { Ok(value) } else { Err(Error::OutOfRange { field, value, accepted }) }
}

/// Refuses coordinates whose products would lose what tells neighbours apart.
pub(crate) fn require_coordinates(what: &'static str, points: &[[f64; 2]]) -> Result<(), Error> {
    const LARGEST: f64 = 1e9;
    let bad = |point: &[f64; 2]| !point.iter().all(|c| c.abs() <= LARGEST);
    match points.iter().position(bad) {
        Some(index) => Err(Error::Coordinate { what, index, point: points[index] }),
        None => Ok(()),
    }
}

use crate::error::{Error, require};
use crate::kernel::single;

/// Uneven illumination of a field of view, relative to the level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Illumination {
    /// The paper's I_d(x, y)ⁿ of Eq. 8: the distance from the image's border, scaled to (0, 1].
    ///
    /// Distance counts from just outside of the image: a border pixel has distance 1, and no value is zero.
    BorderDistance {
        /// The exponent n, from 0 (even) to 16. The paper's released program uses 0.02.
        exponent: f64,
    },
    /// Quadratic falloff: 1 + tilt · (x, y) − falloff_x · x² − falloff_y · y², with x and y from −1 to 1 between
    /// borders (ours).
    ///
    /// Real fields have a smooth quadratic falloff, not a ridge along the border.
    Quadratic {
        /// Decrease from the centre to the left and right borders; negative for an increase.
        falloff_x: f64,
        /// Decrease from the centre to the upper and lower borders; negative for an increase.
        falloff_y: f64,
        /// Slopes along x and y: the increase from the centre to the right and lower borders.
        tilt: [f64; 2],
    },
}

impl Default for Illumination {
    /// Returns the mean falloff of real fields: 1 − 0.0325 x² − 0.0112 y² (ours, measured).
    fn default() -> Self {
        Self::Quadratic { falloff_x: 0.0325, falloff_y: 0.0112, tilt: [0.0, 0.0] }
    }
}

/// [`Illumination`] over a field of view. Both shapes are separable into columns and rows.
#[derive(Debug, Clone)]
pub(crate) struct IlluminationField {
    columns: Vec<f32>,
    rows: Vec<f32>,
    /// Whether a pixel is the minimum of its column and row parts, or their sum.
    smaller: bool,
}

impl IlluminationField {
    pub(crate) fn new(shape: &Illumination, width: usize, height: usize) -> Result<Self, Error> {
        match *shape {
            Illumination::BorderDistance { exponent } => {
                require("illumination.exponent", exponent, (0.0..=16.0).contains(&exponent), "between 0 and 16")?;
                let largest = width.min(height).div_ceil(2) as f64;
                // Eq. 8: I_dⁿ with I_d = min(distance to each border) / largest. Powers with n ≥ 0 are monotonic: they
                // are computed before the minimum, once per column and row.
                let powers = |length: usize| {
                    (0..length)
                        .map(|i| {
                            let distance = (i + 1).min(length - i) as f64;
                            single(libm::pow(distance / largest, exponent))
                        })
                        .collect()
                };
                Ok(Self { columns: powers(width), rows: powers(height), smaller: true })
            }
            Illumination::Quadratic { falloff_x, falloff_y, tilt } => {
                for (field, value) in [
                    ("illumination.falloff_x", falloff_x),
                    ("illumination.falloff_y", falloff_y),
                    ("illumination.tilt[0]", tilt[0]),
                    ("illumination.tilt[1]", tilt[1]),
                ] {
                    require(field, value, value.abs() <= 16.0, "between -16 and 16")?;
                }
                let parabola = |length: usize, level: f64, curvature: f64, slope: f64| {
                    (0..length)
                        .map(|i| {
                            let x = centred(i, length);
                            single(level + slope * x - curvature * x * x)
                        })
                        .collect()
                };
                let field = Self {
                    columns: parabola(width, 1.0, falloff_x, tilt[0]),
                    rows: parabola(height, 0.0, falloff_y, tilt[1]),
                    smaller: false,
                };
                let smallest = |part: &[f32]| part.iter().copied().fold(f32::INFINITY, f32::min);
                let lowest = f64::from(smallest(&field.columns) + smallest(&field.rows));
                if lowest > 0.0 {
                    Ok(field)
                } else {
                    Err(Error::NegativeIllumination { falloff_x, falloff_y, tilt, lowest })
                }
            }
        }
    }

    pub(crate) fn width(&self) -> usize {
        self.columns.len()
    }

    pub(crate) fn height(&self) -> usize {
        self.rows.len()
    }

    /// Writes part of a row of the field of view.
    pub(crate) fn row_into(&self, row: &mut [f32], first_column: usize, number: usize) {
        let from_row = self.rows[number];
        let columns = &self.columns[first_column..first_column + row.len()];
        // One loop per shape, so that the branch is outside.
        if self.smaller {
            fill(row, columns, |column| if column < from_row { column } else { from_row });
        } else {
            fill(row, columns, |column| column + from_row);
        }
    }
}

#[inline(always)]
fn fill(row: &mut [f32], columns: &[f32], combine: impl Fn(f32) -> f32) {
    for (value, &column) in row.iter_mut().zip(columns) {
        *value = combine(column);
    }
}

/// Returns the position of pixel `i` of `length`, from −1 to 1 between borders; 0 for a single pixel.
fn centred(i: usize, length: usize) -> f64 {
    if length < 2 {
        return 0.0;
    }
    2.0 * i as f64 / (length - 1) as f64 - 1.0
}

#[cfg(test)]
mod tests;

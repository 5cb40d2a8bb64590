use crate::error::{Error, require};
use crate::kernel::single;

/// The shape of uneven illumination over a field of view: 1 is the level itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Illumination {
    /// The paper's I_d(x, y)ⁿ of Eq. 8: the distance from the image's border, scaled to (0, 1].
    ///
    /// Distance counts from just outside the image, so that a border pixel has distance 1 and nothing is zero.
    BorderDistance {
        /// The exponent n, from 0 (even) to 16. The paper's released program uses 0.02.
        exponent: f64,
    },
    /// 1 + tilt · (x, y) − x2 · x² − y2 · y² over −1..1 from border to border (ours).
    ///
    /// What real fields show is a smooth quadratic bowl and not a ridge that follows the image's border.
    Bowl {
        /// Fall from the centre to the left and right borders; negative for a rise.
        x2: f64,
        /// Fall from the centre to the upper and lower borders; negative for a rise.
        y2: f64,
        /// Slopes along x and y: the rise from the centre to the right and lower borders.
        tilt: [f64; 2],
    },
}

impl Default for Illumination {
    /// The mean bowl of real fields: 1 − 0.0325 x² − 0.0112 y² (ours, measured).
    fn default() -> Self {
        Self::Bowl { x2: 0.0325, y2: 0.0112, tilt: [0.0, 0.0] }
    }
}

/// [`Illumination`] over one field of view. Both shapes come apart into a row of columns and a column of rows.
#[derive(Debug, Clone)]
pub(crate) struct Shade {
    columns: Vec<f32>,
    rows: Vec<f32>,
    /// Whether the smaller of a column's and a row's part makes a pixel, or their sum.
    smaller: bool,
}

impl Shade {
    pub(crate) fn new(shape: &Illumination, width: usize, height: usize) -> Result<Self, Error> {
        match *shape {
            Illumination::BorderDistance { exponent } => {
                require("illumination.exponent", exponent, (0.0..=16.0).contains(&exponent), "between 0 and 16")?;
                let largest = width.min(height).div_ceil(2) as f64;
                // Eq. 8: I_dⁿ with I_d = min(distance to each border) / largest. A power with n ≥ 0 keeps order, so it
                // may be taken before the minimum, once a column and once a row.
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
            Illumination::Bowl { x2, y2, tilt } => {
                for (field, value) in [
                    ("illumination.x2", x2),
                    ("illumination.y2", y2),
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
                let shade = Self {
                    columns: parabola(width, 1.0, x2, tilt[0]),
                    rows: parabola(height, 0.0, y2, tilt[1]),
                    smaller: false,
                };
                let smallest = |part: &[f32]| part.iter().copied().fold(f32::INFINITY, f32::min);
                let lowest = f64::from(smallest(&shade.columns) + smallest(&shade.rows));
                if lowest > 0.0 { Ok(shade) } else { Err(Error::DarkBowl { x2, y2, tilt, lowest }) }
            }
        }
    }

    pub(crate) fn width(&self) -> usize {
        self.columns.len()
    }

    pub(crate) fn height(&self) -> usize {
        self.rows.len()
    }

    /// Part of a row of the field of view.
    pub(crate) fn row_into(&self, row: &mut [f32], first_column: usize, number: usize) {
        let from_row = self.rows[number];
        let columns = &self.columns[first_column..first_column + row.len()];
        // One loop a shape, so that the choice stands outside it.
        if self.smaller {
            fill(row, columns, |column| if column < from_row { column } else { from_row });
        } else {
            fill(row, columns, |column| column + from_row);
        }
    }
}

#[inline(always)]
fn fill(row: &mut [f32], columns: &[f32], join: impl Fn(f32) -> f32) {
    for (value, &column) in row.iter_mut().zip(columns) {
        *value = join(column);
    }
}

/// Position of pixel `i` of `length` on −1..1 from border to border; 0 if there is but one.
fn centred(i: usize, length: usize) -> f64 {
    if length < 2 {
        return 0.0;
    }
    2.0 * i as f64 / (length - 1) as f64 - 1.0
}

#[cfg(test)]
mod tests;

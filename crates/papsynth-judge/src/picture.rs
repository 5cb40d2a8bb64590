//! What is judged: pictures in grey.

use crate::error::Error;
use crate::number::{nearest, single, whole};

/// What is known of the nuclei of a picture beforehand.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Known {
    /// Nothing: they are found.
    #[default]
    Nothing,
    /// A point in each: x right, y down, in pixels, pixel centres at integers.
    Points(Vec<[f64; 2]>),
    /// A label in each pixel, row by row; 0 is no nucleus.
    Masks(Vec<u32>),
}

/// A field of a slide, in grey.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// What it is called in reports.
    pub name: String,
    /// What it is counted among, such as a grade; empty if there are no groups.
    pub group: String,
    /// Grey levels, row by row, top row first, 0 to [`full_scale`](Self::full_scale).
    pub grey: Vec<f32>,
    /// Columns.
    pub width: usize,
    /// The grey level of a saturated pixel: 255 for 8 bits, 65535 for 16, 1 for fractions.
    pub full_scale: f32,
    /// Its nuclei.
    pub nuclei: Known,
}

impl Default for Picture {
    /// No pixels, of 8 bits, of which nothing is known.
    fn default() -> Self {
        Self {
            name: String::new(),
            group: String::new(),
            grey: Vec::new(),
            width: 0,
            full_scale: 255.0,
            nuclei: Known::Nothing,
        }
    }
}

/// Smallest picture that is measured, pixels a side.
pub(crate) const LEAST_SIDE: usize = 32;

/// A row or column at the border whose mean is below this part of the picture's is no image.
const DEAD: f64 = 0.1;

/// At most this part of a side is taken for a dead border.
const WIDEST_DEAD: f64 = 0.05;

impl Picture {
    /// Rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.grey.len() / self.width.max(1)
    }

    /// Refuses what is no picture.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let (width, height) = (self.width, self.height());
        let refuse = |what: String| Err(Error::Picture { name: self.name.clone(), what });
        if width * height != self.grey.len() || width < LEAST_SIDE || height < LEAST_SIDE {
            return refuse(format!("is {width} x {height} pixels; accepted are at least {LEAST_SIDE} a side"));
        }
        if !(self.full_scale.is_finite() && self.full_scale > 0.0) {
            return refuse(format!("has a full scale of {}; accepted is a number above 0", self.full_scale));
        }
        if let Some(bad) = self.grey.iter().find(|v| !(v.is_finite() && **v >= 0.0 && **v <= self.full_scale)) {
            return refuse(format!("holds the grey level {bad}; accepted is 0 to its full scale, {}", self.full_scale));
        }
        if self.grey.iter().all(|v| *v == self.grey[0]) {
            return refuse("is the same everywhere; there is nothing to judge in it".to_owned());
        }
        match &self.nuclei {
            Known::Masks(labels) if labels.len() != self.grey.len() => {
                refuse(format!("has {} labels for {} pixels", labels.len(), self.grey.len()))
            }
            Known::Points(points) if points.iter().flatten().any(|v| !v.is_finite()) => {
                refuse("has a nucleus at a place that is no number".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Without the rows and columns at its border that hold no image: some cameras and fusions leave them black.
    pub(crate) fn trimmed(&self) -> Self {
        let (width, height) = (self.width, self.height());
        let mean = |values: &mut dyn Iterator<Item = f32>, count: usize| {
            values.map(f64::from).sum::<f64>() / count.max(1) as f64
        };
        let least = DEAD * mean(&mut self.grey.iter().copied(), self.grey.len());
        let row = |y: usize| mean(&mut self.grey[y * width..(y + 1) * width].iter().copied(), width) < least;
        let column = |x: usize| mean(&mut (0..height).map(|y| self.grey[y * width + x]), height) < least;
        let (across, down) = (whole(width as f64 * WIDEST_DEAD), whole(height as f64 * WIDEST_DEAD));
        let left = (0..across).take_while(|&x| column(x)).count();
        let right = (0..across).take_while(|&x| column(width - 1 - x)).count();
        let top = (0..down).take_while(|&y| row(y)).count();
        let bottom = (0..down).take_while(|&y| row(height - 1 - y)).count();
        if left + right + top + bottom == 0 {
            return self.clone();
        }
        self.cut([left, top], [width - left - right, height - top - bottom])
    }

    /// The part from a column and row on, of so many columns and rows. Points of nuclei outside it stay, with places outside it.
    #[must_use]
    pub fn cut(&self, [left, top]: [usize; 2], [width, height]: [usize; 2]) -> Self {
        fn part<T: Copy>(all: &[T], wide: usize, from: [usize; 2], size: [usize; 2]) -> Vec<T> {
            let rows = from[1]..from[1] + size[1];
            rows.flat_map(|y| all[y * wide + from[0]..][..size[0]].iter().copied()).collect()
        }
        let of_points = |points: &[[f64; 2]]| points.iter().map(|[x, y]| [x - left as f64, y - top as f64]).collect();
        Self {
            name: self.name.clone(),
            group: self.group.clone(),
            grey: part(&self.grey, self.width, [left, top], [width, height]),
            width,
            full_scale: self.full_scale,
            nuclei: match &self.nuclei {
                Known::Nothing => Known::Nothing,
                Known::Points(points) => Known::Points(of_points(points)),
                Known::Masks(labels) => Known::Masks(part(labels, self.width, [left, top], [width, height])),
            },
        }
    }

    /// The same in pixels that are `factor` times as large: each the mean of the area that it covers, of labels the one at its centre. A
    /// factor of 1 or less changes nothing: what was never seen cannot be made.
    #[must_use]
    pub fn coarsened(&self, factor: f64) -> Self {
        let (width, height) = (self.width, self.height());
        let factor = if factor > 1.0 { factor.min(width.min(height) as f64) } else { return self.clone() };
        let (wide, high) = (whole(width as f64 / factor), whole(height as f64 / factor));
        let across = shares(wide, factor);
        let narrow: Vec<f64> = self
            .grey
            .chunks_exact(width)
            .flat_map(|row| {
                across.iter().map(|(from, parts)| parts.iter().zip(&row[*from..]).map(|(p, v)| p * f64::from(*v)).sum())
            })
            .collect();
        let mut grey = Vec::with_capacity(wide * high);
        for (from, parts) in shares(high, factor) {
            let at = |x: usize| parts.iter().enumerate().map(|(i, p)| p * narrow[(from + i) * wide + x]).sum::<f64>();
            grey.extend((0..wide).map(|x| single(at(x))));
        }
        let centre = |i: usize, count: usize| nearest((i as f64 + 0.5) * factor - 0.5).min(count - 1);
        let nuclei = match &self.nuclei {
            Known::Nothing => Known::Nothing,
            Known::Points(points) => {
                Known::Points(points.iter().map(|p| p.map(|v| (v + 0.5) / factor - 0.5)).collect())
            }
            Known::Masks(labels) => {
                let rows = (0..high).map(|y| centre(y, height) * width);
                Known::Masks(rows.flat_map(|row| (0..wide).map(move |x| labels[row + centre(x, width)])).collect())
            }
        };
        Self { grey, width: wide, nuclei, ..self.clone() }
    }
}

/// For each of `count` large pixels the first small one that it covers, and the share of it and of those that follow.
fn shares(count: usize, factor: f64) -> Vec<(usize, Vec<f64>)> {
    let share = |i: usize| {
        let (from, to) = (i as f64 * factor, (i + 1) as f64 * factor);
        let first = whole(from);
        // Rounding must not reach for a pixel that is not there.
        let last = whole(to - 1e-9);
        let part = |p: usize| ((p + 1) as f64).min(to) - (p as f64).max(from);
        (first, (first..=last).map(|p| part(p) / factor).collect())
    };
    (0..count).map(share).collect()
}

//! Grey images of fields.

use crate::error::Error;
use crate::number::{nearest, single, whole};

/// Annotated nuclei of an image.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum NucleiAnnotation {
    /// No annotation: nuclei are segmented.
    #[default]
    None,
    /// A point in each nucleus: x to the right, y downwards, pixels; pixel centres are at integers.
    Points(Vec<[f64; 2]>),
    /// A label for each pixel, row by row; 0 is background.
    Masks(Vec<u32>),
}

/// A grey image of a field of a slide.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldImage {
    /// Name in reports.
    pub name: String,
    /// Group, for example a grade; empty if there are no groups.
    pub group: String,
    /// Grey levels, row by row, top row first, 0 to [`full_scale`](Self::full_scale).
    pub grey: Vec<f32>,
    /// Red and blue of a colour image, as `grey`, which is its green channel. Not compared; [`None`] for grey images.
    pub red_blue: Option<[Vec<f32>; 2]>,
    /// Columns.
    pub width: usize,
    /// The grey level of a saturated pixel: 255 for 8 bits, 65535 for 16, 1 for fractions.
    pub full_scale: f32,
    /// Annotated nuclei.
    pub nuclei: NucleiAnnotation,
}

impl Default for FieldImage {
    /// Returns an 8-bit image without pixels and without annotation.
    fn default() -> Self {
        Self {
            name: String::new(),
            group: String::new(),
            grey: Vec::new(),
            red_blue: None,
            width: 0,
            full_scale: 255.0,
            nuclei: NucleiAnnotation::None,
        }
    }
}

/// Minimum width and height, pixels.
pub(crate) const LEAST_SIDE: usize = 32;

/// A row or column at the border is black if its mean is below this fraction of the mean of the image.
const BLACK: f64 = 0.1;

/// Maximum width of a black border, as a fraction of the size of the image.
const WIDEST_BLACK: f64 = 0.05;

impl FieldImage {
    /// Returns the number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.grey.len() / self.width.max(1)
    }

    /// Checks size, grey levels and annotation.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let (width, height) = (self.width, self.height());
        let refuse = |what: String| Err(Error::Image { name: self.name.clone(), what });
        if width * height != self.grey.len() || width < LEAST_SIDE || height < LEAST_SIDE {
            return refuse(format!(
                "has {} grey levels, {width} x {height} pixels; expected {LEAST_SIDE} x {LEAST_SIDE} or more, and full rows",
                self.grey.len()
            ));
        }
        if !(self.full_scale.is_finite() && self.full_scale > 0.0) {
            return refuse(format!("has a full scale of {}; expected a number above 0", self.full_scale));
        }
        if let Some(bad) = self.grey.iter().find(|v| !(v.is_finite() && **v >= 0.0 && **v <= self.full_scale)) {
            return refuse(format!("has the grey level {bad}; expected 0 to the full scale, {}", self.full_scale));
        }
        if self.red_blue.iter().flatten().any(|plane| plane.len() != self.grey.len()) {
            return refuse("has a red or blue channel of another size than its green one".to_owned());
        }
        if self.grey.iter().all(|v| *v == self.grey[0]) {
            return refuse("is constant; expected an image with contrast".to_owned());
        }
        match &self.nuclei {
            NucleiAnnotation::Masks(labels) if labels.len() != self.grey.len() => refuse(format!(
                "has {} mask labels; expected one for each of its {} pixels",
                labels.len(),
                self.grey.len()
            )),
            NucleiAnnotation::Points(points) if points.iter().flatten().any(|v| !v.is_finite()) => {
                refuse("has a nucleus at a coordinate that is not finite".to_owned())
            }
            _ => Ok(()),
        }
    }

    /// Returns the image without black rows and columns at its border, which some cameras and image fusions produce.
    pub(crate) fn trimmed(&self) -> Self {
        let (width, height) = (self.width, self.height());
        let mean = |values: &mut dyn Iterator<Item = f32>, count: usize| {
            values.map(f64::from).sum::<f64>() / count.max(1) as f64
        };
        let least = BLACK * mean(&mut self.grey.iter().copied(), self.grey.len());
        let row = |y: usize| mean(&mut self.grey[y * width..(y + 1) * width].iter().copied(), width) < least;
        let column = |x: usize| mean(&mut (0..height).map(|y| self.grey[y * width + x]), height) < least;
        let (across, down) = (whole(width as f64 * WIDEST_BLACK), whole(height as f64 * WIDEST_BLACK));
        let left = (0..across).take_while(|&x| column(x)).count();
        let right = (0..across).take_while(|&x| column(width - 1 - x)).count();
        let top = (0..down).take_while(|&y| row(y)).count();
        let bottom = (0..down).take_while(|&y| row(height - 1 - y)).count();
        if left + right + top + bottom == 0 {
            return self.clone();
        }
        self.cut([left, top], [width - left - right, height - top - bottom])
    }

    /// Crops the image to a rectangle: left column and top row, then width and height. Points outside the rectangle are
    /// kept.
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
            red_blue: (self.red_blue.as_ref())
                .map(|planes| planes.each_ref().map(|plane| part(plane, self.width, [left, top], [width, height]))),
            width,
            full_scale: self.full_scale,
            nuclei: match &self.nuclei {
                NucleiAnnotation::None => NucleiAnnotation::None,
                NucleiAnnotation::Points(points) => NucleiAnnotation::Points(of_points(points)),
                NucleiAnnotation::Masks(labels) => {
                    NucleiAnnotation::Masks(part(labels, self.width, [left, top], [width, height]))
                }
            },
        }
    }

    /// Resamples the image to pixels `factor` times as large: each is the mean of the area that it covers, and has the
    /// label of its centre. A factor of 1 or less returns a copy.
    #[must_use]
    pub fn coarsened(&self, factor: f64) -> Self {
        let (width, height) = (self.width, self.height());
        let factor = if factor > 1.0 { factor.min(width.min(height) as f64) } else { return self.clone() };
        let (wide, high) = (whole(width as f64 / factor), whole(height as f64 / factor));
        let across = weights(wide, factor);
        let narrow: Vec<f64> = self
            .grey
            .chunks_exact(width)
            .flat_map(|row| {
                across.iter().map(|(from, parts)| parts.iter().zip(&row[*from..]).map(|(p, v)| p * f64::from(*v)).sum())
            })
            .collect();
        let mut grey = Vec::with_capacity(wide * high);
        for (from, parts) in weights(high, factor) {
            let at = |x: usize| parts.iter().enumerate().map(|(i, p)| p * narrow[(from + i) * wide + x]).sum::<f64>();
            grey.extend((0..wide).map(|x| single(at(x))));
        }
        let centre = |i: usize, count: usize| nearest((i as f64 + 0.5) * factor - 0.5).min(count - 1);
        let nuclei = match &self.nuclei {
            NucleiAnnotation::None => NucleiAnnotation::None,
            NucleiAnnotation::Points(points) => {
                NucleiAnnotation::Points(points.iter().map(|p| p.map(|v| (v + 0.5) / factor - 0.5)).collect())
            }
            NucleiAnnotation::Masks(labels) => {
                let rows = (0..high).map(|y| centre(y, height) * width);
                NucleiAnnotation::Masks(
                    rows.flat_map(|row| (0..wide).map(move |x| labels[row + centre(x, width)])).collect(),
                )
            }
        };
        Self { grey, red_blue: None, width: wide, nuclei, ..self.clone() }
    }
}

/// Returns for each of `count` large pixels the first small pixel that it covers, and the weights of this and the next
/// ones.
fn weights(count: usize, factor: f64) -> Vec<(usize, Vec<f64>)> {
    let weight = |i: usize| {
        let (from, to) = (i as f64 * factor, (i + 1) as f64 * factor);
        let first = whole(from);
        // Rounding must not add a pixel beyond the border.
        let last = whole(to - 1e-9);
        let part = |p: usize| ((p + 1) as f64).min(to) - (p as f64).max(from);
        (first, (first..=last).map(|p| part(p) / factor).collect())
    };
    (0..count).map(weight).collect()
}

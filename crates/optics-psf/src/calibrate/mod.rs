//! Measures blur on a user's images: the paper's own procedures, and the condenser's aperture.
//!
//! - [`focus`]: σ against focus offset, from a stack of one object (Fig. 10).
//! - [`edge`]: σ of the image plane, from an edge in focus ("Impulse response").
//! - [`condenser`]: the aperture of the condenser that explains a stack.
//!
//! Images are intensities of any unit, rows of `width` pixels.

mod condenser;
mod edge;
mod focus;

pub use condenser::{CondenserFit, condenser};
pub use edge::{EdgeFit, edge};
pub use focus::{FocusCurve, Line, focus};

use crate::Error;

/// Part of an image, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub left: usize,
    /// First row.
    pub top: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Smallest side of a window, pixels: less has no statistics.
const LEAST_SIDE: usize = 8;

impl Window {
    /// Whether it lies inside an image.
    fn check(self, width: usize, height: usize) -> Result<(), Error> {
        let fits = |from: usize, len: usize, side: usize| len >= LEAST_SIDE && from <= side && len <= side - from;
        if fits(self.left, self.width, width) && fits(self.top, self.height, height) {
            Ok(())
        } else {
            Err(Error::Window { window: self, width, height, least: LEAST_SIDE })
        }
    }

    /// It and `margin` pixels around, as far as the image goes.
    fn grown(self, margin: usize, width: usize, height: usize) -> Self {
        let (left, top) = (self.left.saturating_sub(margin), self.top.saturating_sub(margin));
        let right = (self.left + self.width + margin).min(width);
        let bottom = (self.top + self.height + margin).min(height);
        Self { left, top, width: right - left, height: bottom - top }
    }

    /// Its pixels, row after row.
    fn crop(self, image: &[f32], width: usize) -> Vec<f32> {
        self.rows().flat_map(|y| &image[y * width + self.left..y * width + self.left + self.width]).copied().collect()
    }

    fn rows(self) -> core::ops::Range<usize> {
        self.top..self.top + self.height
    }

    /// The same pixels in a crop of `outer`.
    fn inside(self, outer: Self) -> Self {
        Self { left: self.left - outer.left, top: self.top - outer.top, ..self }
    }
}

/// Height of the images of a stack, which has at least three of one size.
///
/// # Panics
///
/// As the public functions say.
fn stack_height(stack: &[&[f32]], width: usize) -> Result<usize, Error> {
    if stack.len() < 3 {
        return Err(Error::Count { field: "stack", value: stack.len(), accepted: "three planes or more" });
    }
    assert!(width > 0 && stack[0].len().is_multiple_of(width), "an image is not whole rows of its width");
    assert!(stack.iter().all(|plane| plane.len() == stack[0].len()), "planes differ in size");
    Ok(stack[0].len() / width)
}

/// The plane with most detail, which is neither the first nor the last.
fn sharpest(stack: &[&[f32]], width: usize, window: Window) -> Result<usize, Error> {
    let detail: Vec<f64> = stack.iter().map(|plane| detail(&window.crop(plane, width), window.width)).collect();
    if detail.iter().any(|d| !d.is_finite()) || detail.iter().all(|d| *d == 0.0) {
        return Err(Error::Nothing { thing: "detail" });
    }
    let best = (0..detail.len()).max_by(|&a, &b| detail[a].total_cmp(&detail[b])).unwrap_or(0);
    if best == 0 || best + 1 == stack.len() {
        return Err(Error::NoFocusInside { sharpest: best, planes: stack.len() });
    }
    Ok(best)
}

/// Squared differences over two pixels, along x and y.
fn detail(image: &[f32], width: usize) -> f64 {
    let square = |a: f32, b: f32| f64::from(a - b) * f64::from(a - b);
    let along: f64 = image.chunks_exact(width).flat_map(|row| row.windows(3)).map(|w| square(w[0], w[2])).sum();
    let across: f64 = image.iter().zip(&image[2 * width..]).map(|(a, b)| square(*a, *b)).sum();
    along + across
}

/// The mean of |a − b|.
fn mean_difference(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / a.len() as f64
}

/// Where a curve sampled at equal steps is least, in steps, and its value there: a parabola through the lowest
/// sample and its neighbours.
fn lowest(samples: &[f64]) -> (f64, f64) {
    let best = (0..samples.len()).min_by(|&a, &b| samples[a].total_cmp(&samples[b])).unwrap_or(0);
    if best == 0 || best + 1 == samples.len() {
        return (best as f64, samples[best]);
    }
    let (a, b, c) = (samples[best - 1], samples[best], samples[best + 1]);
    let bend = a - 2.0 * b + c;
    if bend <= 0.0 {
        return (best as f64, b);
    }
    let shift = 0.5 * (a - c) / bend;
    (best as f64 + shift, b - 0.25 * (a - c) * shift)
}

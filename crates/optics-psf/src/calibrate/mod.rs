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
use crate::error::require;

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
    fn crop(self, image: &[f32], width: usize) -> impl Iterator<Item = f32> {
        let rows = self.top..self.top + self.height;
        rows.flat_map(move |y| &image[y * width + self.left..][..self.width]).copied()
    }
}

/// What a window shows of a stack.
struct Seen {
    /// The plane with most detail, which is neither the first nor the last.
    focused: usize,
    /// The window with a margin, the window in that, and what the focused plane holds there.
    outer: Window,
    inner: Window,
    source: Vec<f32>,
    /// What each plane holds in the window.
    targets: Vec<Vec<f32>>,
}

impl Seen {
    /// # Panics
    ///
    /// As the public functions say.
    fn new(stack: &[&[f32]], width: usize, window: Window, margin: usize) -> Result<Self, Error> {
        require("stack", stack.len() as f64, stack.len() >= 3, "three planes or more")?;
        assert!(width > 0 && stack[0].len().is_multiple_of(width), "an image is not whole rows of its width");
        assert!(stack.iter().all(|plane| plane.len() == stack[0].len()), "planes differ in size");
        let height = stack[0].len() / width;
        window.check(width, height)?;
        let targets: Vec<Vec<f32>> = stack.iter().map(|plane| window.crop(plane, width).collect()).collect();
        let detail: Vec<f64> = targets.iter().map(|target| detail(target, window.width)).collect();
        if detail.iter().any(|d| !d.is_finite()) || detail.iter().all(|d| *d == 0.0) {
            return Err(Error::Nothing { thing: "detail" });
        }
        let focused = (0..detail.len()).max_by(|&a, &b| detail[a].total_cmp(&detail[b])).unwrap_or(0);
        if focused == 0 || focused + 1 == stack.len() {
            return Err(Error::NoFocusInside { sharpest: focused, planes: stack.len() });
        }
        let outer = window.grown(margin, width, height);
        let inner = Window { left: window.left - outer.left, top: window.top - outer.top, ..window };
        Ok(Self { focused, outer, inner, source: outer.crop(stack[focused], width).collect(), targets })
    }

    /// The mean of |a − b| over the window, of an image of what is around it and a plane.
    fn difference(&self, image: &[f32], plane: usize) -> f64 {
        let (inner, target) = (self.inner.crop(image, self.outer.width), &self.targets[plane]);
        inner.zip(target).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / target.len() as f64
    }
}

/// Squared differences over two pixels, along x and y.
fn detail(image: &[f32], width: usize) -> f64 {
    let square = |a: f32, b: f32| f64::from(a - b) * f64::from(a - b);
    let along: f64 = image.chunks_exact(width).flat_map(|row| row.windows(3)).map(|w| square(w[0], w[2])).sum();
    let across: f64 = image.iter().zip(&image[2 * width..]).map(|(a, b)| square(*a, *b)).sum();
    along + across
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

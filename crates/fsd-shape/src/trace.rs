//! Traces the outline of a mask: marching squares with linear interpolation, along the boundary.

use crate::Error;
use crate::outline::{Point, signed_area};

/// Returns the closed outer boundary of the single object in `mask`, where its values cross `level`.
///
/// The mask is row-major, top row first. Values outside count as 0, so that objects at the border are closed. A pixel
/// belongs to the object if its value exceeds `level`. Points are linearly interpolated between pixel centres: a pixel
/// of 1 among zeros at level 0.5 gives the diamond through its four edge centres. The outline starts at the leftmost
/// crossing of the top row and runs clockwise on the screen, so that [`signed_area`] is positive with x right and y
/// down. Holes are ignored. Pixels that touch at a corner are connected if the mean of the four pixels around it
/// reaches the level; in a binary mask at level 0.5 they are.
///
/// # Errors
///
/// If the length is not a multiple of the width, `level` is not positive and finite, a value is not finite, no value
/// exceeds the level, or the mask has several components.
///
/// ```
/// let mask = [0.0, 1.0, 0.0,
///             1.0, 1.0, 1.0,
///             0.0, 1.0, 0.0];
/// let outline = fsd_shape::trace(&mask, 3, 0.5)?;
/// assert_eq!(outline[0], [0.5, 0.0]);
/// assert_eq!(fsd_shape::signed_area(&outline), 4.5);
/// # Ok::<(), fsd_shape::Error>(())
/// ```
pub fn trace(mask: &[f32], width: usize, level: f32) -> Result<Vec<Point>, Error> {
    if width == 0 || !mask.len().is_multiple_of(width) {
        return Err(Error::MaskSize { len: mask.len(), width });
    }
    if !(level.is_finite() && level > 0.0) {
        return Err(Error::Parameter { field: "level", value: f64::from(level), accepted: "a positive finite number" });
    }
    if let Some(i) = mask.iter().position(|v| !v.is_finite()) {
        return Err(Error::MaskValue { value: mask[i], x: i % width, y: i / width });
    }
    let field = Field { mask, width, level };
    // Every loop, outer or hole, runs upwards along the left side of at least one inside pixel. Each of these pixels
    // starts a loop or is part of a previous one.
    let mut seen = vec![false; mask.len()];
    let mut outline = Vec::new();
    let mut count = 0;
    for y in 0..mask.len() / width {
        for x in 0..width {
            let i = y * width + x;
            let starts = mask[i] > level && (x == 0 || mask[i - 1] <= level) && !seen[i];
            if !starts {
                continue;
            }
            let traced = field.trace_loop(i, &mut seen);
            if signed_area(&traced) > 0.0 {
                count += 1;
                if count == 1 {
                    outline = traced;
                }
            }
        }
    }
    match count {
        0 => Err(Error::EmptyMask { level }),
        1 => Ok(outline),
        _ => Err(Error::SeveralComponents { count }),
    }
}

/// A pixel, possibly outside the image.
type Pixel = [isize; 2];

struct Field<'a> {
    mask: &'a [f32],
    width: usize,
    level: f32,
}

impl Field<'_> {
    fn at(&self, [x, y]: Pixel) -> f32 {
        match (usize::try_from(x), usize::try_from(y)) {
            (Ok(x), Ok(y)) if x < self.width => self.mask.get(y * self.width + x).copied().unwrap_or(0.0),
            _ => 0.0,
        }
    }

    fn inside(&self, pixel: Pixel) -> bool {
        self.at(pixel) > self.level
    }

    /// Returns the point where the mask crosses the level between an outside and an inside pixel.
    fn crossing(&self, outside: Pixel, inside: Pixel) -> Point {
        let (a, b) = (f64::from(self.at(outside)), f64::from(self.at(inside)));
        let t = (f64::from(self.level) - a) / (b - a);
        let along = |axis: usize| outside[axis] as f64 + t * (inside[axis] - outside[axis]) as f64;
        [along(0), along(1)]
    }

    /// Returns the loop that runs upwards along the left side of pixel `start`, and marks each pixel with such a side.
    ///
    /// The current position is between an outside pixel on the left and an inside pixel on the right. The next two
    /// pixels ahead determine the direction: both outside, right; both inside, left; otherwise straight on, or at a
    /// saddle by the mean.
    fn trace_loop(&self, start: usize, seen: &mut [bool]) -> Vec<Point> {
        #[expect(clippy::cast_possible_wrap, reason = "no image has 2^63 columns or rows")]
        let first: Pixel = [(start % self.width) as isize, (start / self.width) as isize];
        let (mut left, mut right) = ([first[0] - 1, first[1]], first);
        let mut points: Vec<Point> = Vec::new();
        loop {
            let point = self.crossing(left, right);
            // If an outside pixel equals the level, several crossings coincide at its centre.
            if points.last() != Some(&point) {
                points.push(point);
            }
            if right[0] == left[0] + 1 {
                #[expect(clippy::cast_sign_loss, reason = "inside pixels are in the image")]
                let index = right[1] as usize * self.width + right[0] as usize;
                seen[index] = true;
            }
            // Ahead is the direction from left to right, rotated left by a quarter turn.
            let ahead = [right[1] - left[1], left[0] - right[0]];
            let ahead_left = [left[0] + ahead[0], left[1] + ahead[1]];
            let ahead_right = [right[0] + ahead[0], right[1] + ahead[1]];
            match (self.inside(ahead_left), self.inside(ahead_right)) {
                (false, false) => left = ahead_right,
                (true, true) => right = ahead_left,
                (false, true) => (left, right) = (ahead_left, ahead_right),
                (true, false) => {
                    let sum = self.at(left) + self.at(right) + self.at(ahead_left) + self.at(ahead_right);
                    if sum / 4.0 >= self.level {
                        right = ahead_left;
                    } else {
                        left = ahead_right;
                    }
                }
            }
            if right == first && left == [first[0] - 1, first[1]] {
                break;
            }
        }
        if points.len() > 1 && points.first() == points.last() {
            points.pop();
        }
        points
    }
}

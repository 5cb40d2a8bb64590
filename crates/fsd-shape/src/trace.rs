//! From a mask to its outline: marching squares with linear interpolation, walked along the boundary.

use crate::Error;
use crate::outline::{Point, signed_area};

/// The closed outer boundary of the one object in `mask`, where its values cross `level`.
///
/// The mask is row-major, top row first; outside it counts as 0, so objects that touch the border are closed. A pixel
/// belongs to the object if its value exceeds `level`. Points lie between pixel centres, linearly interpolated; a pixel of
/// 1 among zeros at level 0.5 becomes the diamond through its four edge centres. The outline starts at the top row's leftmost crossing
/// and runs clockwise on the screen, so that [`signed_area`] is positive with x right and y down. Holes are ignored.
/// Pixels that meet at a corner are joined if the mean of the four around it reaches the level, so in a binary mask at level 0.5 they are.
///
/// # Errors
///
/// If the length is no multiple of the width, `level` is not positive and finite, a value is not finite, no
/// value exceeds the level, or the object falls into several components.
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
        return Err(Error::Parameter {
            field: "level",
            value: f64::from(level),
            accepted: "positive and finite (outside the mask counts as 0)",
        });
    }
    if let Some(i) = mask.iter().position(|v| !v.is_finite()) {
        return Err(Error::MaskValue { value: mask[i], x: i % width, y: i / width });
    }
    let field = Field { mask, width, level };
    // Every loop, outer or hole, somewhere runs upwards past the west side of an inside pixel: each such place starts a loop or lies on one walked before.
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
            let walked = field.walk(i, &mut seen);
            if signed_area(&walked) > 0.0 {
                count += 1;
                if count == 1 {
                    outline = walked;
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

    /// Where the mask crosses the level between an outside and an inside pixel.
    fn crossing(&self, outside: Pixel, inside: Pixel) -> Point {
        let (a, b) = (f64::from(self.at(outside)), f64::from(self.at(inside)));
        let t = (f64::from(self.level) - a) / (b - a);
        let along = |axis: usize| outside[axis] as f64 + t * (inside[axis] - outside[axis]) as f64;
        [along(0), along(1)]
    }

    /// The loop that runs upwards past the west side of pixel `start`; marks each such place it passes.
    ///
    /// The walker stands between an outside pixel at its left hand and an inside pixel at its right, and looks at the two
    /// pixels ahead of these: both outside, it turns right; both inside, left; else straight on, or at a saddle as the mean says.
    fn walk(&self, start: usize, seen: &mut [bool]) -> Vec<Point> {
        #[expect(clippy::cast_possible_wrap, reason = "no image has 2^63 columns or rows")]
        let first: Pixel = [(start % self.width) as isize, (start / self.width) as isize];
        let (mut left, mut right) = ([first[0] - 1, first[1]], first);
        let mut points: Vec<Point> = Vec::new();
        loop {
            let point = self.crossing(left, right);
            // Where an outside pixel equals the level, several crossings fall on its centre.
            if points.last() != Some(&point) {
                points.push(point);
            }
            if right[0] == left[0] + 1 {
                #[expect(clippy::cast_sign_loss, reason = "inside pixels lie in the image")]
                let index = right[1] as usize * self.width + right[0] as usize;
                seen[index] = true;
            }
            // Ahead is the direction from left to right, turned left by a quarter.
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

use crate::Error;
use crate::distance::centrality;

/// Candidates compared at once: one vector of AVX-512, two of AVX, four of NEON.
pub(crate) const LANES: usize = 32;

/// Pixels behind the end of each row, so that a block of candidates may be read past it.
pub(crate) const ROW_PADDING: usize = LANES;

/// Coverage from which a pixel counts as belonging to the mask.
pub(crate) const COVERED: f32 = 0.5;

/// A texture to take patches from, known where its mask is.
///
/// Sources that are quilted together should have a common mean and spread: patches keep their
/// grey levels.
#[derive(Debug, Clone)]
pub struct Source {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Rows of `stride` pixels; 0 where unknown and in the padding.
    pub(crate) pixels: Vec<f32>,
    /// Relative distance from the mask's edge, in the same layout.
    pub(crate) centrality: Vec<f32>,
    /// Whether a pixel is known, in rows of `width`.
    pub(crate) known: Vec<bool>,
    /// Number of known pixels, and the sum of the squares of their deviations from the mean.
    pub(crate) count: usize,
    pub(crate) squares: f64,
}

impl Source {
    /// Takes a texture `width` pixels wide. Pixels whose `mask` (coverage, 0 to 1) is 0.5 or more
    /// are used, the others never looked at.
    ///
    /// # Errors
    ///
    /// If pixels, mask and width do not fit together, the mask covers nothing, or a value used is
    /// not finite.
    pub fn new(pixels: &[f32], mask: &[f32], width: usize) -> Result<Self, Error> {
        if width == 0 || pixels.len() != mask.len() || !pixels.len().is_multiple_of(width) {
            return Err(Error::Shape { pixels: pixels.len(), mask: mask.len(), width });
        }
        finite("mask", mask.iter().enumerate())?;
        let known: Vec<bool> = mask.iter().map(|&m| m >= COVERED).collect();
        let used = || pixels.iter().enumerate().filter(|&(i, _)| known[i]);
        finite("pixels", used())?;
        let count = used().count();
        if count == 0 {
            return Err(Error::EmptyMask);
        }
        #[expect(clippy::cast_precision_loss, reason = "far below 2^53 pixels")]
        let mean = used().map(|(_, &v)| f64::from(v)).sum::<f64>() / count as f64;
        let squares = used().map(|(_, &v)| f64::from(v) - mean).map(|d| d * d).sum();

        let height = pixels.len() / width;
        let stride = width + ROW_PADDING;
        let mut padded = vec![0.0; stride * height + ROW_PADDING];
        let mut depth = padded.clone();
        let distances = centrality(&known, width);
        for y in 0..height {
            for x in 0..width {
                let i = y * width + x;
                if known[i] {
                    padded[y * stride + x] = pixels[i];
                    depth[y * stride + x] = distances[i];
                }
            }
        }
        Ok(Self { width, height, pixels: padded, centrality: depth, known, count, squares })
    }

    /// Width, px.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Pixels from one row to the next in the padded layout.
    pub(crate) fn stride(&self) -> usize {
        self.width + ROW_PADDING
    }
}

fn finite<'a>(slice: &'static str, values: impl Iterator<Item = (usize, &'a f32)>) -> Result<(), Error> {
    for (index, &value) in values {
        if !value.is_finite() {
            return Err(Error::NotFinite { slice, index, value });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mismatches_are_errors() {
        let shape =
            |pixels: usize, mask: usize, width| Source::new(&vec![0.0; pixels], &vec![1.0; mask], width).unwrap_err();
        for bad in [shape(6, 6, 0), shape(6, 5, 3), shape(7, 7, 3)] {
            assert!(matches!(bad, Error::Shape { .. }));
        }
        assert!(matches!(Source::new(&[1.0; 4], &[0.4; 4], 2), Err(Error::EmptyMask)));
        assert!(matches!(Source::new(&[], &[], 3), Err(Error::EmptyMask)));
        let nan = Source::new(&[1.0, f32::NAN], &[1.0, 1.0], 2).unwrap_err();
        assert_eq!(nan.to_string(), "pixels[1] is NaN; accepted: finite values");
        assert!(Source::new(&[1.0, 2.0], &[1.0, f32::NAN], 2).is_err());
    }

    #[test]
    fn pixels_outside_the_mask_are_ignored() {
        let source = Source::new(&[3.0, f32::NAN, 5.0], &[0.5, 0.49, 1.0], 3).unwrap();
        assert_eq!(source.count, 2);
        assert!((source.squares - 2.0).abs() < 1e-12);
        assert!(source.pixels.iter().all(|v| v.is_finite()));
    }
}

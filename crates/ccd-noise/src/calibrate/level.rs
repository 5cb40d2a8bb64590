//! Statistics of the frames of one light level.

use crate::error::{Error, require};

/// Treatment of uneven illumination in flats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shading {
    /// Flats are evenly lit: every difference between pixels belongs to the camera. EMVA 1288 requires even light.
    Kept,
    /// Flats are unevenly lit, as through a microscope. The mean of a square around each pixel is subtracted before the
    /// spatial variance is computed. Pixels closer than half a side to the border are left out.
    Removed {
        /// Side of the square in pixels, odd, from 3 to below the width and height of the frames.
        side_px: usize,
    },
}

/// Amount of light of the frames of a level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightLevel {
    /// Dark frames: closed shutter, same exposure time as the other levels.
    Dark,
    /// An unknown amount of light.
    Unknown,
    /// Amount in any unit, above 0, such as brightness times exposure time. It gives the linearity error.
    Relative(f64),
    /// Mean number of photons per pixel, above 0. It also gives the quantum efficiency.
    Photons(f64),
}

/// A point of the photon transfer curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Amount of light.
    pub light: LightLevel,
    /// Number of frames.
    pub frames: usize,
    /// Mean grey level.
    pub mean_dn: f64,
    /// Temporal variance, from differences of frames. Fluctuation of the frame means is subtracted.
    pub variance_dn2: f64,
    /// Spatial variance of the pixels' temporal means. The contribution of temporal noise is subtracted; the result may
    /// be negative.
    pub spatial_dn2: f64,
    /// Fraction of pixels at the highest grey level.
    pub at_highest: f64,
    /// Fraction of pixels at level 0.
    pub at_zero: f64,
}

/// Measures two or more frames of equal size. `highest` is the highest possible grey level.
pub(super) fn measure(
    frames: &[&[u16]],
    width: usize,
    highest: u16,
    light: LightLevel,
    shading: Shading,
) -> Result<Level, Error> {
    let (count, pixels) = (frames.len() as f64, frames[0].len() as f64);
    let (mut at_highest, mut at_zero) = (0, 0);
    let mut means = Vec::with_capacity(frames.len());
    for frame in frames {
        let (mut sum, mut largest) = (0, 0);
        for &dn in *frame {
            sum += u64::from(dn);
            largest = largest.max(dn);
            at_highest += usize::from(dn == highest);
            at_zero += usize::from(dn == 0);
        }
        require("frames", largest.into(), largest <= highest, "from 0 to 2^bit_depth - 1")?;
        means.push(sum as f64 / pixels);
    }
    // Deviations from the mean of each frame, so that lamp flicker adds no noise.
    let mut mean_image = vec![0.0; frames[0].len()];
    let mut squares = vec![0.0; frames[0].len()];
    for (frame, mean) in frames.iter().zip(&means) {
        for ((sum, square), &dn) in mean_image.iter_mut().zip(&mut squares).zip(*frame) {
            let deviation = f64::from(dn) - mean;
            *sum += deviation;
            *square += deviation * deviation;
        }
    }
    let mut variance = 0.0;
    for (sum, square) in mean_image.iter_mut().zip(&squares) {
        variance += square - *sum * *sum / count;
        *sum /= count;
    }
    variance /= pixels * (count - 1.0);
    let spatial = match shading {
        Shading::Kept => mean_image.iter().map(|v| v * v).sum::<f64>() / (pixels - 1.0).max(1.0),
        Shading::Removed { side_px } => variance_without_shading(&mean_image, width, side_px),
    };
    Ok(Level {
        light,
        frames: frames.len(),
        mean_dn: means.iter().sum::<f64>() / count,
        variance_dn2: variance,
        spatial_dn2: spatial - variance / count,
        at_highest: at_highest as f64 / (count * pixels),
        at_zero: at_zero as f64 / (count * pixels),
    })
}

/// Returns the variance of an image of mean 0 after subtraction of the mean of a square around each pixel. The result is
/// divided by 1 - 1/side², the variance that remains of white noise.
fn variance_without_shading(image: &[f64], width: usize, side: usize) -> f64 {
    let (height, around) = (image.len() / width, side / 2);
    let area = (side * side) as f64;
    // Sums over `side` rows, updated row by row.
    let mut columns = vec![0.0; width];
    let (mut squares, mut count) = (0.0, 0.0);
    for y in 0..height {
        for (sum, value) in columns.iter_mut().zip(&image[y * width..]) {
            *sum += value;
        }
        if y + 1 < side {
            continue;
        }
        let centre = &image[(y - around) * width..][..width];
        let mut sum = columns[..side - 1].iter().sum::<f64>();
        for x in around..width - around {
            sum += columns[x + around];
            let rest = centre[x] - sum / area;
            squares += rest * rest;
            count += 1.0;
            sum -= columns[x - around];
        }
        for (sum, value) in columns.iter_mut().zip(&image[(y + 1 - side) * width..]) {
            *sum -= value;
        }
    }
    squares / (count * (1.0 - 1.0 / area))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shading_removal_matches_direct_computation() {
        let (width, height, side) = (23_usize, 17_usize, 5_usize);
        let image: Vec<f64> = (0..width * height).map(|i| ((i * 7919) % 101) as f64 - 50.0 + i as f64).collect();
        let (mut squares, mut count) = (0.0, 0.0);
        for y in 2..height - 2 {
            for x in 2..width - 2 {
                let square = (y - 2..=y + 2).flat_map(|y| (x - 2..=x + 2).map(move |x| y * width + x));
                let mean = square.map(|i| image[i]).sum::<f64>() / 25.0;
                squares += (image[y * width + x] - mean) * (image[y * width + x] - mean);
                count += 1.0;
            }
        }
        let expected = squares / count / (1.0 - 1.0 / 25.0);
        let got = variance_without_shading(&image, width, side);
        assert!((got / expected - 1.0).abs() < 1e-12, "{got} {expected}");
    }
}

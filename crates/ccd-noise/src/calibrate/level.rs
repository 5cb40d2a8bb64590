//! What the frames of one level of light say.

use crate::error::{Error, require};

/// Whether flats are taken to be lit evenly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shading {
    /// They are: all that differs between pixels is the camera's. EMVA 1288 demands it of the laboratory.
    Kept,
    /// They are not, as through a microscope: from each pixel the mean of a square around it is taken away before
    /// their spread is measured. Pixels nearer to the border than half a side are left out.
    Removed {
        /// Side of the square in pixels, odd, from 3 to below the width and height of the frames.
        side_px: usize,
    },
}

/// How much light frames were taken in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// None: the shutter closed, the exposure as long as that of the others.
    Dark,
    /// Some.
    Unknown,
    /// This much in some unit, above 0, as brightness times time: it tells how straight the response is.
    Relative(f64),
    /// This many photons on average on a pixel, above 0: it tells the quantum efficiency too.
    Photons(f64),
}

/// A point of the photon transfer curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// The light.
    pub light: Light,
    /// How many frames it is measured on.
    pub frames: usize,
    /// Mean grey level.
    pub mean_dn: f64,
    /// Variance in time, from the differences of frames; that of their means is taken off.
    pub variance_dn2: f64,
    /// Variance over the pixels of their means in time; what the noise in time adds is taken off, so that it may be below 0.
    pub spatial_dn2: f64,
    /// The share of pixels at the highest level.
    pub at_highest: f64,
    /// The share of pixels at level 0.
    pub at_zero: f64,
}

/// What two or more frames of one size say, whose highest possible level is `highest`.
pub(super) fn measure(
    frames: &[&[u16]],
    width: usize,
    highest: u16,
    light: Light,
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
    // Frame by frame around its own mean, so that a lamp that flickers adds no noise.
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
    let spread = match shading {
        Shading::Kept => mean_image.iter().map(|v| v * v).sum::<f64>() / (pixels - 1.0).max(1.0),
        Shading::Removed { side_px } => spread_without_shading(&mean_image, width, side_px),
    };
    Ok(Level {
        light,
        frames: frames.len(),
        mean_dn: means.iter().sum::<f64>() / count,
        variance_dn2: variance,
        spatial_dn2: spread - variance / count,
        at_highest: at_highest as f64 / (count * pixels),
        at_zero: at_zero as f64 / (count * pixels),
    })
}

/// The mean square of what remains of an image of mean 0 after the mean of a square around each pixel is taken away, and
/// divided by what remains of white noise, 1 - 1/side².
fn spread_without_shading(image: &[f64], width: usize, side: usize) -> f64 {
    let (height, around) = (image.len() / width, side / 2);
    let area = (side * side) as f64;
    // Sums over `side` rows, moved down a row at a time.
    let mut columns = vec![0.0; width];
    let (mut squares, mut count) = (0.0, 0.0);
    for y in 0..height {
        for (sum, value) in columns.iter_mut().zip(&image[y * width..]) {
            *sum += value;
        }
        if y + 1 < side {
            continue;
        }
        let middle = &image[(y - around) * width..][..width];
        let mut sum = columns[..side - 1].iter().sum::<f64>();
        for x in around..width - around {
            sum += columns[x + around];
            let rest = middle[x] - sum / area;
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
    fn shading_is_removed_as_by_hand() {
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
        let got = spread_without_shading(&image, width, side);
        assert!((got / expected - 1.0).abs() < 1e-12, "{got} {expected}");
    }
}

//! What both image formats decode to, before it is known what it is for.

use crate::error::Problem;

/// Samples as they stand in the file, row by row, channels interleaved.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Samples {
    U8(Vec<u8>),
    U16(Vec<u16>),
    U32(Vec<u32>),
    F32(Vec<f32>),
}

/// Channels of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Channels {
    Grey,
    GreyAlpha,
    Rgb,
    Rgba,
}

impl Channels {
    pub(super) fn count(self) -> usize {
        match self {
            Self::Grey => 1,
            Self::GreyAlpha => 2,
            Self::Rgb => 3,
            Self::Rgba => 4,
        }
    }
}

/// A decoded image of one, two, three or four channels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Raster {
    pub(super) width: usize,
    pub(super) channels: Channels,
    pub(super) samples: Samples,
}

impl Raster {
    /// The one channel of an image whose pixels are all grey and opaque.
    pub(super) fn grey(self) -> Result<Samples, Problem> {
        let (channels, width) = (self.channels, self.width);
        Ok(match self.samples {
            Samples::U8(samples) => Samples::U8(grey(samples, channels, u8::MAX, width)?),
            Samples::U16(samples) => Samples::U16(grey(samples, channels, u16::MAX, width)?),
            Samples::U32(samples) => Samples::U32(grey(samples, channels, u32::MAX, width)?),
            Samples::F32(samples) => Samples::F32(grey(samples, channels, 1.0, width)?),
        })
    }
}

fn grey<T: Copy + PartialEq>(samples: Vec<T>, channels: Channels, opaque: T, width: usize) -> Result<Vec<T>, Problem> {
    let count = channels.count();
    let colours = match channels {
        Channels::Grey => return Ok(samples),
        Channels::GreyAlpha => 1,
        Channels::Rgb | Channels::Rgba => 3,
    };
    let pixels = samples.chunks_exact(count).enumerate();
    pixels
        .map(|(i, pixel)| {
            let what = if pixel[..colours].iter().any(|c| *c != pixel[0]) {
                "coloured"
            } else if count > colours && pixel[colours] != opaque {
                "transparent"
            } else {
                return Ok(pixel[0]);
            };
            Err(Problem::NotGrey { what, x: i % width, y: i / width })
        })
        .collect()
}

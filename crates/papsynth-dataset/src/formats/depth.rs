//! Bit depths of images.

use std::borrow::Cow;

use papsynth::white_level as white;

use crate::read::LevelImage;

/// Bits of the images of formats for training.
pub(crate) const TRAINING_BITS: u32 = 8;

/// Bit depth of the images of a format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Depth {
    /// Bit depth of the camera.
    Camera,
    /// 8 bits, because the readers of trainers (Pillow, OpenCV) truncate deeper images, above all in colour.
    Training,
}

/// Scales camera levels to 8 bits: round(level × 255 / (2^bits − 1)). Levels of at most 8 bits are returned unchanged.
pub(crate) fn to_training(levels: &[u16], bits: u32) -> Cow<'_, [u16]> {
    if bits <= TRAINING_BITS {
        return Cow::Borrowed(levels);
    }
    let white = u32::from(white(bits));
    // There are no ties, because 2^bits − 1 is odd.
    let scaled = |&level: &u16| u16::try_from((510 * u32::from(level) + white) / (2 * white)).unwrap_or(u16::MAX);
    levels.iter().map(scaled).collect::<Vec<_>>().into()
}

/// Scales an 8-bit image of a deeper camera back to the camera's range. [`to_training`] gives the same 8-bit levels
/// again.
pub(crate) fn to_camera(page: LevelImage, bits: u32) -> LevelImage {
    if page.white != u16::from(u8::MAX) || bits <= TRAINING_BITS {
        return page;
    }
    let white = u32::from(white(bits));
    let scaled = |level: u16| u16::try_from((2 * white * u32::from(level) + 255) / 510).unwrap_or(u16::MAX);
    LevelImage { levels: page.levels.into_iter().map(scaled).collect(), white: u16::MAX, ..page }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_scaled_to_8_bits_and_back() {
        for bits in 9..=16 {
            let full = white(bits);
            let all: Vec<u16> = (0..=full).collect();
            let scaled = to_training(&all, bits);
            assert_eq!((scaled[0], scaled[usize::from(full)]), (0, 255));
            for (level, scaled) in all.iter().zip(&*scaled) {
                let expected = (f64::from(*level) * 255.0 / f64::from(full)).round();
                assert_eq!(f64::from(*scaled), expected, "{level} of {full}");
            }
            let eight = LevelImage { width: 256, channels: 1, levels: (0..256).collect(), white: 255 };
            let deep = to_camera(eight.clone(), bits);
            assert_eq!(to_training(&deep.levels, bits), eight.levels);
            assert_eq!((deep.white, deep.levels[255]), (u16::MAX, full));
        }
        assert_eq!(to_training(&[3, 255], 8), [3, 255].as_slice());
        let deep = LevelImage { width: 1, channels: 1, levels: vec![9], white: u16::MAX };
        assert_eq!(to_camera(deep.clone(), 12), deep);
    }
}

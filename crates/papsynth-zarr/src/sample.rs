//! Data types, and images at half size.

/// Data type of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DataType {
    /// Unsigned 8-bit integer.
    U8,
    /// Unsigned 16-bit integer.
    U16,
    /// Unsigned 32-bit integer.
    U32,
    /// IEEE 754 32-bit floating-point number.
    F32,
}

impl DataType {
    /// Returns the size of a value, bytes.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Returns the name in Zarr.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::F32 => "float32",
        }
    }
}

/// A value of an array: `u8`, `u16`, `u32` or `f32`.
pub trait Sample: Copy + Default + PartialEq + sealed::Sealed {
    /// Data type.
    const KIND: DataType;

    /// Appends the bytes of values in little-endian order.
    fn put(values: &[Self], out: &mut Vec<u8>);

    /// Reads a value from the start of a slice; 0 if the slice has less than [`DataType::bytes`] bytes.
    fn get(bytes: &[u8]) -> Self;

    /// Returns the mean of four values; for integers `(a + b + c + d + 2) / 4`.
    #[must_use]
    fn mean(of: [Self; 4]) -> Self;
}

mod sealed {
    pub trait Sealed {}
}

macro_rules! sample {
    ($type:ty, $kind:ident, $mean:expr) => {
        impl sealed::Sealed for $type {}

        impl Sample for $type {
            const KIND: DataType = DataType::$kind;

            fn put(values: &[Self], out: &mut Vec<u8>) {
                let from = out.len();
                out.resize(from + size_of_val(values), 0);
                let (places, _) = out[from..].as_chunks_mut();
                for (place, value) in places.iter_mut().zip(values) {
                    *place = value.to_le_bytes();
                }
            }

            fn get(bytes: &[u8]) -> Self {
                bytes.first_chunk().map_or_else(Self::default, |bytes| Self::from_le_bytes(*bytes))
            }

            #[expect(clippy::cast_possible_truncation, reason = "a mean is not larger than the largest value")]
            #[inline]
            fn mean(of: [Self; 4]) -> Self {
                $mean(of.map(Into::into)) as Self
            }
        }
    };
}

sample!(u8, U8, |[a, b, c, d]: [u32; 4]| (a + b + c + d + 2) / 4);
sample!(u16, U16, |[a, b, c, d]: [u32; 4]| (a + b + c + d + 2) / 4);
sample!(u32, U32, |[a, b, c, d]: [u64; 4]| (a + b + c + d + 2) / 4);
sample!(f32, F32, |[a, b, c, d]: [f64; 4]| (a + b + c + d) / 4.0);

/// Halves an image: each pixel is the mean of 2 x 2 pixels ([`Sample::mean`]).
///
/// `values` are rows of `width` values; the result has `width.div_ceil(2)` columns. An odd last row or column is
/// repeated, so a pixel at the border is the rounded mean of the pixels that exist. Blocks with even start rows and
/// columns can be halved independently.
#[must_use]
pub fn halved<T: Sample>(values: &[T], width: usize) -> Vec<T> {
    by_fours(values, width, T::mean)
}

/// Halves a label image: each pixel is the upper left one of 2 x 2 pixels.
#[must_use]
pub fn halved_labels<T: Sample>(values: &[T], width: usize) -> Vec<T> {
    by_fours(values, width, |[upper_left, ..]| upper_left)
}

fn by_fours<T: Sample>(values: &[T], width: usize, one: impl Fn([T; 4]) -> T) -> Vec<T> {
    let width = width.max(1);
    let rows: Vec<&[T]> = values.chunks_exact(width).collect();
    let mut half = Vec::with_capacity(width.div_ceil(2) * rows.len().div_ceil(2));
    for pair in rows.chunks(2) {
        let [(upper, upper_rest), (lower, lower_rest)] = [pair[0], pair[pair.len() - 1]].map(<[T]>::as_chunks);
        half.extend(upper.iter().zip(lower).map(|(&[a, b], &[c, d])| one([a, b, c, d])));
        half.extend(upper_rest.iter().zip(lower_rest).map(|(&above, &below)| one([above, above, below, below])));
    }
    half
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn small_images_are_halved_as_by_hand() {
        // Halves round up, odd borders are repeated.
        assert_eq!(halved(&[0_u8, 1, 9, 1, 0, 8, 5, 6, 250], 3), [1, 9, 6, 250]);
        assert_eq!(halved(&[255_u8; 12], 4), [255; 4]);
        assert_eq!(halved(&[u32::MAX; 4], 2), [u32::MAX]);
        assert_eq!(halved(&[0.0_f32, 1.0, 2.0, 4.0], 2), [1.75]);
        assert_eq!(halved_labels(&[1_u32, 2, 3, 4, 5, 6, 7, 8, 9], 3), [1, 3, 7, 9]);
        assert!(halved::<u8>(&[], 0).is_empty());
    }

    proptest! {
        /// Against the sum over the pixels that there are.
        #[test]
        fn pixels_are_means_of_existing_pixels(width in 1_usize..20, height in 1_usize..20, seed in 0_u64..1000) {
            let at = |x: usize, y: usize| (x as u64 * 7919 + y as u64 * 104_729 + seed * 31) % 65_536;
            let values: Vec<u16> =
                (0..width * height).map(|i| u16::try_from(at(i % width, i / width)).unwrap()).collect();
            let half = halved(&values, width);
            prop_assert_eq!(half.len(), width.div_ceil(2) * height.div_ceil(2));
            for (i, &found) in half.iter().enumerate() {
                let (x, y) = (i % width.div_ceil(2) * 2, i / width.div_ceil(2) * 2);
                let there: Vec<u64> = [[x, y], [x + 1, y], [x, y + 1], [x + 1, y + 1]]
                    .into_iter()
                    .filter(|&[x, y]| x < width && y < height)
                    .map(|[x, y]| at(x, y))
                    .collect();
                let count = there.len() as u64;
                prop_assert_eq!(u64::from(found), (2 * there.iter().sum::<u64>() + count) / (2 * count));
            }
        }
    }
}

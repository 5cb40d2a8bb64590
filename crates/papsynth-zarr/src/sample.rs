//! The numbers of an array.

/// The type of an array's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// 8 bits without sign.
    U8,
    /// 16 bits without sign.
    U16,
    /// 32 bits without sign.
    U32,
    /// IEEE 754, 32 bits.
    F32,
}

impl Kind {
    /// Bytes of a number.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// As Zarr calls it.
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

/// A number that arrays are made of: `u8`, `u16`, `u32`, `f32`.
pub trait Sample: Copy + Default + PartialEq + sealed::Sealed {
    /// Its type in an array.
    const KIND: Kind;

    /// Appends its bytes, the lowest first.
    fn put(self, out: &mut Vec<u8>);

    /// The number that begins a slice of at least [`Kind::bytes`] bytes; 0 if it is shorter.
    fn get(bytes: &[u8]) -> Self;

    /// The mean of four; of integers `(a + b + c + d + 2) / 4`, a half upwards.
    #[must_use]
    fn mean(of: [Self; 4]) -> Self;
}

mod sealed {
    pub trait Sealed {}

    impl Sealed for u8 {}
    impl Sealed for u16 {}
    impl Sealed for u32 {}
    impl Sealed for f32 {}
}

macro_rules! integer {
    ($type:ty, $kind:expr) => {
        impl Sample for $type {
            const KIND: Kind = $kind;

            fn put(self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            fn get(bytes: &[u8]) -> Self {
                bytes.first_chunk().map_or(0, |bytes| Self::from_le_bytes(*bytes))
            }

            #[expect(clippy::cast_possible_truncation, reason = "a mean is no larger than the largest")]
            fn mean(of: [Self; 4]) -> Self {
                ((of.iter().map(|&v| u64::from(v)).sum::<u64>() + 2) / 4) as Self
            }
        }
    };
}

integer!(u8, Kind::U8);
integer!(u16, Kind::U16);
integer!(u32, Kind::U32);

impl Sample for f32 {
    const KIND: Kind = Kind::F32;

    fn put(self, out: &mut Vec<u8>) {
        out.extend_from_slice(&self.to_le_bytes());
    }

    fn get(bytes: &[u8]) -> Self {
        bytes.first_chunk().map_or(0.0, |bytes| Self::from_le_bytes(*bytes))
    }

    #[expect(clippy::cast_possible_truncation, reason = "rounded once")]
    fn mean([a, b, c, d]: [Self; 4]) -> Self {
        ((f64::from(a) + f64::from(b) + f64::from(c) + f64::from(d)) / 4.0) as Self
    }
}

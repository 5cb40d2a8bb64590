//! Lossy steps of JPEG compression, without the lossless entropy coding.

use crate::error::{Error, require, within};
use crate::field::assert_rows;

/// Chroma subsampling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Subsampling {
    /// 4:4:4: no subsampling.
    S444,
    /// 4:2:2: two columns share one chroma sample.
    S422,
    /// 4:2:0: squares of four pixels share one chroma sample. Most encoders use it.
    #[default]
    S420,
}

/// Parameters of JPEG compression.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JpegParams {
    /// Quality, on the scale of the Independent JPEG Group's encoder, 1 to 100. Default 90, ours.
    pub quality: u32,
    /// Chroma subsampling of colour images. Default 4:2:0, as in most encoders. Grey images have no chroma.
    pub subsampling: Subsampling,
    /// Bit depth of the image. Default 8, the only one of baseline JPEG.
    pub bit_depth: u32,
}

impl Default for JpegParams {
    fn default() -> Self {
        Self { quality: 90, subsampling: Subsampling::S420, bit_depth: 8 }
    }
}

/// An 8 x 8 block of rows.
type Block = [[i32; SIDE]; SIDE];

const SIDE: usize = 8;

/// Compresses and decompresses images in place: chroma subsampling, 8 x 8 cosine transforms and quantisation with the
/// tables of ITU-T T.81, Annex K, scaled by the quality.
///
/// The integer arithmetic has the precision of the Independent JPEG Group's library. Images equal those that programs
/// with this library save and load, to the last bit. Incomplete blocks are padded with the last pixels, as in the
/// library.
#[derive(Debug, Clone, PartialEq)]
pub struct Jpeg {
    /// Quantisation steps of the coefficients.
    luma: Block,
    chroma: Block,
    subsampling: Subsampling,
}

/// ITU-T T.81, table K.1.
const LUMA: [u32; 64] = [
    16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51,
    87, 80, 62, 18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101,
    72, 92, 95, 98, 112, 100, 103, 99,
];

/// ITU-T T.81, table K.2.
const CHROMA: [u32; 64] = [
    17, 18, 24, 47, 99, 99, 99, 99, 18, 21, 26, 66, 99, 99, 99, 99, 24, 26, 56, 99, 99, 99, 99, 99, 47, 66, 99, 99, 99,
    99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99,
    99, 99, 99, 99, 99, 99,
];

/// Row u is √2·cos((2x + 1)·u·π/16), row 0 is cos 0, in units of 2⁻¹³. The last digits are those of sums of the rounded
/// constants of Loeffler, Ligtenberg and Moschytz's transform (doi:10.1109/ICASSP.1989.266596), in the library's order
/// of addition.
const COSINES: Block = [
    [8192, 8192, 8192, 8192, 8192, 8192, 8192, 8192],
    [11_363, 9633, 6437, 2260, -2260, -6437, -9633, -11_363],
    [10_703, 4433, -4433, -10_703, -10_703, -4433, 4433, 10_703],
    [9633, -2259, -11_362, -6436, 6436, 11_362, 2259, -9633],
    [8192, -8192, -8192, 8192, 8192, -8192, -8192, 8192],
    [6437, -11_362, 2261, 9633, -9633, -2261, 11_362, -6437],
    [4433, -10_704, 10_704, -4433, -4433, 10_704, -10_704, 4433],
    [2260, -6436, 9633, -11_363, 11_363, -9633, 6436, -2260],
];

const TRANSPOSED: Block = {
    let mut transposed = [[0; SIDE]; SIDE];
    let mut i = 0;
    while i < SIDE * SIDE {
        transposed[i % SIDE][i / SIDE] = COSINES[i / SIDE][i % SIDE];
        i += 1;
    }
    transposed
};

/// Binary digits of the cosines, and digits kept between the two passes of a transform. Each pass scales by √8.
const COSINE_DIGITS: u32 = 13;
const KEPT_DIGITS: u32 = 2;
const NORM_DIGITS: u32 = 3;

/// The centre of the 8-bit range.
const MIDDLE: i32 = 128;

impl Jpeg {
    /// Creates a compressor: validates the parameters and scales the tables.
    ///
    /// # Errors
    ///
    /// If the quality is out of range, or the bit depth is not 8.
    pub fn new(params: &JpegParams) -> Result<Self, Error> {
        let JpegParams { quality, subsampling, bit_depth } = *params;
        within("quality", quality.into(), 1.0..=100.0, "from 1 to 100")?;
        require("bit_depth", f64::from(bit_depth), bit_depth == 8, "8, the bit depth of baseline JPEG")?;
        Ok(Self { luma: steps(&LUMA, quality), chroma: steps(&CHROMA, quality), subsampling })
    }

    /// Compresses and decompresses an 8-bit grey image in place, in rows of `width` pixels.
    ///
    /// # Panics
    ///
    /// If the length of `grey` is not a multiple of `width`.
    pub fn grey(&self, grey: &mut [u8], width: usize) {
        assert_rows(grey.len(), width);
        compress(&self.luma, grey, width);
    }

    /// Compresses and decompresses a frame of an 8-bit camera in place, in rows of `width` pixels. Values above 255
    /// count as 255.
    ///
    /// # Panics
    ///
    /// If the length of `frame` is not a multiple of `width`.
    pub fn frame(&self, frame: &mut [u16], width: usize) {
        let mut grey: Vec<u8> = frame.iter().map(|&dn| dn.min(255) as u8).collect();
        self.grey(&mut grey, width);
        for (dn, grey) in frame.iter_mut().zip(grey) {
            *dn = u16::from(grey);
        }
    }

    /// Compresses and decompresses an 8-bit RGB image in place: interleaved channels, in rows of `width` pixels.
    ///
    /// # Panics
    ///
    /// If the length of `rgb` is not a multiple of 3 · `width`.
    pub fn rgb(&self, rgb: &mut [u8], width: usize) {
        assert_rows(rgb.len(), 3 * width);
        let [mut luma, mut blue, mut red] = [(); 3].map(|()| vec![0; rgb.len() / 3]);
        split(rgb, &mut luma, &mut blue, &mut red);
        compress(&self.luma, &mut luma, width);
        let [blue, red] = [blue, red].map(|plane| self.difference(plane, width));
        join(&luma, &blue, &red, rgb);
    }

    /// Subsamples, compresses and restores a chroma plane.
    fn difference(&self, mut plane: Vec<u8>, width: usize) -> Vec<u8> {
        let [across, down] = match self.subsampling {
            Subsampling::S444 => {
                compress(&self.chroma, &mut plane, width);
                return plane;
            }
            Subsampling::S422 => [2, 1],
            Subsampling::S420 => [2, 2],
        };
        let height = plane.len() / width;
        // Padding columns repeat the last pixel of the image; padding rows repeat the last subsampled row.
        let thin_width = width.div_ceil(across).next_multiple_of(SIDE);
        let thin_height = height.div_ceil(down);
        let mut thin = Vec::with_capacity(thin_width * thin_height);
        for y in 0..thin_height {
            let rows = [0, down - 1].map(|i| &plane[(y * down + i).min(height - 1) * width..][..width]);
            for x in 0..thin_width {
                let columns = [2 * x, 2 * x + 1].map(|x| x.min(width - 1));
                let sum: u16 = rows.iter().flat_map(|row| columns.map(|x| u16::from(row[x]))).sum();
                // Halves round up and down alternately.
                let turn = if down == 1 { 2 * odd(x) } else { 1 + odd(x) };
                thin.push(narrow((i32::from(sum) + turn) >> 2));
            }
        }
        compress(&self.chroma, &mut thin, thin_width);
        // Interpolates between samples: 3/4 of the nearest and 1/4 of the next nearest, along each axis.
        let columns = width.div_ceil(across);
        let row = |y: usize| &thin[y.min(thin_height - 1) * thin_width..][..columns];
        for (y, out) in plane.chunks_exact_mut(width).enumerate() {
            let near = row(y / down);
            let far = match (down, y % 2) {
                (1, _) => near,
                (_, 0) => row((y / 2).saturating_sub(1)),
                _ => row(y / 2 + 1),
            };
            let column = |x: usize| 3 * i32::from(near[x]) + i32::from(far[x]);
            for (x, out) in out.iter_mut().enumerate() {
                let here = x / 2;
                let next = if x % 2 == 0 { here.saturating_sub(1) } else { (here + 1).min(columns - 1) };
                // Halves round up and down alternately.
                let half = if down == 1 { 4 + 4 * odd(x) } else { 8 - odd(x) };
                *out = narrow((3 * column(here) + column(next) + half) >> 4);
            }
        }
        plane
    }
}

/// Returns the quantisation steps of the coefficients.
fn steps(annex: &[u32; 64], quality: u32) -> Block {
    let scale = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
    let step = |i: usize| ((annex[i] * scale + 50) / 100).clamp(1, 255).cast_signed();
    core::array::from_fn(|u| core::array::from_fn(|v| step(SIDE * u + v)))
}

/// Transforms a block, quantises its coefficients and transforms back.
#[inline(always)]
fn round(steps: &Block, block: &Block) -> Block {
    let rows = product(block, &TRANSPOSED, COSINE_DIGITS - KEPT_DIGITS);
    let mut coefficients = product(&COSINES, &rows, COSINE_DIGITS + KEPT_DIGITS);
    for (row, steps) in coefficients.iter_mut().zip(steps) {
        for (coefficient, step) in row.iter_mut().zip(steps) {
            *coefficient = step * nearest(*coefficient, step << NORM_DIGITS);
        }
    }
    let columns = product(&TRANSPOSED, &coefficients, COSINE_DIGITS - KEPT_DIGITS);
    product(&columns, &COSINES, COSINE_DIGITS + KEPT_DIGITS + NORM_DIGITS)
}

/// Returns the integer nearest to a / b; halves round away from 0. Single precision is exact for integers below 2¹⁶,
/// and its division vectorises.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "below 2¹⁶")]
fn nearest(a: i32, b: i32) -> i32 {
    let level = (a.abs() + b / 2) as f32 / b as f32;
    if a < 0 { -(level as i32) } else { level as i32 }
}

/// Returns the matrix product a·b without its last `digits` binary digits, rounded.
#[inline(always)]
fn product(a: &Block, b: &Block, digits: u32) -> Block {
    let mut out = [[1 << (digits - 1); SIDE]; SIDE];
    for (out, a) in out.iter_mut().zip(a) {
        for (a, b) in a.iter().zip(b) {
            for i in 0..SIDE {
                out[i] += a * b[i];
            }
        }
        for out in out {
            *out >>= digits;
        }
    }
    out
}

/// Compresses and decompresses one plane.
#[multiversion::multiversion(targets = "simd")]
fn compress(steps: &Block, plane: &mut [u8], width: usize) {
    for rows in plane.chunks_mut(SIDE * width) {
        let height = rows.len() / width;
        for left in (0..width).step_by(SIDE) {
            let columns = SIDE.min(width - left);
            let mut block = [[0; SIDE]; SIDE];
            for (y, block) in block.iter_mut().enumerate() {
                let row = &rows[y.min(height - 1) * width + left..][..columns];
                for (x, level) in block.iter_mut().enumerate() {
                    *level = i32::from(row[x.min(columns - 1)]) - MIDDLE;
                }
            }
            let block = round(steps, &block);
            for (row, block) in rows.chunks_exact_mut(width).zip(&block) {
                for (level, value) in row[left..left + columns].iter_mut().zip(block) {
                    *level = narrow(value + MIDDLE);
                }
            }
        }
    }
}

/// Binary digits of the colour transform's factors (ITU-T T.871).
const DIGITS: u32 = 16;
const HALF: i32 = 1 << (DIGITS - 1);

/// Converts RGB to Y, C_b and C_r.
#[multiversion::multiversion(targets = "simd")]
fn split(rgb: &[u8], luma: &mut [u8], blue: &mut [u8], red: &mut [u8]) {
    let difference = |sum: i32| narrow((sum + (MIDDLE << DIGITS) + HALF - 1) >> DIGITS);
    let planes = luma.iter_mut().zip(blue).zip(red);
    for (pixel, ((luma, blue), red)) in rgb.chunks_exact(3).zip(planes) {
        let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(i32::from);
        *luma = narrow((19_595 * r + 38_470 * g + 7_471 * b + HALF) >> DIGITS);
        *blue = difference(-11_059 * r - 21_709 * g + 32_768 * b);
        *red = difference(32_768 * r - 27_439 * g - 5_329 * b);
    }
}

/// Converts Y, C_b and C_r to RGB.
#[multiversion::multiversion(targets = "simd")]
fn join(luma: &[u8], blue: &[u8], red: &[u8], rgb: &mut [u8]) {
    let planes = luma.iter().zip(blue).zip(red);
    for (pixel, ((&luma, &blue), &red)) in rgb.chunks_exact_mut(3).zip(planes) {
        let (luma, blue, red) = (i32::from(luma), i32::from(blue) - MIDDLE, i32::from(red) - MIDDLE);
        let part = |sum: i32| narrow(luma + ((sum + HALF) >> DIGITS));
        pixel.copy_from_slice(&[part(91_881 * red), part(-22_554 * blue - 46_802 * red), part(116_130 * blue)]);
    }
}

#[expect(clippy::cast_sign_loss, reason = "clipped to 8 bits")]
#[inline(always)]
fn narrow(value: i32) -> u8 {
    value.clamp(0, 255) as u8
}

fn odd(x: usize) -> i32 {
    i32::from(!x.is_multiple_of(2))
}

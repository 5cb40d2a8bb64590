//! What JPEG compression takes from an image, without its entropy coding, which takes nothing.

use crate::error::{Error, require, within};
use crate::field::whole_rows;

/// How far the two colour differences are thinned out before they are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Subsampling {
    /// Not at all: 4:4:4.
    Full,
    /// Two columns become one: 4:2:2.
    Columns,
    /// Squares of four pixels become one: 4:2:0, what most encoders do.
    #[default]
    Squares,
}

/// JPEG compression as the last step.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JpegParams {
    /// Quality as the encoders of the Independent JPEG Group count it, 1 to 100. Default 90, ours.
    pub quality: u32,
    /// Colour subsampling. Default 4:2:0, that of most encoders; grey images have none.
    pub subsampling: Subsampling,
    /// Bits of the image's levels. Default 8, all that baseline JPEG has.
    pub bit_depth: u32,
}

impl Default for JpegParams {
    fn default() -> Self {
        Self { quality: 90, subsampling: Subsampling::Squares, bit_depth: 8 }
    }
}

/// An 8 x 8 block, row after row.
type Block = [[i32; SIDE]; SIDE];

const SIDE: usize = 8;

/// Compresses and decompresses images in place: colour differences, 8 x 8 cosine transforms and rounding by the tables
/// of ITU-T T.81, Annex K, scaled by the quality.
///
/// The arithmetic is of integers, to the digits that the Independent JPEG Group's library keeps, so that images are what
/// programs with that library save and load again, to the last bit. What a last block has too many is filled with its last
/// pixels, as there.
#[derive(Debug, Clone, PartialEq)]
pub struct Jpeg {
    /// The steps of the coefficients.
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

/// Row u is √2·cos((2x + 1)·u·π/16), of row 0 cos 0, in units of 2⁻¹³. The last digits are those of sums of the rounded
/// constants of Loeffler, Ligtenberg and Moschytz's transform (doi:10.1109/ICASSP.1989.266596), as the library adds them.
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

/// Binary digits of the cosines, and those kept between the two passes of a transform. Each pass is too large by √8.
const COSINE_DIGITS: u32 = 13;
const KEPT_DIGITS: u32 = 2;
const NORM_DIGITS: u32 = 3;

/// The middle of 8 bits.
const MIDDLE: i32 = 128;

impl Jpeg {
    /// Checks the parameters and scales the tables.
    ///
    /// # Errors
    ///
    /// If the quality lies outside its range, or the bit depth is not 8.
    pub fn new(params: &JpegParams) -> Result<Self, Error> {
        let JpegParams { quality, subsampling, bit_depth } = *params;
        within("quality", quality.into(), 1.0..=100.0, "from 1 to 100")?;
        require("bit_depth", f64::from(bit_depth), bit_depth == 8, "8, all that baseline JPEG has")?;
        Ok(Self { luma: steps(&LUMA, quality), chroma: steps(&CHROMA, quality), subsampling })
    }

    /// A grey image of 8 bits, in rows of `width` pixels.
    ///
    /// # Panics
    ///
    /// If `grey` is not whole rows of `width`.
    pub fn grey(&self, grey: &mut [u8], width: usize) {
        whole_rows(grey.len(), width);
        compress(&self.luma, grey, width);
    }

    /// A frame of a camera of 8 bits, in rows of `width` pixels. What is above 255 counts as 255.
    ///
    /// # Panics
    ///
    /// If `frame` is not whole rows of `width`.
    pub fn frame(&self, frame: &mut [u16], width: usize) {
        let mut grey: Vec<u8> = frame.iter().map(|&dn| dn.min(255) as u8).collect();
        self.grey(&mut grey, width);
        for (dn, grey) in frame.iter_mut().zip(grey) {
            *dn = u16::from(grey);
        }
    }

    /// A colour image of 8 bits: red, green and blue of each pixel side by side, in rows of `width` pixels.
    ///
    /// # Panics
    ///
    /// If `rgb` is not whole rows of `width` pixels.
    pub fn rgb(&self, rgb: &mut [u8], width: usize) {
        whole_rows(rgb.len(), 3 * width);
        let [mut luma, mut blue, mut red] = [(); 3].map(|()| vec![0; rgb.len() / 3]);
        split(rgb, &mut luma, &mut blue, &mut red);
        compress(&self.luma, &mut luma, width);
        let [blue, red] = [blue, red].map(|plane| self.difference(plane, width));
        join(&luma, &blue, &red, rgb);
    }

    /// A plane of colour differences, thinned out for compression.
    fn difference(&self, mut plane: Vec<u8>, width: usize) -> Vec<u8> {
        let [across, down] = match self.subsampling {
            Subsampling::Full => {
                compress(&self.chroma, &mut plane, width);
                return plane;
            }
            Subsampling::Columns => [2, 1],
            Subsampling::Squares => [2, 2],
        };
        let height = plane.len() / width;
        // The columns to the right of the image are those of its last pixels; the rows below it those of the last thinned.
        let thin_width = width.div_ceil(across).next_multiple_of(SIDE);
        let thin_height = height.div_ceil(down);
        let mut thin = Vec::with_capacity(thin_width * thin_height);
        for y in 0..thin_height {
            let rows = [0, down - 1].map(|i| &plane[(y * down + i).min(height - 1) * width..][..width]);
            for x in 0..thin_width {
                let columns = [2 * x, 2 * x + 1].map(|x| x.min(width - 1));
                let sum: u16 = rows.iter().flat_map(|row| columns.map(|x| u16::from(row[x]))).sum();
                // Halves go up and down in turn.
                let turn = if down == 1 { 2 * odd(x) } else { 1 + odd(x) };
                thin.push(narrow((i32::from(sum) + turn) >> 2));
            }
        }
        compress(&self.chroma, &mut thin, thin_width);
        // Between the samples: three parts of the nearest and one of the next nearest, along either axis.
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
                // Halves go up and down in turn.
                let half = if down == 1 { 4 + 4 * odd(x) } else { 8 - odd(x) };
                *out = narrow((3 * column(here) + column(next) + half) >> 4);
            }
        }
        plane
    }
}

/// The steps of the coefficients.
fn steps(annex: &[u32; 64], quality: u32) -> Block {
    let scale = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
    let step = |i: usize| ((annex[i] * scale + 50) / 100).clamp(1, 255).cast_signed();
    core::array::from_fn(|u| core::array::from_fn(|v| step(SIDE * u + v)))
}

/// There, rounded, and back.
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

/// The integer nearest to a / b, halves away from 0. Single precision is exact enough for integers below 2¹⁶, and it divides
/// side by side.
#[inline(always)]
#[expect(clippy::cast_possible_truncation, reason = "below 2¹⁶")]
fn nearest(a: i32, b: i32) -> i32 {
    let level = (a.abs() + b / 2) as f32 / b as f32;
    if a < 0 { -(level as i32) } else { level as i32 }
}

/// a·b without the last `digits`, rounded.
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

/// To Y, C_b and C_r.
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

/// And back.
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

//! JPEG.

use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::file::Limits;
use super::raster::{Channels, Raster, Samples};
use crate::error::InputError;

/// Start of image, and the first byte of the next marker.
pub(super) const SIGNATURE: &[u8] = b"\xff\xd8\xff";

const ACCEPTED: &str = "grey or RGB (YCbCr) JPEG images of 8 bits";

/// Decodes a grey image or one in colour. The EXIF orientation is not applied.
pub(super) fn decode(bytes: &[u8], limits: &Limits) -> Result<Raster, InputError> {
    check_frames(bytes, limits)?;
    let side = limits.max_side_px as usize;
    // The portable code path: the same levels on every processor.
    let options = DecoderOptions::default().set_max_width(side).set_max_height(side);
    let options = options.set_strict_mode(true).set_use_unsafe(false);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(problem)?;
    let (width, height) = decoder.dimensions().ok_or(InputError::Truncated("JPEG"))?;
    let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
    limits.check(side(width), side(height))?;
    let (channels, space) = match decoder.input_colorspace() {
        Some(ColorSpace::Luma) => (Channels::Grey, ColorSpace::Luma),
        Some(ColorSpace::YCbCr | ColorSpace::RGB) => (Channels::Rgb, ColorSpace::RGB),
        _ => return Err(InputError::samples("CMYK or other channels", ACCEPTED)),
    };
    decoder.set_options(options.jpeg_set_out_colorspace(space));
    let samples = decoder.decode().map_err(problem)?;
    if !ends(bytes) {
        return Err(InputError::Truncated("JPEG"));
    }
    if samples.len() != width * height * channels.count() {
        return Err(InputError::broken("JPEG", format!("{} samples for {width} x {height} pixels", samples.len())));
    }
    Ok(Raster { width, channels, samples: Samples::U8(samples) })
}

/// Whether there is an end marker after the last start of a scan. The decoder does not notice a cut in the last rows.
fn ends(bytes: &[u8]) -> bool {
    let last = |marker: u8| bytes.windows(2).rposition(|pair| *pair == [0xff, marker]);
    last(0xd9) > last(0xda)
}

/// Checks whether JPEG is allowed, and the size in every frame header of a JPEG stream, because the decoder allocates
/// by it. Inside entropy-coded data the byte 0xFF is always followed by 0, so a match is a header, at the top or of a
/// thumbnail.
pub(super) fn check_frames(bytes: &[u8], limits: &Limits) -> Result<(), InputError> {
    if !limits.allow_lossy {
        return Err(InputError::samples("lossy JPEG compression", "PNG or lossless TIFF files"));
    }
    for header in bytes.windows(10) {
        let [0xff, 0xc0..=0xc2, 0, length, _, h1, h0, w1, w0, components] = *header else { continue };
        let [height, width] = [[h1, h0], [w1, w0]].map(u16::from_be_bytes);
        if u32::from(length) == 8 + 3 * u32::from(components) {
            limits.check(width.into(), height.into())?;
        }
    }
    Ok(())
}

/// The error for labels in a JPEG.
pub(super) fn lossy_labels() -> InputError {
    InputError::samples(
        "lossy JPEG compression, which changes labels",
        "labels and masks in PNG or lossless TIFF files",
    )
}

/// Converts a pixel from YCbCr to RGB, as JFIF 1.02 gives it, rounded. In 16.16 fixed point.
pub(super) fn rgb([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let (y, cb, cr) = ((i32::from(y) << 16) + (1 << 15), i32::from(cb) - 128, i32::from(cr) - 128);
    // 1.402, 0.344136, 0.714136 and 1.772.
    let rgb = [y + 91_881 * cr, y - 22_554 * cb - 46_802 * cr, y + 116_130 * cb];
    rgb.map(|v| u8::try_from((v >> 16).clamp(0, 255)).unwrap_or(u8::MAX))
}

fn problem(error: DecodeErrors) -> InputError {
    let message = match error {
        DecodeErrors::ExhaustedData | DecodeErrors::IoErrors(_) => return InputError::Truncated("JPEG"),
        DecodeErrors::FormatStatic("Premature end of buffer") => return InputError::Truncated("JPEG"),
        DecodeErrors::Unsupported(_) => return InputError::samples("lossless, arithmetic or 12-bit coding", ACCEPTED),
        DecodeErrors::Format(message) => message,
        DecodeErrors::FormatStatic(message) => message.to_owned(),
        other => other.to_string(),
    };
    InputError::broken("JPEG", message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ycbcr_pixels_become_rgb() {
        // Expected values: the same equations in floating point.
        for (ycbcr, expected) in [
            ([0, 128, 128], [0, 0, 0]),
            ([255, 128, 128], [255, 255, 255]),
            ([76, 85, 255], [254, 0, 0]),
            ([150, 44, 21], [0, 255, 1]),
            ([29, 255, 107], [0, 0, 254]),
            ([100, 100, 150], [131, 94, 50]),
        ] {
            assert_eq!(rgb(ycbcr), expected, "{ycbcr:?}");
        }
    }

    #[test]
    fn sizes_are_read_in_every_frame_header() {
        let limits = Limits { max_side_px: 100, ..Limits::default() };
        let header = |side: u8, kind: u8| [&[0xff, kind, 0, 11, 8, 0, side, 0, side, 1][..], &[1, 0x11, 0]].concat();
        assert_eq!(check_frames(&[header(100, 0xc0), header(7, 0xc2)].concat(), &limits), Ok(()));
        let vast = [header(100, 0xc0), header(101, 0xc2)].concat();
        assert!(matches!(check_frames(&vast, &limits), Err(InputError::ImageSize { width: 101, .. })));
        let lossless = Limits { allow_lossy: false, ..Limits::default() };
        assert!(check_frames(&[], &lossless).is_err());
        // A Huffman table (0xc4) is not a frame header.
        assert_eq!(check_frames(&header(101, 0xc4), &limits), Ok(()));
    }
}

//! PNG.

use std::io;

use png::{BitDepth, ColorType, Compression, Encoder, Filter, PixelDimensions, Unit};

use crate::truth::LabelRuns;

/// Encodes a grey or colour image with 8 bits, or 16 if `bits` is above 8. `pixel_um` is written as physical size
/// (`pHYs`).
pub(crate) fn png(levels: &[u16], width: usize, channels: usize, bits: u32, pixel_um: f64) -> io::Result<Vec<u8>> {
    let (bytes, depth): (Vec<u8>, _) = if bits <= 8 {
        #[expect(clippy::cast_possible_truncation, reason = "grey levels of 8 bits")]
        let narrow = levels.iter().map(|&g| g as u8).collect();
        (narrow, BitDepth::Eight)
    } else {
        (levels.iter().flat_map(|g| g.to_be_bytes()).collect(), BitDepth::Sixteen)
    };
    let mut out = Vec::with_capacity(bytes.len());
    let mut encoder = Encoder::new(&mut out, side(width)?, side(levels.len() / (width * channels).max(1))?);
    encoder.set_color(if channels == 3 { ColorType::Rgb } else { ColorType::Grayscale });
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    // The same filter for all rows: for noisy images as small as a choice per row, and twice as fast.
    encoder.set_filter(Filter::Up);
    let per_metre = pixels_per_metre(pixel_um);
    encoder.set_pixel_dims(Some(PixelDimensions { xppu: per_metre, yppu: per_metre, unit: Unit::Meter }));
    write(encoder, &bytes)?;
    Ok(out)
}

/// Encodes labels with 16 bits.
pub(crate) fn label_png(labels: &LabelRuns, pixel_um: f64) -> io::Result<Vec<u8>> {
    let levels: Vec<u16> =
        labels.pixels().into_iter().map(u16::try_from).collect::<Result<_, _>>().map_err(io::Error::other)?;
    png(&levels, labels.width, 1, 16, pixel_um)
}

/// Encodes a colour image with three bytes per pixel.
pub(crate) fn rgb_png(rgb: &[u8], width: usize) -> io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let mut encoder = Encoder::new(&mut out, side(width)?, side(rgb.len() / (3 * width.max(1)))?);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Fast);
    write(encoder, rgb)?;
    Ok(out)
}

fn write(encoder: Encoder<&mut Vec<u8>>, bytes: &[u8]) -> io::Result<()> {
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    Ok(writer.finish()?)
}

fn side(pixels: usize) -> io::Result<u32> {
    u32::try_from(pixels).map_err(io::Error::other)
}

fn pixels_per_metre(pixel_um: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let whole = (1e6 / pixel_um + 0.5) as u32;
    whole
}

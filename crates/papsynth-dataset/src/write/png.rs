//! PNG.

use std::io;

use png::{BitDepth, ColorType, Compression, Encoder, Filter, PixelDimensions, Unit};

/// A grey image of 8 bits if `bits` are no more, else 16; `pixel_um` goes into its physical size.
pub(crate) fn grey_png(grey: &[u16], width: usize, bits: u32, pixel_um: f64) -> io::Result<Vec<u8>> {
    if bits <= 8 {
        #[expect(clippy::cast_possible_truncation, reason = "grey levels of 8 bits")]
        let narrow: Vec<u8> = grey.iter().map(|&g| g as u8).collect();
        encode(&narrow, width, ColorType::Grayscale, BitDepth::Eight, Some(pixel_um))
    } else {
        let wide: Vec<u8> = grey.iter().flat_map(|g| g.to_be_bytes()).collect();
        encode(&wide, width, ColorType::Grayscale, BitDepth::Sixteen, Some(pixel_um))
    }
}

/// An image in colour, three bytes a pixel.
pub(crate) fn rgb_png(rgb: &[u8], width: usize) -> io::Result<Vec<u8>> {
    encode(rgb, width, ColorType::Rgb, BitDepth::Eight, None)
}

fn encode(bytes: &[u8], width: usize, color: ColorType, depth: BitDepth, pixel_um: Option<f64>) -> io::Result<Vec<u8>> {
    let pixel_bytes = color.samples() * (depth as usize / 8);
    let height = bytes.len() / (width * pixel_bytes).max(1);
    let mut out = Vec::with_capacity(bytes.len());
    let side = |pixels: usize| u32::try_from(pixels).map_err(io::Error::other);
    let mut encoder = Encoder::new(&mut out, side(width)?, side(height)?);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::Fast);
    // One filter for all rows: as small on noisy images as a choice for each row, and twice as fast.
    encoder.set_filter(Filter::Up);
    encoder.set_pixel_dims(pixel_um.map(|um| {
        let per_metre = pixels_per_metre(um);
        PixelDimensions { xppu: per_metre, yppu: per_metre, unit: Unit::Meter }
    }));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(bytes)?;
    writer.finish()?;
    Ok(out)
}

fn pixels_per_metre(pixel_um: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let whole = (1e6 / pixel_um + 0.5) as u32;
    whole
}

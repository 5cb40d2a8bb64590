//! Tiles as PNG files.

use png::{BitDepth, ColorType, Compression, Encoder, Filter};

use crate::server::Reply;

/// Bytes of 1, 3 or 4 channels a pixel as a PNG file.
pub(crate) fn png(bytes: &[u8], width: usize, channels: usize) -> Result<Reply, Reply> {
    let color = match channels {
        1 => ColorType::Grayscale,
        3 => ColorType::Rgb,
        _ => ColorType::Rgba,
    };
    let encode = || {
        let mut out = Vec::with_capacity(bytes.len() / 2);
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        let mut encoder = Encoder::new(&mut out, side(width), side(bytes.len() / (width * channels).max(1)));
        encoder.set_color(color);
        encoder.set_depth(BitDepth::Eight);
        encoder.set_compression(Compression::Fast);
        encoder.set_filter(Filter::Up);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()?;
        Ok::<_, png::EncodingError>(out)
    };
    encode().map(Reply::png).map_err(|error| Reply::refusal(500, &error.to_string()))
}

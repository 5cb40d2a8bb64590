//! The interface of data sets and slides to the viewer.

use papsynth::truth::Group;
use png::{BitDepth, ColorType, Compression, Encoder, Filter};
use serde::Serialize;
use serde_json::Value;

use super::grid::Grid;
use crate::server::Reply;

pub(crate) trait Source: Send {
    /// Returns the current number of images.
    fn count(&mut self) -> Result<usize, Reply>;

    /// Returns size, planes and tiles of an image.
    fn image(&mut self, image: usize) -> Result<ImageInfo, Reply>;

    /// Returns a tile of a plane as PNG.
    fn tile(&mut self, image: usize, plane: usize, at: TileIndex) -> Result<Reply, Reply>;

    /// Returns a tile of the labels of a group as PNG.
    fn label(&mut self, image: usize, group: Group, at: TileIndex) -> Result<Reply, Reply>;

    /// Returns the objects at a pixel, the nearest to the objective first.
    fn objects_at(&mut self, image: usize, x: usize, y: usize) -> Result<Vec<Value>, Reply>;
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct TileIndex {
    pub(crate) level: usize,
    pub(crate) row: usize,
    pub(crate) column: usize,
}

/// Properties of an image that the page needs before it requests tiles.
#[derive(Debug, Serialize)]
pub(crate) struct ImageInfo {
    pub(crate) name: String,
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Pixel size, µm.
    pub(crate) pixel_um: f64,
    /// Stage position of each plane, µm; empty for EDF images.
    pub(crate) planes_um: Vec<f64>,
    pub(crate) levels: usize,
    /// Size of a tile, px.
    pub(crate) tile: usize,
}

impl ImageInfo {
    pub(crate) fn new(name: String, grid: &Grid, pixel_um: f64, planes_um: Vec<f64>) -> Self {
        let Grid { width, height, tile, levels } = *grid;
        Self { name, width, height, pixel_um, planes_um, levels, tile }
    }
}

pub(crate) fn check_plane(plane: usize, planes: usize) -> Result<(), Reply> {
    if plane < planes {
        return Ok(());
    }
    Err(Reply::error(404, &format!("no plane {plane}: expected 0 to {}", planes.saturating_sub(1))))
}

pub(crate) fn check_pixel(x: usize, y: usize, width: usize, height: usize) -> Result<(), Reply> {
    if x < width && y < height {
        return Ok(());
    }
    Err(Reply::error(404, &format!("no pixel {x}, {y} in an image of {width} x {height} pixels")))
}

/// Encodes bytes of 1, 3 or 4 channels per pixel as PNG.
pub(crate) fn png(bytes: &[u8], width: usize, channels: usize) -> Result<Reply, Reply> {
    png_of(bytes, BitDepth::Eight, width, channels)
}

/// Encodes samples of 16 bits, of 1 or 3 channels per pixel, as PNG.
pub(crate) fn png16(samples: &[u16], width: usize, channels: usize) -> Result<Reply, Reply> {
    let bytes: Vec<u8> = samples.iter().flat_map(|sample| sample.to_be_bytes()).collect();
    png_of(&bytes, BitDepth::Sixteen, width, channels)
}

fn png_of(bytes: &[u8], depth: BitDepth, width: usize, channels: usize) -> Result<Reply, Reply> {
    let sample = if depth == BitDepth::Sixteen { 2 } else { 1 };
    let color = match channels {
        1 => ColorType::Grayscale,
        3 => ColorType::Rgb,
        _ => ColorType::Rgba,
    };
    let encode = || {
        let mut out = Vec::with_capacity(bytes.len() / 2);
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        let mut encoder = Encoder::new(&mut out, side(width), side(bytes.len() / (width * channels * sample).max(1)));
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.set_compression(Compression::Fast);
        encoder.set_filter(Filter::Up);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()?;
        Ok::<_, png::EncodingError>(out)
    };
    encode().map(Reply::png).map_err(|error| Reply::error(500, &error.to_string()))
}

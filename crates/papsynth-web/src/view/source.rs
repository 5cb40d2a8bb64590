//! What can be shown: a data set or a slide, asked the same things.

use papsynth::truth::Group;
use png::{BitDepth, ColorType, Compression, Encoder, Filter};
use serde::Serialize;
use serde_json::Value;

use super::grid::Grid;
use crate::server::Reply;

pub(crate) trait Source: Send {
    /// How many pictures there are now.
    fn count(&mut self) -> Result<usize, Reply>;

    /// What a picture is like.
    fn picture(&mut self, picture: usize) -> Result<Picture, Reply>;

    /// A tile of a plane.
    fn tile(&mut self, picture: usize, plane: usize, at: At) -> Result<Reply, Reply>;

    /// A tile of the labels of a group.
    fn label(&mut self, picture: usize, group: Group, at: At) -> Result<Reply, Reply>;

    /// What lies under a pixel, nearest first.
    fn under(&mut self, picture: usize, x: usize, y: usize) -> Result<Vec<Value>, Reply>;
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct At {
    pub(crate) level: usize,
    pub(crate) row: usize,
    pub(crate) column: usize,
}

/// What the page must know of a picture before it asks for tiles.
#[derive(Debug, Serialize)]
pub(crate) struct Picture {
    pub(crate) name: String,
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Side of a pixel, µm.
    pub(crate) pixel_um: f64,
    /// Travel of the stage to each plane, µm; nothing if the picture has everything in focus.
    pub(crate) planes_um: Vec<f64>,
    pub(crate) levels: usize,
    /// Side of a tile, px.
    pub(crate) tile: usize,
}

impl Picture {
    pub(crate) fn new(name: String, grid: &Grid, pixel_um: f64, planes_um: Vec<f64>) -> Self {
        let Grid { width, height, tile, levels } = *grid;
        Self { name, width, height, pixel_um, planes_um, levels, tile }
    }
}

pub(crate) fn check_plane(plane: usize, planes: usize) -> Result<(), Reply> {
    if plane < planes {
        return Ok(());
    }
    Err(Reply::refusal(404, &format!("there is no plane {plane}; the last is {}", planes.saturating_sub(1))))
}

pub(crate) fn check_pixel(x: usize, y: usize, width: usize, height: usize) -> Result<(), Reply> {
    if x < width && y < height {
        return Ok(());
    }
    Err(Reply::refusal(404, &format!("there is no pixel {x}, {y} in {width} x {height}")))
}

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

//! Images of the user, in memory.

use std::collections::BTreeMap;
use std::sync::Arc;

use papsynth::white_level;
use papsynth_dataset::memory::format_bytes;
use papsynth_dataset::read::{LevelImage, Limits};
use serde_json::json;

use super::rendering::framed;
use crate::server::{Reply, Request};

/// Content type of image files: browsers do not let pages of other sites send it without asking.
const BINARY: &[u8] = b"application/octet-stream";

/// Bit depths of cameras whose images have 16 bits: the smallest that holds the brightest pixel is assumed.
const DEEP: [u32; 3] = [12, 14, 16];

/// Images of the user by number.
#[derive(Default)]
pub(super) struct RealImages {
    images: BTreeMap<usize, Arc<RealImage>>,
    /// Number of the last image.
    last: usize,
    /// Memory for all images, bytes; `None` for no limit.
    max_bytes: Option<u64>,
}

impl RealImages {
    pub(super) fn within(max_bytes: Option<u64>) -> Self {
        Self { max_bytes, ..Self::default() }
    }

    /// Returns the limits of a further image.
    pub(super) fn limits(&self) -> Limits {
        let left = self.max_bytes.map(|most| most.saturating_sub(self.bytes()) / RealImage::BYTES_WHILE_DECODED);
        let limits = Limits::default();
        Limits { max_pixels: left.map_or(limits.max_pixels, |pixels| pixels.min(limits.max_pixels)), ..limits }
    }

    fn bytes(&self) -> u64 {
        self.images.values().map(|image| size_of_val(&image.image.levels[..]) as u64).sum()
    }

    /// Adds an image, and returns its number, its size and its samples.
    pub(super) fn add(&mut self, image: RealImage) -> Result<Reply, Reply> {
        if let Some(most) = self.max_bytes.filter(|most| self.bytes() > *most) {
            let most = format_bytes(most as f64);
            return Err(Reply::error(
                413,
                &format!(
                    "the images need more than {most}; remove images, or start the program with a larger --max-memory"
                ),
            ));
        }
        self.last += 1;
        let reply = image.reply(self.last);
        self.images.insert(self.last, Arc::new(image));
        Ok(reply)
    }

    pub(super) fn remove(&mut self, id: usize) {
        self.images.remove(&id);
    }

    /// Returns an image.
    #[cfg(feature = "judge")]
    pub(super) fn get(&self, id: usize) -> Result<Arc<RealImage>, Reply> {
        self.images.get(&id).cloned().ok_or_else(|| Reply::error(404, "this image was removed"))
    }
}

/// An image of the user.
pub(super) struct RealImage {
    pub(super) image: LevelImage,
    /// Bit depth of its grey levels.
    pub(super) bits: u32,
}

impl RealImage {
    /// Memory of a pixel of a colour image of 16 bits while it is decoded: the file, its samples, and the reply.
    const BYTES_WHILE_DECODED: u64 = 24;

    /// Returns the file in a request.
    pub(super) fn encoded(request: &Request) -> Result<Vec<u8>, Reply> {
        match request.content_type == Some(BINARY) {
            true => Ok(request.body.to_vec()),
            false => Err(Reply::error(415, "expected content type application/octet-stream")),
        }
    }

    /// Decodes a PNG, JPEG or TIFF file.
    pub(super) fn decode(file: &[u8], limits: &Limits) -> Result<Self, Reply> {
        let image = LevelImage::decode(file, limits);
        let is_short = limits.max_pixels < Limits::default().max_pixels;
        let help = if is_short { "; remove images, or start the program with a larger --max-memory" } else { "" };
        let image = image.map_err(|error| Reply::error(422, &format!("{error}{help}")))?;
        let brightest = image.levels.iter().copied().max().unwrap_or(0);
        let bits = match image.white > u16::from(u8::MAX) {
            true => DEEP.into_iter().find(|bits| white_level(*bits) >= brightest).unwrap_or(u16::BITS),
            false => u8::BITS,
        };
        Ok(Self { image, bits })
    }

    /// Returns width and height.
    #[cfg(feature = "match")]
    pub(super) fn size(&self) -> [usize; 2] {
        [self.image.width, self.image.height()]
    }

    fn reply(&self, id: usize) -> Reply {
        let Self { image, bits } = self;
        let (width, height, channels) = (image.width, image.height(), image.channels);
        let head = json!({ "id": id, "width": width, "height": height, "channels": channels, "bits": bits });
        framed(&head, &image.levels, *bits)
    }
}

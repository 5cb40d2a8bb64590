//! Writers of formats: each receives every plane when it is ready, and the ground truth at the end of a frame.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::io;

use papsynth::Plane;
use papsynth::truth::Truth;

use super::depth::{Depth, TRAINING_BITS, to_training};
use super::format::Layout;
use crate::error::Error;
use crate::files::{FileRecord, Folder};
use crate::truth::{Document, FrameSummary, Split};
use crate::write;

/// Writes the frames of a shard, one after the other.
pub(crate) trait Sink {
    fn begin(&mut self, _: &FrameSummary, _: &Files) -> Result<(), Error> {
        Ok(())
    }

    fn plane(&mut self, _: &Plane, _: &FrameSummary, _: &Files) -> Result<(), Error> {
        Ok(())
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error>;

    /// Ends the shard: files of several frames are renamed from their temporary names.
    fn close(self: Box<Self>, _: &mut Files) -> Result<(), Error> {
        Ok(())
    }
}

/// A format that writes all files of a frame at its end.
pub(super) struct AtEnd(pub(super) fn(&Field, &mut Files) -> Result<(), Error>);

impl Sink for AtEnd {
    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        (self.0)(field, files)
    }
}

/// A complete frame: image, ground truth and COCO document.
#[derive(Debug)]
pub(crate) struct Field<'a> {
    /// Seed of the data set.
    pub(crate) seed: u64,
    pub(crate) frame: &'a FrameSummary,
    pub(crate) truth: &'a Truth,
    pub(crate) document: &'a Document,
    /// Levels of the image; of a stack, of the all-in-focus image.
    pub(crate) image: &'a [u16],
    png: OnceCell<Vec<u8>>,
    training_png: OnceCell<Vec<u8>>,
}

impl<'a> Field<'a> {
    pub(crate) fn new(
        seed: u64,
        frame: &'a FrameSummary,
        truth: &'a Truth,
        document: &'a Document,
        image: &'a [u16],
    ) -> Self {
        Self { seed, frame, truth, document, image, png: OnceCell::new(), training_png: OnceCell::new() }
    }

    pub(crate) fn split(&self) -> Split {
        Split::of_slide(self.seed, self.frame.slide)
    }

    /// Returns the levels of the image at 8 bits.
    pub(crate) fn training_image(&self) -> Cow<'a, [u16]> {
        to_training(self.image, self.frame.bits)
    }

    /// Returns the image as PNG. It is encoded once for all formats.
    pub(crate) fn png(&self, depth: Depth) -> io::Result<&[u8]> {
        let is_camera = depth == Depth::Camera || self.frame.bits <= TRAINING_BITS;
        let cell = if is_camera { &self.png } else { &self.training_png };
        if let Some(png) = cell.get() {
            return Ok(png);
        }
        let FrameSummary { width, channels, bits, training_bits, pixel_um, .. } = *self.frame;
        let png = match is_camera {
            true => write::png(self.image, width, channels, bits, pixel_um)?,
            false => write::png(&self.training_image(), width, channels, training_bits, pixel_um)?,
        };
        Ok(cell.get_or_init(|| png))
    }
}

#[derive(Debug)]
pub(crate) struct Files<'a> {
    pub(crate) folder: &'a Folder,
    pub(crate) layout: &'a Layout,
    #[cfg_attr(not(feature = "parquet"), expect(dead_code, reason = "only Parquet has a file for each split"))]
    pub(crate) seed: u64,
    pub(crate) shard: u64,
    pub(crate) written: Vec<FileRecord>,
}

impl<'a> Files<'a> {
    pub(crate) fn new(folder: &'a Folder, layout: &'a Layout, seed: u64, shard: u64) -> Self {
        Self { folder, layout, seed, shard, written: Vec::new() }
    }

    pub(crate) fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.written.push(self.folder.write(name, bytes)?);
        Ok(())
    }

    pub(crate) fn encode(&mut self, name: &str, encoded: io::Result<Vec<u8>>) -> Result<(), Error> {
        let bytes = encoded.map_err(Error::io("encode", &self.folder.path(name)))?;
        self.write(name, &bytes)
    }

    pub(crate) fn png(&mut self, name: &str, field: &Field, depth: Depth) -> Result<(), Error> {
        let bytes = field.png(depth).map_err(Error::io("encode", &self.folder.path(name)))?;
        self.write(name, bytes)
    }
}

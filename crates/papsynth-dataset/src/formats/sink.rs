//! What every format does: it gets each plane as it arrives and, at the end of a frame, everything that is known of it.

use std::cell::OnceCell;
use std::io;

use papsynth::Plane;
use papsynth::truth::Truth;

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

    /// No further frame follows: the files of the shard get their names.
    fn close(self: Box<Self>, _: &mut Files) -> Result<(), Error> {
        Ok(())
    }
}

/// A format whose files are all written when everything is known of their frame.
pub(super) struct AtOnce(pub(super) fn(&Field, &mut Files) -> Result<(), Error>);

impl Sink for AtOnce {
    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        (self.0)(field, files)
    }
}

/// A frame of which everything is known.
#[derive(Debug)]
pub(crate) struct Field<'a> {
    /// Seed of the data set.
    pub(crate) seed: u64,
    pub(crate) frame: &'a FrameSummary,
    pub(crate) truth: &'a Truth,
    pub(crate) document: &'a Document,
    /// Grey levels of the image or, of a stack, with every object in focus.
    pub(crate) picture: &'a [u16],
    png: OnceCell<Vec<u8>>,
}

impl<'a> Field<'a> {
    pub(crate) fn new(
        seed: u64,
        frame: &'a FrameSummary,
        truth: &'a Truth,
        document: &'a Document,
        picture: &'a [u16],
    ) -> Self {
        Self { seed, frame, truth, document, picture, png: OnceCell::new() }
    }

    pub(crate) fn split(&self) -> Split {
        Split::of_slide(self.seed, self.frame.slide)
    }

    /// The picture as PNG, made once for all formats.
    pub(crate) fn png(&self) -> io::Result<&[u8]> {
        if let Some(png) = self.png.get() {
            return Ok(png);
        }
        let FrameSummary { width, channels, bits, pixel_um, .. } = *self.frame;
        let png = write::png(self.picture, width, channels, bits, pixel_um)?;
        Ok(self.png.get_or_init(|| png))
    }
}

#[derive(Debug)]
pub(crate) struct Files<'a> {
    pub(crate) folder: &'a Folder,
    pub(crate) layout: &'a Layout,
    #[cfg_attr(not(feature = "parquet"), expect(dead_code, reason = "Parquet alone has a file for each split"))]
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

    pub(crate) fn png(&mut self, name: &str, field: &Field) -> Result<(), Error> {
        let bytes = field.png().map_err(Error::io("encode", &self.folder.path(name)))?;
        self.write(name, bytes)
    }
}

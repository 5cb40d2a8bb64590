//! A TIFF file to which pages are added.

use super::page::{Page, Pixels};
use super::tiff::PageWriter;
use crate::error::Error;
use crate::files::{FileRecord, Pending};

/// A TIFF file that gets its name when all its pages are there.
pub(crate) struct Pages {
    pending: Pending,
    writer: PageWriter<'static>,
}

impl Pages {
    /// A file that will hold about `bytes` bytes of pixels.
    pub(crate) fn new(pending: Pending, bytes: u64) -> Result<Self, Error> {
        let writer = PageWriter::new(pending.handle()?, bytes).map_err(Error::io("write", pending.path()))?;
        Ok(Self { pending, writer })
    }

    pub(crate) fn write(&mut self, pixels: Pixels, page: &Page) -> Result<(), Error> {
        self.writer.write(pixels, page).map_err(Error::io("write", self.pending.path()))
    }

    /// The same as a pyramid, if it is large.
    pub(crate) fn write_pyramid(&mut self, pixels: Pixels, page: &Page) -> Result<(), Error> {
        self.writer.write_pyramid(pixels, page).map_err(Error::io("write", self.pending.path()))
    }

    pub(crate) fn commit(self) -> Result<FileRecord, Error> {
        self.pending.commit()
    }
}

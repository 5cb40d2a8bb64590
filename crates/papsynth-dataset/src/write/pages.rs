//! A TIFF file to which pages are added.

use tiff::TiffError;

use super::tiff::{PageWriter, Pixels};
use crate::error::Error;
use crate::files::{Handle, Pending};
use crate::record::{FileRecord, Geometry};

/// A TIFF file that gets its name when all its pages are there.
pub(crate) struct Pages {
    pending: Pending,
    writer: PageWriter<Handle>,
}

impl Pages {
    /// A file that will hold about `bytes` bytes of pixels.
    pub(crate) fn new(pending: Pending, bytes: u64) -> Result<Self, Error> {
        let writer = PageWriter::new(pending.handle()?, bytes).map_err(failed(&pending))?;
        Ok(Self { pending, writer })
    }

    pub(crate) fn write(&mut self, pixels: Pixels, geometry: &Geometry, text: Option<&str>) -> Result<(), Error> {
        let Geometry { view, channels, .. } = geometry;
        self.writer.write(pixels, view.width, *channels, view.pixel_um, text).map_err(failed(&self.pending))
    }

    /// The same as a pyramid, if it is large.
    pub(crate) fn write_pyramid(
        &mut self,
        pixels: Pixels,
        geometry: &Geometry,
        text: Option<&str>,
    ) -> Result<(), Error> {
        let Geometry { view, channels, .. } = geometry;
        let written = self.writer.write_pyramid(pixels, view.width, *channels, view.pixel_um, text);
        written.map_err(failed(&self.pending))
    }

    pub(crate) fn commit(self) -> Result<FileRecord, Error> {
        self.pending.commit()
    }
}

/// Whatever goes wrong with a TIFF that is being written is the writing's fault.
fn failed(pending: &Pending) -> impl FnOnce(TiffError) -> Error {
    let path = pending.path();
    move |e| Error::io("write", path)(super::tiff::as_io(e))
}

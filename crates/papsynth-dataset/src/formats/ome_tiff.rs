//! `ome-tiff`: every frame an OME-TIFF, with its labels as layers that never overlap in a second one.

use papsynth::Plane;
use papsynth::truth::Group;

use super::written::is_described;
use super::{Field, Files, Place, Sink, Written};
use crate::error::Error;
use crate::layers::layers;
use crate::record::{FileRecord, Geometry};
use crate::write::{Pages, Pixels, description, narrow, of_labels, ome_labels};

pub(super) struct Images<'a> {
    files: Files<'a>,
    image: Option<Pages>,
}

impl<'a> Images<'a> {
    pub(super) fn new(place: Place<'a>) -> Self {
        Self { files: Files::new(place.folder), image: None }
    }
}

pub(super) fn image(index: u64) -> String {
    format!("ome-tiff/{index:06}.ome.tif")
}

fn labels(group: Group, index: u64) -> String {
    format!("ome-tiff/{index:06}.{}.ome.tif", group.name())
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let (index, geometry) = (written.field.index(), written.field.geometry);
    written.file(&image(index), |bytes| {
        written.planes(bytes)?;
        is_described(bytes, &description(geometry))
    })?;
    Group::ALL.into_iter().try_for_each(|group| {
        let pages = layers(written.field.truth, group);
        let small = pages.iter().flatten().all(|&id| id <= u16::MAX.into());
        let kind = if small { "uint16" } else { "uint32" };
        written.file(&labels(group, index), |bytes| {
            written.layers(bytes, &pages)?;
            is_described(bytes, &of_labels(geometry, group, pages.len(), kind))
        })
    })
}

impl Sink for Images<'_> {
    fn begin(&mut self, geometry: &Geometry) -> Result<(), Error> {
        let name = image(geometry.key.index);
        let values = geometry.values() as u64 * geometry.planes_um.len() as u64;
        self.image = Some(Pages::new(self.files.folder.pending(&name)?, values * 3)?);
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, geometry: &Geometry) -> Result<(), Error> {
        let Some(pages) = &mut self.image else { return Ok(()) };
        let text = (plane.index == 0).then(|| description(geometry));
        match geometry.bits {
            ..=8 => pages.write_pyramid(Pixels::U8(&narrow(&plane.grey)), geometry, text.as_deref()),
            _ => pages.write_pyramid(Pixels::U16(&plane.grey), geometry, text.as_deref()),
        }
    }

    fn field(&mut self, field: &Field) -> Result<(), Error> {
        if let Some(pages) = self.image.take() {
            self.files.written.push(pages.commit()?);
        }
        for group in Group::ALL {
            let pages = layers(field.truth, group);
            self.files.encode(&labels(group, field.index()), ome_labels(&pages, group, field.geometry))?;
        }
        Ok(())
    }

    fn close(self: Box<Self>) -> Result<Vec<FileRecord>, Error> {
        Ok(self.files.written)
    }
}

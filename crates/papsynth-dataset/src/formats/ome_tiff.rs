//! `ome-tiff`: every frame an OME-TIFF, with its labels as layers that never overlap in a second one.

use papsynth::Plane;
use papsynth::truth::Group;

use super::ome::{Levels, description, of_labels, ome_labels, page};
use super::sink::{Field, Files, Sink};
use super::written::{Written, is_described};
use crate::error::Error;
use crate::truth::{Geometry, layers};
use crate::write::Pages;

#[derive(Default)]
pub(super) struct Images {
    image: Option<Pages>,
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
        written.file(&labels(group, index), |bytes| {
            written.layers(bytes, &pages)?;
            is_described(bytes, &of_labels(geometry, group, &pages))
        })
    })
}

impl Sink for Images {
    fn begin(&mut self, geometry: &Geometry, files: &Files) -> Result<(), Error> {
        let name = image(geometry.key.index);
        let values = geometry.values() as u64 * geometry.planes_um.len() as u64;
        self.image = Some(Pages::new(files.folder.pending(&name)?, values * 3)?);
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, geometry: &Geometry, _: &Files) -> Result<(), Error> {
        let Some(pages) = &mut self.image else { return Ok(()) };
        let text = (plane.index == 0).then(|| description(geometry));
        pages.write_pyramid(Levels::new(&plane.grey, geometry).pixels(), &page(geometry, text.as_deref()))
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        if let Some(pages) = self.image.take() {
            files.written.push(pages.commit()?);
        }
        for group in Group::ALL {
            let pages = layers(field.truth, group);
            files.encode(&labels(group, field.index()), ome_labels(&pages, group, field.geometry))?;
        }
        Ok(())
    }
}

//! `folder`: PNG and TIFF files in folders.

use papsynth::Plane;
use papsynth::truth::Group;

use super::written::{differs, is_described};
use super::{Field, Files, Place, Sink, Written};
use crate::error::Error;
use crate::image_of::LIMITS;
use crate::layout::{self, Form};
use crate::read;
use crate::record::{FileRecord, Geometry};
use crate::write::{Pages, Pixels, compressed, description, label_tiff, narrow};

pub(super) struct Frames<'a> {
    files: Files<'a>,
    /// The planes of a stack; a single plane becomes a PNG.
    stack: Option<Pages>,
    noise_free: Option<Pages>,
}

impl<'a> Frames<'a> {
    pub(super) fn new(place: Place<'a>) -> Self {
        Self { files: Files::new(place.folder), stack: None, noise_free: None }
    }
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let (index, geometry, truth) = (written.field.index(), written.field.geometry, written.field.truth);
    let form = Form::of(geometry.planes_um.len());
    written.file(&layout::image(index, form), |bytes| {
        written.planes(bytes)?;
        if form == Form::Stack { is_described(bytes, &description(geometry)) } else { Ok(()) }
    })?;
    if form == Form::Stack {
        written.file(&layout::all_in_focus(index), |bytes| written.picture(bytes))?;
    }
    written.file(&layout::noise_free(index), |bytes| {
        let due = geometry.planes_um.len();
        let pages = read::float_pages(bytes, &LIMITS, due)?;
        if pages.len() != due {
            return differs(&format!("it has {} planes, the record says {due}", pages.len()));
        }
        match pages.iter().all(|page| page.len() == geometry.values() && page.iter().all(|v| v.is_finite())) {
            true => Ok(()),
            false => differs("it has not the finite values of the size that the record says"),
        }
    })?;
    for group in Group::ALL {
        let ids = truth.labels(group).ids;
        written.file(&layout::labels(group, index), |bytes| written.labels(bytes, &ids))?;
    }
    let layers: Vec<u32> = truth.layers().into_iter().map(u32::from).collect();
    written.file(&layout::layers(index), |bytes| written.labels(bytes, &layers))
}

impl Sink for Frames<'_> {
    fn begin(&mut self, geometry: &Geometry) -> Result<(), Error> {
        let index = geometry.key.index;
        let planes = geometry.planes_um.len();
        let values = geometry.values() as u64 * planes as u64;
        self.stack = match Form::of(planes) {
            Form::Single => None,
            form => Some(Pages::new(self.files.folder.pending(&layout::image(index, form))?, values * 2)?),
        };
        self.noise_free = Some(Pages::new(self.files.folder.pending(&layout::noise_free(index))?, values * 4)?);
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, geometry: &Geometry) -> Result<(), Error> {
        if let Some(pages) = &mut self.stack {
            let text = (plane.index == 0).then(|| description(geometry));
            match geometry.bits {
                ..=8 => pages.write(Pixels::U8(&narrow(&plane.grey)), geometry, text.as_deref())?,
                _ => pages.write(Pixels::U16(&plane.grey), geometry, text.as_deref())?,
            }
        }
        match &mut self.noise_free {
            Some(pages) => pages.write(Pixels::F32(&plane.noise_free), geometry, None),
            None => Ok(()),
        }
    }

    fn field(&mut self, field: &Field) -> Result<(), Error> {
        let (index, view) = (field.index(), field.geometry.view);
        let picture = match self.stack.take() {
            Some(pages) => {
                self.files.written.push(pages.commit()?);
                layout::all_in_focus(index)
            }
            None => layout::image(index, Form::Single),
        };
        self.files.png(&picture, field)?;
        let mut ids = Vec::new();
        for group in Group::ALL {
            field.truth.labels_into(group, &mut ids);
            self.files.encode(&layout::labels(group, index), label_tiff(&ids, view.width, view.pixel_um))?;
        }
        let layers = compressed(&[Pixels::U16(&field.truth.layers())], view.width, 1, view.pixel_um, None);
        self.files.encode(&layout::layers(index), layers)?;
        if let Some(pages) = self.noise_free.take() {
            self.files.written.push(pages.commit()?);
        }
        Ok(())
    }

    fn close(self: Box<Self>) -> Result<Vec<FileRecord>, Error> {
        Ok(self.files.written)
    }
}

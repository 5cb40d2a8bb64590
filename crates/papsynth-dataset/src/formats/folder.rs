//! `folder`: PNG and TIFF files in folders.

use papsynth::Plane;
use papsynth::truth::Group;

use super::names;
use super::ome::{Levels, description, page};
use super::sink::{Field, Files, Sink};
use super::written::{LIMITS, Written, differs, is_described};
use crate::error::Error;
use crate::read;
use crate::truth::{Form, Geometry};
use crate::write::{Page, Pages, Pixels, compressed, label_tiff};

#[derive(Default)]
pub(super) struct Frames {
    /// The planes of a stack; a single plane becomes a PNG.
    stack: Option<Pages>,
    noise_free: Option<Pages>,
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let (index, geometry, truth) = (written.field.index(), written.field.geometry, written.field.truth);
    let form = Form::of(geometry.planes_um.len());
    written.file(&names::image(index, form), |bytes| {
        written.planes(bytes)?;
        if form == Form::Stack { is_described(bytes, &description(geometry)) } else { Ok(()) }
    })?;
    if form == Form::Stack {
        written.file(&names::all_in_focus(index), |bytes| written.picture(bytes))?;
    }
    written.file(&names::noise_free(index), |bytes| {
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
        written.file(&names::labels(group, index), |bytes| written.labels(bytes, &ids))?;
    }
    let layers: Vec<u32> = truth.layers().into_iter().map(u32::from).collect();
    written.file(&names::layers(index), |bytes| written.labels(bytes, &layers))
}

impl Sink for Frames {
    fn begin(&mut self, geometry: &Geometry, files: &Files) -> Result<(), Error> {
        let index = geometry.key.index;
        let planes = geometry.planes_um.len();
        let values = geometry.values() as u64 * planes as u64;
        self.stack = match Form::of(planes) {
            Form::Single => None,
            form => Some(Pages::new(files.folder.pending(&names::image(index, form))?, values * 2)?),
        };
        self.noise_free = Some(Pages::new(files.folder.pending(&names::noise_free(index))?, values * 4)?);
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, geometry: &Geometry, _: &Files) -> Result<(), Error> {
        if let Some(pages) = &mut self.stack {
            let text = (plane.index == 0).then(|| description(geometry));
            pages.write(Levels::new(&plane.grey, geometry).pixels(), &page(geometry, text.as_deref()))?;
        }
        match &mut self.noise_free {
            Some(pages) => pages.write(Pixels::F32(&plane.noise_free), &page(geometry, None)),
            None => Ok(()),
        }
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        let (index, view) = (field.index(), field.geometry.view);
        let picture = match self.stack.take() {
            Some(pages) => {
                files.written.push(pages.commit()?);
                names::all_in_focus(index)
            }
            None => names::image(index, Form::Single),
        };
        files.png(&picture, field)?;
        let mut ids = Vec::new();
        for group in Group::ALL {
            field.truth.labels_into(group, &mut ids);
            files.encode(&names::labels(group, index), label_tiff(&ids, view.width, view.pixel_um))?;
        }
        let layers = &[Pixels::U16(&field.truth.layers())];
        let layers = compressed(layers, &Page { channels: 1, ..page(field.geometry, None) });
        files.encode(&names::layers(index), layers)?;
        if let Some(pages) = self.noise_free.take() {
            files.written.push(pages.commit()?);
        }
        Ok(())
    }
}

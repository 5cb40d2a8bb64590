//! `folder`: PNG and TIFF files in folders.

use papsynth::Plane;
use papsynth::truth::{Group, SemanticClass, Truth};

use super::depth::{Depth, TRAINING_BITS};
use super::format::{Extra, Layout};
use super::names;
use super::ome::{Levels, description, label_tiff, page};
use super::sink::{Field, Files, Sink};
use super::written::{LIMITS, Written, is_described};
use crate::error::{Error, InputError};
use crate::read;
use crate::truth::{Flatten, FrameSummary, overlaps};
use crate::write::{self, Pages, Pixels};

#[derive(Default)]
pub(super) struct Frames {
    /// The planes of a stack; a single plane becomes a PNG.
    stack: Option<Pages>,
    noise_free: Option<Pages>,
}

/// Returns the value of each pixel of the semantic label image.
fn semantic<T: From<u8>>(truth: &Truth, layout: &Layout) -> impl Iterator<Item = T> {
    truth.semantic(&SemanticClass::ALL, layout.min_detectability).into_iter().map(T::from)
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let (frame, truth) = (written.field.frame, written.field.truth);
    let index = frame.index;
    written.file(&names::image(frame), |bytes| {
        written.planes(bytes, Depth::Camera)?;
        if frame.is_stack() { is_described(bytes, &description(frame)) } else { Ok(()) }
    })?;
    if frame.is_stack() {
        written.file(&names::all_in_focus(index), |bytes| written.image(bytes, Depth::Camera))?;
    }
    let has = |extra| written.layout.has_extra(extra);
    if frame.bits > TRAINING_BITS && has(Extra::Preview) {
        written.file(&names::preview(index), |bytes| written.image(bytes, Depth::Training))?;
    }
    if has(Extra::NoiseFree) {
        written.file(&names::noise_free(index), |bytes| {
            let due = frame.planes_um.len();
            let pages = read::float_pages(bytes, &LIMITS, due)?;
            InputError::unless(pages.len() == due, format!("{} planes; the record has {due}", pages.len()))?;
            let fits = pages.iter().all(|page| page.len() == frame.values() && page.iter().all(|v| v.is_finite()));
            InputError::unless(fits, "the size differs from the record, or some values are not finite")
        })?;
    }
    for group in Group::ALL.into_iter().filter(|_| has(Extra::Labels)) {
        let ids = truth.labels(group).ids;
        written.file(&names::labels(group, index), |bytes| written.labels(bytes, ids))?;
    }
    if has(Extra::Semantic) {
        let classes = semantic(truth, written.layout).collect();
        written.file(&names::semantic(index), |bytes| written.labels(bytes, classes))?;
    }
    if has(Extra::Layers) {
        let layers: Vec<u32> = truth.layers().into_iter().map(u32::from).collect();
        written.file(&names::layers(index), |bytes| written.labels(bytes, layers))?;
    }
    Ok(())
}

impl Sink for Frames {
    fn begin(&mut self, frame: &FrameSummary, files: &Files) -> Result<(), Error> {
        let planes = frame.planes_um.len();
        let values = (frame.values() * planes) as u64;
        let pages = |name: &str, bytes| Pages::new(files.folder.pending(name)?, planes, bytes);
        self.stack = frame.is_stack().then(|| pages(&names::image(frame), values * 2)).transpose()?;
        let noise_free = || pages(&names::noise_free(frame.index), values * 4);
        self.noise_free = files.layout.has_extra(Extra::NoiseFree).then(noise_free).transpose()?;
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, frame: &FrameSummary, _: &Files) -> Result<(), Error> {
        if let Some(pages) = &mut self.stack {
            let text = (plane.index == 0).then(|| description(frame));
            pages.write(Levels::new(&plane.grey, frame).pixels(), &page(frame, text.as_deref()))?;
        }
        match &mut self.noise_free {
            Some(pages) => pages.write(Pixels::F32(&plane.noise_free), &page(frame, None)),
            None => Ok(()),
        }
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        let (frame, index, layout) = (field.frame, field.frame.index, files.layout);
        let image = match self.stack.take() {
            Some(pages) => {
                files.written.push(pages.commit()?);
                names::all_in_focus(index)
            }
            None => names::image(frame),
        };
        files.png(&image, field, Depth::Camera)?;
        if frame.bits > TRAINING_BITS && layout.has_extra(Extra::Preview) {
            files.png(&names::preview(index), field, Depth::Training)?;
        }
        for group in Group::ALL.into_iter().filter(|_| layout.has_extra(Extra::Labels)) {
            files.encode(&names::labels(group, index), label_tiff(Flatten::Top.labels(field.truth, group), frame))?;
        }
        if layout.has_extra(Extra::Semantic) {
            let classes: Vec<u16> = semantic(field.truth, layout).collect();
            files.encode(&names::semantic(index), write::png(&classes, frame.width, 1, 8, frame.pixel_um))?;
        }
        if layout.has_extra(Extra::Layers) {
            files.encode(&names::layers(index), label_tiff(overlaps(field.truth), frame))?;
        }
        if let Some(pages) = self.noise_free.take() {
            files.written.push(pages.commit()?);
        }
        Ok(())
    }
}

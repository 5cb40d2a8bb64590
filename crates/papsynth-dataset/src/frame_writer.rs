//! One frame, plane by plane.

use std::collections::BTreeMap;
use std::fs;
use std::io;

use papsynth::scene::Scene;
use papsynth::truth::{Group, Mask, Truth};
use papsynth::{Finished, Plane};
use tiff::{TiffError, TiffResult};

use crate::coco::{Document, category_name};
use crate::dataset::Dataset;
use crate::error::Error;
use crate::files::{Handle, Pending};
use crate::layout::{self, Form};
use crate::record::{FORMAT_VERSION, FileRecord, FrameRecord, FrameSummary, Geometry, WRITER};
use crate::table::table;
use crate::write::{PageWriter, Pixels, compressed, description, label_tiff, png};

/// Writes the files of one frame. Planes are written as they arrive and not kept. Dropped before it is finished, it
/// leaves no record, and the frame counts as not made.
pub struct FrameWriter<'a> {
    dataset: &'a Dataset,
    geometry: Geometry,
    /// The planes of a stack; a single plane becomes a PNG.
    stack: Option<Pages>,
    noise_free: Pages,
    /// Masks of the planes' saturated pixels.
    saturated: Vec<Mask>,
    floored: Vec<usize>,
    files: Vec<FileRecord>,
}

/// A TIFF file to which pages are added.
struct Pages {
    pending: Pending,
    writer: PageWriter<Handle>,
}

impl Pages {
    fn new(pending: Pending, bytes: u64) -> Result<Self, Error> {
        let writer = PageWriter::new(pending.handle()?, bytes).map_err(failed(&pending))?;
        Ok(Self { pending, writer })
    }

    fn write(&mut self, pixels: Pixels, geometry: &Geometry, description: Option<&str>) -> Result<(), Error> {
        let Geometry { view, channels, .. } = geometry;
        self.writer.write(pixels, view.width, *channels, view.pixel_um, description).map_err(failed(&self.pending))
    }
}

/// Whatever goes wrong with a TIFF that is being written is the writing's fault.
fn failed(pending: &Pending) -> impl FnOnce(TiffError) -> Error {
    let path = pending.path();
    move |e| {
        Error::io("write", path)(match e {
            TiffError::IoError(e) => e,
            other => io::Error::other(other),
        })
    }
}

impl<'a> FrameWriter<'a> {
    pub(crate) fn new(dataset: &'a Dataset, scene: &Scene) -> Result<Self, Error> {
        let index = scene.key.index;
        let wrong = |message: String| Error::Frame { index, message };
        if scene.key.seed != dataset.identity.seed {
            return Err(wrong(format!(
                "the scene is of seed {}, the data set of {}",
                scene.key.seed, dataset.identity.seed
            )));
        }
        let geometry = Geometry::of(scene);
        let (pixels, planes) = (geometry.pixels(), geometry.planes_um.len());
        if pixels == 0 || planes == 0 {
            return Err(wrong(format!(
                "the scene has {pixels} pixels and {planes} planes; at least one of each is wanted"
            )));
        }
        // From now on the frame is not whole, whatever it was before.
        let record = dataset.folder.path(&layout::record(index));
        match fs::remove_file(&record) {
            Err(e) if !matches!(e.kind(), io::ErrorKind::NotFound) => return Err(Error::io("remove", &record)(e)),
            _ => {}
        }
        let form = Form::of(planes);
        let values = geometry.values() as u64 * planes as u64;
        let stack = match form {
            Form::Single => None,
            Form::Stack => Some(Pages::new(dataset.folder.pending(&layout::image(index, form))?, values * 2)?),
        };
        let noise_free = Pages::new(dataset.folder.pending(&layout::noise_free(index))?, values * 4)?;
        let (saturated, floored) = (Vec::with_capacity(planes), Vec::with_capacity(planes));
        Ok(Self { dataset, geometry, stack, noise_free, saturated, floored, files: Vec::new() })
    }

    /// Writes the next plane.
    ///
    /// # Errors
    /// If it is not the next one or of another size than the scene, or the system refuses.
    pub fn write_plane(&mut self, plane: &Plane) -> Result<(), Error> {
        let (values, bits) = (self.geometry.values(), self.geometry.bits);
        let (next, planes) = (self.saturated.len(), self.geometry.planes_um.len());
        if plane.index != next || next >= planes {
            return Err(self.wrong(format!("plane {} came where plane {next} of {planes} was due", plane.index)));
        }
        self.check_size("grey levels", plane.grey.len(), values)?;
        self.check_size("noise-free values", plane.noise_free.len(), values)?;
        let brightest = plane.grey.iter().copied().max().unwrap_or(0);
        if brightest > white(bits) {
            return Err(self.wrong(format!("grey level {brightest} does not fit into {bits} bits")));
        }
        let (geometry, index) = (&self.geometry, self.geometry.key.index);
        let text = (plane.index == 0).then(|| description(&self.geometry));
        match &mut self.stack {
            Some(pages) if bits <= 8 => {
                #[expect(clippy::cast_possible_truncation, reason = "checked above")]
                let narrow: Vec<u8> = plane.grey.iter().map(|&g| g as u8).collect();
                pages.write(Pixels::U8(&narrow), geometry, text.as_deref())?;
            }
            Some(pages) => pages.write(Pixels::U16(&plane.grey), geometry, text.as_deref())?,
            None => self.write_png(&layout::image(index, Form::Single), &plane.grey)?,
        }
        self.noise_free.write(Pixels::F32(&plane.noise_free), &self.geometry, None)?;
        self.saturated.push(plane.saturated.clone());
        self.floored.push(plane.floored);
        Ok(())
    }

    /// Writes everything else and, last, the record that makes the frame whole.
    ///
    /// # Errors
    /// If planes are missing, something is of another size than the scene, or the system refuses.
    pub fn finish(mut self, finished: &Finished) -> Result<FrameSummary, Error> {
        self.check(finished)?;
        let (index, truth) = (self.geometry.key.index, &finished.truth);
        if let Some(pages) = self.stack.take() {
            self.files.push(pages.pending.commit()?);
            let grey = rounded(&finished.all_in_focus, white(self.geometry.bits));
            self.write_png(&layout::all_in_focus(index), &grey)?;
        }
        let view = self.geometry.view;
        let mut ids = Vec::new();
        for group in Group::ALL {
            truth.labels_into(group, &mut ids);
            self.write_tiff(&layout::labels(group, index), label_tiff(&ids, view.width, view.pixel_um))?;
        }
        let layers = truth.layers();
        let most_layers = layers.iter().copied().max().unwrap_or(0);
        self.write_tiff(&layout::layers(index), compressed(Pixels::U16(&layers), view.width, view.pixel_um))?;
        let rows = table(truth, index).map_err(|e| self.wrong(e.to_string()))?;
        self.write(&layout::table(index), &rows)?;
        let saturated = std::mem::take(&mut self.saturated);
        let counts = saturated.iter().map(|mask| usize::try_from(mask.area()).unwrap_or(usize::MAX)).collect();
        let floored = std::mem::take(&mut self.floored);
        let summary = summary(&self.geometry, truth, most_layers, [counts, floored]);
        let document = Document::of_frame(truth, &summary, &saturated, &self.dataset.categories)
            .map_err(|name| self.wrong(format!("the recipe knows no category `{name}`")))?;
        let document = serde_json::to_vec(&document).map_err(|e| self.wrong(e.to_string()))?;
        self.write(&layout::coco(index), &document)?;

        let Self { dataset, noise_free, mut files, .. } = self;
        files.push(noise_free.pending.commit()?);
        files.sort_by(|a, b| a.path.cmp(&b.path));
        let record = FrameRecord {
            version: FORMAT_VERSION,
            writer: WRITER.to_owned(),
            identity: dataset.identity.clone(),
            summary,
            files,
        };
        let text = serde_json::to_vec_pretty(&record).map_err(|e| Error::Frame { index, message: e.to_string() })?;
        dataset.folder.write(&layout::record(index), &text)?;
        Ok(record.summary)
    }

    fn write(&mut self, name: &str, bytes: &[u8]) -> Result<(), Error> {
        self.files.push(self.dataset.folder.write(name, bytes)?);
        Ok(())
    }

    fn write_png(&mut self, name: &str, levels: &[u16]) -> Result<(), Error> {
        let Geometry { view, bits, channels, .. } = &self.geometry;
        let png = png(levels, view.width, *channels, *bits, view.pixel_um);
        let bytes = png.map_err(Error::io("encode", &self.dataset.folder.path(name)))?;
        self.write(name, &bytes)
    }

    fn write_tiff(&mut self, name: &str, encoded: TiffResult<Vec<u8>>) -> Result<(), Error> {
        let bytes = encoded.map_err(|e| self.wrong(format!("{name}: {e}")))?;
        self.write(name, &bytes)
    }

    /// Everything must fit to the scene before a file is written.
    fn check(&self, finished: &Finished) -> Result<(), Error> {
        let (view, due) = (&self.geometry.view, self.geometry.planes_um.len());
        let (values, truth) = (self.geometry.values(), &finished.truth);
        if self.saturated.len() != due {
            return Err(self.wrong(format!("{} of {due} planes were written", self.saturated.len())));
        }
        if Geometry::of(&finished.scene) != self.geometry {
            return Err(self.wrong(format!(
                "the truth handed over is that of another scene, of frame {}",
                finished.scene.key.index
            )));
        }
        if due > 1 {
            self.check_size("all-in-focus values", finished.all_in_focus.len(), values)?;
        }
        if [truth.width, truth.height] != [view.width, view.height] {
            let ([w, h], [width, height]) = ([truth.width, truth.height], [view.width, view.height]);
            return Err(self.wrong(format!("the truth is that of {w} x {h} pixels, the image has {width} x {height}")));
        }
        let outside = truth.objects.iter().find(|object| {
            [&object.amodal, &object.front]
                .iter()
                .filter_map(|mask| mask.bounds())
                .any(|b| (b.x + b.width) as usize > view.width || (b.y + b.height) as usize > view.height)
        });
        outside.map_or(Ok(()), |object| Err(self.wrong(format!("the mask of object {} leaves the image", object.id))))
    }

    fn check_size(&self, what: &str, found: usize, values: usize) -> Result<(), Error> {
        if found == values {
            Ok(())
        } else {
            let channels = self.geometry.channels;
            let pixels = values / channels;
            let each = if channels == 1 { String::new() } else { format!(" with {channels} channels") };
            Err(self.wrong(format!("{found} {what} for an image of {pixels} pixels{each}")))
        }
    }

    fn wrong(&self, message: String) -> Error {
        Error::Frame { index: self.geometry.key.index, message }
    }
}

/// The largest grey level.
pub(crate) fn white(bits: u32) -> u16 {
    u16::MAX >> 16_u32.saturating_sub(bits.max(1)).min(15)
}

/// Expected grey levels as a camera without noise would give them.
fn rounded(values: &[f32], white: u16) -> Vec<u16> {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the range; NaN becomes 0")]
    let round = |v: f32| (v + 0.5).clamp(0.0, f32::from(white)) as u16;
    values.iter().map(|&v| round(v)).collect()
}

fn summary(
    geometry: &Geometry,
    truth: &Truth,
    most_layers: u16,
    [saturated, floored]: [Vec<usize>; 2],
) -> FrameSummary {
    let mut objects = BTreeMap::new();
    for object in &truth.objects {
        *objects.entry(category_name(&object.class, object.part)).or_insert(0) += 1;
    }
    FrameSummary {
        index: geometry.key.index,
        width: geometry.view.width,
        height: geometry.view.height,
        pixel_um: geometry.view.pixel_um,
        bits: geometry.bits,
        channels: geometry.channels,
        slide: geometry.slide,
        planes_um: geometry.planes_um.clone(),
        saturated,
        floored,
        objects,
        truncated: truth.objects.iter().filter(|o| o.truncated).count() as u64,
        most_layers,
    }
}

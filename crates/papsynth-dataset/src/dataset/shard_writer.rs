//! Writing of a shard in every format of the data set, one frame and one plane at a time.

use std::collections::BTreeSet;
use std::ops::Range;

use papsynth::scene::Scene;
use papsynth::truth::{Mask, Truth};
use papsynth::{Finished, Plane, white_level as white};

use super::record::{FORMAT_VERSION, ShardRecord, WRITER, read_record};
use super::rgb_image::ContactSheet;
use super::set::Dataset;
use crate::error::Error;
use crate::files::{FileRecord, Output, Pending};
use crate::formats::parquet::Table;
use crate::formats::{Depth, Extra, Field, Files, Sink, names};
use crate::read::LevelImage;
use crate::truth::{Document, FrameSummary, Image, Info, Row, extends_beyond, table, typed_columns};

impl Dataset {
    /// Starts a shard. Its existing record is removed.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn shard_writer(&self, shard: u64) -> Result<ShardWriter<'_>, Error> {
        let folder = &self.folder;
        // Without its record the shard is incomplete.
        folder.inside(names::SHARDS)?;
        check_folders(self, shard)?;
        folder.remove(&names::record(shard))?;
        let files = Files::new(folder, &self.layout, self.identity.seed, shard);
        let sinks = self.layout.formats.iter().map(|format| format.sink(&files)).collect::<Result<_, _>>()?;
        let truth = TruthFiles::begin(self, shard)?;
        Ok(ShardWriter { dataset: self, shard, files, sinks, truth, frame: None, done: Vec::new() })
    }
}

/// Writes the files of one shard. Frames and planes are written one after the other and not kept in memory. Dropping it
/// before [`commit`](Self::commit) leaves an incomplete shard without a record.
pub struct ShardWriter<'a> {
    dataset: &'a Dataset,
    shard: u64,
    files: Files<'a>,
    sinks: Vec<Box<dyn Sink + 'a>>,
    truth: TruthFiles,
    frame: Option<OpenFrame>,
    done: Vec<FrameSummary>,
}

struct OpenFrame {
    frame: FrameSummary,
    saturated: Vec<Mask>,
    clipped_px: Vec<usize>,
    /// Grey levels of a single plane.
    levels: Vec<u16>,
}

struct TruthFiles {
    coco: Output,
    table: Output,
    /// The table as Parquet, if the layout contains it.
    objects: Option<(Pending, Table<'static>)>,
    annotations: u64,
    images: Vec<Image>,
}

impl ShardWriter<'_> {
    /// Starts the frame of a scene.
    ///
    /// # Errors
    /// If the frame is not in this shard, is out of order, or a file cannot be written.
    pub fn begin(&mut self, scene: &Scene) -> Result<(), Error> {
        let frame = FrameSummary::of_scene(scene);
        let (found, expected) = (scene.key.seed, self.dataset.identity.seed);
        frame.due(found == expected, format!("the seed of the scene is {found}, that of the data set {expected}"))?;
        self.begin_with(frame)
    }

    /// As [`begin`](Self::begin), without a check of the seed.
    pub(crate) fn begin_with(&mut self, frame: FrameSummary) -> Result<(), Error> {
        let Range { start, end } = self.dataset.frames_of_shard(self.shard);
        let follows = self.done.last().is_none_or(|last| last.index < frame.index);
        let range = format!("shard {} contains frames {start} to {} in ascending order", self.shard, end - 1);
        frame.due((start..end).contains(&frame.index) && follows, range)?;
        if let Some(begun) = &self.frame {
            return Err(frame.wrong(format!("frame {} is not finished yet", begun.frame.index)));
        }
        let (pixels, planes) = (frame.width * frame.height, frame.planes_um.len());
        let few = format!("pixels {pixels}, planes {planes}; expected at least 1 of each");
        frame.due(pixels > 0 && planes > 0, few)?;
        for sink in &mut self.sinks {
            sink.begin(&frame, &self.files)?;
        }
        self.frame = Some(OpenFrame { frame, saturated: Vec::new(), clipped_px: Vec::new(), levels: Vec::new() });
        Ok(())
    }

    /// Writes the next plane.
    ///
    /// # Errors
    /// If it is not the next plane, its size differs from the scene, or a file cannot be written.
    pub fn write_plane(&mut self, plane: &Plane) -> Result<(), Error> {
        let begun = self.frame.as_mut().ok_or_else(|| not_begun(self.dataset, self.shard))?;
        begun.check_plane(plane)?;
        for sink in &mut self.sinks {
            sink.plane(plane, &begun.frame, &self.files)?;
        }
        if !begun.frame.is_stack() {
            begun.levels.clone_from(&plane.grey);
        }
        begun.saturated.push(plane.saturated.clone());
        begun.clipped_px.push(plane.clipped_px);
        Ok(())
    }

    /// Ends the frame and writes its ground truth.
    ///
    /// # Errors
    /// If planes are missing, a size differs from the scene, or a file cannot be written.
    pub fn end(&mut self, finished: &Finished) -> Result<&FrameSummary, Error> {
        let OpenFrame { frame, .. } = self.frame.as_ref().ok_or_else(|| not_begun(self.dataset, self.shard))?;
        let key = finished.scene.key;
        let same = key.seed == self.dataset.identity.seed && frame.is_of(&finished.scene);
        frame.due(same, format!("the ground truth belongs to another scene, of frame {}", key.index))?;
        let edf = if frame.is_stack() { finished.all_in_focus_levels() } else { Vec::new() };
        if self.dataset.layout.scenes {
            self.files.write(&names::scene(key.index), finished.scene.to_json().as_bytes())?;
        }
        self.end_with(&finished.truth, edf)
    }

    /// As [`end`](Self::end), with the grey levels of the extended-depth-of-field image of a stack.
    pub(crate) fn end_with(&mut self, truth: &Truth, edf: Vec<u16>) -> Result<&FrameSummary, Error> {
        let begun = self.frame.take().ok_or_else(|| not_begun(self.dataset, self.shard))?;
        begun.check(truth, &edf)?;
        let OpenFrame { frame, saturated, clipped_px, levels } = begun;
        let levels = if edf.is_empty() { levels } else { edf };
        let Dataset { identity, layout, categories, .. } = self.dataset;
        let frame = frame.counted(truth, &saturated, clipped_px, layout.flatten);
        let files = self.dataset.image_paths(&frame, self.shard);
        let document = Document::of_frame(truth, &frame, &saturated, categories, files, layout.min_detectability)
            .map_err(|category| frame.wrong(format!("the recipe has no category `{category}`")))?;
        let field = Field::new(identity.seed, &frame, truth, &document, &levels);
        for sink in &mut self.sinks {
            sink.field(&field, &mut self.files)?;
        }
        self.keep_thumbnail(&frame, truth, levels);
        let rows = table(truth, frame.index, self.done.is_empty());
        self.truth.add(document, &rows, truth, frame.index)?;
        self.done.push(frame);
        Ok(&self.done[self.done.len() - 1])
    }

    /// Keeps the thumbnail of a frame for the contact sheet, if a merge would draw the same from its files.
    fn keep_thumbnail(&self, frame: &FrameSummary, truth: &Truth, levels: Vec<u16>) {
        let Dataset { layout, thumbnails, .. } = self.dataset;
        let is_exact = layout.best_format(false).is_some_and(|format| format.depth() == Depth::Camera);
        if frame.is_stack() || !is_exact || !layout.has_extra(Extra::ContactSheet) {
            return;
        }
        thumbnails.keep(frame.index, || {
            let FrameSummary { width, channels, bits, .. } = *frame;
            let image = LevelImage { width, channels, levels, white: white(bits) };
            let masks: Vec<_> = truth.objects.iter().map(|object| (object.group(), object.amodal.clone())).collect();
            ContactSheet::thumbnail(&image, white(bits), &masks)
        });
    }

    /// Renames the files to their names, then writes the record that completes the shard.
    ///
    /// # Errors
    /// If a frame is not ended, or a file cannot be written.
    pub fn commit(self) -> Result<Vec<FrameSummary>, Error> {
        if let Some(begun) = &self.frame {
            return Err(begun.frame.wrong("is not finished"));
        }
        let mut files = self.files;
        for sink in self.sinks {
            sink.close(&mut files)?;
        }
        let mut files = files.written;
        files.extend(self.truth.commit()?);
        files.sort_by(|a, b| a.path.cmp(&b.path));
        let record = ShardRecord {
            version: FORMAT_VERSION,
            writer: WRITER.to_owned(),
            identity: self.dataset.identity.clone(),
            layout: self.dataset.layout.clone(),
            shard: self.shard,
            frames: self.done,
            files,
            sha256: String::new(),
        }
        .sealed();
        let folder = &self.dataset.folder;
        // The files and their names must be on the disk before the record.
        folder.sync_names(&record.files)?;
        let name = names::record(self.shard);
        folder.sync_names([&folder.write(&name, &record.to_json())?])?;
        folder.release(record.files.iter().map(|file| file.path.as_str()).chain([name.as_str()]));
        Ok(record.frames)
    }
}

/// Checks the folders of a recorded shard for symbolic links before its record is removed.
fn check_folders(dataset: &Dataset, shard: u64) -> Result<(), Error> {
    if dataset.folder.is_remote() {
        return Ok(());
    }
    let Ok(record) = read_record(&dataset.folder, shard) else { return Ok(()) };
    let folders: BTreeSet<&str> =
        record.files.iter().filter_map(|file| file.path.rsplit_once('/')).map(|(folder, _)| folder).collect();
    folders.into_iter().try_for_each(|name| dataset.folder.no_link(name))
}

fn not_begun(dataset: &Dataset, shard: u64) -> Error {
    Error::Frame { index: dataset.frames_of_shard(shard).start, message: "no frame was started".to_owned() }
}

impl TruthFiles {
    fn begin(dataset: &Dataset, shard: u64) -> Result<Self, Error> {
        let output = |name: String| Output::new(dataset.folder.pending(&name)?);
        let mut coco = output(names::coco(shard))?;
        coco.bytes(b"{\"info\":")?;
        coco.json(&Info::default())?;
        coco.bytes(b",\"licenses\":[],\"categories\":")?;
        coco.json(&dataset.categories)?;
        coco.bytes(b",\"annotations\":[")?;
        let begin = |pending: Pending| {
            let table = Table::begin(pending.handle()?, pending.path(), typed_columns())?;
            Ok::<_, Error>((pending, table))
        };
        let objects = dataset.layout.objects_parquet.then(|| dataset.folder.pending(&names::objects(shard)));
        let objects = objects.transpose()?.map(begin).transpose()?;
        Ok(Self { coco, table: output(names::table(shard))?, objects, annotations: 0, images: Vec::new() })
    }

    fn add(&mut self, frame: Document, rows: &[u8], truth: &Truth, index: u64) -> Result<(), Error> {
        let before = self.annotations;
        for annotation in frame.annotations {
            self.coco.bytes(if self.annotations == 0 { b"\n" } else { b",\n" })?;
            self.coco.json(&annotation.renumbered(before))?;
            self.annotations += 1;
        }
        self.images.extend(frame.images);
        if let Some((_, table)) = &mut self.objects {
            Row::all(truth, index).try_for_each(|row| table.row(&row))?;
        }
        self.table.bytes(rows)
    }

    fn commit(mut self) -> Result<Vec<FileRecord>, Error> {
        self.coco.bytes(b"],\"images\":[")?;
        for (number, image) in self.images.iter().enumerate() {
            self.coco.bytes(if number == 0 { b"\n" } else { b",\n" })?;
            self.coco.json(image)?;
        }
        self.coco.bytes(b"]}\n")?;
        let mut files = vec![self.coco.commit()?, self.table.commit()?];
        if let Some((pending, table)) = self.objects {
            table.end()?;
            files.push(pending.commit()?);
        }
        Ok(files)
    }
}

impl OpenFrame {
    fn check_plane(&self, plane: &Plane) -> Result<(), Error> {
        let Self { frame, saturated, .. } = self;
        let (next, planes) = (saturated.len(), frame.planes_um.len());
        let message = format!("found plane {}, expected plane {next} of {planes}", plane.index);
        frame.due(plane.index == next && next < planes, message)?;
        self.check_size("grey levels", plane.grey.len())?;
        self.check_size("noise-free values", plane.noise_free.len())?;
        let (brightest, bits) = (plane.grey.iter().copied().max().unwrap_or_default(), frame.bits);
        frame.due(brightest <= white(bits), format!("grey level {brightest} exceeds {bits} bits"))
    }

    /// Checks sizes before a file is written.
    fn check(&self, truth: &Truth, edf: &[u16]) -> Result<(), Error> {
        let Self { frame, saturated, .. } = self;
        let (found, expected) = (saturated.len(), frame.planes_um.len());
        frame.due(found == expected, format!("planes written: {found} of {expected}"))?;
        if frame.is_stack() {
            self.check_size("grey levels of the extended-depth-of-field image", edf.len())?;
        }
        let ([w, h], [width, height]) = ([truth.width, truth.height], [frame.width, frame.height]);
        let other = format!("the ground truth is {w} x {h} px, the image {width} x {height} px");
        frame.due([w, h] == [width, height], other)?;
        let outside = truth.objects.iter().find(|object| extends_beyond(object, width, height));
        outside.map_or(Ok(()), |o| Err(frame.wrong(format!("the mask of object {} extends beyond the image", o.id))))
    }

    fn check_size(&self, what: &str, found: usize) -> Result<(), Error> {
        let FrameSummary { width, height, channels, .. } = self.frame;
        let expected = self.frame.values();
        let message = format!("{what}: found {found}, expected {width} x {height} x {channels} = {expected}");
        self.frame.due(found == expected, message)
    }
}

//! Data sets written anew in other formats: from their files, without an engine.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use papsynth::Plane;

use super::generate::{Outcome, Progress};
use super::images::{images, pages};
use super::record::ShardRecord;
use super::set::Dataset;
use crate::bytes::sha256;
use crate::error::{Error, Problem};
use crate::files::Check;
use crate::formats::{Format, LIMITS, Layout, levels, names};
use crate::read::{self, LevelImage};
use crate::truth::{Document, Form, FrameSummary, Geometry, Image};

/// Largest recipe, model or map.
const GIVEN_BYTES: u64 = 1 << 30;

/// Writes a data set in other formats into another folder, and goes on where an earlier conversion was left. Images are copied level by
/// level, truth mask by mask; recipe, model and seed stay.
///
/// # Errors
/// If `from` is no whole data set, its formats lack what those of `layout` want (noise-free images, planes of stacks), or the system
/// refuses.
pub fn convert(
    from: &Path,
    to: &Path,
    layout: &Layout,
    stop: &AtomicBool,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Outcome, Error> {
    let source = Source::open(from)?;
    source.offers(layout)?;
    let target = source.begin(to, layout)?;
    let (mut kept, mut made, mut open) = (0, 0, None);
    let frames = source.frames()?;
    for (shard, frames) in by_shard(&frames, layout.frames_per_shard) {
        if stop.load(Ordering::Relaxed) {
            return Ok(Outcome { kept, made, stopped: true });
        }
        let has_all = |record: ShardRecord| frames.iter().all(|&(index, _)| record.covers(&(index..index + 1)));
        if target.whole(shard, Check::Sizes)?.is_some_and(has_all) {
            frames.iter().for_each(|&(index, _)| report(Progress::Kept(index)));
            kept += frames.len() as u64;
            continue;
        }
        let mut writer = target.shard_writer(shard)?;
        for &(index, there) in frames {
            if open.as_ref().is_none_or(|open: &Open| open.record.shard != there) {
                open = Some(source.shard(there)?);
            }
            let Some(open) = &open else { continue };
            let frame = open.record.frames.iter().find(|frame| frame.index == index);
            let Some(frame) = frame else { continue };
            writer.begin_with(Geometry::of_summary(frame, source.dataset.identity.seed))?;
            source.planes(open, frame, |plane| writer.write_plane(&plane))?;
            let truth = source.dataset.truth_in(&open.document, there, index)?;
            let sharp = source.sharp(frame, there)?;
            report(Progress::Made(writer.end_with(&truth, sharp)?));
        }
        writer.commit()?;
        made += frames.len() as u64;
    }
    target.finish()?;
    Ok(Outcome { kept, made, stopped: false })
}

/// Frames of each shard of a layout, with the shard that they come from.
fn by_shard(frames: &[(u64, u64)], each: u64) -> impl Iterator<Item = (u64, &[(u64, u64)])> {
    frames.chunk_by(move |(a, _), (b, _)| a / each == b / each).map(move |chunk| (chunk[0].0 / each, chunk))
}

struct Source {
    dataset: Dataset,
}

/// A shard whose truth is in memory.
struct Open {
    record: ShardRecord,
    document: Document,
}

impl Source {
    fn open(path: &Path) -> Result<Self, Error> {
        Ok(Self { dataset: Dataset::open(path)? })
    }

    fn refuse<T>(&self, message: String) -> Result<T, Error> {
        Err(Error::folder(self.dataset.path(), message))
    }

    /// Whether there is all that a layout wants.
    fn offers(&self, layout: &Layout) -> Result<(), Error> {
        let there = &self.dataset.layout;
        if layout.has(Format::Folder) && !there.has(Format::Folder) {
            return self.refuse(format!(
                "the format `folder` wants noise-free images, which {there} does not keep; `papsynth generate` with the recipe \
                 of the data set makes them"
            ));
        }
        Ok(())
    }

    /// A data set of the same identity.
    fn begin(&self, to: &Path, layout: &Layout) -> Result<Dataset, Error> {
        let Dataset { folder, identity, categories, map, .. } = &self.dataset;
        let given = |name: &str| read::bytes(&folder.inside(name)?, GIVEN_BYTES);
        let (recipe, model) = (given(names::RECIPE)?, given(names::MODEL)?);
        for (name, bytes, sha) in
            [(names::RECIPE, &recipe, &identity.recipe_sha256), (names::MODEL, &model, &identity.model_sha256)]
        {
            if sha256(bytes) != *sha {
                return self.refuse(format!("{name} is not the one that the data set was made from"));
            }
        }
        let mut kept = vec![(names::RECIPE.to_owned(), recipe), (names::MODEL.to_owned(), model)];
        if let Some(map) = map {
            kept.push((map.clone(), given(map)?));
        }
        Dataset::begin(to, identity.clone(), layout.clone(), categories.clone(), map.clone(), &kept)
    }

    /// Every frame with its shard, by index.
    fn frames(&self) -> Result<Vec<(u64, u64)>, Error> {
        let mut frames = Vec::new();
        for shard in self.dataset.shards()? {
            frames.extend(self.record(shard)?.frames.iter().map(|frame| (frame.index, shard)));
        }
        if frames.is_empty() {
            return self.refuse("the data set has no whole frame".to_owned());
        }
        Ok(frames)
    }

    fn record(&self, shard: u64) -> Result<ShardRecord, Error> {
        match self.dataset.whole_or_flaw(shard, Check::Sizes)? {
            Ok(record) => Ok(record),
            Err(flaw) => self.refuse(format!("{flaw}; `papsynth verify` says what is wrong")),
        }
    }

    fn shard(&self, shard: u64) -> Result<Open, Error> {
        let record = self.record(shard)?;
        for file in &record.files {
            if let Some(message) = self.dataset.folder.flaw(file, Check::Hashes)? {
                return self.refuse(format!("{} {message}; `papsynth verify` says what is wrong", file.path));
            }
        }
        Ok(Open { record, document: self.dataset.document(shard)? })
    }

    /// Hands over the planes of a frame.
    fn planes(
        &self,
        open: &Open,
        frame: &FrameSummary,
        mut take: impl FnMut(Plane) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let folder = &self.dataset.folder;
        let stack = Form::of(frame.planes_um.len()) == Form::Stack;
        let format = self.dataset.layout.formats.iter().find(|format| !stack || format.has_planes());
        let Some(format) = format else {
            return self.refuse(format!("{} keeps no planes of stacks", self.dataset.layout));
        };
        let name = format.image(self.dataset.identity.seed, open.record.shard, frame);
        let mut noise_free = match self.dataset.layout.has(Format::Folder) {
            true => Some(NoiseFree::open(&folder.inside(&names::noise_free(frame.index))?, frame.planes_um.len())?),
            false => None,
        };
        let coco = folder.path(&names::coco(open.record.shard));
        let image = open.document.images.iter().find(|image| image.index() == frame.index);
        let saturated = image.map_or_else(|| Ok(Vec::new()), Image::saturated).map_err(Error::input(&coco))?;
        let mut index = 0;
        let mut failure = None;
        let read = pages(&self.dataset, &name, frame, open.record.shard, &mut |page| {
            let values = frame.width * frame.height * frame.channels;
            let grey = levels(page, frame.channels);
            let done = || -> Result<(), Error> {
                let noise_free = match &mut noise_free {
                    Some(pages) => pages.next()?,
                    None => vec![0.0; values],
                };
                take(Plane {
                    index,
                    stage_um: frame.planes_um.get(index).copied().unwrap_or_default(),
                    channels: frame.channels,
                    grey,
                    noise_free,
                    saturated: saturated.get(index).cloned().unwrap_or_default(),
                    floored: frame.floored.get(index).copied().unwrap_or_default(),
                })
            };
            let done = done();
            index += 1;
            done.map_err(|error| {
                failure = Some(error);
                Problem::differs("")
            })
        });
        match (failure, read) {
            (Some(error), _) => Err(error),
            (None, read) => read,
        }
    }

    /// The levels of a stack's picture with everything in focus; of a single plane none.
    fn sharp(&self, frame: &FrameSummary, shard: u64) -> Result<Vec<u16>, Error> {
        if Form::of(frame.planes_um.len()) == Form::Single {
            return Ok(Vec::new());
        }
        let (_, Some(name)) = self.dataset.images_of(frame, shard) else {
            let layout = &self.dataset.layout;
            return self.refuse(format!("{layout} keeps no picture of a stack with everything in focus"));
        };
        let path = self.dataset.folder.path(&name);
        let files = images(&self.dataset, &name, shard)?;
        let file = files.first().map(Vec::as_slice).unwrap_or_default();
        let image = LevelImage::decode(file, &LIMITS).map_err(Error::input(&path))?;
        Ok(levels(image, frame.channels))
    }
}

/// The pages of a file of noise-free images.
struct NoiseFree {
    path: std::path::PathBuf,
    pages: std::vec::IntoIter<Vec<f32>>,
}

impl NoiseFree {
    fn open(path: &Path, planes: usize) -> Result<Self, Error> {
        let pages = read::float_pages(&read::bytes(path, LIMITS.max_file_bytes)?, &LIMITS, planes);
        Ok(Self { path: path.to_owned(), pages: pages.map_err(Error::input(path))?.into_iter() })
    }

    fn next(&mut self) -> Result<Vec<f32>, Error> {
        let missing = || Error::input(&self.path)(Problem::differs("it has too few planes"));
        self.pages.next().ok_or_else(missing)
    }
}

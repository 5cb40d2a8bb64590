//! `ome-zarr`: an OME-Zarr 0.5 group for each frame, with labels in layers without overlap, each a label image.
//!
//! Each array is one shard, so that a frame has few files. Planes of a stack are compressed when they are ready.

use std::collections::BTreeSet;
use std::io::Cursor;

use papsynth::Plane;
use papsynth::truth::Group;
use papsynth_zarr::{
    Channel, Coordinates, DataType, Image, Labels, Pyramid, PyramidShape, Sample, Shard, ShardEncoder, ShardReader,
    Tiling, halved, halved_labels, levels_until, shard_bytes,
};
use serde_json::{Map, Value, json};

use super::depth::Depth;
use super::names::{numbered, zarr_group as group_of};
use super::sink::{Field, Files, Sink};
use super::written::{LIMITS, Take, Written, is_of_masks};
use crate::error::{Error, InputError};
use crate::files::{Folder, Output};
use crate::read::{self, LevelImage};
use crate::truth::{FrameSummary, LabelRuns, category_name, layers};
use crate::write::is_large;
use papsynth::white_level as white;

/// Width and height of a chunk, the smallest unit that a viewer reads.
const CHUNK: usize = 512;

#[derive(Default)]
pub(super) struct Images {
    levels: Vec<Level>,
}

struct Level {
    encoder: ShardEncoder,
    output: Output,
}

impl Images {
    fn add<T: Sample>(&mut self, channel: usize, plane: usize, mut values: Vec<T>) -> Result<(), papsynth_zarr::Error> {
        for level in &mut self.levels {
            let width = level.encoder.block().columns.len();
            let bytes = level.encoder.plane(channel, plane, &values)?;
            level.output.bytes(&bytes).map_err(|error| match error {
                Error::Io { source, .. } => source.into(),
                other => papsynth_zarr::Error::Argument { what: other.to_string() },
            })?;
            values = halved(&values, width);
        }
        Ok(())
    }
}

/// Returns the arrays of an image or label image of a frame.
fn pyramid(frame: &FrameSummary, kind: DataType, [channels, planes]: [Option<usize>; 2]) -> Result<Pyramid, Error> {
    let [width, height] = [frame.width, frame.height];
    let form = PyramidShape {
        kind,
        channels,
        planes,
        height,
        width,
        tiling: Tiling::whole(CHUNK, planes.unwrap_or(1), width, height),
        levels: if is_large(width, height) { levels_until(CHUNK, width, height) } else { 1 },
    };
    Pyramid::new(&form).map_err(|error| frame.wrong(error.to_string()))
}

fn image_pyramid(frame: &FrameSummary) -> Result<Pyramid, Error> {
    let many = |count: usize| (count > 1).then_some(count);
    let kind = if frame.bits <= 8 { DataType::U8 } else { DataType::U16 };
    pyramid(frame, kind, [many(frame.channels), many(frame.planes_um.len())])
}

struct Layer {
    labels: Labels,
    ids: Vec<u32>,
}

fn label_layers(field: &Field) -> Result<Vec<Layer>, Error> {
    let mut found = Vec::new();
    for group in Group::ALL {
        let pages = layers(field.truth, group);
        let kind = if pages.iter().all(LabelRuns::fits_16_bits) { DataType::U16 } else { DataType::U32 };
        for (number, ids) in pages.iter().map(LabelRuns::pixels).enumerate() {
            let shown: BTreeSet<u32> = ids.iter().copied().filter(|&id| id > 0).collect();
            let labels = Labels {
                name: format!("{}-{number}", group.name()),
                pyramid: pyramid(field.frame, kind, [None, None])?,
                colors: Vec::new(),
                properties: properties(field, group, &shown),
            };
            found.push(Layer { labels, ids });
        }
    }
    Ok(found)
}

/// Returns the properties of the objects of a group in a layer.
fn properties(field: &Field, group: Group, shown: &BTreeSet<u32>) -> Vec<(u32, Map<String, Value>)> {
    let objects = field.truth.objects.iter().zip(&field.document.annotations);
    let shown = objects.filter(|(object, _)| object.group() == group && shown.contains(&object.id));
    shown
        .map(|(object, annotation)| {
            let known = [
                ("category", json!(category_name(&object.class, object.part))),
                ("class", json!(object.class)),
                ("bethesda", json!(object.bethesda)),
                ("kind", json!(object.kind.name())),
                ("semantic_class", json!(object.semantic_class().name())),
                ("ignored", json!(annotation.iscrowd == 1)),
                // Nucleus and cell have the same label.
                ("parent", json!(annotation.parent_id.map(|_| object.id))),
                ("depth_um", json!(object.depth_um)),
                ("mean_absorbance", json!(object.mean_absorbance)),
                ("area_um2", json!(object.area_um2)),
                ("area_px", json!(object.amodal.area())),
                ("truncated", json!(object.truncated)),
            ];
            (object.id, known.map(|(name, value)| (name.to_owned(), value)).into_iter().collect())
        })
        .collect()
}

/// Returns all `zarr.json` of a frame, with their paths.
fn documents(seed: u64, frame: &FrameSummary, labels: Vec<Labels>) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let planes = &frame.planes_um;
    let step_um = match planes.as_slice() {
        [first, second, ..] if first != second => second - first,
        _ => 1.0,
    };
    let own = json!({
        "seed": seed,
        "index": frame.index,
        "slide": frame.slide,
        "bits": frame.bits,
        "planes_um": planes,
    });
    let image = Image {
        name: numbered(frame.index),
        pyramid: image_pyramid(frame)?,
        coordinates: Coordinates {
            pixel_um: frame.pixel_um,
            step_um,
            first_um: planes.first().copied().unwrap_or(0.0),
        },
        channels: channels(frame.channels, frame.bits),
        plane: planes.len() / 2,
        labels,
        attributes: Map::from_iter([("papsynth".to_owned(), own)]),
    };
    image.documents().map_err(|error| frame.wrong(error.to_string()))
}

/// Returns the descriptions of the channels of an image.
pub(crate) fn channels(count: usize, bits: u32) -> Vec<Channel> {
    let range = [0.0, f64::from(white(bits))];
    let channel = |(label, color): (&str, [u8; 3])| Channel { label: label.to_owned(), color, range, window: range };
    match count {
        3 => [("red", [255, 0, 0]), ("green", [0, 255, 0]), ("blue", [0, 0, 255])].map(channel).to_vec(),
        _ => vec![channel(("grey", [255; 3]))],
    }
}

/// Returns the path of the shard of a level within the folder of the group.
fn shard_file(level: usize, array: &papsynth_zarr::Array) -> String {
    format!("{level}/{}", array.file(Shard::default()))
}

impl Sink for Images {
    fn begin(&mut self, frame: &FrameSummary, files: &Files) -> Result<(), Error> {
        let group = group_of(frame.index);
        self.levels.clear();
        for (level, array) in image_pyramid(frame)?.levels().iter().enumerate() {
            let name = format!("{group}/{}", shard_file(level, array));
            let output = Output::new(files.folder.pending(&name)?)?;
            let encoder = ShardEncoder::new(array, Shard::default()).map_err(|error| frame.wrong(error.to_string()))?;
            self.levels.push(Level { encoder, output });
        }
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, frame: &FrameSummary, files: &Files) -> Result<(), Error> {
        for channel in 0..frame.channels {
            let values = plane.grey.iter().skip(channel).step_by(frame.channels);
            let added = match frame.bits {
                // `ShardWriter` has checked that levels fit into the bits of the camera.
                ..=8 => self.add(channel, plane.index, values.map(|&v| v.to_le_bytes()[0]).collect()),
                _ => self.add(channel, plane.index, values.copied().collect()),
            };
            added.map_err(|error| failed(error, files.folder, &group_of(frame.index), frame))?;
        }
        Ok(())
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        let (frame, group) = (field.frame, group_of(field.frame.index));
        let folder = files.folder;
        let broken = |error| failed(error, folder, &group, frame);
        for Level { encoder, mut output } in self.levels.drain(..) {
            output.bytes(&encoder.end().map_err(broken)?)?;
            files.written.push(output.commit()?);
        }
        let mut described = Vec::new();
        for Layer { labels, ids } in label_layers(field)? {
            let folder = format!("{group}/{}", labels.folder());
            for (name, bytes) in label_shards(&labels, ids).map_err(broken)? {
                files.write(&format!("{folder}/{name}"), &bytes)?;
            }
            described.push(labels);
        }
        for (name, bytes) in documents(field.seed, frame, described)? {
            files.write(&format!("{group}/{name}"), &bytes)?;
        }
        Ok(())
    }
}

fn failed(error: papsynth_zarr::Error, folder: &Folder, group: &str, frame: &FrameSummary) -> Error {
    match error {
        papsynth_zarr::Error::Io(source) => Error::io("write", &folder.path(group))(source),
        other => frame.wrong(other.to_string()),
    }
}

/// Returns the shards of all levels of a label image, with their paths in its folder.
fn label_shards(labels: &Labels, mut ids: Vec<u32>) -> Result<Vec<(String, Vec<u8>)>, papsynth_zarr::Error> {
    let mut shards = Vec::new();
    for (level, array) in labels.pyramid.levels().iter().enumerate() {
        let bytes = match array.kind() {
            DataType::U16 => shard_bytes(array, Shard::default(), &small(&ids))?,
            _ => shard_bytes(array, Shard::default(), &ids)?,
        };
        shards.push((shard_file(level, array), bytes));
        ids = halved_labels(&ids, array.shape()[3]);
    }
    Ok(shards)
}

/// Narrows values to 16 bits.
fn small(values: &[u32]) -> Vec<u16> {
    values.iter().map(|&value| u16::try_from(value).unwrap_or(u16::MAX)).collect()
}

/// Checks a frame: documents are equal, each level is the previous one at half size, labels are those of the masks.
pub(super) fn check(written: &Written) -> Result<(), Error> {
    let field = written.field;
    let (frame, group) = (field.frame, group_of(field.frame.index));
    let layers = label_layers(field)?;
    for (name, expected) in documents(field.seed, frame, layers.iter().map(|layer| layer.labels.clone()).collect())? {
        written.file(&format!("{group}/{name}"), |bytes| {
            InputError::unless(bytes == expected, "the content differs from the record and coco.json")
        })?;
    }
    let pyramid = image_pyramid(frame)?;
    let first = format!("{group}/{}", shard_file(0, &pyramid.levels()[0]));
    written.file(&first, |bytes| written.read_planes(Depth::Camera, &mut |take| planes(bytes, frame, take)))?;
    are_halves(written, &group, &pyramid)?;
    layers.into_iter().try_for_each(|Layer { labels, ids }| are_labels(written, &group, &labels, ids))
}

fn are_halves(written: &Written, group: &str, pyramid: &Pyramid) -> Result<(), Error> {
    for (number, pair) in pyramid.levels().windows(2).enumerate() {
        let [full, half] = [&pair[0], &pair[1]];
        let name = |level: usize, array| format!("{group}/{}", shard_file(level, array));
        let above = written.folder.path(&name(number, full));
        let bytes = read::bytes(&above, LIMITS.max_file_bytes)?;
        let mut above = Reader::open(full, &bytes).map_err(Error::input(&above))?;
        written.file(&name(number + 1, half), |bytes| {
            let mut below = Reader::open(half, bytes)?;
            let [channels, planes, _, width] = full.shape();
            for (plane, channel) in (0..planes).flat_map(|plane| (0..channels).map(move |channel| (plane, channel))) {
                let expected = halved(&above.plane(channel, plane)?, width);
                InputError::unless(
                    below.plane(channel, plane)? == expected,
                    "the level is not the previous level at half size",
                )?;
            }
            Ok(())
        })?;
    }
    Ok(())
}

fn are_labels(written: &Written, group: &str, labels: &Labels, mut ids: Vec<u32>) -> Result<(), Error> {
    for (level, array) in labels.pyramid.levels().iter().enumerate() {
        written.file(&format!("{group}/{}/{}", labels.folder(), shard_file(level, array)), |bytes| {
            is_of_masks(Reader::open(array, bytes)?.plane(0, 0)? == ids)
        })?;
        ids = halved_labels(&ids, array.shape()[3]);
    }
    Ok(())
}

/// Reads the shard of an array with values of any type.
struct Reader<'a> {
    shard: ShardReader<Cursor<&'a [u8]>>,
    kind: DataType,
}

impl<'a> Reader<'a> {
    fn open(array: &papsynth_zarr::Array, bytes: &'a [u8]) -> Result<Self, InputError> {
        let shard = ShardReader::open(array, Shard::default(), Cursor::new(bytes)).map_err(broken)?;
        Ok(Self { shard, kind: array.kind() })
    }

    fn plane(&mut self, channel: usize, plane: usize) -> Result<Vec<u32>, InputError> {
        let values = match self.kind {
            DataType::U8 => self.shard.plane::<u8>(channel, plane).map(|v| v.into_iter().map(u32::from).collect()),
            DataType::U16 => self.shard.plane::<u16>(channel, plane).map(|v| v.into_iter().map(u32::from).collect()),
            _ => self.shard.plane(channel, plane),
        };
        values.map_err(broken)
    }
}

fn broken(error: papsynth_zarr::Error) -> InputError {
    InputError::broken("Zarr", error)
}

/// Reads the planes of a frame from the shard of its image at full size.
fn planes(bytes: &[u8], frame: &FrameSummary, take: &mut Take) -> Result<(), InputError> {
    let pyramid = image_pyramid(frame).map_err(|error| InputError::unfit(error.to_string()))?;
    let mut reader = Reader::open(&pyramid.levels()[0], bytes)?;
    let (width, channels) = (frame.width, frame.channels);
    for plane in 0..frame.planes_um.len() {
        let mut levels = vec![0; frame.values()];
        for channel in 0..channels {
            let at = levels.iter_mut().skip(channel).step_by(channels);
            at.zip(small(&reader.plane(channel, plane)?)).for_each(|(level, value)| *level = value);
        }
        take(LevelImage { width, channels, levels, white: white(if frame.bits <= 8 { 8 } else { 16 }) })?;
    }
    Ok(())
}

/// Calls `take` with each plane of a frame of a data set.
pub(crate) fn read_planes(folder: &Folder, frame: &FrameSummary, take: &mut Take) -> Result<(), Error> {
    let array = image_pyramid(frame)?;
    let path = folder.path(&format!("{}/{}", group_of(frame.index), shard_file(0, &array.levels()[0])));
    let bytes = read::bytes(&path, LIMITS.max_file_bytes)?;
    planes(&bytes, frame, take).map_err(Error::input(&path))
}

//! Checks the files of a frame in every format against the ground truth.

use std::cell::OnceCell;

use papsynth::truth::Group;

use super::depth::{Depth, TRAINING_BITS, to_training};
use super::format::Layout;
use super::sink::Field;
use crate::bytes::sha256;
use crate::error::{Error, InputError};
use crate::files::Folder;
use crate::read::{self, LevelImage, Limits};
use crate::truth::LabelRuns;

/// Limits on the files of one frame.
pub(crate) const LIMITS: Limits = Limits {
    max_side_px: 1 << 15,
    max_pixels: 1 << 30,
    max_file_bytes: 1 << 32,
    max_regions: 1 << 20,
    allow_lossy: false,
};

/// Returns the levels of a page with the channels of the frame. A colour image in which all pixels are grey is read as
/// grey.
pub(crate) fn levels(page: LevelImage, channels: usize) -> Vec<u16> {
    match channels / page.channels.max(1) {
        3 => page.levels.iter().flat_map(|&level| [level; 3]).collect(),
        _ => page.levels,
    }
}

pub(crate) type Take<'a> = dyn FnMut(LevelImage) -> Result<(), InputError> + 'a;

type Read<'a> = dyn FnMut(&mut Take) -> Result<(), InputError> + 'a;

/// A frame whose files are read back.
pub(crate) struct Written<'a> {
    pub(crate) folder: &'a Folder,
    pub(crate) layout: &'a Layout,
    /// The frame as its record and COCO document describe it, without image.
    pub(crate) field: &'a Field<'a>,
    planes: Seen,
    image: Seen,
}

/// SHA-256 of the levels of each plane in the first format of each bit depth.
#[derive(Default)]
struct Seen {
    camera: OnceCell<Vec<String>>,
    training: OnceCell<Vec<String>>,
}

impl<'a> Written<'a> {
    pub(crate) fn new(folder: &'a Folder, layout: &'a Layout, field: &'a Field<'a>) -> Self {
        Self { folder, layout, field, planes: Seen::default(), image: Seen::default() }
    }

    pub(super) fn file(&self, name: &str, check: impl FnOnce(&[u8]) -> Result<(), InputError>) -> Result<(), Error> {
        let path = self.folder.inside(name)?;
        check(&read::bytes(&path, LIMITS.max_file_bytes)?).map_err(Error::input(&path))
    }

    /// Checks the planes of an image: number, size and bit depth as in the record, and the same levels in every format.
    pub(super) fn planes(&self, bytes: &[u8], depth: Depth) -> Result<(), InputError> {
        self.read_planes(depth, &mut |take| LevelImage::pages(bytes, &LIMITS, take))
    }

    /// Checks the image of a frame in one plane: the same levels in every format.
    pub(crate) fn image(&self, bytes: &[u8], depth: Depth) -> Result<(), InputError> {
        self.compare(1, depth, &self.image, &mut |take| LevelImage::pages(bytes, &LIMITS, take))
    }

    /// Checks the planes that `read` reads, as [`planes`](Self::planes) does.
    pub(super) fn read_planes(&self, depth: Depth, read: &mut Read) -> Result<(), InputError> {
        let frame = self.field.frame;
        self.compare(frame.planes_um.len(), depth, if frame.is_stack() { &self.planes } else { &self.image }, read)
    }

    fn compare(&self, planes: usize, depth: Depth, seen: &Seen, read: &mut Read) -> Result<(), InputError> {
        let frame = self.field.frame;
        let is_deep = frame.bits > TRAINING_BITS;
        let is_camera = !is_deep || depth == Depth::Camera;
        let sample_bits = if is_deep && is_camera { 16 } else { 8 };
        let hash = |levels: &[u16]| sha256(&levels.iter().flat_map(|level| level.to_le_bytes()).collect::<Vec<_>>());
        let (mut camera, mut training) = (Vec::new(), Vec::new());
        read(&mut |page| {
            let same_size = [page.width, page.height()] == [frame.width, frame.height];
            InputError::unless(same_size, "the image size differs from the record")?;
            let bits = if page.white > u16::from(u8::MAX) { 16 } else { 8 };
            InputError::unless(bits == sample_bits, format!("the samples have {bits} bits; expected {sample_bits}"))?;
            let levels = levels(page, frame.channels);
            InputError::unless(levels.len() == frame.values(), "the number of channels differs from the record")?;
            let more = format!("more than {planes} plane{}; the record has {planes}", plural(planes));
            InputError::unless(camera.len().max(training.len()) < planes, more)?;
            if is_camera {
                camera.push(hash(&levels));
            }
            if is_deep {
                training.push(if is_camera { hash(&to_training(&levels, frame.bits)) } else { hash(&levels) });
            }
            Ok(())
        })?;
        let count = camera.len().max(training.len());
        let few = format!("{count} plane{}; the record has {planes}", plural(count));
        InputError::unless(count == planes, few)?;
        for (seen, found) in [(&seen.camera, camera), (&seen.training, training)] {
            let same = found.is_empty() || *seen.get_or_init(|| found.clone()) == found;
            InputError::unless(same, "the pixels differ from the image in another format")?;
        }
        Ok(())
    }

    pub(super) fn labels(&self, bytes: &[u8], ids: Vec<u32>) -> Result<(), InputError> {
        let found = read::label_map(bytes, &LIMITS)?;
        is_of_masks(found.width == self.field.frame.width && found.ids == ids)
    }

    pub(super) fn layers(&self, bytes: &[u8], layers: &[LabelRuns]) -> Result<(), InputError> {
        let found = read::label_pages(bytes, &LIMITS, layers.len().max(1))?;
        is_of_masks(found.into_iter().map(|page| page.ids).eq(layers.iter().map(LabelRuns::pixels)))
    }

    /// Returns the labels of a group, one per pixel.
    pub(super) fn flat(&self, group: Group) -> Vec<u32> {
        self.layout.flatten.labels(self.field.truth, group).pixels()
    }
}

/// Compares sizes, channels, units and depths in the OME-XML of a file with `expected`.
pub(super) fn is_described(bytes: &[u8], expected: &str) -> Result<(), InputError> {
    let found = read::description(bytes)?.unwrap_or_default();
    let wrong =
        ["SizeX", "SizeY", "SizeZ", "SizeC", "SizeT", "Type", "PhysicalSizeX", "PhysicalSizeY", "PhysicalSizeZ"]
            .into_iter()
            .find(|name| values(&found, name).ne(values(expected, name)))
            .or_else(|| values(&found, "PositionZ").ne(values(expected, "PositionZ")).then_some("PositionZ"));
    wrong.map_or(Ok(()), |name| Err(InputError::unfit(format!("{name} in the OME-XML differs from the record"))))
}

/// Returns all values of an attribute.
fn values<'x>(xml: &'x str, attribute: &str) -> impl Iterator<Item = &'x str> {
    let name = format!(" {attribute}=\"");
    xml.match_indices(&name)
        .map(|(at, name)| xml[at + name.len()..].split('"').next().unwrap_or_default())
        .collect::<Vec<_>>()
        .into_iter()
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

pub(super) fn is_of_masks(holds: bool) -> Result<(), InputError> {
    InputError::unless(holds, "the labels differ from the masks in coco.json")
}

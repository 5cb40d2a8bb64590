//! A frame as it lies in the files of a format, against what the truth says must lie there.

use std::cell::OnceCell;

use papsynth::truth::Group;

use super::format::Layout;
use super::sink::Field;
use crate::bytes::sha256;
use crate::error::{Error, Problem};
use crate::files::Folder;
use crate::read::{self, LevelImage, Limits};

/// What was written for one frame is read whole.
pub(crate) const LIMITS: Limits =
    Limits { max_side_px: 1 << 15, max_pixels: 1 << 30, max_file_bytes: 1 << 32, max_regions: 1 << 20 };

/// The levels of a page with as many channels as the frame has: a picture in colour whose pixels are all grey is read as grey.
pub(crate) fn levels(page: LevelImage, channels: usize) -> Vec<u16> {
    match channels / page.channels.max(1) {
        3 => page.levels.iter().flat_map(|&level| [level; 3]).collect(),
        _ => page.levels,
    }
}

pub(crate) type Take<'a> = dyn FnMut(LevelImage) -> Result<(), Problem> + 'a;

type Read<'a> = dyn FnMut(&mut Take) -> Result<(), Problem> + 'a;

/// A frame of which every file is read again.
pub(crate) struct Written<'a> {
    pub(crate) folder: &'a Folder,
    pub(crate) layout: &'a Layout,
    /// What is known of it from its shard's record and COCO document; its picture is not among it.
    pub(crate) field: &'a Field<'a>,
    /// SHA-256 of the levels of each plane, and of the picture of a stack, as the first format had them that was read.
    planes: OnceCell<Vec<String>>,
    picture: OnceCell<Vec<String>>,
}

impl<'a> Written<'a> {
    pub(crate) fn new(folder: &'a Folder, layout: &'a Layout, field: &'a Field<'a>) -> Self {
        Self { folder, layout, field, planes: OnceCell::new(), picture: OnceCell::new() }
    }

    pub(super) fn file(&self, name: &str, look: impl FnOnce(&[u8]) -> Result<(), Problem>) -> Result<(), Error> {
        let path = self.folder.inside(name)?;
        look(&read::bytes(&path, LIMITS.max_file_bytes)?).map_err(Error::input(&path))
    }

    /// All planes are there and of the size that the record says, and the same in every format.
    pub(super) fn planes(&self, bytes: &[u8]) -> Result<(), Problem> {
        self.shown(&mut |take| LevelImage::pages(bytes, &LIMITS, take))
    }

    /// The one picture of a frame, the same in every format.
    pub(crate) fn picture(&self, bytes: &[u8]) -> Result<(), Problem> {
        self.compare(1, &self.picture, &mut |take| LevelImage::pages(bytes, &LIMITS, take))
    }

    /// All planes, handed over by `read`, are there and of the size that the record says, and the same in every format.
    pub(super) fn shown(&self, read: &mut Read) -> Result<(), Problem> {
        let frame = self.field.frame;
        self.compare(frame.planes_um.len(), if frame.is_stack() { &self.planes } else { &self.picture }, read)
    }

    fn compare(&self, planes: usize, seen: &OnceCell<Vec<String>>, read: &mut Read) -> Result<(), Problem> {
        let frame = self.field.frame;
        let mut found = Vec::new();
        read(&mut |page| {
            let same_size = [page.width, page.height()] == [frame.width, frame.height];
            Problem::unless(same_size, "it has not the size that the record says")?;
            let levels = levels(page, frame.channels);
            Problem::unless(levels.len() == frame.values(), "it has not the channels that the record says")?;
            let more = format!("it has more planes than the {planes} that the record says");
            Problem::unless(found.len() < planes, more)?;
            found.push(sha256(&levels.iter().flat_map(|level| level.to_le_bytes()).collect::<Vec<_>>()));
            Ok(())
        })?;
        let count = found.len();
        Problem::unless(count == planes, format!("it has {count} planes, the record says {planes}"))?;
        let same = *seen.get_or_init(|| found.clone()) == found;
        Problem::unless(same, "it shows other pixels than the image in another format")
    }

    pub(super) fn labels(&self, bytes: &[u8], ids: &[u32]) -> Result<(), Problem> {
        let found = read::label_map(bytes, &LIMITS)?;
        is_of_masks(found.width == self.field.frame.width && found.ids == ids)
    }

    pub(super) fn layers(&self, bytes: &[u8], layers: &[Vec<u32>]) -> Result<(), Problem> {
        let found = read::label_pages(bytes, &LIMITS, layers.len().max(1))?;
        is_of_masks(found.iter().map(|page| &page.ids).eq(layers))
    }

    /// The labels of a group where a pixel has one.
    pub(super) fn flat(&self, group: Group) -> Vec<u32> {
        self.layout.flatten.labels(self.field.truth, group)
    }
}

/// OME-XML says sizes, channels, units and depths as `expected` does.
pub(super) fn is_described(bytes: &[u8], expected: &str) -> Result<(), Problem> {
    let found = read::description(bytes)?.unwrap_or_default();
    let wrong =
        ["SizeX", "SizeY", "SizeZ", "SizeC", "SizeT", "Type", "PhysicalSizeX", "PhysicalSizeY", "PhysicalSizeZ"]
            .into_iter()
            .find(|name| values(&found, name).ne(values(expected, name)))
            .or_else(|| values(&found, "PositionZ").ne(values(expected, "PositionZ")).then_some("PositionZ"));
    wrong.map_or(Ok(()), |name| Err(Problem::unfit(format!("its OME-XML says another {name} than the record"))))
}

/// All values of an attribute.
fn values<'x>(xml: &'x str, attribute: &str) -> impl Iterator<Item = &'x str> {
    let name = format!(" {attribute}=\"");
    xml.match_indices(&name)
        .map(|(at, name)| xml[at + name.len()..].split('"').next().unwrap_or_default())
        .collect::<Vec<_>>()
        .into_iter()
}

pub(super) fn is_of_masks(holds: bool) -> Result<(), Problem> {
    Problem::unless(holds, "it is not what the masks of coco.json give")
}

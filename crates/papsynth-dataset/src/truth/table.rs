//! The table of objects.

use papsynth::truth::{Bounds, ObjectTruth, Part, Truth};

use super::rle;

/// An object, or a part of a cell, of an image.
struct Entry<'a> {
    image: u64,
    object: &'a ObjectTruth,
}

/// What stands in a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sort {
    Id,
    Whole,
    WholeOrNone,
    Number,
    NumberOrNone,
    Text,
    Flag,
    /// One a plane.
    Numbers,
}

/// What stands in one place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cell {
    Nothing,
    Id(u32),
    Whole(u64),
    Number(f64),
    Text(String),
    Flag(bool),
    Numbers(Vec<f64>),
}

impl Cell {
    /// A number is printed with as few digits as read back to it; lists have one value a plane, separated by semicolons.
    fn whole(&self) -> Option<u64> {
        match *self {
            Self::Id(id) => Some(id.into()),
            Self::Whole(whole) => Some(whole),
            _ => None,
        }
    }

    /// NaN where nothing stands.
    fn number(&self) -> f64 {
        match *self {
            Self::Number(number) => number,
            _ => self.whole().map_or(f64::NAN, |whole| whole as f64),
        }
    }

    fn print(&self) -> String {
        match self {
            Self::Nothing => String::new(),
            Self::Id(id) => id.to_string(),
            Self::Whole(whole) => whole.to_string(),
            Self::Number(number) => number.to_string(),
            Self::Text(text) => text.clone(),
            Self::Flag(flag) => flag.to_string(),
            Self::Numbers(numbers) => numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(";"),
        }
    }
}

/// What a column is called, and what stands in it.
type Named = (&'static str, Sort, fn(&Entry) -> Cell);

/// The columns: what each is called and what stands in it.
const COLUMNS: [Named; 28] = [
    ("image", Sort::Whole, |e| Cell::Whole(e.image)),
    ("id", Sort::Id, |e| Cell::Id(e.object.id)),
    ("part", Sort::Text, |e| text(part(e.object.part))),
    ("kind", Sort::Text, |e| text(e.object.kind.name())),
    ("class", Sort::Text, |e| text(&e.object.class)),
    ("bethesda", Sort::Text, |e| text(&e.object.bethesda)),
    ("traits", Sort::Text, |e| text(&e.object.traits.to_string())),
    ("cluster", Sort::Id, |e| Cell::Id(e.object.cluster)),
    ("centre_x_um", Sort::Number, |e| Cell::Number(e.object.centre_um[0])),
    ("centre_y_um", Sort::Number, |e| Cell::Number(e.object.centre_um[1])),
    ("depth_um", Sort::Number, |e| Cell::Number(e.object.depth_um)),
    ("rotation_deg", Sort::Number, |e| Cell::Number(e.object.rotation_deg)),
    ("stain", Sort::Number, |e| Cell::Number(e.object.stain)),
    ("tint", Sort::Text, |e| text(e.object.tint_name())),
    ("area_um2", Sort::Number, |e| Cell::Number(e.object.area_um2)),
    ("area_px", Sort::Whole, |e| Cell::Whole(e.object.amodal.area())),
    ("front_area_px", Sort::Whole, |e| Cell::Whole(e.object.front.area())),
    ("bbox_x_px", Sort::WholeOrNone, |e| bounds(e, |b| b.x)),
    ("bbox_y_px", Sort::WholeOrNone, |e| bounds(e, |b| b.y)),
    ("bbox_width_px", Sort::WholeOrNone, |e| bounds(e, |b| b.width)),
    ("bbox_height_px", Sort::WholeOrNone, |e| bounds(e, |b| b.height)),
    ("centroid_x_px", Sort::NumberOrNone, |e| centroid(e, 0)),
    ("centroid_y_px", Sort::NumberOrNone, |e| centroid(e, 1)),
    ("truncated", Sort::Flag, |e| Cell::Flag(e.object.truncated)),
    ("best_plane", Sort::WholeOrNone, |e| best(e).map_or(Cell::Nothing, |plane| Cell::Whole(plane as u64))),
    ("best_detectability", Sort::NumberOrNone, |e| {
        best(e).map_or(Cell::Nothing, |plane| Cell::Number(e.object.detectability[plane]))
    }),
    ("defocus_um", Sort::Numbers, |e| Cell::Numbers(e.object.defocus_um.clone())),
    ("detectability", Sort::Numbers, |e| Cell::Numbers(e.object.detectability.clone())),
];

/// The rows of one frame as CSV, if wanted below a header, which stands even if there is no object.
pub(crate) fn table(truth: &Truth, image: u64, header: bool) -> Vec<u8> {
    let cells = |object| COLUMNS.into_iter().map(move |(_, _, cell)| cell(&Entry { image, object }));
    csv(header.then_some(COLUMNS.map(|(name, _, _)| name)).into_iter().flatten(), truth.objects.iter().map(cells))
}

/// Rows of cells as CSV below the names of their columns, if there are any.
fn csv<'n, R: Iterator<Item = Cell>>(names: impl Iterator<Item = &'n str>, rows: impl Iterator<Item = R>) -> Vec<u8> {
    const FITS: &str = "rows of one length can be written to memory";
    let mut writer = csv::Writer::from_writer(Vec::new());
    let names: Vec<&str> = names.collect();
    if !names.is_empty() {
        writer.write_record(names).expect(FITS);
    }
    for row in rows {
        writer.write_record(row.map(|cell| cell.print())).expect(FITS);
    }
    writer.into_inner().expect(FITS)
}

/// The columns of the table with types: those of the CSV, the size of the image, and the complete and the visible mask as COCO's run lengths.
pub(crate) fn typed_columns() -> impl Iterator<Item = (&'static str, Sort)> {
    let sizes = ["image_width_px", "image_height_px"].map(|name| (name, Sort::Whole));
    let masks = ["rle", "front_rle"].map(|name| (name, Sort::Text));
    COLUMNS.into_iter().map(|(name, sort, _)| (name, sort)).chain(sizes).chain(masks)
}

/// What stands in these columns of an object's row.
pub(crate) fn typed_cells(truth: &Truth, object: &ObjectTruth, image: u64) -> impl Iterator<Item = Cell> {
    let sizes = [truth.width, truth.height].map(|side| Cell::Whole(side as u64));
    let masks = [&object.amodal, &object.front].map(|mask| Cell::Text(rle::encode(mask, truth.width, truth.height)));
    COLUMNS.into_iter().map(move |(_, _, cell)| cell(&Entry { image, object })).chain(sizes).chain(masks)
}

/// The columns of the table of a slide that are those of a frame's table, in their order; another, `rle`, follows.
#[cfg(feature = "zarr")]
const OF_SLIDE: [&str; 21] = [
    "id",
    "part",
    "kind",
    "class",
    "bethesda",
    "traits",
    "cluster",
    "centre_x_um",
    "centre_y_um",
    "depth_um",
    "rotation_deg",
    "stain",
    "tint",
    "area_um2",
    "area_px",
    "truncated",
    "bbox_x_px",
    "bbox_y_px",
    "bbox_width_px",
    "bbox_height_px",
    "defocus_um",
];

/// These columns.
#[cfg(feature = "zarr")]
fn of_slide() -> impl Iterator<Item = Named> {
    OF_SLIDE.into_iter().filter_map(|wanted| COLUMNS.into_iter().find(|(name, ..)| *name == wanted))
}

/// The columns of the table of a part of a slide. A mask stands in its box alone: the run lengths are those of an image of the box's size.
#[cfg(feature = "zarr")]
pub(crate) fn slide_columns() -> impl Iterator<Item = (&'static str, Sort)> {
    of_slide().map(|(name, sort, _)| (name, sort)).chain([("rle", Sort::Text)])
}

/// What stands in these columns of an object's row.
#[cfg(feature = "zarr")]
pub(crate) fn slide_cells(object: &ObjectTruth) -> impl Iterator<Item = Cell> {
    let entry = Entry { image: 0, object };
    of_slide().map(move |(_, _, cell)| cell(&entry)).chain([Cell::Text(rle::encode_in_box(&object.amodal))])
}

/// The table of a part of a slide as CSV.
#[cfg(feature = "zarr")]
pub(crate) fn slide_table(objects: &[ObjectTruth]) -> Vec<u8> {
    csv(slide_columns().map(|(name, _)| name), objects.iter().map(slide_cells))
}

/// What stands in a column of the table of objects.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// Whole numbers: ids, pixels.
    Whole(Vec<u64>),
    /// Numbers; NaN where there is none.
    Number(Vec<f64>),
    /// Truth values.
    Flag(Vec<bool>),
    /// Texts.
    Text(Vec<String>),
    /// One number a plane.
    Numbers(Vec<Vec<f64>>),
}

/// The table of the objects of an image, column by column: those of `objects.csv`.
#[must_use]
pub fn columns(truth: &Truth, image: u64) -> Vec<(&'static str, Column)> {
    let cells = |(name, sort, cell): Named| {
        let cells = truth.objects.iter().map(move |object| cell(&Entry { image, object }));
        (name, Column::of(sort, cells))
    };
    COLUMNS.into_iter().map(cells).collect()
}

impl Column {
    fn of(sort: Sort, cells: impl Iterator<Item = Cell>) -> Self {
        match sort {
            Sort::Id | Sort::Whole => {
                Self::Whole(cells.map(|cell| cell.whole().expect("a whole number in every row")).collect())
            }
            Sort::WholeOrNone | Sort::Number | Sort::NumberOrNone => {
                Self::Number(cells.map(|cell| cell.number()).collect())
            }
            Sort::Text => Self::Text(cells.map(|cell| cell.print()).collect()),
            Sort::Flag => Self::Flag(cells.map(|cell| cell == Cell::Flag(true)).collect()),
            Sort::Numbers => {
                Self::Numbers(cells.map(|cell| if let Cell::Numbers(all) = cell { all } else { Vec::new() }).collect())
            }
        }
    }
}

pub(crate) fn part(part: Part) -> &'static str {
    match part {
        Part::Cytoplasm => "cytoplasm",
        Part::Nucleus => "nucleus",
        Part::Whole => "whole",
    }
}

fn text(text: &str) -> Cell {
    Cell::Text(text.to_owned())
}

fn bounds(entry: &Entry, side: fn(Bounds) -> u32) -> Cell {
    entry.object.amodal.bounds().map_or(Cell::Nothing, |b| Cell::Whole(side(b).into()))
}

fn centroid(entry: &Entry, axis: usize) -> Cell {
    entry.object.amodal.centroid().map_or(Cell::Nothing, |c| Cell::Number(c[axis]))
}

/// The plane in which an object is easiest to detect; of equal ones the first.
fn best(entry: &Entry) -> Option<usize> {
    let detectability = &entry.object.detectability;
    (0..detectability.len()).reduce(|best, i| if detectability[i] > detectability[best] { i } else { best })
}

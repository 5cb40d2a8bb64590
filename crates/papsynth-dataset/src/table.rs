//! The table of objects.

use papsynth::truth::{Bounds, ObjectTruth, Part, Truth};

/// An object, or a part of a cell, of an image.
pub(crate) struct Entry<'a> {
    image: u64,
    object: &'a ObjectTruth,
}

/// What stands in a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(not(feature = "parquet"), allow(dead_code, reason = "text needs no types"))]
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

    pub(crate) fn print(&self) -> String {
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
pub(crate) const COLUMNS: [Named; 28] = [
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

/// The cells of one object.
#[cfg(feature = "parquet")]
pub(crate) fn cells(object: &ObjectTruth, image: u64) -> impl Iterator<Item = Cell> {
    COLUMNS.into_iter().map(move |(_, _, cell)| cell(&Entry { image, object }))
}

/// The rows of one frame, if wanted below a header, which stands even if there is no object.
pub(crate) fn table(truth: &Truth, image: u64, header: bool) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    if header {
        writer.write_record(COLUMNS.map(|(name, _, _)| name))?;
    }
    for object in &truth.objects {
        let entry = Entry { image, object };
        writer.write_record(COLUMNS.map(|(_, _, cell)| cell(&entry).print()))?;
    }
    writer.into_inner().map_err(|e| e.into_error().into())
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
            Sort::Id | Sort::Whole => Self::Whole(cells.map(|cell| cell.whole().unwrap_or_default()).collect()),
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

pub(crate) fn text(text: &str) -> Cell {
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

//! The table of objects.

use papsynth::truth::{Bounds, ObjectTruth, Part, Truth};

use super::rle;

/// A row: an object, or a part of a cell, of an image.
pub(crate) struct Row<'a> {
    image: u64,
    /// Columns and rows of the image.
    size: [usize; 2],
    object: &'a ObjectTruth,
}

impl<'a> Row<'a> {
    pub(crate) fn all(truth: &'a Truth, image: u64) -> impl Iterator<Item = Self> {
        truth.objects.iter().map(move |object| Self { image, size: [truth.width, truth.height], object })
    }

    /// The rows of a part of a slide, whose columns ask for no image.
    #[cfg(feature = "zarr")]
    pub(crate) fn of_slide(objects: &'a [ObjectTruth]) -> impl Iterator<Item = Self> {
        objects.iter().map(|object| Self { image: 0, size: [0; 2], object })
    }
}

/// What stands in a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Id,
    Whole,
    Number,
    Text,
    Flag,
    /// Bytes, which are not compressed again.
    #[cfg(feature = "parquet")]
    Bytes,
    /// Any number of values of one kind, any of which may be missing.
    List(&'static Kind),
    /// Fields, at least one.
    #[cfg(feature = "parquet")]
    Struct(&'static [Head]),
}

/// The head of a column, or a field of a struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Head {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    /// Whether there may be nothing in it.
    pub(crate) nullable: bool,
}

impl Head {
    /// Of a column in which something stands in every row.
    pub(crate) const fn new(name: &'static str, kind: Kind) -> Self {
        Self { name, kind, nullable: false }
    }

    /// The same in which there may be nothing.
    pub(crate) const fn or_null(self) -> Self {
        Self { nullable: true, ..self }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cell {
    Nothing,
    Id(u32),
    Whole(u64),
    Number(f64),
    Text(String),
    Flag(bool),
    #[cfg(feature = "parquet")]
    Bytes(Vec<u8>),
    List(Vec<Cell>),
    #[cfg(feature = "parquet")]
    Struct(Vec<Cell>),
}

impl Cell {
    pub(crate) fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    pub(crate) fn numbers(numbers: &[f64]) -> Self {
        Self::List(numbers.iter().copied().map(Self::Number).collect())
    }

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

    fn list(&self) -> &[Self] {
        if let Self::List(cells) = self { cells } else { &[] }
    }

    /// A number is printed with as few digits as read back to it; lists have one value a plane, separated by semicolons.
    fn print(&self) -> String {
        match self {
            Self::Id(id) => id.to_string(),
            Self::Whole(whole) => whole.to_string(),
            Self::Number(number) => number.to_string(),
            Self::Text(text) => text.clone(),
            Self::Flag(flag) => flag.to_string(),
            other => other.list().iter().map(Self::print).collect::<Vec<_>>().join(";"),
        }
    }
}

/// A column: its head, and what stands in it.
pub(crate) type Named = (Head, fn(&Row) -> Cell);

/// The columns of a frame's table.
const COLUMNS: [Named; 28] = [
    (Head::new("image", Kind::Whole), |row| Cell::Whole(row.image)),
    (Head::new("id", Kind::Id), |row| Cell::Id(row.object.id)),
    (Head::new("part", Kind::Text), |row| Cell::text(part(row.object.part))),
    (Head::new("kind", Kind::Text), |row| Cell::text(row.object.kind.name())),
    (Head::new("class", Kind::Text), |row| Cell::text(&row.object.class)),
    (Head::new("bethesda", Kind::Text), |row| Cell::text(&row.object.bethesda)),
    (Head::new("traits", Kind::Text), |row| Cell::text(row.object.traits.to_string())),
    (Head::new("cluster", Kind::Id), |row| Cell::Id(row.object.cluster)),
    (Head::new("centre_x_um", Kind::Number), |row| Cell::Number(row.object.centre_um[0])),
    (Head::new("centre_y_um", Kind::Number), |row| Cell::Number(row.object.centre_um[1])),
    (Head::new("depth_um", Kind::Number), |row| Cell::Number(row.object.depth_um)),
    (Head::new("rotation_deg", Kind::Number), |row| Cell::Number(row.object.rotation_deg)),
    (Head::new("stain", Kind::Number), |row| Cell::Number(row.object.mean_absorbance)),
    (Head::new("tint", Kind::Text), |row| Cell::text(row.object.tint_name())),
    (Head::new("area_um2", Kind::Number), |row| Cell::Number(row.object.area_um2)),
    (Head::new("area_px", Kind::Whole), |row| Cell::Whole(row.object.amodal.area())),
    (Head::new("front_area_px", Kind::Whole), |row| Cell::Whole(row.object.visible.area())),
    (Head::new("bbox_x_px", Kind::Whole).or_null(), |row| bounds(row, |b| b.x)),
    (Head::new("bbox_y_px", Kind::Whole).or_null(), |row| bounds(row, |b| b.y)),
    (Head::new("bbox_width_px", Kind::Whole).or_null(), |row| bounds(row, |b| b.width)),
    (Head::new("bbox_height_px", Kind::Whole).or_null(), |row| bounds(row, |b| b.height)),
    (Head::new("centroid_x_px", Kind::Number).or_null(), |row| centroid(row, 0)),
    (Head::new("centroid_y_px", Kind::Number).or_null(), |row| centroid(row, 1)),
    (Head::new("truncated", Kind::Flag), |row| Cell::Flag(row.object.truncated)),
    (Head::new("best_plane", Kind::Whole).or_null(), |row| {
        best(row).map_or(Cell::Nothing, |plane| Cell::Whole(plane as u64))
    }),
    (Head::new("best_detectability", Kind::Number).or_null(), |row| {
        best(row).map_or(Cell::Nothing, |plane| Cell::Number(row.object.detectability[plane]))
    }),
    (Head::new("defocus_um", Kind::List(&Kind::Number)), |row| Cell::numbers(&row.object.defocus_um)),
    (Head::new("detectability", Kind::List(&Kind::Number)), |row| Cell::numbers(&row.object.detectability)),
];

/// What the table with types has besides: the size of the image, and the complete and the visible mask as COCO's run lengths.
const MORE: [Named; 4] = [
    (Head::new("image_width_px", Kind::Whole), |row| Cell::Whole(row.size[0] as u64)),
    (Head::new("image_height_px", Kind::Whole), |row| Cell::Whole(row.size[1] as u64)),
    (Head::new("rle", Kind::Text), |row| Cell::text(rle::encode(&row.object.amodal, row.size[0], row.size[1]))),
    (Head::new("front_rle", Kind::Text), |row| Cell::text(rle::encode(&row.object.visible, row.size[0], row.size[1]))),
];

pub(crate) fn typed_columns() -> Vec<Named> {
    [&COLUMNS[..], &MORE].concat()
}

/// The rows of one frame as CSV, if wanted below a header, which stands even if there is no object.
pub(crate) fn table(truth: &Truth, image: u64, header: bool) -> Vec<u8> {
    csv(header, &COLUMNS, Row::all(truth, image))
}

/// Rows as CSV, if wanted below the names of the columns.
fn csv<'a>(header: bool, columns: &[Named], rows: impl Iterator<Item = Row<'a>>) -> Vec<u8> {
    const FITS: &str = "rows of one length can be written to memory";
    let mut writer = csv::Writer::from_writer(Vec::new());
    if header {
        writer.write_record(columns.iter().map(|(head, _)| head.name)).expect(FITS);
    }
    for row in rows {
        writer.write_record(columns.iter().map(|(_, cell)| cell(&row).print())).expect(FITS);
    }
    writer.into_inner().expect(FITS)
}

/// The columns of the table of a slide that are those of a frame's table, in their order; another, `rle`, follows.
#[cfg(feature = "zarr")]
const OF_SLIDE: &str = "id,part,kind,class,bethesda,traits,cluster,centre_x_um,centre_y_um,depth_um,rotation_deg,stain,\
    tint,area_um2,area_px,truncated,bbox_x_px,bbox_y_px,bbox_width_px,bbox_height_px,defocus_um";

/// The columns of the table of a part of a slide. A mask stands in its box alone: the run lengths are those of an image of the box's size.
#[cfg(feature = "zarr")]
pub(crate) fn slide_columns() -> Vec<Named> {
    let mask: Named = (Head::new("rle", Kind::Text), |row| Cell::text(rle::encode_in_box(&row.object.amodal)));
    let known = OF_SLIDE.split(',').filter_map(|wanted| COLUMNS.into_iter().find(|(head, _)| head.name == wanted));
    known.chain([mask]).collect()
}

#[cfg(feature = "zarr")]
pub(crate) fn slide_table(objects: &[ObjectTruth]) -> Vec<u8> {
    csv(true, &slide_columns(), Row::of_slide(objects))
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
    let column = |(head, cell): Named| (head.name, Column::of(head, Row::all(truth, image).map(|row| cell(&row))));
    COLUMNS.into_iter().map(column).collect()
}

impl Column {
    fn of(head: Head, cells: impl Iterator<Item = Cell>) -> Self {
        match head.kind {
            Kind::Id | Kind::Whole if !head.nullable => {
                Self::Whole(cells.map(|cell| cell.whole().expect("a whole number in every row")).collect())
            }
            Kind::Id | Kind::Whole | Kind::Number => Self::Number(cells.map(|cell| cell.number()).collect()),
            Kind::Flag => Self::Flag(cells.map(|cell| cell == Cell::Flag(true)).collect()),
            Kind::List(_) => Self::Numbers(cells.map(|c| c.list().iter().map(Cell::number).collect()).collect()),
            _ => Self::Text(cells.map(|cell| cell.print()).collect()),
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

fn bounds(row: &Row, side: fn(Bounds) -> u32) -> Cell {
    row.object.amodal.bounds().map_or(Cell::Nothing, |b| Cell::Whole(side(b).into()))
}

fn centroid(row: &Row, axis: usize) -> Cell {
    row.object.amodal.centroid().map_or(Cell::Nothing, |c| Cell::Number(c[axis]))
}

/// The plane in which an object is easiest to detect; of equal ones the first.
fn best(row: &Row) -> Option<usize> {
    let detectability = &row.object.detectability;
    (0..detectability.len()).reduce(|best, i| if detectability[i] > detectability[best] { i } else { best })
}

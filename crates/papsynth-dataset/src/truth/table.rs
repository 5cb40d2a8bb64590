//! The table of objects.

use std::fmt::Write;

use papsynth::truth::{Bounds, ObjectTruth, Part, Truth};

use super::rle;

/// A row: an object or part of a cell.
pub(crate) struct Row<'a> {
    image: u64,
    /// Width and height of the image.
    size: [usize; 2],
    object: &'a ObjectTruth,
}

impl<'a> Row<'a> {
    pub(crate) fn all(truth: &'a Truth, image: u64) -> impl Iterator<Item = Self> {
        truth.objects.iter().map(move |object| Self { image, size: [truth.width, truth.height], object })
    }

    /// Returns the rows of a tile of a slide. Its table has no columns of the image.
    #[cfg(feature = "zarr")]
    pub(crate) fn of_slide(objects: &'a [ObjectTruth]) -> impl Iterator<Item = Self> {
        objects.iter().map(|object| Self { image: 0, size: [0; 2], object })
    }
}

/// Type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Id,
    Whole,
    Number,
    Text,
    Flag,
    /// Bytes, stored without compression.
    #[cfg(feature = "parquet")]
    Bytes,
    /// A list of nullable values.
    List(&'static Kind),
    /// A struct of at least one field.
    #[cfg(feature = "parquet")]
    Struct(&'static [Head]),
}

/// Name and type of a column, or of a field of a struct.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Head {
    pub(crate) name: &'static str,
    pub(crate) kind: Kind,
    /// Whether values may be null.
    pub(crate) nullable: bool,
}

impl Head {
    /// A column without nulls.
    pub(crate) const fn new(name: &'static str, kind: Kind) -> Self {
        Self { name, kind, nullable: false }
    }

    /// Returns the column with nulls allowed.
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

    /// Returns the number, or NaN for a null.
    fn number(&self) -> f64 {
        match *self {
            Self::Number(number) => number,
            _ => self.whole().map_or(f64::NAN, |whole| whole as f64),
        }
    }

    fn list(&self) -> &[Self] {
        if let Self::List(cells) = self { cells } else { &[] }
    }

    /// Prints the value. Numbers have the fewest digits that give the same number back; list values are separated by
    /// semicolons.
    fn print(&self) -> String {
        let mut text = String::new();
        self.append_to(&mut text);
        text
    }

    /// Appends the printed value to a text.
    fn append_to(&self, text: &mut String) {
        // Writing to a string cannot fail.
        let _ = match self {
            Self::Id(id) => write!(text, "{id}"),
            Self::Whole(whole) => write!(text, "{whole}"),
            Self::Number(number) => write!(text, "{number}"),
            Self::Text(value) => text.write_str(value),
            Self::Flag(flag) => write!(text, "{flag}"),
            other => {
                for (number, value) in other.list().iter().enumerate() {
                    text.push_str(if number > 0 { ";" } else { "" });
                    value.append_to(text);
                }
                Ok(())
            }
        };
    }
}

/// A column: its head, and a function that returns the value of a row.
pub(crate) type Named = (Head, fn(&Row) -> Cell);

/// The columns of the table of a frame.
const COLUMNS: [Named; 29] = [
    (Head::new("image", Kind::Whole), |row| Cell::Whole(row.image)),
    (Head::new("id", Kind::Id), |row| Cell::Id(row.object.id)),
    (Head::new("part", Kind::Text), |row| Cell::text(part(row.object.part))),
    (Head::new("kind", Kind::Text), |row| Cell::text(row.object.kind.name())),
    (Head::new("class", Kind::Text), |row| Cell::text(&row.object.class)),
    (Head::new("bethesda", Kind::Text), |row| Cell::text(&row.object.bethesda)),
    (Head::new("traits", Kind::Text), |row| Cell::text(row.object.traits.to_string())),
    (Head::new("semantic_class", Kind::Text), |row| Cell::text(row.object.semantic_class().name())),
    (Head::new("cluster", Kind::Id), |row| Cell::Id(row.object.cluster)),
    (Head::new("centre_x_um", Kind::Number), |row| Cell::Number(row.object.centre_um[0])),
    (Head::new("centre_y_um", Kind::Number), |row| Cell::Number(row.object.centre_um[1])),
    (Head::new("depth_um", Kind::Number), |row| Cell::Number(row.object.depth_um)),
    (Head::new("rotation_deg", Kind::Number), |row| Cell::Number(row.object.rotation_deg)),
    (Head::new("mean_absorbance", Kind::Number), |row| Cell::Number(row.object.mean_absorbance)),
    (Head::new("tint", Kind::Text), |row| Cell::text(row.object.tint_name())),
    (Head::new("area_um2", Kind::Number), |row| Cell::Number(row.object.area_um2)),
    (Head::new("area_px", Kind::Whole), |row| Cell::Whole(row.object.amodal.area())),
    (Head::new("visible_area_px", Kind::Whole), |row| Cell::Whole(row.object.visible.area())),
    (Head::new("bbox_x_px", Kind::Whole).or_null(), |row| bounds(row, |b| b.x)),
    (Head::new("bbox_y_px", Kind::Whole).or_null(), |row| bounds(row, |b| b.y)),
    (Head::new("bbox_width_px", Kind::Whole).or_null(), |row| bounds(row, |b| b.width)),
    (Head::new("bbox_height_px", Kind::Whole).or_null(), |row| bounds(row, |b| b.height)),
    (Head::new("centroid_x_px", Kind::Number).or_null(), |row| centroid(row, 0)),
    (Head::new("centroid_y_px", Kind::Number).or_null(), |row| centroid(row, 1)),
    (Head::new("truncated", Kind::Flag), |row| Cell::Flag(row.object.truncated)),
    (Head::new("best_plane", Kind::Whole).or_null(), |row| {
        row.object.best_plane().map_or(Cell::Nothing, |plane| Cell::Whole(plane as u64))
    }),
    (Head::new("best_detectability", Kind::Number).or_null(), |row| {
        row.object.best_detectability().map_or(Cell::Nothing, Cell::Number)
    }),
    (Head::new("defocus_um", Kind::List(&Kind::Number)), |row| Cell::numbers(&row.object.defocus_um)),
    (Head::new("detectability", Kind::List(&Kind::Number)), |row| Cell::numbers(&row.object.detectability)),
];

/// Further columns of the Parquet table: image size, complete and visible mask as COCO run lengths.
const MORE: [Named; 4] = [
    (Head::new("image_width_px", Kind::Whole), |row| Cell::Whole(row.size[0] as u64)),
    (Head::new("image_height_px", Kind::Whole), |row| Cell::Whole(row.size[1] as u64)),
    (Head::new("rle", Kind::Text), |row| Cell::text(rle::encode(&row.object.amodal, row.size[0], row.size[1]))),
    (Head::new("visible_rle", Kind::Text), |row| {
        Cell::text(rle::encode(&row.object.visible, row.size[0], row.size[1]))
    }),
];

pub(crate) fn typed_columns() -> Vec<Named> {
    [&COLUMNS[..], &MORE].concat()
}

/// Returns the rows of a frame as CSV, with or without a header. The header is written even if there is no object.
pub(crate) fn table(truth: &Truth, image: u64, header: bool) -> Vec<u8> {
    csv(header, &COLUMNS, Row::all(truth, image))
}

/// Returns rows as CSV, with or without a header.
fn csv<'a>(header: bool, columns: &[Named], rows: impl Iterator<Item = Row<'a>>) -> Vec<u8> {
    const FITS: &str = "rows of equal length can be written to memory";
    let mut writer = csv::Writer::from_writer(Vec::new());
    if header {
        writer.write_record(columns.iter().map(|(head, _)| head.name)).expect(FITS);
    }
    let mut text = String::new();
    for row in rows {
        for (_, cell) in columns {
            text.clear();
            cell(&row).append_to(&mut text);
            writer.write_field(&text).expect(FITS);
        }
        writer.write_record(None::<&[u8]>).expect(FITS);
    }
    writer.into_inner().expect(FITS)
}

/// The columns of the table of a slide that are also in the table of a frame. The column `rle` follows.
#[cfg(feature = "zarr")]
const OF_SLIDE: &str = "id,part,kind,class,bethesda,traits,cluster,centre_x_um,centre_y_um,depth_um,rotation_deg,mean_absorbance,\
    tint,area_um2,area_px,truncated,bbox_x_px,bbox_y_px,bbox_width_px,bbox_height_px,defocus_um";

/// Returns the columns of the table of a tile of a slide. `rle` has the run lengths of the mask within its bounding
/// box.
#[cfg(feature = "zarr")]
pub(crate) fn slide_columns() -> Vec<Named> {
    let mask: Named = (Head::new("rle", Kind::Text), |row| Cell::text(rle::encode_in_box(&row.object.amodal)));
    let known = OF_SLIDE.split(',').filter_map(|name| COLUMNS.into_iter().find(|(head, _)| head.name == name));
    known.chain([mask]).collect()
}

#[cfg(feature = "zarr")]
pub(crate) fn slide_table(objects: &[ObjectTruth]) -> Vec<u8> {
    csv(true, &slide_columns(), Row::of_slide(objects))
}

/// The values of a column of the table of objects.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// Integers: ids, pixels.
    Whole(Vec<u64>),
    /// Numbers; NaN for missing values.
    Number(Vec<f64>),
    /// Booleans.
    Flag(Vec<bool>),
    /// Strings.
    Text(Vec<String>),
    /// For each row, one number per plane.
    Numbers(Vec<Vec<f64>>),
}

/// Returns the columns of the table of the objects of an image, as in `objects.csv`.
#[must_use]
pub fn columns(truth: &Truth, image: u64) -> Vec<(&'static str, Column)> {
    let column = |(head, cell): Named| (head.name, Column::of(head, Row::all(truth, image).map(|row| cell(&row))));
    COLUMNS.into_iter().map(column).collect()
}

impl Column {
    fn of(head: Head, cells: impl Iterator<Item = Cell>) -> Self {
        match head.kind {
            Kind::Id | Kind::Whole if !head.nullable => {
                Self::Whole(cells.map(|cell| cell.whole().expect("columns of integers have no nulls")).collect())
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

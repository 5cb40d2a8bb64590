//! Frames of the format `huggingface`: a row for each, in a file for each split of a shard.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt::Write;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use papsynth::Plane;
use papsynth::truth::ObjectTruth;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{List, ListAccessor, Row, RowAccessor};
use parquet::schema::types::Type;

use super::features::{CLASS, IMAGE, metadata, yaml};
use super::writer::{Writer, failed};
use crate::error::{Error, InputError};
use crate::files::Pending;
use crate::formats::depth::{Depth, to_training};
use crate::formats::names::{HUGGINGFACE_CARD, IMAGE as FILE, PLANES, huggingface_file, huggingface_split, numbered};
use crate::formats::sink::{Field, Files, Sink};
use crate::truth::{Cell, FrameSummary, Head, Kind, Split, part, rle};
use crate::write;

/// No value is null, but `datasets` uses the features of a file only if all columns are nullable.
const fn head(name: &'static str, kind: Kind) -> Head {
    Head::new(name, kind).or_null()
}

type FrameColumn = (Head, fn(&Field) -> Cell);
type ObjectColumn = (Head, fn(&Object) -> Cell);

/// The columns of a frame without images.
const FRAME: [FrameColumn; 9] = [
    (head("index", Kind::Whole), |field| Cell::Whole(field.frame.index)),
    (head("slide", Kind::Whole), |field| Cell::Whole(field.frame.slide)),
    (head("width", Kind::Whole), |field| Cell::Whole(field.frame.width as u64)),
    (head("height", Kind::Whole), |field| Cell::Whole(field.frame.height as u64)),
    (head("pixel_um", Kind::Number), |field| Cell::Number(field.frame.pixel_um)),
    (head("bits", Kind::Whole), |field| Cell::Whole(field.frame.training_bits.into())),
    (head("camera_bits", Kind::Whole), |field| Cell::Whole(field.frame.bits.into())),
    (head("planes_um", Kind::List(&Kind::Number)), |field| Cell::numbers(&field.frame.planes_um)),
    (head("objects", Kind::List(&Kind::Struct(&OBJECT_HEADS))), objects),
];

/// An object of a frame, and the index of its category in the data set.
struct Object<'a> {
    frame: &'a FrameSummary,
    truth: &'a ObjectTruth,
    category: u64,
    is_ignored: bool,
}

const OBJECT: [ObjectColumn; 20] = [
    (head("id", Kind::Id), |o| Cell::Id(o.truth.id)),
    (head("part", Kind::Text), |o| Cell::text(part(o.truth.part))),
    (head(CLASS, Kind::Whole), |o| Cell::Whole(o.category)),
    (head("kind", Kind::Text), |o| Cell::text(o.truth.kind.name())),
    (head("class", Kind::Text), |o| Cell::text(&o.truth.class)),
    (head("bethesda", Kind::Text), |o| Cell::text(&o.truth.bethesda)),
    (head("traits", Kind::Text), |o| Cell::text(o.truth.traits.to_string())),
    (head("semantic_class", Kind::Text), |o| Cell::text(o.truth.semantic_class().name())),
    (head("ignored", Kind::Flag), |o| Cell::Flag(o.is_ignored)),
    (head("cluster", Kind::Id), |o| Cell::Id(o.truth.cluster)),
    (head("bbox", Kind::List(&Kind::Whole)), |o| {
        let bounds = o.truth.amodal.bounds().map_or([0; 4], |b| [b.x, b.y, b.width, b.height]);
        Cell::List(bounds.map(|side| Cell::Whole(side.into())).to_vec())
    }),
    (head("area", Kind::Whole), |o| Cell::Whole(o.truth.amodal.area())),
    (head("visible_area", Kind::Whole), |o| Cell::Whole(o.truth.visible.area())),
    (head("area_um2", Kind::Number), |o| Cell::Number(o.truth.area_um2)),
    (head("depth_um", Kind::Number), |o| Cell::Number(o.truth.depth_um)),
    (head("mean_absorbance", Kind::Number), |o| Cell::Number(o.truth.mean_absorbance)),
    (head("tint", Kind::Text), |o| Cell::text(o.truth.tint_name())),
    (head("truncated", Kind::Flag), |o| Cell::Flag(o.truth.truncated)),
    (head("rle", Kind::Text), |o| Cell::text(rle::encode(&o.truth.amodal, o.frame.width, o.frame.height))),
    (head("visible_rle", Kind::Text), |o| Cell::text(rle::encode(&o.truth.visible, o.frame.width, o.frame.height))),
];

const OBJECT_HEADS: [Head; OBJECT.len()] = {
    let mut heads = [OBJECT[0].0; OBJECT.len()];
    let mut at = 1;
    while at < heads.len() {
        heads[at] = OBJECT[at].0;
        at += 1;
    }
    heads
};

fn columns() -> Vec<Head> {
    let images = [head("image", IMAGE), head("planes", Kind::List(&IMAGE))];
    FRAME.into_iter().map(|(head, _)| head).chain(images).collect()
}

fn objects(field: &Field) -> Cell {
    let Field { frame, document, .. } = field;
    let objects = field.truth.objects.iter().zip(&document.annotations).map(|(truth, annotation)| {
        let category = document.categories.iter().position(|category| category.id == annotation.category_id);
        let category = category.expect("annotations have categories of their document") as u64;
        let object = Object { frame, truth, category, is_ignored: annotation.iscrowd == 1 };
        Cell::Struct(OBJECT.iter().map(|(_, cell)| cell(&object)).collect())
    });
    Cell::List(objects.collect())
}

fn image(path: String, bytes: Vec<u8>) -> Cell {
    Cell::Struct(vec![Cell::Bytes(bytes), Cell::text(path)])
}

/// Writes the frames of a shard, a file for each split.
#[derive(Default)]
struct Shard {
    files: BTreeMap<Split, (Pending, Writer<'static>)>,
    /// The planes of a stack as PNG; empty for a single plane.
    planes: Vec<Vec<u8>>,
}

#[expect(clippy::unnecessary_wraps, reason = "without the feature it fails")]
pub(crate) fn sink(_: &Files) -> Result<Box<dyn Sink>, Error> {
    Ok(Box::new(Shard::default()))
}

impl Sink for Shard {
    fn begin(&mut self, _: &FrameSummary, _: &Files) -> Result<(), Error> {
        self.planes.clear();
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, frame: &FrameSummary, files: &Files) -> Result<(), Error> {
        if frame.is_stack() {
            let png = write::png(
                &to_training(&plane.grey, frame.bits),
                frame.width,
                frame.channels,
                frame.training_bits,
                frame.pixel_um,
            );
            let path = files.folder.path(&huggingface_file(Split::of_slide(files.seed, frame.slide), files.shard));
            self.planes.push(png.map_err(Error::io("encode", &path))?);
        }
        Ok(())
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        let (split, key) = (field.split(), numbered(field.frame.index));
        let name = huggingface_file(split, files.shard);
        let path = files.folder.path(&name);
        let mut row: Vec<Cell> = FRAME.iter().map(|(_, cell)| cell(field)).collect();
        row.push(image(
            format!("{key}{FILE}"),
            field.png(Depth::Training).map_err(Error::io("encode", &path))?.to_vec(),
        ));
        let planes = std::mem::take(&mut self.planes).into_iter().enumerate();
        let planes = planes.map(|(number, png)| image(format!("{key}.{number:03}{FILE}"), png));
        row.push(Cell::List(planes.collect()));
        let (_, writer) = match self.files.entry(split) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => {
                let classes: Vec<String> =
                    field.document.categories.iter().map(|category| category.name.clone()).collect();
                let pending = files.folder.pending(&name)?;
                let features = metadata(&columns(), &classes);
                let writer = Writer::new(Box::new(pending.handle()?), columns(), &[("huggingface", &features)]);
                entry.insert((pending, writer.map_err(failed("write", &path))?))
            }
        };
        writer.row(row).map_err(failed("write", &path))
    }

    fn close(self: Box<Self>, files: &mut Files) -> Result<(), Error> {
        for (pending, writer) in self.files.into_values() {
            writer.finish().map_err(failed("write", pending.path()))?;
            files.written.push(pending.commit()?);
        }
        Ok(())
    }
}

/// Returns the dataset card. Its header has the files of each split with frames, and the features.
#[expect(clippy::unnecessary_wraps, reason = "without the feature it fails")]
pub(crate) fn card(classes: &[String], splits: &[Split]) -> Result<(String, Vec<u8>), Error> {
    let mut text = "---\nlicense: cc0-1.0\ntask_categories:\n- image-segmentation\n- object-detection\ntags:\n- synthetic\n- cytology\n\
                    - microscopy\nconfigs:\n- config_name: default\n  data_files:\n"
        .to_owned();
    for split in splits {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  - split: {0}\n    path: data/{0}-*.parquet", huggingface_split(*split));
    }
    let _ = writeln!(text, "dataset_info:\n  features: {}\n---", yaml(&columns(), classes));
    text.push_str(
        "\n# Synthetic cervical smears\n\nA row is a field. `image` is the image (for a focus stack, all in focus), `planes` has the planes of a \
         stack; images have 8 bits. `objects` has every cell, nucleus and piece of debris, with its complete mask (`rle`) and its \
         visible mask (`visible_rle`) as COCO's compressed run lengths. Splits are by slide, because fields of a slide have the same \
         staining and light.\n\n```python\nfrom datasets import \
         load_dataset\n\nfields = load_dataset(\"huggingface\", split=\"train\")    # this folder\n```\n",
    );
    Ok((HUGGINGFACE_CARD.to_owned(), text.into_bytes()))
}

/// Reads the files of an image, or of all planes of a stack. The SHA-256 of the Parquet file must be checked before.
pub(crate) fn images(path: &Path, image: &str) -> Result<Vec<Vec<u8>>, Error> {
    let named = image.strip_suffix(FILE).map(|index| (index, "image"));
    let named = named.or(image.strip_suffix(PLANES).map(|index| (index, "planes")));
    let requested = named.and_then(|(index, column)| Some((index.parse().ok()?, column)));
    let found = match requested {
        Some((index, column)) => find(path, index, column).map_err(failed("read", path))?,
        None => None,
    };
    found.ok_or_else(|| {
        Error::input(path)(InputError::broken("Parquet", format!("the file has no image `{}`", image.escape_default())))
    })
}

/// Returns the images in a column of the row of a frame, if there is one. Row groups are read one at a time.
fn find(path: &Path, index: i64, column: &str) -> Result<Option<Vec<Vec<u8>>>, ParquetError> {
    let reader = SerializedFileReader::new(File::open(path)?)?;
    let fields = reader.metadata().file_metadata().schema().get_fields().to_vec();
    let only = |name: &str| {
        let fields = fields.iter().filter(|field| field.name() == name).map(Arc::clone).collect();
        Type::group_type_builder("schema").with_fields(fields).build()
    };
    for number in 0..reader.num_row_groups() {
        let group = reader.get_row_group(number)?;
        for (place, row) in group.get_row_iter(Some(only("index")?))?.enumerate() {
            if row?.get_long(0)? == index {
                let row = group.get_row_iter(Some(only(column)?))?.nth(place).transpose()?;
                return row.map(|row| files(&row, column)).transpose();
            }
        }
    }
    Ok(None)
}

fn files(row: &Row, column: &str) -> Result<Vec<Vec<u8>>, ParquetError> {
    let bytes = |image: &Row| image.get_bytes(0).map(ByteArray::data).map(<[u8]>::to_vec);
    if column == "image" {
        return Ok(vec![bytes(row.get_group(0)?)?]);
    }
    let planes = row.get_list(0)?;
    (0..List::len(planes)).map(|plane| bytes(planes.get_group(plane)?)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_json_with_all_columns_in_order() {
        let classes = ["superficial \"nucleus\"".to_owned(), "debris".to_owned()];
        let text = metadata(&columns(), &classes);
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let features = &json["info"]["features"];
        assert_eq!(features.as_object().unwrap().len(), columns().len());
        assert_eq!(features["image"]["_type"], "Image");
        assert_eq!(features["planes"]["feature"]["_type"], "Image");
        assert_eq!(features["objects"][0]["category"]["names"][0], "superficial \"nucleus\"");
        let places = columns().into_iter().map(|column| text.find(&format!("\"{}\": ", column.name)).unwrap());
        assert!(places.collect::<Vec<_>>().is_sorted());
        let (_, card) = card(&classes, &[Split::Train, Split::Test]).unwrap();
        let card = String::from_utf8(card).unwrap();
        let features = card.lines().find_map(|line| line.strip_prefix("  features: ")).unwrap();
        let features: serde_json::Value = serde_json::from_str(features).unwrap();
        let names = features.as_array().unwrap().iter().map(|feature| feature["name"].as_str().unwrap().to_owned());
        assert!(names.eq(columns().into_iter().map(|column| column.name)));
        assert!(card.contains("data/test-*.parquet") && !card.contains("validation"));
    }
}

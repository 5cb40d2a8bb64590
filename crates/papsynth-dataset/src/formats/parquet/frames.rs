//! The frames of the format `huggingface`: a row each, in a file for each split of a shard.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt::Write;

use papsynth::Plane;
use papsynth::truth::{ObjectTruth, Truth};

use super::failed::failed;
use super::features::{CLASS, image, metadata, yaml};
use super::schema::{Column, Kind};
use super::writer::{Value, Writer};
use crate::error::Error;
use crate::files::Pending;
use crate::formats::huggingface::{CARD, PICTURE, file, name};
use crate::formats::names::numbered;
use crate::formats::sink::{Field, Files, Sink};
use crate::truth::{Category, Form, Geometry, Split, part, rle};
use crate::write;

/// The columns. Nothing is missing anywhere, but `datasets` takes features from a file only where all may be.
fn columns() -> Vec<Column> {
    let column = |name, kind| Column::new(name, kind).or_null();
    vec![
        column("index", Kind::I64),
        column("slide", Kind::I64),
        column("width", Kind::I64),
        column("height", Kind::I64),
        column("pixel_um", Kind::F64),
        column("bits", Kind::I64),
        column("planes_um", Kind::list(Kind::F64)),
        column("objects", Kind::list(Kind::Struct(object_columns()))),
        column("image", image()),
        column("planes", Kind::list(image())),
    ]
}

fn object_columns() -> Vec<Column> {
    let column = |name, kind| Column::new(name, kind).or_null();
    vec![
        column("id", Kind::U32),
        column("part", Kind::Text),
        column(CLASS, Kind::I64),
        column("kind", Kind::Text),
        column("class", Kind::Text),
        column("bethesda", Kind::Text),
        column("traits", Kind::Text),
        column("cluster", Kind::U32),
        column("bbox", Kind::list(Kind::I64)),
        column("area", Kind::I64),
        column("front_area", Kind::I64),
        column("area_um2", Kind::F64),
        column("depth_um", Kind::F64),
        column("stain", Kind::F64),
        column("tint", Kind::Text),
        column("truncated", Kind::Bool),
        column("rle", Kind::Text),
        column("front_rle", Kind::Text),
    ]
}

/// What is known of a frame but its pixels: the first columns.
fn row(field: &Field) -> Result<Vec<Value>, Error> {
    let Geometry { view, bits, planes_um, slide, .. } = field.geometry;
    let category = |id: u32| field.document.categories.iter().position(|category: &Category| category.id == id);
    let objects = field.truth.objects.iter().zip(&field.document.annotations).map(|(one, annotation)| {
        let category = category(annotation.category_id);
        category
            .map(|category| object(field.truth, one, category as u64))
            .ok_or_else(|| field.geometry.wrong(format!("there is no category {}", annotation.category_id)))
    });
    Ok(vec![
        field.index().into(),
        (*slide).into(),
        (view.width as u64).into(),
        (view.height as u64).into(),
        view.pixel_um.into(),
        u64::from(*bits).into(),
        Value::List(planes_um.iter().copied().map(Value::F64).collect()),
        Value::List(objects.collect::<Result<_, _>>()?),
    ])
}

fn object(truth: &Truth, object: &ObjectTruth, category: u64) -> Value {
    let bounds = object.amodal.bounds().map_or([0; 4], |b| [b.x, b.y, b.width, b.height]);
    let mask = |mask| rle::encode(mask, truth.width, truth.height).into();
    Value::Struct(vec![
        object.id.into(),
        part(object.part).into(),
        category.into(),
        object.kind.name().into(),
        object.class.as_str().into(),
        object.bethesda.as_str().into(),
        object.traits.to_string().as_str().into(),
        object.cluster.into(),
        Value::List(bounds.map(|side| u64::from(side).into()).to_vec()),
        object.amodal.area().into(),
        object.front.area().into(),
        object.area_um2.into(),
        object.depth_um.into(),
        object.stain.into(),
        object.tint_name().into(),
        object.truncated.into(),
        mask(&object.amodal),
        mask(&object.front),
    ])
}

fn picture(path: String, bytes: Vec<u8>) -> Value {
    Value::Struct(vec![bytes.into(), path.into()])
}

/// Writes the frames of a shard, a file for each split.
#[derive(Default)]
struct Shard {
    files: BTreeMap<Split, (Pending, Writer<'static>)>,
    /// The planes of a stack as PNG; a single plane is the picture.
    planes: Vec<Vec<u8>>,
}

#[expect(clippy::unnecessary_wraps, reason = "without the feature it fails")]
pub(crate) fn sink(_: &Files) -> Result<Box<dyn Sink>, Error> {
    Ok(Box::new(Shard::default()))
}

impl Sink for Shard {
    fn begin(&mut self, _: &Geometry, _: &Files) -> Result<(), Error> {
        self.planes.clear();
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, geometry: &Geometry, files: &Files) -> Result<(), Error> {
        if Form::of(geometry.planes_um.len()) == Form::Stack {
            let Geometry { view, bits, channels, slide, key, .. } = geometry;
            let png = write::png(&plane.grey, view.width, *channels, *bits, view.pixel_um);
            let path = files.folder.path(&file(Split::of_slide(key.seed, *slide), files.shard));
            self.planes.push(png.map_err(Error::io("encode", &path))?);
        }
        Ok(())
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        let (split, key) = (field.split(), numbered(field.index()));
        let name = file(split, files.shard);
        let path = files.folder.path(&name);
        let mut row = row(field)?;
        row.push(picture(format!("{key}{PICTURE}"), field.png().map_err(Error::io("encode", &path))?.to_vec()));
        let planes = std::mem::take(&mut self.planes).into_iter().enumerate();
        let planes = planes.map(|(number, png)| picture(format!("{key}.{number:03}{PICTURE}"), png));
        row.push(Value::List(planes.collect()));
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

/// The card, whose head names the files of the splits that there are and the features.
#[expect(clippy::unnecessary_wraps, reason = "without the feature it fails")]
pub(crate) fn card(classes: &[String], splits: &[Split]) -> Result<(String, Vec<u8>), Error> {
    let mut text = "---\nlicense: cc0-1.0\ntask_categories:\n- image-segmentation\n- object-detection\ntags:\n- synthetic\n- cytology\n\
                    - microscopy\nconfigs:\n- config_name: default\n  data_files:\n"
        .to_owned();
    for split in splits {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  - split: {0}\n    path: data/{0}-*.parquet", name(*split));
    }
    let _ = writeln!(text, "dataset_info:\n  features: {}\n---", yaml(&columns(), classes));
    text.push_str(
        "\n# Synthetic cervical smears\n\nA row is a field: `image` (of a focus stack, everything in focus, and its planes in `planes`), and in `objects` \
         every cell, nucleus and piece of debris with its complete mask (`rle`) and the part of it that nothing hides (`front_rle`), as COCO's \
         compressed run lengths. Splits are by slide: fields of a slide share stain and light.\n\n```python\nfrom datasets import \
         load_dataset\n\nfields = load_dataset(\"huggingface\", split=\"train\")    # this folder\n```\n",
    );
    Ok((CARD.to_owned(), text.into_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn features_are_json_that_names_every_column_in_its_order() {
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

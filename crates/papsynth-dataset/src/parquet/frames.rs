//! The frames of the format `huggingface`: a row each, in a file for each split of a shard.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use papsynth::Plane;
use papsynth::truth::{ObjectTruth, Truth};
use papsynth_parquet::{Column, Kind, Reader, Rows, Value};

use super::features::{CLASS, image, metadata};
use super::objects::signed;
use super::{Writer, begin, failed, open};
use crate::coco::Category;
use crate::error::{Error, Problem};
use crate::files::{Folder, Pending};
use crate::formats::huggingface::{PICTURE, PLANES, file};
use crate::formats::{Field, Place, Sink, Written};
use crate::layout::{Form, numbered};
use crate::record::{FileRecord, Geometry};
use crate::rle;
use crate::splits::Split;
use crate::table::part;
use crate::write;

/// The columns, of which those with the images come last. Nothing is missing anywhere, but `datasets` takes features from a file only where all may be.
pub(super) fn columns() -> Vec<Column> {
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

/// How many of the columns are of images.
const IMAGES: usize = 2;

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
        signed(field.index()),
        signed(*slide),
        signed(view.width as u64),
        signed(view.height as u64),
        view.pixel_um.into(),
        signed((*bits).into()),
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
        signed(category),
        object.kind.name().into(),
        object.class.as_str().into(),
        object.bethesda.as_str().into(),
        object.traits.to_string().as_str().into(),
        object.cluster.into(),
        Value::List(bounds.map(|side| signed(side.into())).to_vec()),
        signed(object.amodal.area()),
        signed(object.front.area()),
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

/// The names of the picture of a frame and of its planes.
fn names(field: &Field) -> (String, impl Fn(usize) -> String) {
    let key = numbered(field.index());
    (format!("{key}{PICTURE}"), move |plane| format!("{key}.{plane:03}{PICTURE}"))
}

fn split(field: &Field) -> Split {
    Split::of_slide(field.geometry.key.seed, field.geometry.slide)
}

/// Writes the frames of a shard.
struct Shard<'a> {
    place: Place<'a>,
    files: BTreeMap<Split, (Pending, Writer)>,
    /// The planes of a stack as PNG; a single plane is the picture.
    planes: Vec<Vec<u8>>,
}

pub(crate) fn sink(place: Place<'_>) -> Result<Box<dyn Sink + '_>, Error> {
    Ok(Box::new(Shard { place, files: BTreeMap::new(), planes: Vec::new() }))
}

impl Shard<'_> {
    fn name(&self, split: Split) -> String {
        file(split, self.place.shard)
    }
}

impl Sink for Shard<'_> {
    fn begin(&mut self, _: &Geometry) -> Result<(), Error> {
        self.planes.clear();
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, geometry: &Geometry) -> Result<(), Error> {
        if Form::of(geometry.planes_um.len()) == Form::Stack {
            let Geometry { view, bits, channels, slide, key, .. } = geometry;
            let png = write::png(&plane.grey, view.width, *channels, *bits, view.pixel_um);
            let path = self.place.folder.path(&self.name(Split::of_slide(key.seed, *slide)));
            self.planes.push(png.map_err(Error::io("encode", &path))?);
        }
        Ok(())
    }

    fn field(&mut self, field: &Field) -> Result<(), Error> {
        let split = split(field);
        let name = self.name(split);
        let path = self.place.folder.path(&name);
        if !self.files.contains_key(&split) {
            let classes: Vec<String> = field.document.categories.iter().map(|category| category.name.clone()).collect();
            let columns = columns();
            let pending = self.place.folder.pending(&name)?;
            let writer = begin(&pending, &columns, &[("huggingface", &metadata(&columns, &classes))])?;
            self.files.insert(split, (pending, writer));
        }
        let (name, plane_name) = names(field);
        let mut row = row(field)?;
        row.push(picture(name, field.png().map_err(Error::io("encode", &path))?.to_vec()));
        let planes = std::mem::take(&mut self.planes).into_iter().enumerate();
        row.push(Value::List(planes.map(|(number, png)| picture(plane_name(number), png)).collect()));
        match self.files.get_mut(&split) {
            Some((_, writer)) => writer.row(row).map_err(failed("write", &path)),
            None => Ok(()),
        }
    }

    fn close(self: Box<Self>) -> Result<Vec<FileRecord>, Error> {
        let each = self.files.into_values().map(|(pending, writer)| {
            writer.finish().map_err(failed("write", pending.path()))?;
            pending.commit()
        });
        each.collect()
    }
}

/// The files of an image: its picture, or all its planes.
pub(crate) fn images(path: &Path, image: &str) -> Result<Vec<Vec<u8>>, Error> {
    let broken = |what: String| Error::input(path)(Problem::Broken { format: "Parquet", message: what });
    let missing = || broken(format!("it has no image `{}`", image.escape_default()));
    let (index, column) = match (image.strip_suffix(PICTURE), image.strip_suffix(PLANES)) {
        (Some(index), _) => (index, "image"),
        (_, Some(index)) => (index, "planes"),
        _ => return Err(missing()),
    };
    let index = Value::I64(index.parse().map_err(|_| missing())?);
    let reader = open(path)?;
    let read = |columns: &[&str], range| reader.rows(columns, range).map_err(failed("read", path));
    let (mut row, mut is_there) = (0, false);
    for found in read(&["index"], 0..u64::MAX)? {
        if found.map_err(failed("read", path))? == [index.clone()] {
            is_there = true;
            break;
        }
        row += 1;
    }
    if !is_there {
        return Err(missing());
    }
    let found = read(&[column], row..row + 1)?.next().transpose().map_err(failed("read", path))?;
    let files = match found.and_then(|mut row| row.pop()) {
        Some(Value::List(images)) => images.into_iter().map(bytes).collect(),
        Some(image) => bytes(image).map(|bytes| vec![bytes]),
        None => None,
    };
    files.ok_or_else(missing)
}

/// The bytes of an image.
fn bytes(image: Value) -> Option<Vec<u8>> {
    match image {
        Value::Struct(fields) => match fields.into_iter().next() {
            Some(Value::Bytes(bytes)) => Some(bytes),
            _ => None,
        },
        _ => None,
    }
}

/// The frames of a shard, read again beside their truth.
pub(crate) struct Frames {
    folder: Folder,
    shard: u64,
    files: BTreeMap<Split, (PathBuf, Rows<Reader>)>,
}

impl Frames {
    #[expect(clippy::unnecessary_wraps, reason = "without the feature it fails")]
    pub(crate) fn new(folder: &Folder, shard: u64) -> Result<Self, Error> {
        Ok(Self { folder: folder.clone(), shard, files: BTreeMap::new() })
    }

    /// The next row of its split is a frame.
    pub(crate) fn check(&mut self, written: &Written) -> Result<(), Error> {
        let split = split(written.field);
        if !self.files.contains_key(&split) {
            let path = self.folder.inside(&file(split, self.shard))?;
            let rows = Self::rows(&path, written.field)?;
            self.files.insert(split, (path, rows));
        }
        let Some((path, rows)) = self.files.get_mut(&split) else { return Ok(()) };
        let row = rows.next().transpose().map_err(failed("read", path))?;
        Self::look(written, row.unwrap_or_default()).and_then(|looked| looked.map_err(Error::input(path)))
    }

    fn rows(path: &Path, field: &Field) -> Result<Rows<Reader>, Error> {
        let reader = open(path)?;
        let columns = columns();
        let classes: Vec<String> = field.document.categories.iter().map(|category| category.name.clone()).collect();
        let told = reader.metadata("huggingface");
        if reader.columns() != columns || told != Some(metadata(&columns, &classes).as_str()) {
            return Err(Error::input(path)(differs("its columns or features are not those of this format")));
        }
        let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
        reader.into_rows(&names, 0..u64::MAX).map_err(failed("read", path))
    }

    fn look(written: &Written, mut found: Vec<Value>) -> Result<Result<(), Problem>, Error> {
        let (field, index) = (written.field, written.field.index());
        let images = found.split_off(found.len().saturating_sub(IMAGES));
        if found != row(field)? {
            return Ok(Err(differs(&format!("its row of frame {index} is not as the record and coco.json say"))));
        }
        let (name, plane_name) = names(field);
        let planes = field.geometry.planes_um.len();
        let due = if Form::of(planes) == Form::Stack { planes } else { 0 };
        let is_named = |image: &Value, name: String| matches!(image, Value::Struct(fields) if matches!(fields.as_slice(), [Value::Bytes(_), Value::Text(path)] if *path == name));
        let [whole, Value::List(apart)] = images.as_slice() else { return Ok(Err(differs("it has no images"))) };
        let are_named = (0..).zip(apart).all(|(number, image)| is_named(image, plane_name(number)));
        if apart.len() != due || !is_named(whole, name) || !are_named {
            return Ok(Err(differs(&format!("the images of frame {index} are not those that the record says"))));
        }
        let content = |image: &Value| bytes(image.clone()).unwrap_or_default();
        let looked = written.picture(&content(whole)).and_then(|()| match due {
            0 => Ok(()),
            _ => {
                let files: Vec<Vec<u8>> = apart.iter().map(content).collect();
                written.planes_apart(files.iter().map(Vec::as_slice))
            }
        });
        Ok(looked)
    }

    /// No further row follows.
    pub(crate) fn end(self) -> Result<(), Error> {
        for (path, mut rows) in self.files.into_values() {
            if rows.next().transpose().map_err(failed("read", &path))?.is_some() {
                return Err(Error::input(&path)(differs("it has a row of no frame")));
            }
        }
        Ok(())
    }
}

fn differs(what: &str) -> Problem {
    Problem::Differs { what: what.to_owned() }
}

//! What Hugging Face wants to be told of a table: which bytes are images, which numbers are classes.

use std::fmt::Write;

use papsynth_parquet::{Column, Kind};

use super::frames::columns;
use crate::error::Error;
use crate::formats::huggingface::{CARD, name};
use crate::splits::Split;

/// The column of integers that stand for the classes of the data set, counted from 0.
pub(super) const CLASS: &str = "category";

/// An image as Hugging Face keeps it: the bytes of its file, and the name that file would have.
pub(super) fn image() -> Kind {
    Kind::Struct(vec![Column::new("bytes", Kind::Bytes).or_null(), Column::new("path", Kind::Text).or_null()])
}

/// The text of the key `huggingface` of a file: features by name, in the order of the columns.
pub(super) fn metadata(columns: &[Column], classes: &[String]) -> String {
    format!("{{\"info\": {{\"features\": {}}}}}", object(columns, classes))
}

/// A text as JSON, which YAML is, too.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn object(columns: &[Column], classes: &[String]) -> String {
    let each = columns.iter().map(|column| format!("{}: {}", quoted(&column.name), feature(column, classes)));
    format!("{{{}}}", each.collect::<Vec<_>>().join(", "))
}

/// As JSON. Lists are told in a way that old and new releases of `datasets` know.
fn feature(column: &Column, classes: &[String]) -> String {
    match &column.kind {
        kind if *kind == image() => "{\"_type\": \"Image\"}".to_owned(),
        Kind::List(kind) => {
            let element = Column::new(&column.name, (**kind).clone());
            match &element.kind {
                Kind::Struct(fields) if element.kind != image() => format!("[{}]", object(fields, classes)),
                _ => format!("{{\"feature\": {}, \"_type\": \"Sequence\"}}", feature(&element, classes)),
            }
        }
        Kind::Struct(fields) => object(fields, classes),
        _ if column.name == CLASS => {
            let names: Vec<String> = classes.iter().map(|class| quoted(class)).collect();
            format!("{{\"names\": [{}], \"_type\": \"ClassLabel\"}}", names.join(", "))
        }
        kind => format!("{{\"dtype\": \"{}\", \"_type\": \"Value\"}}", dtype(kind)),
    }
}

fn dtype(kind: &Kind) -> &'static str {
    match kind {
        Kind::Bool => "bool",
        Kind::U32 => "uint32",
        Kind::I64 => "int64",
        Kind::F64 => "float64",
        Kind::Text => "string",
        // Lists and structs have no name of one word.
        Kind::Bytes | Kind::List(_) | Kind::Struct(_) => "binary",
    }
}

/// The same as the card wants it: a list of features with their names.
fn yaml(columns: &[Column], classes: &[String]) -> String {
    let each = columns.iter().map(|column| {
        let (key, what) = entry(&column.name, &column.kind, classes);
        format!("{{\"name\": {}, \"{key}\": {what}}}", quoted(&column.name))
    });
    format!("[{}]", each.collect::<Vec<_>>().join(", "))
}

fn entry(name: &str, kind: &Kind, classes: &[String]) -> (&'static str, String) {
    match kind {
        kind if *kind == image() => ("dtype", "\"image\"".to_owned()),
        Kind::List(kind) => match &**kind {
            Kind::Struct(fields) if **kind != image() => ("list", yaml(fields, classes)),
            kind => ("list", entry(name, kind, classes).1),
        },
        Kind::Struct(fields) => ("struct", yaml(fields, classes)),
        _ if name == CLASS => {
            let names = (0..).zip(classes).map(|(number, class): (u32, _)| format!("\"{number}\": {}", quoted(class)));
            let names = names.collect::<Vec<_>>().join(", ");
            ("dtype", format!("{{\"class_label\": {{\"names\": {{{names}}}}}}}"))
        }
        kind => ("dtype", format!("\"{}\"", dtype(kind))),
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

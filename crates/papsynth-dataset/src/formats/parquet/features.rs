//! What Hugging Face wants to be told of a table: which bytes are images, which numbers are classes.

use crate::truth::{Head, Kind};

/// The column of integers that stand for the classes of the data set, counted from 0.
pub(super) const CLASS: &str = "category";

/// An image as Hugging Face keeps it: the bytes of its file, and the name that file would have.
pub(super) const IMAGE: Kind =
    Kind::Struct(&[Head::new("bytes", Kind::Bytes).or_null(), Head::new("path", Kind::Text).or_null()]);

/// The text of the key `huggingface` of a file: features by name, in the order of the columns.
pub(super) fn metadata(columns: &[Head], classes: &[String]) -> String {
    format!("{{\"info\": {{\"features\": {}}}}}", object(columns, classes))
}

/// A text as JSON, which YAML is, too.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn object(columns: &[Head], classes: &[String]) -> String {
    let each = columns.iter().map(|column| format!("{}: {}", quoted(column.name), feature(column, classes)));
    format!("{{{}}}", each.collect::<Vec<_>>().join(", "))
}

/// As JSON. Lists are told in a way that old and new releases of `datasets` know.
fn feature(column: &Head, classes: &[String]) -> String {
    match column.kind {
        IMAGE => "{\"_type\": \"Image\"}".to_owned(),
        Kind::List(kind) => {
            let element = Head::new(column.name, *kind);
            match element.kind {
                Kind::Struct(fields) if element.kind != IMAGE => format!("[{}]", object(fields, classes)),
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

fn dtype(kind: Kind) -> &'static str {
    match kind {
        Kind::Flag => "bool",
        Kind::Id => "uint32",
        Kind::Whole => "int64",
        Kind::Number => "float64",
        Kind::Text => "string",
        // Lists and structs have no name of one word.
        Kind::Bytes | Kind::List(_) | Kind::Struct(_) => "binary",
    }
}

/// The same as the card wants it: a list of features with their names.
pub(super) fn yaml(columns: &[Head], classes: &[String]) -> String {
    let each = columns.iter().map(|column| {
        let (key, what) = entry(column.name, column.kind, classes);
        format!("{{\"name\": {}, \"{key}\": {what}}}", quoted(column.name))
    });
    format!("[{}]", each.collect::<Vec<_>>().join(", "))
}

fn entry(name: &str, kind: Kind, classes: &[String]) -> (&'static str, String) {
    match kind {
        IMAGE => ("dtype", "\"image\"".to_owned()),
        Kind::List(kind) => match *kind {
            Kind::Struct(fields) if *kind != IMAGE => ("list", yaml(fields, classes)),
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

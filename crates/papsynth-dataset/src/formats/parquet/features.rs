//! Features of Hugging Face tables: the types of columns, such as images and class labels.

use crate::truth::{Head, Kind};

/// The column with the class labels of the data set, numbers from 0.
pub(super) const CLASS: &str = "category";

/// An image of Hugging Face: the bytes of the file and a file name.
pub(super) const IMAGE: Kind =
    Kind::Struct(&[Head::new("bytes", Kind::Bytes).or_null(), Head::new("path", Kind::Text).or_null()]);

/// Returns the metadata value for the key `huggingface`: the features, in the order of the columns.
pub(super) fn metadata(columns: &[Head], classes: &[String]) -> String {
    format!("{{\"info\": {{\"features\": {}}}}}", object(columns, classes))
}

/// Returns a string in JSON, which is also YAML.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn object(columns: &[Head], classes: &[String]) -> String {
    let each = columns.iter().map(|column| format!("{}: {}", quoted(column.name), feature(column, classes)));
    format!("{{{}}}", each.collect::<Vec<_>>().join(", "))
}

/// Returns a feature as JSON. The notation of lists is valid for old and new releases of `datasets`.
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
        // Lists and structs are handled by the callers.
        Kind::Bytes | Kind::List(_) | Kind::Struct(_) => "binary",
    }
}

/// Returns the features for the dataset card: a list with names.
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

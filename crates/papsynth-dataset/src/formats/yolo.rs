//! `yolo-seg`: for each object a line with its class and the corners of its complete outline, as fractions of width and
//! height.
//!
//! Separate parts and holes are joined by seams of zero width. Filled by the even-odd rule, the polygon is the mask.

use std::fmt::Write;

use super::depth::Depth;
use super::sink::{Field, Files};
use super::written::Written;
use crate::error::{Error, InputError};
use crate::truth::{Split, outlines};

pub(super) fn image(split: Split, index: u64) -> String {
    format!("yolo-seg/images/{}/{index:06}.png", split.name())
}

fn labels(split: Split, index: u64) -> String {
    format!("yolo-seg/labels/{}/{index:06}.txt", split.name())
}

/// Returns the lines of a frame. An object with an empty mask has no line.
fn text(field: &Field) -> String {
    let [width, height] = [field.frame.width, field.frame.height].map(|side| side as f64);
    let mut text = String::new();
    for (object, annotation) in field.truth.objects.iter().zip(&field.document.annotations) {
        let mut corners = Vec::new();
        let mut seams = Vec::new();
        for ring in outlines(&object.amodal) {
            seams.extend(ring.first().copied());
            corners.extend(ring.iter().copied());
            corners.extend(ring.first().copied());
        }
        if corners.is_empty() {
            continue;
        }
        // Back along the seams, in reverse order.
        corners.extend(seams.into_iter().rev().skip(1));
        // Writing to a string cannot fail.
        let _ = write!(text, "{}", annotation.category_id - 1);
        for [x, y] in corners {
            let [x, y] = [f64::from(x) / width, f64::from(y) / height];
            let _ = write!(text, " {x:.6} {y:.6}");
        }
        text.push('\n');
    }
    text
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let field = written.field;
    let split = field.split();
    written.file(&image(split, field.frame.index), |bytes| written.image(bytes, Depth::Training))?;
    written.file(&labels(split, field.frame.index), |bytes| {
        InputError::unless(bytes == text(field).as_bytes(), "the outlines differ from the masks in coco.json")
    })
}

pub(super) fn write(field: &Field, files: &mut Files) -> Result<(), Error> {
    let split = field.split();
    files.png(&image(split, field.frame.index), field, Depth::Training)?;
    files.write(&labels(split, field.frame.index), text(field).as_bytes())
}

/// Returns `data.yaml`: the folders of the splits, and the names of the classes.
///
/// Ultralytics needs `train` and `val`, and folders that exist. A split without frames is left out, or replaced by
/// another one if it is needed. The file has no `path`: Ultralytics then starts from the folder of the file, but
/// resolves a relative `path` against its own settings or the current folder.
pub(super) fn description(classes: &[String], splits: &[Split]) -> (String, Vec<u8>) {
    let mut text = "# Complete (amodal) outlines; all fields of a slide are in the same split.\n".to_owned();
    for split in Split::ALL {
        // Validation with test frames is better than with training frames.
        let instead = match split {
            Split::Train => [Split::Val, Split::Test],
            Split::Val => [Split::Test, Split::Train],
            Split::Test => [Split::Test, Split::Test],
        };
        let Some(used) = [split].into_iter().chain(instead).find(|used| splits.contains(used)) else { continue };
        let (key, name) = (split.name(), used.name());
        if used != split {
            let _ =
                writeln!(text, "# No slide is in the split `{key}`: `{name}` is used for both. Generate more slides.");
        }
        let _ = writeln!(text, "{key}: images/{name}");
    }
    text.push_str("names:\n");
    for (number, class) in classes.iter().enumerate() {
        let _ = writeln!(text, "  {number}: {}", serde_json::Value::from(class.as_str()));
    }
    ("yolo-seg/data.yaml".to_owned(), text.into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_yaml_names_only_folders_that_exist() {
        use Split::{Test, Train, Val};
        let lines = |splits: &[Split]| {
            let (_, bytes) = description(&["a".to_owned()], splits);
            let text = String::from_utf8(bytes).unwrap();
            text.lines().filter(|line| line.contains(": images/")).map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(lines(&[Train, Val, Test]), ["train: images/train", "val: images/val", "test: images/test"]);
        assert_eq!(lines(&[Train, Val]), ["train: images/train", "val: images/val"]);
        assert_eq!(lines(&[Train]), ["train: images/train", "val: images/train"]);
        assert_eq!(lines(&[Train, Test]), ["train: images/train", "val: images/test", "test: images/test"]);
        assert_eq!(lines(&[Test]), ["train: images/test", "val: images/test", "test: images/test"]);
    }
}

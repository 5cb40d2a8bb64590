//! `yolo-seg`: a line an object, its class and the corners of its complete outline as fractions of width and height.
//!
//! Parts that lie apart, and holes, are joined by seams of no width: filled by the even-odd rule the polygon is the mask.

use std::fmt::Write;

use super::sink::{Field, Files};
use super::written::Written;
use crate::error::{Error, Problem};
use crate::truth::{Split, outlines};

pub(super) fn image(split: Split, index: u64) -> String {
    format!("yolo-seg/images/{}/{index:06}.png", split.name())
}

fn labels(split: Split, index: u64) -> String {
    format!("yolo-seg/labels/{}/{index:06}.txt", split.name())
}

/// The lines of a frame. What no pixel shows has no outline, and no line.
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
        // Back over the seams, the way they came.
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
    written.file(&image(split, field.frame.index), |bytes| written.picture(bytes))?;
    written.file(&labels(split, field.frame.index), |bytes| {
        Problem::unless(bytes == text(field).as_bytes(), "its outlines are not those of the masks of coco.json")
    })
}

pub(super) fn write(field: &Field, files: &mut Files) -> Result<(), Error> {
    let split = field.split();
    files.png(&image(split, field.frame.index), field)?;
    files.write(&labels(split, field.frame.index), text(field).as_bytes())
}

/// What tells a trainer where the splits lie and what the classes are called. Without a `path`, Ultralytics starts from the folder of the
/// file; a relative one would mean the folder of its own settings, or the one it runs in.
pub(super) fn description(classes: &[String]) -> (String, Vec<u8>) {
    let mut text = "# Complete (amodal) outlines; the split is that of the slide.\n".to_owned();
    for split in Split::ALL {
        text.push_str(&format!("{0}: images/{0}\n", split.name()));
    }
    text.push_str("names:\n");
    for (number, class) in classes.iter().enumerate() {
        text.push_str(&format!("  {number}: {}\n", serde_json::Value::from(class.as_str())));
    }
    ("yolo-seg/data.yaml".to_owned(), text.into_bytes())
}

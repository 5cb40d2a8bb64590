//! Which file lies where.

use papsynth::truth::Group;

pub(crate) const MANIFEST: &str = "manifest.json";
pub(crate) const RECIPE: &str = "recipe.toml";
pub(crate) const MODEL: &str = "model.json";
pub(crate) const TABLE: &str = "objects.csv";
pub(crate) const COCO: &str = "coco.json";
pub(crate) const SHEET: &str = "contact-sheet.png";
pub(crate) const FRAMES: &str = "frames";

/// Every folder that files of frames are written to.
pub(crate) const FOLDERS: [&str; 9] = [
    "images",
    "noise-free",
    "all-in-focus",
    "labels/cytoplasm",
    "labels/nucleus",
    "labels/debris",
    "labels/layers",
    "objects",
    FRAMES,
];

/// Whether a frame is a single image or a focus stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    Single,
    Stack,
}

impl Form {
    pub(crate) fn of(planes: usize) -> Self {
        if planes > 1 { Self::Stack } else { Self::Single }
    }
}

/// The name of a frame: its index in at least six digits.
pub(crate) fn frame_name(index: u64) -> String {
    format!("{index:06}")
}

pub(crate) fn image(index: u64, form: Form) -> String {
    let ending = match form {
        Form::Single => "png",
        Form::Stack => "ome.tif",
    };
    format!("images/{index:06}.{ending}")
}

pub(crate) fn noise_free(index: u64) -> String {
    format!("noise-free/{index:06}.tif")
}

pub(crate) fn all_in_focus(index: u64) -> String {
    format!("all-in-focus/{index:06}.png")
}

pub(crate) fn labels(group: Group, index: u64) -> String {
    format!("labels/{}/{index:06}.tif", group.name())
}

pub(crate) fn layers(index: u64) -> String {
    format!("labels/layers/{index:06}.tif")
}

pub(crate) fn table(index: u64) -> String {
    format!("objects/{index:06}.csv")
}

pub(crate) fn coco(index: u64) -> String {
    format!("{FRAMES}/{index:06}.coco.json")
}

pub(crate) fn record(index: u64) -> String {
    format!("{FRAMES}/{index:06}.json")
}

/// The index of the frame whose record has this file name.
pub(crate) fn index_of_record(file_name: &str) -> Option<u64> {
    let digits = file_name.strip_suffix(".json")?;
    let index = digits.parse().ok()?;
    (frame_name(index) == digits).then_some(index)
}

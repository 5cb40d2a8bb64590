//! Names of the files of a data set.

use papsynth::truth::Group;

use crate::truth::{FrameSummary, Split};

pub(crate) const MANIFEST: &str = "manifest.json";
pub(crate) const RECIPE: &str = "recipe.toml";
pub(crate) const MODEL: &str = "model.json";
pub(crate) const TABLE: &str = "objects.csv";
pub(crate) const OBJECTS: &str = "objects.parquet";
pub(crate) const COCO: &str = "coco.json";
pub(crate) const SHEET: &str = "contact-sheet.png";
pub(crate) const CARD: &str = "README.md";
pub(crate) const CROISSANT: &str = "croissant.json";
pub(crate) const SPLITS: &str = "splits.csv";

/// The files at the top of a data set, except the map that the recipe names.
pub(crate) const OF_EVERY_SET: [&str; 9] = [RECIPE, MODEL, TABLE, OBJECTS, COCO, SPLITS, SHEET, CARD, CROISSANT];

/// Folder with the records and COCO documents of the shards.
pub(crate) const SHARDS: &str = "shards";

/// Folder with the tables of the shards.
pub(crate) const TABLES: &str = "objects";

/// Returns the name of a frame or shard: its number with at least six digits.
pub(crate) fn numbered(number: u64) -> String {
    format!("{number:06}")
}

pub(crate) fn image(frame: &FrameSummary) -> String {
    format!("images/{:06}.{}", frame.index, if frame.is_stack() { "ome.tif" } else { "png" })
}

pub(crate) fn noise_free(index: u64) -> String {
    format!("noise-free/{index:06}.tif")
}

pub(crate) fn all_in_focus(index: u64) -> String {
    format!("all-in-focus/{index:06}.png")
}

/// Image of a camera of more than 8 bits, at 8 bits.
pub(crate) fn preview(index: u64) -> String {
    format!("preview/{index:06}.png")
}

pub(crate) fn labels(group: Group, index: u64) -> String {
    format!("labels/{}/{index:06}.tif", group.name())
}

pub(crate) fn layers(index: u64) -> String {
    format!("labels/layers/{index:06}.tif")
}

pub(crate) fn semantic(index: u64) -> String {
    format!("labels/semantic/{index:06}.png")
}

pub(crate) fn table(shard: u64) -> String {
    format!("{TABLES}/{shard:06}.csv")
}

pub(crate) fn objects(shard: u64) -> String {
    format!("{TABLES}/{shard:06}.parquet")
}

pub(crate) fn coco(shard: u64) -> String {
    format!("{SHARDS}/{shard:06}.coco.json")
}

pub(crate) fn record(shard: u64) -> String {
    format!("{SHARDS}/{shard:06}.json")
}

pub(crate) fn scene(index: u64) -> String {
    format!("scenes/{index:06}.json")
}

/// Returns the number of the shard whose record has this file name.
pub(crate) fn number_of_record(file_name: &str) -> Option<u64> {
    let digits = file_name.strip_suffix(".json")?;
    let number = digits.parse().ok()?;
    (numbered(number) == digits).then_some(number)
}

/// Returns the folder of the Zarr group of a frame.
pub(crate) fn zarr_group(index: u64) -> String {
    format!("ome-zarr/{index:06}{ZARR_GROUP}")
}

/// Extension of the folder of a Zarr group.
pub(crate) const ZARR_GROUP: &str = ".ome.zarr";

/// Dataset card of the format `huggingface`, with the files of each split.
pub(crate) const HUGGINGFACE_CARD: &str = "huggingface/README.md";

/// Returns the file with the frames of a shard in a split. The name has no total number, because shards are written in
/// any order.
pub(crate) fn huggingface_file(split: Split, shard: u64) -> String {
    format!("huggingface/data/{}-{shard:06}.parquet", huggingface_split(split))
}

/// Returns the name of a split on Hugging Face.
pub(crate) fn huggingface_split(split: Split) -> &'static str {
    match split {
        Split::Train => "train",
        Split::Val => "validation",
        Split::Test => "test",
    }
}

/// Returns the path of the image of a frame, or of all planes of a stack: the file, then a name with this extension.
pub(super) fn huggingface_image(seed: u64, shard: u64, frame: &FrameSummary, ending: &str) -> String {
    format!("{}/{}{ending}", huggingface_file(Split::of_slide(seed, frame.slide), shard), numbered(frame.index))
}

/// Extensions of names within a file: of an image, and of all planes of a stack.
pub(crate) const IMAGE: &str = ".png";
pub(crate) const PLANES: &str = ".planes";

//! Which file of a data set lies where.

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

/// The files that lie in a data set itself, but for the map that its recipe names.
pub(crate) const OF_EVERY_SET: [&str; 9] = [RECIPE, MODEL, TABLE, OBJECTS, COCO, SPLITS, SHEET, CARD, CROISSANT];

/// Records and truth of all shards.
pub(crate) const SHARDS: &str = "shards";

/// Tables of all shards.
pub(crate) const TABLES: &str = "objects";

/// The name of a frame or shard: its number in at least six digits.
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

pub(crate) fn labels(group: Group, index: u64) -> String {
    format!("labels/{}/{index:06}.tif", group.name())
}

pub(crate) fn layers(index: u64) -> String {
    format!("labels/layers/{index:06}.tif")
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

/// The number of the shard whose record has this file name.
pub(crate) fn number_of_record(file_name: &str) -> Option<u64> {
    let digits = file_name.strip_suffix(".json")?;
    let number = digits.parse().ok()?;
    (numbered(number) == digits).then_some(number)
}

/// The folder of a frame that is a group of Zarr.
pub(crate) fn zarr_group(index: u64) -> String {
    format!("ome-zarr/{index:06}{ZARR_GROUP}")
}

/// How the name of such a folder ends.
pub(crate) const ZARR_GROUP: &str = ".ome.zarr";

/// The card of the format `huggingface` that names the files of each split.
pub(crate) const HUGGINGFACE_CARD: &str = "huggingface/README.md";

/// The file of the frames of a shard that fall into a split. Its name tells no total: shards are written in any order.
pub(crate) fn huggingface_file(split: Split, shard: u64) -> String {
    format!("huggingface/data/{}-{shard:06}.parquet", huggingface_split(split))
}

/// The name of a split as Hugging Face has it.
pub(crate) fn huggingface_split(split: Split) -> &'static str {
    match split {
        Split::Train => "train",
        Split::Val => "validation",
        Split::Test => "test",
    }
}

/// The picture of a frame or all planes of a stack, by how their names end, behind the name of their file.
pub(super) fn huggingface_image(seed: u64, shard: u64, frame: &FrameSummary, ending: &str) -> String {
    format!("{}/{}{ending}", huggingface_file(Split::of_slide(seed, frame.slide), shard), numbered(frame.index))
}

/// How names within a file end: of a picture, and of all planes of a stack.
pub(crate) const PICTURE: &str = ".png";
pub(crate) const PLANES: &str = ".planes";

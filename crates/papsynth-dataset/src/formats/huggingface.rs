//! `huggingface`: Parquet files of many frames, a row each, as the library `datasets` reads them without a script. Here is where they lie; what is in them
//! stands in `parquet`, which wants the feature of that name.

use super::names::numbered;
use crate::truth::{Form, FrameSummary, Split};

/// The card that names the files of each split.
pub(crate) const CARD: &str = "huggingface/README.md";

/// The file of the frames of a shard that fall into a split. Its name tells no total: shards are written in any order.
pub(crate) fn file(split: Split, shard: u64) -> String {
    format!("huggingface/data/{}-{shard:06}.parquet", name(split))
}

/// The name of a split as Hugging Face has it.
pub(crate) fn name(split: Split) -> &'static str {
    match split {
        Split::Train => "train",
        Split::Val => "validation",
        Split::Test => "test",
    }
}

/// The image of a frame, or all planes of a stack, behind the name of its file.
pub(super) fn image(seed: u64, shard: u64, frame: &FrameSummary, form: Form) -> String {
    let ending = if form == Form::Stack { PLANES } else { PICTURE };
    format!("{}/{}{ending}", file(Split::of_slide(seed, frame.slide), shard), numbered(frame.index))
}

/// How names within a file end: of a picture, and of all planes of a stack.
pub(crate) const PICTURE: &str = ".png";
pub(crate) const PLANES: &str = ".planes";

//! How a data set lies in files.

use std::fmt::{self, Formatter};
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::format::{Format, HAS_PARQUET};
use crate::error::Problem;
use crate::truth::Flatten;

/// Most frames of a shard.
const MOST_FRAMES_PER_SHARD: u64 = 1_000_000_000;

/// How a data set lies in files: decided when it is begun, and kept in its manifest.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    /// The formats it is written in, in the order of [`Format::ALL`], each once; at least one.
    pub formats: Vec<Format>,
    /// Frames that are written, made again and recorded together, at least 1: shard *n* holds those with an index from
    /// *n* times this number on.
    pub frames_per_shard: u64,
    /// What pixels show that belong to several objects, in formats that have one label a pixel.
    pub flatten: Flatten,
    /// Whether the table of objects is also written as Parquet, with masks; wants the feature `parquet`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub objects_parquet: bool,
    /// Whether the scene of every frame is written, as JSON.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub scenes: bool,
}

impl Default for Layout {
    fn default() -> Self {
        Self::new([Format::Folder])
    }
}

impl Layout {
    /// Frames of a shard of formats that keep many in a file: some hundred megabytes.
    pub const FRAMES_PER_SHARD: u64 = 256;

    /// The usual layout of these formats: with the feature `parquet` objects are also written as Parquet.
    #[must_use]
    pub fn new(formats: impl IntoIterator<Item = Format>) -> Self {
        let mut formats: Vec<Format> = formats.into_iter().collect();
        formats.sort_unstable();
        formats.dedup();
        let many = formats.iter().any(|format| format.is_sharded());
        let frames_per_shard = if many { Self::FRAMES_PER_SHARD } else { 1 };
        Self { formats, frames_per_shard, flatten: Flatten::Top, objects_parquet: HAS_PARQUET, scenes: false }
    }

    /// Why a range of frames cannot be made, if it cannot: it begins within a shard.
    #[must_use]
    pub fn refusal_of(&self, frames: &Range<u64>) -> Option<String> {
        let each = self.frames_per_shard;
        (!frames.is_empty() && !frames.start.is_multiple_of(each)).then(|| {
            format!(
                "frames {}..{} begin within a shard; with {each} frames a shard a range begins at a multiple of {each}",
                frames.start, frames.end
            )
        })
    }

    /// A layout that was read is one that can be written.
    pub(crate) fn check(&self) -> Result<(), Problem> {
        let message = match self.frames_per_shard {
            1..=MOST_FRAMES_PER_SHARD if self.formats.is_empty() => "the layout names no format".to_owned(),
            1..=MOST_FRAMES_PER_SHARD if !self.formats.is_sorted_by(|a, b| a < b) => {
                "the formats of the layout are not in order, each once".to_owned()
            }
            1..=MOST_FRAMES_PER_SHARD => return Ok(()),
            frames => format!("frames_per_shard is {frames}; expected 1 to {MOST_FRAMES_PER_SHARD}"),
        };
        Err(Problem::broken("JSON", message))
    }

    /// Whether every frame is a shard of its own.
    pub(crate) fn is_by_frame(&self) -> bool {
        self.frames_per_shard == 1
    }

    /// The feature without which this build cannot write it, and what wants it.
    pub(crate) fn needs(&self) -> Option<(&'static str, String)> {
        let format = self.formats.iter().find_map(|format| Some((format.needs()?, format.title())));
        let table =
            (self.objects_parquet && !HAS_PARQUET).then(|| ("parquet", "the table of objects as Parquet".to_owned()));
        format.or(table)
    }

    /// Whether a format is among the data set's.
    #[must_use]
    pub fn has(&self, format: Format) -> bool {
        self.formats.contains(&format)
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.formats.iter().map(|format| format.name()).collect();
        let table = if self.objects_parquet { ", objects also as Parquet" } else { "" };
        let scenes = if self.scenes { ", with scenes" } else { "" };
        write!(f, "{} with {} a shard, {}{table}{scenes}", names.join(","), self.frames_per_shard, self.flatten.name())
    }
}

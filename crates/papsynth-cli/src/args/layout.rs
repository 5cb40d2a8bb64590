//! What can be typed about the files of a data set.

use clap::Args;
use papsynth_dataset::{Flatten, Format, Layout};

use super::values::{format_parser, named};

/// How a data set lies in files.
#[derive(Debug, Args)]
pub(crate) struct LayoutArgs {
    /// Formats to write, one or several [default: folder; webdataset above 10000 frames]
    #[arg(long, value_name = "NAME", value_parser = format_parser(), value_delimiter = ',')]
    pub(crate) format: Vec<Format>,
    #[command(flatten)]
    pub(crate) files: FileArgs,
    /// Write the scene of each frame too, as scenes/NNNNNN.json, which `papsynth render` reads
    #[arg(long)]
    pub(crate) scenes: bool,
}

/// The same, whatever the formats.
#[derive(Debug, Args)]
pub(crate) struct FileArgs {
    /// What a pixel shows that belongs to several objects, in formats with one label a pixel
    #[arg(long, value_name = "POLICY", value_parser = named(Flatten::ALL, Flatten::name), default_value = Flatten::Top.name())]
    pub(crate) flatten: Flatten,
    /// Frames that are written and made again together [default: 1; 256 with webdataset and huggingface]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    pub(crate) frames_per_shard: Option<u64>,
    /// Write the table of objects as CSV alone, not as Parquet too
    #[cfg(feature = "parquet")]
    #[arg(long)]
    pub(crate) no_parquet: bool,
}

impl LayoutArgs {
    /// From this many frames on a folder of single files is a burden.
    pub(crate) const MOST_IN_FOLDERS: u64 = 10_000;

    /// The layout of a data set of so many frames, and whether its format was chosen for their number.
    pub(crate) fn layout(&self, frames: u64) -> (Layout, bool) {
        let many = self.format.is_empty() && frames > Self::MOST_IN_FOLDERS;
        let usual = if many { Format::Webdataset } else { Format::Folder };
        let formats = if self.format.is_empty() { vec![usual] } else { self.format.clone() };
        (Layout { scenes: self.scenes, ..self.files.layout(formats) }, many)
    }
}

impl FileArgs {
    pub(crate) fn layout(&self, formats: Vec<Format>) -> Layout {
        let mut layout = Layout::new(formats);
        layout.flatten = self.flatten;
        #[cfg(feature = "parquet")]
        if self.no_parquet {
            layout.objects_parquet = false;
        }
        if let Some(frames) = self.frames_per_shard {
            layout.frames_per_shard = frames;
        }
        layout
    }
}

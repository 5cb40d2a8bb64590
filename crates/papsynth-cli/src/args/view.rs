//! What can be typed about looking at files.

use std::path::PathBuf;

use clap::Args;

/// Look at a data set or a slide in the browser: pan, zoom, focus, and the truth over the picture.
///
/// A page on this machine alone (127.0.0.1). Nothing is written; a data set or slide that is being made can be looked at, too.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  papsynth view fields
  papsynth view stacks --open            in the browser at once
  papsynth view slide --port 8080        a slide of `papsynth slide make` (a build with --features zarr)

Drag moves, the wheel zooms, with Shift it focuses; a click says what lies there. The address in the
browser keeps picture, place, focus and labels. Ctrl-C ends.")]
pub(crate) struct View {
    /// Folder of the data set or slide
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
    /// Port of 127.0.0.1 to serve the page at [default: any]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) port: Option<u16>,
    /// Open the page in the browser
    #[arg(long)]
    pub(crate) open: bool,
}

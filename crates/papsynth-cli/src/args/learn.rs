//! What can be typed after `learn`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::values::parse_pixel;

/// Learn what cells of a class are like, from real material.
///
/// Reads nuclei with their masks, and cytoplasm as outlines or label images, and writes one model file for
/// `papsynth generate --model`. What is not given is kept as the base model has it.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("material").required(true).multiple(true)
    .args(["nuclei", "nucleus_outlines", "outlines", "labels"]), after_help = "\
Examples:
  papsynth learn --class intermediate --nuclei nuclei --outlines cells.csv --pixel-um 0.25 --out mine.json
  papsynth learn --class high-grade --nuclei hsil/crops --masks hsil/masks --pixel-um 0.25 \\
      --base mine.json --numbers-only --out mine.json
  papsynth learn --class parabasal --like intermediate --labels fields --pixel-um 0.33 --out mine.json

Images are grey PNG, JPEG or TIFF; a mask or label image is 0 outside. An outline file is CSV with the columns
outline, k, x_px, y_px: name of the outline, number of its point from 0, and its place in pixels.")]
pub(crate) struct Learn {
    /// Class that is learned: new, or one of the base model's to learn anew
    #[arg(long, value_name = "NAME", value_parser = parse_class)]
    pub(crate) class: String,
    /// Folder of nuclei: `images` and `masks` in it hold files of the same names
    #[arg(long, value_name = "DIR")]
    pub(crate) nuclei: Option<PathBuf>,
    /// Folder of the masks, where they are elsewhere; then `--nuclei` holds the images themselves
    #[arg(long, value_name = "DIR", requires = "nuclei")]
    pub(crate) masks: Option<PathBuf>,
    /// Outlines of nuclei, instead of those of their masks
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) nucleus_outlines: Option<PathBuf>,
    /// Outlines of whole cells
    #[arg(long, value_name = "FILE.csv", conflicts_with = "labels")]
    pub(crate) outlines: Option<PathBuf>,
    /// Folder of label images of whole cells; those at an image's border are left out
    #[arg(long, value_name = "DIR")]
    pub(crate) labels: Option<PathBuf>,
    /// Size of a pixel of all of them, in micrometres
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: f64,
    /// Class of the base model to take after in what the material does not show [default: the class itself]
    #[arg(long, value_name = "NAME")]
    pub(crate) like: Option<String>,
    /// Category of the Bethesda system, such as NILM or HSIL [default: that of the class it takes after]
    #[arg(long, value_name = "NAME")]
    pub(crate) bethesda: Option<String>,
    /// Where the material came from, for the record [default: the names of the files]
    #[arg(long, value_name = "TEXT")]
    pub(crate) source: Option<String>,
    /// Model to learn into [default: the one that ships]
    #[arg(long, value_name = "MODEL")]
    pub(crate) base: Option<PathBuf>,
    /// Keep means, covariances and spectra of this class alone, and no pixels
    #[arg(long)]
    pub(crate) numbers_only: bool,
    /// Model file to write; an older model is replaced, no other file
    #[arg(long, value_name = "MODEL.json")]
    pub(crate) out: PathBuf,
}

/// A name that can stand in a recipe without quotes.
fn parse_class(text: &str) -> Result<String, String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    match !text.is_empty() && text.chars().all(plain) {
        true => Ok(text.to_owned()),
        false => Err("expected letters, digits, `-` and `_`".to_owned()),
    }
}

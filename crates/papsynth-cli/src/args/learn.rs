//! Options of `learn`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::values::parse_pixel;

/// Learn a class of cells from real images and outlines.
///
/// Reads nuclei with masks, and cytoplasm as outlines, label images or fields, and writes a model file for `papsynth
/// generate --model`. Properties without data keep the values of the base model.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("material").required(true).multiple(true)
    .args(["nuclei", "nucleus_outlines", "outlines", "labels", "cytoplasm"]), after_help = "\
Examples:
  papsynth learn --class intermediate --nuclei nuclei --outlines cells.csv --pixel-um 0.25 \\
      --out mine.json
  papsynth learn --class high-grade --nuclei hsil/crops --masks hsil/masks --pixel-um 0.25 \\
      --base mine.json --numbers-only --out mine.json
  papsynth learn --class parabasal --like intermediate --labels fields --pixel-um 0.33 \\
      --out mine.json
  papsynth learn --cytoplasm fields --pixel-um 0.33 --out mine.json

Images are grey PNG, JPEG or TIFF files; masks and label images are 0 outside the objects. An \
outline file is a CSV file with the columns outline, k, x_px, y_px: name of the outline, index of the \
point from 0, and its position in pixels.")]
pub(crate) struct Learn {
    /// Class to learn: a new class, or a class of the base model to replace
    #[arg(long, value_name = "NAME", value_parser = parse_class, required_unless_present = "cytoplasm")]
    pub(crate) class: Option<String>,
    /// Folder of nuclei, with the subfolders `images` and `masks` of files with equal names
    #[arg(long, value_name = "DIR")]
    pub(crate) nuclei: Option<PathBuf>,
    /// Folder of the masks, if `--nuclei` holds only the images
    #[arg(long, value_name = "DIR", requires = "nuclei")]
    pub(crate) masks: Option<PathBuf>,
    /// Outlines of nuclei, instead of those of the masks
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) nucleus_outlines: Option<PathBuf>,
    /// Outlines of cells
    #[arg(long, value_name = "FILE.csv", conflicts_with = "labels")]
    pub(crate) outlines: Option<PathBuf>,
    /// Folder of label images of cells; cells at the border of an image are ignored
    #[arg(long, value_name = "DIR")]
    pub(crate) labels: Option<PathBuf>,
    /// Folder of fields whose cytoplasm shows the texture of all classes; PNG, JPEG or TIFF, with or without centres of
    /// nuclei, as for `papsynth judge`
    #[arg(long, value_name = "DIR")]
    pub(crate) cytoplasm: Option<PathBuf>,
    /// Pixel size of all images and outlines, in micrometres
    #[arg(long, value_name = "UM", value_parser = parse_pixel)]
    pub(crate) pixel_um: f64,
    /// Class of the base model for properties without data [default: the class itself]
    #[arg(long, value_name = "NAME")]
    pub(crate) like: Option<String>,
    /// Category of the Bethesda system, such as NILM or HSIL [default: that of `--like`]
    #[arg(long, value_name = "NAME")]
    pub(crate) bethesda: Option<String>,
    /// Source of the data, for the record [default: the names of the files]
    #[arg(long, value_name = "TEXT")]
    pub(crate) source: Option<String>,
    /// Base model [default: the built-in model]
    #[arg(long, value_name = "MODEL")]
    pub(crate) base: Option<PathBuf>,
    /// Store only means, covariances and spectra of this class, no pixels
    #[arg(long)]
    pub(crate) numbers_only: bool,
    /// Model file to write; replaces an older model, but no other file
    #[arg(long, value_name = "MODEL.json")]
    pub(crate) out: PathBuf,
    /// Replace any existing file
    #[arg(long)]
    pub(crate) force: bool,
}

/// Parses a name that needs no quotes in a recipe.
fn parse_class(text: &str) -> Result<String, String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    match !text.is_empty() && text.chars().all(plain) {
        true => Ok(text.to_owned()),
        false => Err("expected letters, digits, `-` and `_`".to_owned()),
    }
}

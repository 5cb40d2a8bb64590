//! Folders of field images, with or without annotated nuclei.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use papsynth::truth::LabelMap;

use super::components::components;
use super::file::{Limits, bytes, parse};
use super::image::{LevelImage, read_label_map};
use super::nucleus::{image_files, same_size};
use crate::error::{Error, InputError};
use papsynth::white_level as white;

/// Table with the group of each image of a folder.
const GROUPS: &str = "frames.csv";

const GROUP_COLUMNS: [&str; 2] = ["frame", "grade"];

const TABLE_BYTES: u64 = 1 << 26;

/// Bit depths of cameras that write 16-bit files.
const DEEP: [u32; 3] = [12, 14, 16];

/// The channel that is read of three: stains of nuclei and cytoplasm absorb green most.
const RED: usize = 0;
const GREEN: usize = 1;
const BLUE: usize = 2;

/// Annotated nuclei of a field.
#[derive(Debug, Clone, PartialEq)]
pub enum FieldNuclei {
    /// No annotation.
    Unknown,
    /// A point in each nucleus: x right, y down, pixels.
    Points(Vec<[f64; 2]>),
    /// A label for each pixel in row-major order; 0 is background.
    Labels(Vec<u32>),
}

/// The file with the annotated nuclei of a field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum NucleiFile {
    Unknown,
    Points(PathBuf),
    Labels(PathBuf),
}

/// The files of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldFile {
    /// Name of the image without extension.
    pub name: String,
    /// Group in `frames.csv`, or an empty string.
    pub group: String,
    /// Size of a pixel, µm, where the files give it.
    pub pixel_um: Option<f64>,
    /// Number of the slide, where the files give it. Fields of one slide have the same staining.
    pub slide: Option<u64>,
    pub(crate) image: PathBuf,
    pub(crate) nuclei: NucleiFile,
    /// The largest grey level, where the files give it.
    pub(crate) white: Option<u16>,
}

/// The image of a field, with its annotated nuclei.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldImage {
    /// Columns.
    pub width: usize,
    /// Grey levels in row-major order; of colour images, the green channel.
    pub grey: Vec<u16>,
    /// Red and blue of a colour image.
    pub red_blue: Option<[Vec<u16>; 2]>,
    /// The grey level of a saturated pixel.
    pub white: u16,
    /// Annotated nuclei.
    pub nuclei: FieldNuclei,
}

impl FieldFile {
    /// Whether the nuclei are annotated, with points or masks.
    #[must_use]
    pub fn has_points(&self) -> bool {
        self.nuclei != NucleiFile::Unknown
    }

    /// Whether the nuclei have masks.
    #[must_use]
    pub fn has_masks(&self) -> bool {
        matches!(self.nuclei, NucleiFile::Labels(_))
    }

    /// Path of the image.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.image
    }

    /// Reads the image and the annotation. A 16-bit image does not give its saturation level: it is that of 12, 14 or
    /// 16 bits, the smallest that is not below the brightest pixel.
    ///
    /// # Errors
    /// If a file cannot be read, the masks differ in size from the image, or most points are outside the image.
    pub fn read(&self, limits: &Limits) -> Result<FieldImage, Error> {
        let image = LevelImage::read(&self.image, limits)?;
        let channel = if image.channels == 3 { GREEN } else { 0 };
        let plane = |channel: usize| image.levels.iter().skip(channel).step_by(image.channels).copied().collect();
        let grey: Vec<u16> = plane(channel);
        let red_blue = (image.channels == 3).then(|| [RED, BLUE].map(plane));
        let planes = red_blue.iter().flatten().chain([&grey]);
        let brightest = planes.flatten().copied().max().unwrap_or(0);
        let deep = || DEEP.map(white).into_iter().find(|w| *w >= brightest).unwrap_or(u16::MAX);
        let full = self.white.unwrap_or_else(|| if image.white == u16::MAX { deep() } else { image.white });
        let nuclei = match &self.nuclei {
            NucleiFile::Unknown => FieldNuclei::Unknown,
            NucleiFile::Points(path) => {
                let points = points(&bytes(path, TABLE_BYTES)?).map_err(Error::input(path))?;
                within(&points, [image.width, grey.len() / image.width.max(1)]).map_err(Error::input(path))?;
                FieldNuclei::Points(points)
            }
            NucleiFile::Labels(path) => {
                let labels = read_label_map(path, limits)?;
                same_size(&labels, [image.width, grey.len()]).map_err(Error::input(path))?;
                FieldNuclei::Labels(separate(labels, limits).map_err(Error::input(path))?)
            }
        };
        Ok(FieldImage { width: image.width, grey, red_blue, white: full.max(brightest), nuclei })
    }
}

/// Returns the fields of a folder that is not a data set, sorted by name.
pub(crate) fn files_in(folder: &Path) -> Result<Vec<FieldFile>, Error> {
    let images = match image_files(folder) {
        Err(Error::Input { problem: InputError::NoImages, .. }) if folder.join("images").is_dir() => {
            image_files(&folder.join("images"))?
        }
        other => other?,
    };
    let masks = if folder.join("masks").is_dir() { image_files(&folder.join("masks"))? } else { BTreeMap::new() };
    let table = folder.join(GROUPS);
    let mut groups = if table.exists() {
        parse(&table, &Limits { max_file_bytes: TABLE_BYTES, ..Limits::default() }, groups)?
    } else {
        BTreeMap::new()
    };
    let field = |(name, image): (String, PathBuf)| {
        let points = image.with_extension("csv");
        let nuclei = match masks.get(&name) {
            Some(mask) => NucleiFile::Labels(mask.clone()),
            None if points.exists() => NucleiFile::Points(points),
            None => NucleiFile::Unknown,
        };
        FieldFile {
            group: groups.remove(&name).unwrap_or_default(),
            name,
            pixel_um: None,
            slide: None,
            image,
            nuclei,
            white: None,
        }
    };
    Ok(images.into_iter().map(field).collect())
}

/// Gives each connected region of a binary mask a label. Label images are returned unchanged.
fn separate(labels: LabelMap, limits: &Limits) -> Result<Vec<u32>, InputError> {
    let first = labels.ids.iter().copied().find(|id| *id != 0);
    if labels.ids.iter().any(|id| *id != 0 && Some(*id) != first) {
        return Ok(labels.ids);
    }
    let mut ids = vec![0; labels.ids.len()];
    for (id, region) in (1..).zip(components(&labels, limits)?) {
        for run in region.mask.runs() {
            let row = run.y as usize * labels.width;
            ids[row + run.x0 as usize..row + run.x1 as usize].fill(id);
        }
    }
    Ok(ids)
}

/// Parses a table of points `y,x`, with or without a header.
fn points(bytes: &[u8]) -> Result<Vec<[f64; 2]>, InputError> {
    let mut points = Vec::new();
    for (line, [y, x]) in rows(bytes)? {
        let number = |text: &str| text.parse::<f64>().ok().filter(|v| v.is_finite());
        match (number(&y), number(&x)) {
            (Some(y), Some(x)) => points.push([x, y]),
            _ if line == 1 && y == "y" && x == "x" => {}
            _ => {
                return Err(InputError::Row {
                    line,
                    message: format!("found `{y},{x}`; expected two numbers: y,x in pixels"),
                });
            }
        }
    }
    Ok(points)
}

/// Checks that at most half of the points are outside the image. More indicate another image, or x before y; a few
/// outside the border are common.
fn within(points: &[[f64; 2]], image: [usize; 2]) -> Result<(), InputError> {
    let inside = |p: &[f64; 2]| (0..2).all(|axis| (-0.5..image[axis] as f64 - 0.5).contains(&p[axis]));
    let outside = points.iter().filter(|p| !inside(p)).count();
    let (count, [width, height]) = (points.len(), image);
    let what = format!(
        "{outside} of {count} points are outside the image of {width} x {height} pixels; expected the columns y,x in pixels"
    );
    InputError::unless(2 * outside <= count, what)
}

fn groups(bytes: &[u8]) -> Result<BTreeMap<String, String>, InputError> {
    let mut rows = rows(bytes)?.into_iter();
    match rows.next() {
        Some((_, header)) if header == GROUP_COLUMNS => Ok(rows.map(|(_, [frame, grade])| (frame, grade)).collect()),
        _ => Err(InputError::Row { line: 1, message: format!("expected the columns {}", GROUP_COLUMNS.join(",")) }),
    }
}

fn rows(bytes: &[u8]) -> Result<Vec<(u64, [String; 2])>, InputError> {
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(bytes);
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|e| InputError::broken("CSV", e))?;
        let line = record.position().map_or(0, csv::Position::line);
        let (Some(a), Some(b), 2) = (record.get(0), record.get(1), record.len()) else {
            return Err(InputError::Row { line, message: format!("{} values; expected 2", record.len()) });
        };
        rows.push((line, [a.trim_start_matches('\u{feff}').to_owned(), b.to_owned()]));
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn points_are_read_y_first_with_or_without_a_header() {
        assert_eq!(points(b"53,88\n73,1072\n").unwrap(), [[88.0, 53.0], [1072.0, 73.0]]);
        assert_eq!(points(b"y,x\n1.5,2\n").unwrap(), [[2.0, 1.5]]);
        assert_eq!(points(b"").unwrap(), [[0.0; 2]; 0]);
        for bad in ["1,2,3", "1", "a,b", "1,nan", "1,2\ny,x"] {
            assert!(matches!(points(bad.as_bytes()), Err(InputError::Row { .. })), "{bad}");
        }
    }

    #[test]
    fn points_outside_the_image_are_refused() {
        let image = [100, 50];
        assert_eq!(within(&[], image), Ok(()));
        assert_eq!(within(&[[99.4, 49.0], [-3.0, 2.0]], image), Ok(()));
        let refused = within(&[[10.0, 90.0], [-3.0, 2.0], [1.0, 1.0]], image).unwrap_err().to_string();
        assert!(refused.starts_with("2 of 3 points"), "{refused}");
    }

    #[test]
    fn groups_need_their_columns() {
        assert_eq!(
            groups(b"frame,grade\na,N\nb,H\n").unwrap(),
            BTreeMap::from([("a".into(), "N".into()), ("b".into(), "H".into())])
        );
        assert!(groups(b"a,N\n").is_err());
        assert!(groups(b"").is_err());
    }

    #[test]
    fn a_binary_mask_is_split_into_its_regions() {
        let limits = Limits::default();
        let map = |ids: &[u32]| LabelMap { width: 4, ids: ids.to_vec() };
        assert_eq!(separate(map(&[255, 255, 0, 255]), &limits).unwrap(), [1, 1, 0, 2]);
        assert_eq!(separate(map(&[7, 7, 0, 9]), &limits).unwrap(), [7, 7, 0, 9]);
        assert_eq!(separate(map(&[0; 4]), &limits).unwrap(), [0; 4]);
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_table_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..60), text in "[-0-9.,yx\\n \"]{0,40}") {
            for bytes in [&bytes[..], text.as_bytes()] {
                if let Ok(points) = points(bytes) {
                    prop_assert!(points.iter().flatten().all(|v| v.is_finite()));
                }
                let _ = groups(bytes);
            }
        }
    }
}

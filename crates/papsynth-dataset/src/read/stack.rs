//! Focus stacks: planes of the same size.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use super::file::{Limits, bytes};
use super::image::{decode, is_tiff};
use super::nucleus::image_files;
use super::raster::{Meaning, Raster, Samples};
use super::tiff;
use crate::error::{Error, InputError};

/// Largest number of pixels of all planes: 1 GiB in memory.
const MOST_PIXELS: u64 = 1 << 28;

/// A focus stack: planes of the same size, in the units of their files.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stack {
    /// Columns of each plane.
    pub width: usize,
    /// The planes, each in row-major order.
    pub planes: Vec<Vec<f32>>,
}

impl Stack {
    /// Reads a stack: a TIFF file of several pages, a folder of PNG, JPEG or TIFF files, or several of these files.
    /// Files of one folder are sorted by the [numbers in their names](natural_order).
    ///
    /// # Errors
    /// If a file cannot be read, is not a grey image within the limits, or differs in size from the first.
    pub fn read(paths: &[PathBuf], limits: &Limits) -> Result<Self, Error> {
        let mut files = Vec::new();
        for path in paths {
            if path.is_dir() {
                files.extend(image_files(path)?.into_values());
            } else {
                files.push(path.clone());
            }
        }
        files.sort_by(|a, b| a.parent().cmp(&b.parent()).then_with(|| natural_order(&name(a), &name(b))));
        let mut stack = Self::default();
        for file in &files {
            stack.add(&bytes(file, limits.max_file_bytes)?, limits).map_err(Error::input(file))?;
        }
        Ok(stack)
    }

    /// Decodes a stack in one file.
    ///
    /// # Errors
    /// If the bytes are not complete grey images of the same size within the limits.
    pub fn decode(bytes: &[u8], limits: &Limits) -> Result<Self, InputError> {
        let mut stack = Self::default();
        stack.add(bytes, limits)?;
        Ok(stack)
    }

    /// Rows of each plane.
    #[must_use]
    pub fn height(&self) -> usize {
        self.planes.first().map_or(0, |plane| plane.len() / self.width.max(1))
    }

    fn add(&mut self, bytes: &[u8], limits: &Limits) -> Result<(), InputError> {
        if is_tiff(bytes) {
            tiff::pages(bytes, limits, &mut |raster| self.push(raster))
        } else {
            self.push(decode(bytes, limits, Meaning::Brightness)?)
        }
    }

    fn push(&mut self, raster: Raster) -> Result<(), InputError> {
        let width = raster.width;
        #[expect(clippy::cast_precision_loss, reason = "sensors have at most 24 bits")]
        let plane: Vec<f32> = match raster.grey()? {
            Samples::U8(samples) => samples.into_iter().map(f32::from).collect(),
            Samples::U16(samples) => samples.into_iter().map(f32::from).collect(),
            Samples::U32(samples) => samples.into_iter().map(|v| v as f32).collect(),
            Samples::F32(samples) => samples,
        };
        if plane.iter().any(|v| !v.is_finite()) {
            return Err(InputError::samples("infinite or NaN samples", "finite grey samples"));
        }
        let (found, first) = ([width, plane.len() / width.max(1)], [self.width, self.height()]);
        if !self.planes.is_empty() && found != first {
            return Err(InputError::unfit(format!(
                "plane {} is {} x {} pixels, the first {} x {}; expected planes of the same size",
                self.planes.len(),
                found[0],
                found[1],
                first[0],
                first[1]
            )));
        }
        if (self.planes.len() as u64 + 1) * plane.len() as u64 > MOST_PIXELS {
            return Err(InputError::unfit(format!(
                "with this file the stack has more than {MOST_PIXELS} pixels; crop the images, or use fewer planes"
            )));
        }
        self.width = width;
        self.planes.push(plane);
        Ok(())
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Compares names with numbers in them by value: `plane2` sorts before `plane10`.
#[must_use]
pub fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    loop {
        let ((a_head, a_tail), (b_head, b_tail)) = (split(a_rest), split(b_rest));
        let digits = |s: &str| s.starts_with(|c: char| c.is_ascii_digit());
        let order = if digits(a_head) && digits(b_head) {
            let (a_digits, b_digits) = (a_head.trim_start_matches('0'), b_head.trim_start_matches('0'));
            a_digits.len().cmp(&b_digits.len()).then_with(|| a_digits.cmp(b_digits))
        } else {
            a_head.cmp(b_head)
        };
        if order.is_ne() {
            return order;
        }
        if a_tail.is_empty() || b_tail.is_empty() {
            // Names that differ only in leading zeros.
            return a_tail.len().cmp(&b_tail.len()).then_with(|| a.cmp(b));
        }
        (a_rest, b_rest) = (a_tail, b_tail);
    }
}

/// Splits a text after its leading run of digits or of other characters.
fn split(text: &str) -> (&str, &str) {
    let digits = text.starts_with(|c: char| c.is_ascii_digit());
    let end = text.find(|c: char| c.is_ascii_digit() != digits).unwrap_or(text.len());
    text.split_at(end)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::io;

    use ::tiff::encoder::{TiffEncoder, TiffValue, colortype};

    use super::*;
    use crate::support::Scratch;

    fn pages<C: colortype::ColorType>(pages: &[&[C::Inner]], width: u32) -> Vec<u8>
    where
        [C::Inner]: TiffValue,
    {
        let mut out = io::Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut out).unwrap();
        for page in pages {
            let height = u32::try_from(page.len() / C::BITS_PER_SAMPLE.len()).unwrap() / width;
            encoder.write_image::<C>(width, height, page).unwrap();
        }
        out.into_inner()
    }

    fn decode(bytes: &[u8]) -> Result<Stack, InputError> {
        Stack::decode(bytes, &Limits::default())
    }

    #[test]
    fn pages_of_every_depth_are_planes() {
        let eight = decode(&pages::<colortype::Gray8>(&[&[0, 255], &[3, 4], &[5, 6]], 2)).unwrap();
        assert_eq!(eight, Stack { width: 2, planes: vec![vec![0.0, 255.0], vec![3.0, 4.0], vec![5.0, 6.0]] });
        assert_eq!(eight.height(), 1);
        let deep = decode(&pages::<colortype::Gray16>(&[&[1, 65_535]], 1)).unwrap();
        assert_eq!(deep, Stack { width: 1, planes: vec![vec![1.0, 65_535.0]] });
        let float = decode(&pages::<colortype::Gray32Float>(&[&[0.25, -1.5], &[0.5, 1e9]], 2)).unwrap();
        assert_eq!(float.planes, [[0.25, -1.5], [0.5, 1e9]]);
        // A colour file with grey pixels.
        assert_eq!(decode(&pages::<colortype::RGB8>(&[&[7, 7, 7, 9, 9, 9]], 2)).unwrap().planes, [[7.0, 9.0]]);
    }

    #[test]
    fn invalid_stacks_are_refused() {
        let nan = pages::<colortype::Gray32Float>(&[&[0.5, f32::NAN]], 2);
        assert!(matches!(decode(&nan), Err(InputError::Samples { .. })));
        assert!(matches!(decode(&pages::<colortype::Gray64Float>(&[&[0.5]], 1)), Err(InputError::Samples { .. })));
        assert!(matches!(decode(&pages::<colortype::RGB8>(&[&[7, 7, 8]], 1)), Err(InputError::NotGrey { .. })));
        assert!(matches!(decode(b"no image"), Err(InputError::Format)));
        let good = pages::<colortype::Gray8>(&[&[0, 255], &[3, 4]], 2);
        for end in 0..good.len() {
            // A truncated file is refused, or all of its pages are complete.
            if let Ok(stack) = decode(&good[..end]) {
                assert!(stack.planes.iter().all(|plane| plane.len() == 2));
            }
        }
        let one = Limits { max_pixels: 1, ..Limits::default() };
        assert!(matches!(Stack::decode(&good, &one), Err(InputError::ImageSize { .. })));
    }

    #[test]
    fn files_of_a_folder_are_sorted_by_number() {
        let scratch = Scratch::new("stack");
        for (name, value) in [("z10", 10), ("z9", 9), ("z2", 2)] {
            fs::write(scratch.join(&format!("{name}.tif")), pages::<colortype::Gray8>(&[&[value]], 1)).unwrap();
        }
        let planes = |paths: &[PathBuf]| Stack::read(paths, &Limits::default()).map(|stack| stack.planes.concat());
        assert_eq!(planes(&[scratch.path().to_owned()]).unwrap(), [2.0, 9.0, 10.0]);
        assert_eq!(planes(&["z10.tif", "z2.tif"].map(|name| scratch.join(name))).unwrap(), [2.0, 10.0]);
        fs::write(scratch.join("z11.tif"), pages::<colortype::Gray8>(&[&[1, 2]], 1)).unwrap();
        let error = planes(&[scratch.path().to_owned()]).unwrap_err().to_string();
        assert!(
            error.ends_with("z11.tif: plane 3 is 1 x 2 pixels, the first 1 x 1; expected planes of the same size"),
            "{error}"
        );
        assert!(planes(&[scratch.join("missing.tif")]).unwrap_err().to_string().contains("no such file"));
    }

    #[test]
    fn numbers_in_names_are_compared_by_value() {
        let mut names = ["b", "a10", "a9", "a", "a09", "10", "9", "a9b2", "a9b10"];
        names.sort_by(|a, b| natural_order(a, b));
        assert_eq!(names, ["9", "10", "a", "a09", "a9", "a9b2", "a9b10", "a10", "b"]);
        for (a, b) in names.iter().flat_map(|a| names.iter().map(move |b| (a, b))) {
            assert_eq!(natural_order(a, b), natural_order(b, a).reverse());
        }
    }
}

//! Images for tests.

use std::fs;
use std::ops::Deref;
use std::path::{Path, PathBuf};

use papsynth_dataset::write_png;

use crate::design::Answer;
use crate::plan::Folders;
use crate::saved::Exposure;
use crate::session::Session;

/// A temporary folder of one test.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    pub(crate) fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("papsynth-study-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Deref for Scratch {
    type Target = Path;

    fn deref(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Writes an 8-bit PNG file and creates its folder.
pub(crate) fn write_image(path: &Path, number: u32, side: [u32; 2]) {
    exposed(path, number, side, 230, 8);
}

/// Writes an image of glass with dark discs at positions that depend on the number.
pub(crate) fn exposed(path: &Path, number: u32, [width, height]: [u32; 2], glass: u32, bits: u32) {
    let disc = |x: u32, y: u32| {
        let (dx, dy) = ((x + 17 * number) % 60, (y + 29 * number) % 60);
        dx.abs_diff(30).pow(2) + dy.abs_diff(30).pow(2) < 400
    };
    let level = |x, y| if disc(x, y) { glass / 2 + number % 7 } else { glass - (x + y) % 3 };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let levels: Vec<u16> = pixels.map(|(x, y)| level(x, y).try_into().unwrap()).collect();
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_png(path, &levels, width as usize, 1, bits, 0.25).unwrap();
}

/// Writes the folders `real`, with darker exposure, and `synthetic`.
pub(crate) fn study_folders(scratch: &Scratch, real: u32, synthetic: u32) -> Folders {
    for (side, count, glass, first) in [("real", real, 200, 0), ("synthetic", synthetic, 230, 100)] {
        for k in 0..count {
            exposed(&scratch.join(format!("{side}/f{k}.png")), first + k, [300, 240], glass, 8);
        }
    }
    Folders::new(&scratch.join("real"), &scratch.join("synthetic")).unwrap()
}

pub(crate) const EXPOSURE: Exposure =
    Exposure { exposure_ms: 2000.0, frames: 120, longest_frame_ms: 16.7, pixel_ratio: 1.0 };

/// Answers the current trial.
pub(crate) fn go_on(session: &mut Session, answer: Answer) {
    let name = session.state().patches[0].clone();
    session.patch(&name).unwrap();
    session.shown(&name, EXPOSURE).unwrap();
    session.answer(&name, answer, 500.0).unwrap();
}

//! Pictures to test with.

use std::fs;
use std::path::{Path, PathBuf};

use crate::plan::Folders;

/// A folder of this test alone, removed at its end.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    pub(crate) fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("papsynth-study-{}-{name}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    pub(crate) fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Glass of one level with dark discs on it, at places that depend on the number.
fn levels(number: u32, width: u32, height: u32, glass: u32) -> Vec<u32> {
    let disc = |x: u32, y: u32| {
        let (dx, dy) = ((x + 17 * number) % 60, (y + 29 * number) % 60);
        dx.abs_diff(30).pow(2) + dy.abs_diff(30).pow(2) < 400
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    pixels.map(|(x, y)| if disc(x, y) { glass / 2 + number % 7 } else { glass - (x + y) % 3 }).collect()
}

fn encode(bytes: &[u8], depth: png::BitDepth, width: u32, height: u32) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(bytes).unwrap();
    writer.finish().unwrap();
    out
}

/// A PNG of 8 bits.
pub(crate) fn picture(number: u32, width: u32, height: u32) -> Vec<u8> {
    exposed(number, width, height, 230)
}

fn exposed(number: u32, width: u32, height: u32, glass: u32) -> Vec<u8> {
    let bytes: Vec<u8> = levels(number, width, height, glass).into_iter().map(|l| u8::try_from(l).unwrap()).collect();
    encode(&bytes, png::BitDepth::Eight, width, height)
}

/// A PNG of 16 bits in a folder that is made.
pub(crate) fn write_deep(path: &Path, width: u32, height: u32, glass: u32) {
    let levels = levels(1, width, height, glass);
    let bytes: Vec<u8> = levels.into_iter().flat_map(|l| u16::try_from(l).unwrap().to_be_bytes()).collect();
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, encode(&bytes, png::BitDepth::Sixteen, width, height)).unwrap();
}

/// Folders `real`, whose fields are exposed darker, and `synthetic`.
pub(crate) fn study_folders(scratch: &Scratch, real: u32, synthetic: u32) -> Folders {
    for (side, count, glass, first) in [("real", real, 200, 0), ("synthetic", synthetic, 230, 100)] {
        fs::create_dir_all(scratch.join(side)).unwrap();
        for k in 0..count {
            fs::write(scratch.join(&format!("{side}/f{k}.png")), exposed(first + k, 300, 240, glass)).unwrap();
        }
    }
    Folders::new(&scratch.join("real"), &scratch.join("synthetic")).unwrap()
}

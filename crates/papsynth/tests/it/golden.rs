//! Golden images of every stage and of two complete fields, each with its recipe.
//!
//! `cargo xtask golden` runs this test, `cargo xtask golden --bless` rewrites the images.
//!
//! Tolerance: no pixel may differ by more than 1 grey level, and at most 1 % of the pixels may differ. Optimised
//! routines may round differently; `fixtures/hashes.txt` covers every bit.

#![expect(clippy::cast_possible_truncation, reason = "a small program with small numbers")]

use std::path::{Path, PathBuf};

use image::ColorType;
use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use papsynth::{Engine, Inputs};

/// Largest accepted difference of a pixel, grey levels.
const MAX_DIFFERENCE: u8 = 1;
/// Largest accepted fraction of differing pixels.
const MAX_FRACTION: f64 = 0.01;
/// Seed of all golden images.
const SEED: u64 = 20_150_624;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/golden")
}

#[test]
fn every_stage_matches_its_golden_image() {
    let mut recipes: Vec<PathBuf> = std::fs::read_dir(folder())
        .expect("fixtures/golden exists")
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    recipes.sort();
    assert!(recipes.len() >= 10, "golden recipes are missing");
    let bless = std::env::var_os("PAPSYNTH_BLESS").is_some();
    let failures: Vec<String> = recipes.iter().filter_map(|recipe| compare(recipe, bless).err()).collect();
    assert!(failures.is_empty(), "{} of {} images differ:\n{}", failures.len(), recipes.len(), failures.join("\n"));
}

fn compare(recipe_path: &Path, bless: bool) -> Result<(), String> {
    let name = recipe_path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let text = std::fs::read_to_string(recipe_path).map_err(|e| format!("{name}: {e}"))?;
    let recipe: Recipe = toml::from_str(&text).map_err(|e| format!("{name}: {e}"))?;
    let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).map_err(|e| format!("{name}: {e}"))?;
    let frame = engine.frame(Key { seed: SEED, index: 0 }).map_err(|e| format!("{name}: {e}"))?;
    let view = frame.finished.scene.view;
    let actual: Vec<u8> = frame.planes[0].grey.iter().map(|g| u8::try_from(*g).unwrap_or(u8::MAX)).collect();
    let (width, height) = (view.width as u32, view.height as u32);
    let golden = recipe_path.with_extension("png");
    let colour = match frame.planes[0].channels {
        1 => ColorType::L8,
        _ => ColorType::Rgb8,
    };
    let save = |path: &Path, pixels: &[u8]| {
        image::save_buffer(path, pixels, width, height, colour).map_err(|e| format!("{name}: {e}"))
    };
    if bless {
        return save(&golden, &actual);
    }
    let expected = image::open(&golden).map_err(|e| format!("{name}: {e}"))?;
    if (expected.width(), expected.height(), expected.color()) != (width, height, colour) {
        return Err(format!(
            "{name}: size or colour type differs from the golden image: {width} x {height} {colour:?}"
        ));
    }
    let expected = expected.into_bytes();
    let difference: Vec<u8> = actual.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).collect();
    let largest = difference.iter().copied().max().unwrap_or(0);
    let differing = difference.iter().filter(|d| **d > 0).count();
    if largest <= MAX_DIFFERENCE && differing as f64 <= MAX_FRACTION * difference.len() as f64 {
        return Ok(());
    }
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("golden");
    std::fs::create_dir_all(&out).map_err(|e| format!("{name}: {e}"))?;
    save(&out.join(format!("{name}.actual.png")), &actual)?;
    let shown: Vec<u8> = difference.iter().map(|d| d.saturating_mul(32)).collect();
    save(&out.join(format!("{name}.difference.png")), &shown)?;
    Err(format!("{name}: {differing} pixels differ, by at most {largest} grey levels; see {}", out.display()))
}

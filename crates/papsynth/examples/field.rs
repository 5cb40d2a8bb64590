//! Renders one image of a preset or recipe file to a PNG: a minimal program that uses the engine.
//!
//! ```sh
//! cargo run --release -p papsynth --example field -- lbc 7 target/field.png
//! ```

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small program with small numbers")]

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe};
use papsynth::{Engine, Inputs};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_else(|| "lbc".to_owned());
    let index = arguments.next().map_or(Ok(0), |text| text.parse())?;
    let out = arguments.next().unwrap_or_else(|| "target/field.png".to_owned());
    let recipe: Recipe = match Preset::by_name(&name) {
        Some(preset) => preset.recipe(),
        None => toml::from_str(&std::fs::read_to_string(&name)?)?,
    };
    let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default())?;
    let frame = engine.frame(Key { seed: 1, index })?;
    let view = frame.finished.scene.view;
    let scale =
        f32::from(u8::MAX) / f32::from(frame.planes.iter().flat_map(|p| &p.grey).copied().max().unwrap_or(1).max(255));
    let pixels: Vec<u8> = frame.planes[0].grey.iter().map(|grey| (f32::from(*grey) * scale) as u8).collect();
    let (width, height) = (u32::try_from(view.width)?, u32::try_from(view.height)?);
    let colour = if frame.planes[0].channels == 3 { image::ColorType::Rgb8 } else { image::ColorType::L8 };
    image::save_buffer(&out, &pixels, width, height, colour)?;
    eprintln!("{out}: {width} x {height}, {} rows of ground truth", frame.finished.truth.objects.len());
    Ok(())
}

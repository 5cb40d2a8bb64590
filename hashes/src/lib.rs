//! Hashes of the output of small recipes. `fixtures/hashes.txt` contains the expected values for every machine.

#![forbid(unsafe_code)]

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{
    CameraPreset, Clusters, Colour, Imaging, Layout, LightSection, Microscope, Mixing, Number, Optics, Preset, Recipe,
    Rendition,
};
use papsynth::truth::Group;
use papsynth::{Engine, Frame, Inputs};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use sha2::{Digest, Sha256};
use steerable_texture::{PyramidParams, Statistics, SynthesisParams, Synthesizer, TextureParams};

/// Seed of all recipes.
const SEED: u64 = 20_150_624;

/// Returns one line per recipe and stage, `recipe stage hash`, in order of computation. The first different stage
/// locates a deviation.
///
/// # Errors
/// If a recipe is invalid.
pub fn lines() -> Result<String, Box<dyn core::error::Error>> {
    let mut lines = String::new();
    for (name, recipe) in recipes() {
        let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default())?;
        let frame = engine.frame(Key { seed: SEED, index: 1 })?;
        for (stage, hash) in hashes(&frame) {
            lines.push_str(&format!("{name} {stage} {hash}\n"));
        }
    }
    for (stage, hash) in texture()? {
        lines.push_str(&format!("texture {stage} {hash}\n"));
    }
    Ok(lines)
}

/// Returns hashes of the statistics of a small texture and of an image synthesized from them.
fn texture() -> Result<[(&'static str, String); 2], steerable_texture::Error> {
    const SIDE: usize = 64;
    let pyramid = PyramidParams { scales: 3, orientations: 4 };
    let params = SynthesisParams { texture: TextureParams { pyramid, neighbourhood: 7 }, iterations: 4 };
    let source: Vec<f32> = (0..SIDE * SIDE).map(|i| ((i % SIDE * (i / SIDE)) % 11) as f32).collect();
    let mask: Vec<f32> = (0..SIDE * SIDE).map(|i| if i % SIDE < 50 { 1.0 } else { 0.0 }).collect();
    let statistics = Statistics::measure(&source, SIDE, Some(&mask), &params.texture)?;
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let image = Synthesizer::new(SIDE, SIDE, &params)?.synthesize(&statistics, &mut rng)?;
    let pixels = Hash::default().bytes(image.iter().map(|v| v.to_bits().to_le_bytes()));
    Ok([("statistics", Hash::default().text(&format!("{statistics:?}")).hex()), ("pixels", pixels.hex())])
}

/// Returns small fields that cover every model of light, colour and stack, and every kind of object.
fn recipes() -> Vec<(&'static str, Recipe)> {
    let mut recipes: Vec<(&str, Recipe)> = Preset::ALL.map(|preset| (preset.name(), small(preset, [192, 144]))).into();
    let mut stack = small(Preset::HighGrade, [128, 96]);
    stack.focus.planes = Number::Fixed(3.0);
    stack.camera = CameraPreset::Scmos.camera();
    recipes.push(("stack", stack));

    let mut colour = small(Preset::Inflamed, [128, 96]);
    colour.light = in_colour();
    recipes.push(("colour", colour));

    let mut jpeg = small(Preset::Lbc, [128, 96]);
    jpeg.light = in_colour();
    jpeg.camera.jpeg_quality = Number::Fixed(85.0);
    recipes.push(("jpeg", jpeg));

    let mut abbe = small(Preset::Sparse, [64, 48]);
    if let Optics::BrightField(Microscope { imaging, directions, .. }) = &mut abbe.optics {
        *imaging = Imaging::Abbe;
        *directions = Number::Fixed(5.0);
    }
    recipes.push(("abbe", abbe));
    recipes
}

fn in_colour() -> LightSection {
    LightSection::Colour(Colour {
        lamp_k: Number::Fixed(3200.0),
        mixing: Mixing::Spectral,
        chromatic_um: Number::Fixed(0.3),
        rendition: Rendition::Display,
    })
}

/// Returns a preset on a field so small that a few cells fill it.
fn small(preset: Preset, [width, height]: [u16; 2]) -> Recipe {
    let mut recipe = preset.recipe();
    recipe.field.width_px = Number::Fixed(width.into());
    recipe.field.height_px = Number::Fixed(height.into());
    for mix in recipe.cells.values_mut() {
        mix.count = Number::uniform(1.0, 2.0).into();
    }
    if let Layout::Clusters(Clusters { radius_um, .. }) = &mut recipe.layout {
        *radius_um = Number::Fixed(15.0);
    }
    recipe.slide.spacing_um = Number::Fixed(4.0);
    recipe
}

/// Returns SHA-256 hashes of all parts of a frame.
fn hashes(frame: &Frame) -> [(&'static str, String); 5] {
    let Frame { planes, finished } = frame;
    // Debug output contains every digit of every number, as do the tables.
    let scene = Hash::default().text(&format!("{:?}", finished.scene));
    let truth = Hash::default().text(&format!("{:?}", finished.truth));
    let labels = Group::ALL.iter().fold(Hash::default(), |hash, &group| {
        hash.bytes(finished.truth.labels(group).ids.iter().map(|id| id.to_le_bytes()))
    });
    let labels = labels.bytes(finished.truth.layers().iter().map(|layer| layer.to_le_bytes()));
    let light = planes.iter().fold(Hash::default(), |hash, plane| {
        hash.bytes(plane.noise_free.iter().map(|level| level.to_bits().to_le_bytes()))
    });
    let light = light.bytes(finished.all_in_focus.iter().map(|level| level.to_bits().to_le_bytes()));
    let grey = planes
        .iter()
        .fold(Hash::default(), |hash, plane| hash.bytes(plane.grey.iter().map(|level| level.to_le_bytes())));
    [("scene", scene), ("truth", truth), ("labels", labels), ("noise-free", light), ("pixels", grey)]
        .map(|(stage, hash)| (stage, hash.hex()))
}

#[derive(Default)]
struct Hash(Sha256);

impl Hash {
    fn bytes<const N: usize>(mut self, numbers: impl Iterator<Item = [u8; N]>) -> Self {
        numbers.for_each(|number| self.0.update(number));
        self
    }

    fn text(mut self, text: &str) -> Self {
        self.0.update(text);
        self
    }

    fn hex(self) -> String {
        self.0.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

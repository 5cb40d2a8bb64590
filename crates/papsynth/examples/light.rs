//! Draws images that show the optics: `light NAME OUT.png`, NAME one of focus, halo, colour.
//!
//! focus: a nucleus at five stage positions, with the product model (the default), Abbe's integration over the source,
//! and the paper's Gaussians. halo: a refracting speck through focus, with the same models. colour: a field in colour.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small program with small numbers")]

use image::{GrayImage, RgbImage};
use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{
    Border, Colour, Debris, Illumination, Imaging, Layout, LightSection, Mixing, PhotonNoise, Preset, Recipe, Rendition,
};
use papsynth::scene::{Body, Scene, SceneOptics};
use papsynth::{Engine, Error, Inputs, Threads};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Stage positions, µm.
const STAGES_UM: [f64; 5] = [-4.0, -2.0, 0.0, 2.0, 4.0];

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_default();
    let out = arguments.next().unwrap_or_else(|| format!("target/light-{name}.png"));
    match name.as_str() {
        "focus" => through_focus(&nucleus(), 48, 4)?.save(out)?,
        "halo" => through_focus(&speck(), 32, 8)?.save(out)?,
        "colour" => colour()?.save(out)?,
        _ => return Err("usage: light NAME OUT.png, NAME one of focus, halo, colour".into()),
    }
    Ok(())
}

/// Returns a recipe for a field of a few micrometres without noise, shading or debris.
fn bare() -> Recipe {
    let mut recipe = Preset::Sparse.recipe();
    recipe.field.width_px = 64.0.into();
    recipe.field.height_px = 64.0.into();
    recipe.layout = Layout::Uniform {};
    recipe.slide.spacing_um = 0.0.into();
    recipe.slide.depth_um = 0.0.into();
    recipe.slide.stacking_um = 0.0.into();
    recipe.cells.clear();
    recipe.debris = Debris::none();
    recipe.background.illumination = Illumination::Border(Border { exponent: 0.0.into() });
    recipe.background.texture = 0.0.into();
    recipe.background.level = 0.8.into();
    recipe.camera.photon_noise = PhotonNoise::Off;
    recipe.camera.read_noise_e = 0.0.into();
    recipe
}

fn scene(recipe: &Recipe) -> Outcome<(Engine, Scene)> {
    let engine = Engine::new(recipe, &Model::builtin(), &Inputs::default())?;
    let mut scene = engine.scene(Key { seed: 2015, index: 1 })?;
    for object in &mut scene.objects {
        (object.centre_um, object.depth_um) = ([8.0, 8.0], 0.0);
        if let Body::Cell(cell) = &mut object.body {
            cell.nucleus.off_centre = [0.0, 0.0];
        }
    }
    scene.planes_um = STAGES_UM.to_vec();
    Ok((engine, scene))
}

fn nucleus() -> Recipe {
    let mut recipe = bare();
    let mut mix = Preset::Sparse.recipe().cells["intermediate"].clone();
    mix.count = 1.0.into();
    recipe.cells.insert("intermediate".to_owned(), mix);
    recipe.nucleus.pyknotic = 0.0.into();
    recipe
}

fn speck() -> Recipe {
    let mut recipe = bare();
    recipe.debris.speckles.count = 1.0.into();
    recipe.debris.speckles.dilations = 2.0.into();
    recipe.debris.speckles.absorbance = 0.05.into();
    recipe.debris.speckles.phase_rad = 0.5.into();
    recipe
}

/// Draws the planes in columns and the models (product, Abbe, Gaussian) in rows, cropped to the central `pixels`.
fn through_focus(recipe: &Recipe, pixels: u32, zoom: u32) -> Outcome<GrayImage> {
    const GAP: u32 = 4;
    let (engine, scene) = scene(recipe)?;
    let with = |imaging: Imaging| {
        let mut scene = scene.clone();
        if let SceneOptics::BrightField(microscope) = &mut scene.optics {
            (microscope.imaging, microscope.directions, microscope.stray_light) = (imaging, 128, 0.0);
        }
        scene
    };
    let gaussian = SceneOptics::Gaussian { sigma_xy_um: 0.225, sigma_z_um_per_um: 0.25 };
    let rows = [with(Imaging::Product), with(Imaging::Abbe), Scene { optics: gaussian, ..scene.clone() }];
    let side = pixels * zoom;
    let columns = STAGES_UM.len() as u32;
    let mut sheet = GrayImage::from_pixel(columns * (side + GAP) - GAP, 3 * (side + GAP) - GAP, image::Luma([255]));
    for (row, scene) in (0..).zip(rows) {
        let mut column = 0;
        engine.image::<Error>(scene, Threads::All, |plane| {
            let grey = |x: u32, y: u32| plane.grey[(y as usize) * 64 + x as usize].min(255) as u8;
            let whole = GrayImage::from_fn(64, 64, |x, y| image::Luma([grey(x, y)]));
            let middle = image::imageops::crop_imm(&whole, 32 - pixels / 2, 32 - pixels / 2, pixels, pixels).to_image();
            let large = image::imageops::resize(&middle, side, side, image::imageops::FilterType::CatmullRom);
            let (x, y) = (i64::from(column * (side + GAP)), i64::from(row * (side + GAP)));
            image::imageops::replace(&mut sheet, &large, x, y);
            column += 1;
            Ok(())
        })?;
    }
    // Half the size shows the same in a quarter of the bytes.
    let (width, height) = (sheet.width() / 2, sheet.height() / 2);
    Ok(image::imageops::resize(&sheet, width, height, image::imageops::FilterType::Triangle))
}

fn colour() -> Outcome<RgbImage> {
    let mut recipe = Preset::Lbc.recipe();
    recipe.field.width_px = 1000.0.into();
    recipe.field.height_px = 620.0.into();
    for mix in recipe.cells.values_mut() {
        mix.count = 8.0.into();
    }
    recipe.light = LightSection::Colour(Colour {
        lamp_k: 3200.0.into(),
        mixing: Mixing::Spectral,
        chromatic_um: 0.3.into(),
        rendition: Rendition::Display,
    });
    let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default())?;
    let frame = engine.frame(Key { seed: 2015, index: 5 })?;
    // Without noise, which is invisible at this size and would enlarge the PNG.
    let rgb: Vec<u8> = frame.planes[0].noise_free.iter().map(|level| (level + 0.5).min(255.0) as u8).collect();
    let whole = RgbImage::from_raw(1000, 620, rgb).ok_or("the image has another size")?;
    Ok(image::imageops::resize(&whole, 500, 310, image::imageops::FilterType::Triangle))
}

//! Redraws figures of the paper with synthetic images: `figures NUMBER OUT.png`, NUMBER one of 1, 5, 7, 8, 9, 12, 13.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small program with small numbers")]

use image::GrayImage;
use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Band, CellMix, Chromatin, Clusters, Debris, Layout, Number, PhotonNoise, Preset, Recipe};
use papsynth::scene::ObjectKind;
use papsynth::truth::{ObjectTruth, Part};
use papsynth::{Engine, Frame, Inputs};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1);
    let number = arguments.next().unwrap_or_default();
    let out = arguments.next().unwrap_or_else(|| format!("target/figure{number}.png"));
    let figure = match number.as_str() {
        "1" => debris()?,
        "5" => chromatin()?,
        "7" => detail()?,
        "8" => layouts()?,
        "9" => leukocytes()?,
        "12" => complete_field(Preset::Lbc, 4)?,
        "13" => high_grade()?,
        _ => return Err("usage: figures NUMBER OUT.png, NUMBER one of 1, 5, 7, 8, 9, 12, 13".into()),
    };
    figure.save(&out)?;
    Ok(())
}

fn frame(recipe: &Recipe, index: u64) -> Outcome<Frame> {
    let engine = Engine::new(recipe, &Model::builtin(), &Inputs::default())?;
    Ok(engine.frame(Key { seed: 2015, index })?)
}

fn to_image(frame: &Frame) -> GrayImage {
    let view = frame.finished.scene.view;
    let grey = |x: u32, y: u32| frame.planes[0].grey[y as usize * view.width + x as usize].min(255) as u8;
    GrayImage::from_fn(view.width as u32, view.height as u32, |x, y| image::Luma([grey(x, y)]))
}

/// Returns an enlarged square around the centre of an object.
fn crop(frame: &Frame, object: &ObjectTruth, side: u32, zoom: u32) -> GrayImage {
    let whole = to_image(frame);
    let [x, y] = object.amodal.centroid().unwrap_or_default();
    let corner =
        |middle: f64, length: u32| ((middle - f64::from(side) / 2.0).max(0.0) as u32).min(length.saturating_sub(side));
    let (x, y) = (corner(x, whole.width()), corner(y, whole.height()));
    let cut = image::imageops::crop_imm(&whole, x, y, side.min(whole.width()), side.min(whole.height())).to_image();
    image::imageops::resize(&cut, cut.width() * zoom, cut.height() * zoom, image::imageops::FilterType::CatmullRom)
}

/// Arranges images in rows of `columns`.
fn sheet(images: &[GrayImage], columns: u32) -> GrayImage {
    const GAP: u32 = 6;
    let (width, height) = images.iter().fold((1, 1), |(w, h), p| (p.width().max(w), p.height().max(h)));
    let rows = (images.len() as u32).div_ceil(columns);
    let mut sheet =
        GrayImage::from_pixel(columns * (width + GAP) + GAP, rows * (height + GAP) + GAP, image::Luma([255]));
    for (i, image) in (0_u32..).zip(images) {
        let (x, y) = (GAP + i % columns * (width + GAP), GAP + i / columns * (height + GAP));
        image::imageops::replace(&mut sheet, image, i64::from(x), i64::from(y));
    }
    sheet
}

/// Returns a recipe for an empty field.
fn empty() -> Recipe {
    let mut recipe = Preset::Lbc.recipe();
    recipe.cells.clear();
    recipe.debris = Debris::none();
    recipe.slide.depth_um = 0.0.into();
    recipe.slide.stacking_um = 0.0.into();
    recipe.layout = Layout::Uniform {};
    recipe.field.width_px = 480.0.into();
    recipe.field.height_px = 360.0.into();
    recipe
}

fn with_cells(mut recipe: Recipe, class: &str, count: f64) -> Recipe {
    recipe.cells.insert(class.to_owned(), CellMix { count: count.into(), ..CellMix::default() });
    recipe
}

fn of_kind(frame: &Frame, kind: ObjectKind) -> Vec<&ObjectTruth> {
    frame.finished.truth.objects.iter().filter(|o| o.kind == kind && !o.truncated).collect()
}

/// Fig. 1: bacilli, leukocytes, specks and objects out of focus, a row each.
fn debris() -> Outcome<GrayImage> {
    let mut images = Vec::new();
    for kind in [ObjectKind::Bacillus, ObjectKind::Leukocyte, ObjectKind::Speckle, ObjectKind::OutOfFocus] {
        for index in 0..5 {
            let mut recipe = empty();
            match kind {
                ObjectKind::Bacillus => {
                    recipe.debris.bacilli.clusters = 2.0.into();
                    recipe.debris.bacilli.on_cells = 0.0.into();
                }
                ObjectKind::Leukocyte => recipe.debris.leukocytes.clusters = 3.0.into(),
                ObjectKind::Speckle => recipe.debris.speckles.count = 80.0.into(),
                _ => {
                    recipe.debris.out_of_focus.count = 2.0.into();
                    recipe.debris.out_of_focus.absorbance = Number::uniform(0.1, 0.3);
                }
            }
            let frame = frame(&recipe, index)?;
            let objects = of_kind(&frame, kind);
            let chosen =
                objects.first().copied().or(frame.finished.truth.objects.first()).ok_or("nothing was drawn")?;
            images.push(crop(&frame, chosen, 110, 2));
        }
    }
    Ok(sheet(&images, 5))
}

/// Fig. 5: top, textures from the spectrum of a class; bottom, nuclei quilted from three such donors each.
fn chromatin() -> Outcome<GrayImage> {
    let mut images = Vec::new();
    for chromatin in [Chromatin::Field, Chromatin::Quilt] {
        for index in 0..4 {
            let mut recipe = with_cells(empty(), "intermediate", 1.0);
            recipe.nucleus.chromatin = chromatin;
            recipe.nucleus.pyknotic = 0.0.into();
            let frame = frame(&recipe, index)?;
            let nucleus = frame.finished.truth.objects.iter().find(|o| o.part == Part::Nucleus).ok_or("no nucleus")?;
            images.push(crop(&frame, nucleus, 56, 4));
        }
    }
    Ok(sheet(&images, 4))
}

/// Fig. 7: low-frequency noise, flecks, cytoskeleton, and a cell with all three.
fn detail() -> Outcome<GrayImage> {
    let mut images = Vec::new();
    for level in 0..4 {
        let mut recipe = with_cells(empty(), "intermediate", 1.0);
        let strength = |on: bool, value: f64| Number::Fixed(if on { value } else { 0.0 });
        recipe.camera.photon_noise = PhotonNoise::Off;
        recipe.camera.read_noise_e = 0.0.into();
        recipe.cytoplasm.clouds = strength(level == 0 || level == 3, 0.25);
        recipe.cytoplasm.flecks = strength(level == 1 || level == 3, 0.6);
        recipe.cytoplasm.cytoskeleton = strength(level == 2 || level == 3, 0.45);
        recipe.cytoplasm.texture = 0.0.into();
        recipe.cytoplasm.granular = 0.0.into();
        recipe.cytoplasm.folds.flap = 0.0.into();
        recipe.cytoplasm.folds.roll = 0.0.into();
        recipe.cytoplasm.folds.folded_over = 0.0.into();
        let frame = frame(&recipe, 3)?;
        let cell = frame.finished.truth.objects.iter().find(|o| o.part == Part::Cytoplasm).ok_or("no cell")?;
        images.push(crop(&frame, cell, 240, 1));
    }
    Ok(sheet(&images, 4))
}

/// Fig. 8: positions drawn from a uniform, a clustered and a band layout.
fn layouts() -> Outcome<GrayImage> {
    let layouts = [
        Layout::Uniform {},
        Layout::Clusters(Clusters { count: 4.0.into(), radius_um: 14.0.into(), outside: 0.03.into() }),
        Layout::Band(Band { width_um: 12.0.into(), outside: 0.03.into() }),
    ];
    let mut images = Vec::new();
    for layout in layouts {
        let mut recipe = with_cells(empty(), "intermediate", 400.0);
        recipe.layout = layout;
        recipe.slide.spacing_um = 0.0.into();
        let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default())?;
        let scene = engine.scene(Key { seed: 2015, index: 0 })?;
        let mut dots = GrayImage::from_pixel(scene.view.width as u32, scene.view.height as u32, image::Luma([240]));
        for object in &scene.objects {
            let [x, y] = scene.view.to_px(object.centre_um).map(|v| v.round() as i64);
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)] {
                let inside = |v: i64, length: u32| u32::try_from(v).ok().filter(|v| *v < length);
                if let (Some(x), Some(y)) = (inside(x + dx, dots.width()), inside(y + dy, dots.height())) {
                    dots.put_pixel(x, y, image::Luma([30]));
                }
            }
        }
        images.push(dots);
    }
    Ok(sheet(&images, 3))
}

/// Fig. 9: masks and image of a cluster.
fn leukocytes() -> Outcome<GrayImage> {
    let mut recipe = empty();
    recipe.debris.leukocytes.clusters = 1.0.into();
    recipe.debris.leukocytes.per_cluster = 9.0.into();
    recipe.debris.leukocytes.cytoplasm_absorbance = 0.0.into();
    let frame = frame(&recipe, 2)?;
    let first = of_kind(&frame, ObjectKind::Leukocyte).first().copied().ok_or("no leukocyte")?;
    let mut masks = frame.clone();
    let ids = &frame.finished.truth.labels(papsynth::truth::Group::Debris).ids;
    for (grey, id) in masks.planes[0].grey.iter_mut().zip(ids) {
        *grey = if *id == 0 { 0 } else { 90 + (*id as u16 * 37) % 160 };
    }
    Ok(sheet(&[crop(&masks, first, 130, 3), crop(&frame, first, 130, 3)], 2))
}

/// Fig. 13: cells of a high-grade lesion.
fn high_grade() -> Outcome<GrayImage> {
    let mut images = Vec::new();
    for index in 0..4 {
        let frame = frame(&with_cells(empty(), "high-grade", 1.0), index)?;
        let cell = frame.finished.truth.objects.iter().find(|o| o.part == Part::Cytoplasm).ok_or("no cell")?;
        images.push(crop(&frame, cell, 150, 2));
    }
    Ok(sheet(&images, 4))
}

/// Fig. 12: a complete field.
fn complete_field(preset: Preset, index: u64) -> Outcome<GrayImage> {
    Ok(to_image(&frame(&preset.recipe(), index)?))
}

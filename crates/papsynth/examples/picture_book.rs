//! Draws every class of cell or every kind of debris with its name: `picture_book cells|debris OUT.png [colour]`.

#![expect(clippy::cast_possible_truncation, reason = "a small program with small numbers")]

mod support;

use image::{Rgb, RgbImage};
use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{
    CellMix, Colour, Debris, Group, GroupForm, Layout, LightSection, Mixing, Number, Preset, Recipe, Rendition, TintMix,
};
use papsynth::scene::ObjectKind;
use papsynth::truth::Part;
use papsynth::{Engine, Frame, Inputs};
use support::{Outcome, crop_around, enlarged, save, to_image, write};

/// Camera pixels of a tile.
const TILE: [u32; 2] = [150, 120];
/// Magnification of a tile.
const ZOOM: u32 = 2;
/// Tiles per row.
const COLUMNS: u32 = 6;
/// Pixels between tiles.
const GAP: u32 = 8;
/// Line height, px.
const LINE: u32 = 24;
/// Size of a dot of a character, px.
const DOT: u32 = 2;

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1);
    let entries = match arguments.next().as_deref() {
        Some("cells") => complete(&Model::builtin(), cells())?,
        Some("debris") => debris(),
        _ => return Err("usage: picture_book cells|debris OUT.png [colour]".into()),
    };
    let out = arguments.next().unwrap_or_else(|| "target/picture-book.png".to_owned());
    let colour = arguments.next().is_some_and(|word| word == "colour");
    let rows = (entries.len() as u32).div_ceil(COLUMNS);
    let cell = [TILE[0] * ZOOM + GAP, TILE[1] * ZOOM + GAP + LINE];
    let mut page = RgbImage::from_pixel(COLUMNS * cell[0] + GAP, rows * cell[1] + GAP, Rgb([255; 3]));
    for (i, entry) in (0_u32..).zip(&entries) {
        let (x, y) = (GAP + i % COLUMNS * cell[0], GAP + i / COLUMNS * cell[1]);
        let tile = draw(entry, colour)?;
        image::imageops::replace(&mut page, &tile, i64::from(x), i64::from(y));
        // Names wider than a tile are written smaller.
        let fits = entry.name.len() as u32 * 8 * DOT <= TILE[0] * ZOOM;
        write(&mut page, entry.name, [x + 4, y + TILE[1] * ZOOM + 4], if fits { DOT } else { 1 });
    }
    save(page, &out)
}

/// The content of one tile.
struct Entry {
    name: &'static str,
    /// Kind of the object at the centre of the tile.
    kind: ObjectKind,
    recipe: Recipe,
}

/// Returns an entry for an empty slide with the debris set by `add`.
fn entry(name: &'static str, kind: ObjectKind, add: impl FnOnce(&mut Debris)) -> Entry {
    let mut recipe = Preset::Lbc.recipe();
    recipe.cells.clear();
    recipe.debris = Debris::none();
    recipe.slide.depth_um = 0.0.into();
    recipe.slide.stacking_um = 0.0.into();
    recipe.layout = Layout::Uniform {};
    recipe.field.pixel_um = 0.25.into();
    recipe.field.width_px = 480.0.into();
    recipe.field.height_px = 400.0.into();
    add(&mut recipe.debris);
    Entry { name, kind, recipe }
}

/// Uses larger pixels, for large objects.
fn zoomed_out(mut entry: Entry) -> Entry {
    entry.recipe.field.pixel_um = 0.55.into();
    entry
}

fn with_cells(mut entry: Entry) -> Entry {
    let one = CellMix { count: 6.0.into(), ..CellMix::default() };
    entry.recipe.cells.insert("intermediate".to_owned(), one);
    entry.recipe.slide.spacing_um = 40.0.into();
    entry
}

/// Returns an entry for a class of cell.
fn class(name: &'static str, count: f64, group: Group) -> Entry {
    let mut entry = entry(name, ObjectKind::Cell, |_| {});
    let tints = if name.contains("superficial") { TintMix::superficial() } else { TintMix::default() };
    let mix = CellMix { count: count.into(), group, tints, ..CellMix::default() };
    entry.recipe.cells.insert(name.to_owned(), mix);
    entry.recipe.slide.spacing_um = 0.0.into();
    entry
}

fn cells() -> Vec<Entry> {
    let group = |form, size: f64, distance: f64| Group { form, size: size.into(), distance: distance.into() };
    let heap = |size| group(GroupForm::Aggregate, size, 0.85);
    vec![
        zoomed_out(class("superficial", 1.0, Group::default())),
        zoomed_out(class("intermediate", 1.0, Group::default())),
        zoomed_out(class("parabasal", 4.0, heap(4.0))),
        zoomed_out(class("basal", 6.0, heap(6.0))),
        zoomed_out(class("metaplastic", 4.0, heap(4.0))),
        zoomed_out(class("endocervical", 9.0, group(GroupForm::Palisade, 9.0, 0.46))),
        zoomed_out(class("endocervical-en-face", 19.0, group(GroupForm::Honeycomb, 19.0, 0.85))),
        zoomed_out(class("ascus", 1.0, Group::default())),
        zoomed_out(class("lsil", 2.0, heap(2.0))),
        zoomed_out(class("high-grade", 3.0, heap(3.0))),
        zoomed_out(class("moderate", 4.0, heap(4.0))),
        zoomed_out(class("severe", 5.0, heap(5.0))),
        zoomed_out(class("carcinoma-in-situ", 6.0, heap(6.0))),
        zoomed_out(class("carcinoma", 6.0, heap(6.0))),
        zoomed_out(class("oral-superficial", 1.0, Group::default())),
        zoomed_out(class("oral-intermediate", 1.0, Group::default())),
        zoomed_out(class("oral-parabasal", 3.0, heap(3.0))),
    ]
}

/// Returns the entries, or an error if a class of the model has none.
fn complete(model: &Model, entries: Vec<Entry>) -> Outcome<Vec<Entry>> {
    match model.classes.keys().find(|class| entries.iter().all(|entry| entry.name != class.as_str())) {
        Some(class) => Err(format!("no entry for the class {class}: add it to `cells`").into()),
        None => Ok(entries),
    }
}

fn debris() -> Vec<Entry> {
    use ObjectKind as K;
    vec![
        entry("neutrophils", K::Leukocyte, |d| {
            (d.leukocytes.clusters, d.leukocytes.per_cluster) = (1.0.into(), 6.0.into());
            (d.leukocytes.degenerated, d.leukocytes.on_cells) = (0.0.into(), 0.0.into());
        }),
        entry("neutrophils, degenerated", K::Leukocyte, |d| {
            (d.leukocytes.clusters, d.leukocytes.per_cluster) = (1.0.into(), 5.0.into());
            d.leukocytes.degenerated = 1.0.into();
        }),
        with_cells(entry("lactobacilli", K::Bacillus, |d| {
            (d.bacilli.clusters, d.bacilli.per_cluster) = (6.0.into(), 40.0.into());
        })),
        entry("cocci", K::Coccus, |d| {
            (d.cocci.colonies, d.cocci.per_colony) = (12.0.into(), 60.0.into());
        }),
        zoomed_out(with_cells(entry("clue cell", K::Cell, |d| d.clue_cells.fraction = 1.0.into()))),
        entry("candida", K::Candida, |d| {
            d.candida.colonies = 1.0.into();
            d.candida.hyphae = 4.0.into();
        }),
        entry("trichomonads", K::Trichomonad, |d| {
            (d.trichomonads.groups, d.trichomonads.per_group) = (1.0.into(), 7.0.into());
        }),
        entry("red cells", K::RedCell, |d| {
            (d.red_cells.clusters, d.red_cells.per_cluster) = (1.0.into(), 10.0.into());
        }),
        zoomed_out(entry("mucus", K::Mucus, |d| d.mucus.strands = 2.0.into())),
        entry("bare nuclei", K::BareNucleus, |d| d.bare_nuclei.count = 30.0.into()),
        entry("smudges", K::Smudge, |d| {
            (d.smudges.count, d.smudges.diameter_um) = (20.0.into(), Number::uniform(4.0, 20.0));
        }),
        entry("dirt", K::Dirt, |d| d.dirt.clusters = 40.0.into()),
        entry("specks", K::Speckle, |d| d.speckles.count = 60.0.into()),
        entry("dye crystals", K::Crystal, |d| d.crystals.count = 60.0.into()),
        zoomed_out(entry("dust", K::Dust, |d| {
            d.dust.count = 6.0.into();
            d.dust.height_um = 20.0.into();
        })),
        zoomed_out(entry("fibre", K::Fibre, |d| {
            d.fibres.count = 1.0.into();
            d.fibres.length_um = 60.0.into();
        })),
        zoomed_out(entry("air bubble", K::Bubble, |d| {
            d.bubbles.count = 1.0.into();
            d.bubbles.radius_um = 16.0.into();
        })),
        zoomed_out(entry("scratch", K::Scratch, |d| d.scratches.count = 4.0.into())),
        zoomed_out(entry("out of focus", K::OutOfFocus, |d| d.out_of_focus.count = 3.0.into())),
    ]
}

/// Draws the tile of an entry, centred on the object farthest from the image border in several frames.
fn draw(entry: &Entry, colour: bool) -> Outcome<RgbImage> {
    let mut recipe = entry.recipe.clone();
    if colour {
        recipe.light = LightSection::Colour(Colour {
            lamp_k: 5500.0.into(),
            mixing: Mixing::Spectral,
            chromatic_um: 0.0.into(),
            rendition: Rendition::Display,
        });
    }
    let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default())?;
    const TRIES: u64 = 6;
    let mut best: Option<(f64, [f64; 2], Frame)> = None;
    for index in 0..TRIES {
        let frame = engine.frame(Key { seed: 2015, index })?;
        let view = frame.finished.scene.view;
        let of_kind = |part: Part| part != Part::Nucleus;
        for object in frame.finished.truth.objects.iter().filter(|o| o.kind == entry.kind && of_kind(o.part)) {
            let Some([x, y]) = object.amodal.centroid() else { continue };
            let inside = x.min(view.width as f64 - x).min(y).min(view.height as f64 - y).min(90.0);
            let score = inside + 0.02 * (object.amodal.area() as f64).sqrt();
            if best.as_ref().is_none_or(|(least, ..)| score > *least) {
                best = Some((score, [x, y], frame.clone()));
            }
        }
    }
    let (_, [x, y], frame) = best.ok_or("nothing was drawn")?;
    Ok(enlarged(&crop_around(&to_image(&frame), [x, y], TILE), ZOOM))
}

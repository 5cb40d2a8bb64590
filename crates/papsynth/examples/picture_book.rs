//! A picture of every class of cell and every kind of debris with its name beneath:
//! `picture_book cells|debris OUT.png [colour]`.

#![expect(clippy::cast_possible_truncation, reason = "a small program with small numbers")]

mod support;

use image::{Rgb, RgbImage};
use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{
    CellMix, Colour, Debris, Group, GroupForm, Layout, LightSection, Mixing, Number, Preset, Recipe, Rendition, TintMix,
};
use papsynth::scene::Kind;
use papsynth::truth::Part;
use papsynth::{Engine, Frame, Inputs};
use support::{Outcome, around, enlarged, picture, save, write};

/// Camera pixels of a tile, and how much larger they are shown.
const TILE: [u32; 2] = [150, 120];
const ZOOM: u32 = 2;
/// Tiles in a row, and pixels between them.
const COLUMNS: u32 = 6;
const GAP: u32 = 8;
/// Height of a line of letters with the space about it, and the size of a letter's dots.
const LINE: u32 = 24;
const DOT: u32 = 2;

fn main() -> Outcome<()> {
    let mut arguments = std::env::args().skip(1);
    let chapters = match arguments.next().as_deref() {
        Some("cells") => all_of(&Model::builtin(), cells())?,
        Some("debris") => debris(),
        _ => return Err("usage: picture_book cells|debris OUT.png [colour]".into()),
    };
    let out = arguments.next().unwrap_or_else(|| "target/picture-book.png".to_owned());
    let colour = arguments.next().is_some_and(|word| word == "colour");
    let rows = (chapters.len() as u32).div_ceil(COLUMNS);
    let cell = [TILE[0] * ZOOM + GAP, TILE[1] * ZOOM + GAP + LINE];
    let mut page = RgbImage::from_pixel(COLUMNS * cell[0] + GAP, rows * cell[1] + GAP, Rgb([255; 3]));
    for (i, chapter) in (0_u32..).zip(&chapters) {
        let (x, y) = (GAP + i % COLUMNS * cell[0], GAP + i / COLUMNS * cell[1]);
        let tile = draw(chapter, colour)?;
        image::imageops::replace(&mut page, &tile, i64::from(x), i64::from(y));
        // A name that is too long for its tile is written smaller.
        let fits = chapter.name.len() as u32 * 8 * DOT <= TILE[0] * ZOOM;
        write(&mut page, chapter.name, [x + 4, y + TILE[1] * ZOOM + 4], if fits { DOT } else { 1 });
    }
    save(page, &out)
}

/// What is shown on one tile.
struct Chapter {
    name: &'static str,
    /// What the tile is centred on.
    kind: Kind,
    recipe: Recipe,
}

/// Nothing on the slide but what `add` puts there.
fn chapter(name: &'static str, kind: Kind, add: impl FnOnce(&mut Debris)) -> Chapter {
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
    Chapter { name, kind, recipe }
}

/// The same seen from farther away, as all cells are.
fn far(mut chapter: Chapter) -> Chapter {
    chapter.recipe.field.pixel_um = 0.55.into();
    chapter
}

fn with_cells(mut chapter: Chapter) -> Chapter {
    let one = CellMix { count: 6.0.into(), ..CellMix::default() };
    chapter.recipe.cells.insert("intermediate".to_owned(), one);
    chapter.recipe.slide.spacing_um = 40.0.into();
    chapter
}

/// A class of cell, in groups if it lies in groups.
fn class(name: &'static str, count: f64, group: Group) -> Chapter {
    let mut chapter = chapter(name, Kind::Cell, |_| {});
    let tints = if name.contains("superficial") { TintMix::superficial() } else { TintMix::default() };
    let mix = CellMix { count: count.into(), group, tints, ..CellMix::default() };
    chapter.recipe.cells.insert(name.to_owned(), mix);
    chapter.recipe.slide.spacing_um = 0.0.into();
    chapter
}

fn cells() -> Vec<Chapter> {
    let group = |form, size: f64, distance: f64| Group { form, size: size.into(), distance: distance.into() };
    let heap = |size| group(GroupForm::Aggregate, size, 0.85);
    vec![
        far(class("superficial", 1.0, Group::default())),
        far(class("intermediate", 1.0, Group::default())),
        far(class("parabasal", 4.0, heap(4.0))),
        far(class("basal", 6.0, heap(6.0))),
        far(class("metaplastic", 4.0, heap(4.0))),
        far(class("endocervical", 9.0, group(GroupForm::Palisade, 9.0, 0.46))),
        far(class("endocervical-en-face", 19.0, group(GroupForm::Honeycomb, 19.0, 0.85))),
        far(class("ascus", 1.0, Group::default())),
        far(class("lsil", 2.0, heap(2.0))),
        far(class("high-grade", 3.0, heap(3.0))),
        far(class("moderate", 4.0, heap(4.0))),
        far(class("severe", 5.0, heap(5.0))),
        far(class("carcinoma-in-situ", 6.0, heap(6.0))),
        far(class("carcinoma", 6.0, heap(6.0))),
        far(class("oral-superficial", 1.0, Group::default())),
        far(class("oral-intermediate", 1.0, Group::default())),
        far(class("oral-parabasal", 3.0, heap(3.0))),
    ]
}

/// The chapters, if no class of the model is without one.
fn all_of(model: &Model, chapters: Vec<Chapter>) -> Outcome<Vec<Chapter>> {
    match model.classes.keys().find(|class| chapters.iter().all(|chapter| chapter.name != class.as_str())) {
        Some(class) => Err(format!("the picture book has no tile of the class {class}").into()),
        None => Ok(chapters),
    }
}

fn debris() -> Vec<Chapter> {
    use Kind as K;
    vec![
        chapter("neutrophils", K::Leukocyte, |d| {
            (d.leukocytes.clusters, d.leukocytes.per_cluster) = (1.0.into(), 6.0.into());
            (d.leukocytes.degenerated, d.leukocytes.on_cells) = (0.0.into(), 0.0.into());
        }),
        chapter("neutrophils, degenerated", K::Leukocyte, |d| {
            (d.leukocytes.clusters, d.leukocytes.per_cluster) = (1.0.into(), 5.0.into());
            d.leukocytes.degenerated = 1.0.into();
        }),
        with_cells(chapter("lactobacilli", K::Bacillus, |d| {
            (d.bacilli.clusters, d.bacilli.per_cluster) = (6.0.into(), 40.0.into());
        })),
        chapter("cocci", K::Coccus, |d| {
            (d.cocci.colonies, d.cocci.per_colony) = (12.0.into(), 60.0.into());
        }),
        far(with_cells(chapter("clue cell", K::Cell, |d| d.clue_cells.share = 1.0.into()))),
        chapter("candida", K::Candida, |d| {
            d.candida.colonies = 1.0.into();
            d.candida.hyphae = 4.0.into();
        }),
        chapter("trichomonads", K::Trichomonad, |d| {
            (d.trichomonads.groups, d.trichomonads.per_group) = (1.0.into(), 7.0.into());
        }),
        chapter("red cells", K::RedCell, |d| {
            (d.red_cells.clusters, d.red_cells.per_cluster) = (1.0.into(), 10.0.into());
        }),
        far(chapter("mucus", K::Mucus, |d| d.mucus.strands = 2.0.into())),
        chapter("bare nuclei", K::BareNucleus, |d| d.bare_nuclei.count = 30.0.into()),
        chapter("smudges", K::Smudge, |d| {
            (d.smudges.count, d.smudges.diameter_um) = (20.0.into(), Number::uniform(4.0, 20.0));
        }),
        chapter("dirt", K::Dirt, |d| d.dirt.clusters = 40.0.into()),
        chapter("specks", K::Speckle, |d| d.speckles.count = 60.0.into()),
        chapter("dye crystals", K::Crystal, |d| d.crystals.count = 60.0.into()),
        far(chapter("dust", K::Dust, |d| {
            d.dust.count = 6.0.into();
            d.dust.height_um = 20.0.into();
        })),
        far(chapter("fibre", K::Fibre, |d| {
            d.fibres.count = 1.0.into();
            d.fibres.length_um = 60.0.into();
        })),
        far(chapter("air bubble", K::Bubble, |d| {
            d.bubbles.count = 1.0.into();
            d.bubbles.radius_um = 16.0.into();
        })),
        far(chapter("scratch", K::Scratch, |d| d.scratches.count = 4.0.into())),
        far(chapter("out of focus", K::OutOfFocus, |d| d.out_of_focus.count = 3.0.into())),
    ]
}

/// The tile of a chapter: of a few tries the one whose middle object lies farthest from the image's border.
fn draw(chapter: &Chapter, colour: bool) -> Outcome<RgbImage> {
    let mut recipe = chapter.recipe.clone();
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
        for object in frame.finished.truth.objects.iter().filter(|o| o.kind == chapter.kind && of_kind(o.part)) {
            let Some([x, y]) = object.amodal.centroid() else { continue };
            let inside = x.min(view.width as f64 - x).min(y).min(view.height as f64 - y).min(90.0);
            let score = inside + 0.02 * (object.amodal.area() as f64).sqrt();
            if best.as_ref().is_none_or(|(least, ..)| score > *least) {
                best = Some((score, [x, y], frame.clone()));
            }
        }
    }
    let (_, [x, y], frame) = best.ok_or("nothing was drawn")?;
    Ok(enlarged(&around(&picture(&frame), [x, y], TILE), ZOOM))
}

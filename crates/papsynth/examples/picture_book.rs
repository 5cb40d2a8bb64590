//! A picture of every kind of debris with its name beneath: `picture_book OUT.png [colour]`.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small program with small numbers")]

use image::{Rgb, RgbImage};
use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{CellMix, Debris, Layout, Light, Mixing, Number, Preset, Recipe, Rendition};
use papsynth::scene::Kind;
use papsynth::truth::Part;
use papsynth::{Engine, Frame, Inputs};

type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

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
    let out = arguments.next().unwrap_or_else(|| "target/picture-book.png".to_owned());
    let colour = arguments.next().is_some_and(|word| word == "colour");
    let chapters = chapters();
    let rows = (chapters.len() as u32).div_ceil(COLUMNS);
    let cell = [TILE[0] * ZOOM + GAP, TILE[1] * ZOOM + GAP + LINE];
    let mut page = RgbImage::from_pixel(COLUMNS * cell[0] + GAP, rows * cell[1] + GAP, Rgb([255; 3]));
    for (i, chapter) in (0_u32..).zip(&chapters) {
        let (x, y) = (GAP + i % COLUMNS * cell[0], GAP + i / COLUMNS * cell[1]);
        let tile = draw(chapter, colour)?;
        image::imageops::replace(&mut page, &tile, i64::from(x), i64::from(y));
        write(&mut page, chapter.name, [x + 4, y + TILE[1] * ZOOM + 6]);
    }
    page.save(&out)?;
    Ok(())
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

/// The same seen from farther away.
fn far(mut chapter: Chapter) -> Chapter {
    chapter.recipe.field.pixel_um = 0.45.into();
    chapter
}

fn with_cells(mut chapter: Chapter) -> Chapter {
    let one = CellMix { count: 6.0.into(), ..CellMix::default() };
    chapter.recipe.cells.insert("intermediate".to_owned(), one);
    chapter.recipe.slide.spacing_um = 40.0.into();
    chapter
}

fn chapters() -> Vec<Chapter> {
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
        chapter("dirt", K::Dirt, |d| d.dirt.drifts = 40.0.into()),
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
        recipe.light = Light::Colour {
            lamp_k: 5500.0.into(),
            mixing: Mixing::Spectral,
            chromatic_um: 0.0.into(),
            rendition: Rendition::Display,
        };
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
    let whole = picture(&frame);
    let corner =
        |middle: f64, side: u32, length: u32| ((middle - f64::from(side) / 2.0).max(0.0) as u32).min(length - side);
    let (x, y) = (corner(x, TILE[0], whole.width()), corner(y, TILE[1], whole.height()));
    let cut = image::imageops::crop_imm(&whole, x, y, TILE[0], TILE[1]).to_image();
    let filter = image::imageops::FilterType::CatmullRom;
    Ok(image::imageops::resize(&cut, TILE[0] * ZOOM, TILE[1] * ZOOM, filter))
}

fn picture(frame: &Frame) -> RgbImage {
    let (view, plane) = (frame.finished.scene.view, &frame.planes[0]);
    RgbImage::from_fn(view.width as u32, view.height as u32, |x, y| {
        let at = (y as usize * view.width + x as usize) * plane.channels;
        let grey = |channel: usize| plane.grey[at + channel.min(plane.channels - 1)].min(255) as u8;
        Rgb([grey(0), grey(1), grey(2)])
    })
}

/// Rows of five dots, the leftmost the highest bit, of the letters that names are made of.
const LETTERS: [(char, [u8; 7]); 23] = [
    ('a', [0, 0, 14, 1, 15, 17, 15]),
    ('b', [16, 16, 30, 17, 17, 17, 30]),
    ('c', [0, 0, 14, 16, 16, 17, 14]),
    ('d', [1, 1, 15, 17, 17, 17, 15]),
    ('e', [0, 0, 14, 17, 31, 16, 14]),
    ('f', [6, 9, 28, 8, 8, 8, 8]),
    ('g', [0, 0, 15, 17, 15, 1, 14]),
    ('h', [16, 16, 30, 17, 17, 17, 17]),
    ('i', [4, 0, 12, 4, 4, 4, 14]),
    ('k', [16, 16, 18, 20, 24, 20, 18]),
    ('l', [12, 4, 4, 4, 4, 4, 14]),
    ('m', [0, 0, 26, 21, 21, 21, 21]),
    ('n', [0, 0, 30, 17, 17, 17, 17]),
    ('o', [0, 0, 14, 17, 17, 17, 14]),
    ('p', [0, 0, 30, 17, 30, 16, 16]),
    ('r', [0, 0, 22, 25, 16, 16, 16]),
    ('s', [0, 0, 15, 16, 14, 1, 30]),
    ('t', [8, 8, 28, 8, 8, 9, 6]),
    ('u', [0, 0, 17, 17, 17, 19, 13]),
    ('v', [0, 0, 17, 17, 17, 10, 4]),
    ('w', [0, 0, 17, 17, 21, 21, 10]),
    ('y', [0, 0, 17, 17, 15, 1, 14]),
    (',', [0, 0, 0, 0, 12, 4, 8]),
];

/// Writes a line of letters.
fn write(page: &mut RgbImage, text: &str, [left, top]: [u32; 2]) {
    for (place, letter) in (0_u32..).zip(text.chars()) {
        let Some((_, rows)) = LETTERS.iter().find(|(known, _)| *known == letter) else { continue };
        for (y, row) in (0_u32..).zip(rows) {
            for x in (0..5).filter(|x| row >> (4 - x) & 1 == 1) {
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let at = [left + (place * 6 + x) * DOT + dx, top + y * DOT + dy];
                    if at[0] < page.width() && at[1] < page.height() {
                        page.put_pixel(at[0], at[1], Rgb([0; 3]));
                    }
                }
            }
        }
    }
}

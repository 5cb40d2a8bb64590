//! Complete slides: no seams, and no dependence on tiles, frames, order or slide size.

use papsynth::model::Model;
use papsynth::recipe::{Colour, Illumination, LightSection, Preset, Quadratic, Recipe};
use papsynth::slide::SlidePart;
use papsynth::truth::Part;
use papsynth::{Engine, Inputs, Threads};

/// Returns a recipe for a slide with objects of all kinds everywhere.
fn recipe() -> Recipe {
    let mut recipe = Preset::Inflamed.recipe();
    (recipe.scan.width_px, recipe.scan.height_px, recipe.scan.frame_px) = (900, 700, 256);
    recipe.scan.deposit.radius_um = 60_000.0.into();
    recipe
}

/// Sets uniform illumination, so that frames differ only in noise.
fn uniformly_lit(mut recipe: Recipe) -> Recipe {
    recipe.background.illumination =
        Illumination::Quadratic(Quadratic { falloff_x: 0.into(), falloff_y: 0.into(), centre_offset: 0.into() });
    recipe
}

fn engine(recipe: &Recipe) -> Engine {
    Engine::new(recipe, &Model::builtin(), &Inputs::default()).unwrap()
}

fn part(engine: &Engine, origin: [u32; 2], size: [u32; 2]) -> SlidePart {
    engine.slide(5, 0).unwrap().part(origin, size, Threads::One).unwrap()
}

fn assert_same(a: &SlidePart, b: &SlidePart) {
    assert!(a.planes == b.planes, "pixels differ");
    assert_eq!(a.labels, b.labels);
    assert_eq!(a.layers, b.layers);
    assert_eq!(a.objects, b.objects);
}

/// Returns the largest difference of noise-free grey levels.
fn difference(a: &SlidePart, b: &SlidePart) -> f32 {
    let pairs = a.planes.iter().zip(&b.planes).flat_map(|(a, b)| a.noise_free.iter().zip(&b.noise_free));
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

#[test]
fn frames_join_without_a_seam() {
    let mut colour = recipe();
    colour.light = LightSection::Colour(Colour {
        lamp_k: 3200.0.into(),
        mixing: papsynth::recipe::Mixing::Spectral,
        chromatic_um: 0.3.into(),
        rendition: papsynth::recipe::Rendition::Display,
    });
    let mut stack = recipe();
    (stack.focus.planes, stack.focus.step_um) = (2.0.into(), 3.0.into());
    let mut paper = Preset::Paper2015.recipe();
    paper.layout = papsynth::recipe::Layout::Uniform {};
    paper.scan = recipe().scan;
    for (name, recipe) in [("default", recipe()), ("colour", colour), ("stack", stack), ("paper", paper)] {
        let mut recipe = uniformly_lit(recipe);
        let size = [500, 400];
        let small = part(&engine(&recipe), [100, 90], size);
        recipe.scan.frame_px = 1024;
        let large = part(&engine(&recipe), [100, 90], size);
        let off = difference(&small, &large);
        assert!(off == 0.0, "{name}: {off} grey levels");
        assert_eq!(small.labels, large.labels, "{name}");
        assert_eq!(small.layers, large.layers, "{name}");
        assert_eq!(small.objects.len(), large.objects.len(), "{name}");
        for (a, b) in small.objects.iter().zip(&large.objects) {
            assert_eq!((a.id, &a.amodal, a.area_um2, a.depth_um), (b.id, &b.amodal, b.area_um2, b.depth_um), "{name}");
        }
    }
}

#[test]
fn a_part_does_not_depend_on_its_size_or_the_slide_size() {
    let recipe = recipe();
    let engine = engine(&recipe);
    let whole = part(&engine, [0, 0], [900, 700]);
    let cut = |origin: [u32; 2], size: [u32; 2]| -> Vec<u16> {
        let rows = (origin[1]..origin[1] + size[1]).map(|y| (y * 900 + origin[0]) as usize);
        rows.flat_map(|at| &whole.planes[0].grey[at..at + size[0] as usize]).copied().collect()
    };
    for (origin, size) in [([0, 0], [64, 64]), ([250, 250], [10, 10]), ([612, 433], [288, 267]), ([899, 699], [1, 1])] {
        assert!(part(&engine, origin, size).planes[0].grey == cut(origin, size), "{origin:?}");
    }
    let mut larger = recipe;
    (larger.scan.width_px, larger.scan.height_px) = (5000, 3000);
    let of_larger = part(&self::engine(&larger), [300, 200], [300, 300]);
    let of_smaller = part(&engine, [300, 200], [300, 300]);
    assert!(of_larger.planes == of_smaller.planes);
    assert_eq!(of_larger.labels, of_smaller.labels);
}

/// Compares random windows, assembled from tiles of three sizes, with the complete slide.
///
/// The environment variable `PAPSYNTH_WINDOWS` sets the number of windows.
#[test]
fn windows_of_tiles_match_the_complete_slide() {
    const TILES_PX: [u32; 3] = [61, 128, 300];
    let count: u64 = std::env::var("PAPSYNTH_WINDOWS").ok().and_then(|n| n.parse().ok()).unwrap_or(6);
    let mut recipe = recipe();
    recipe.scan.frame_px = 128;
    let engine = engine(&recipe);
    let slide = engine.slide(7, 1).unwrap();
    let whole = slide.picture([0, 0], slide.size_px(), Threads::All).unwrap();
    let mut numbers = 0x5EED_u64;
    let mut below = |end: u32| {
        numbers = numbers.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        u32::try_from((numbers >> 33) % u64::from(end)).unwrap()
    };
    for window in 0..count {
        let side = TILES_PX[usize::try_from(window % 3).unwrap()];
        let size = [1 + below(400), 1 + below(400)];
        let origin = [below(901 - size[0]), below(701 - size[1])];
        let mut tiles: Vec<[u32; 2]> =
            (0..size[1].div_ceil(side)).flat_map(|row| (0..size[0].div_ceil(side)).map(move |c| [c, row])).collect();
        let turn = below(u32::try_from(tiles.len()).unwrap()) as usize;
        tiles.rotate_left(turn);
        for tile in tiles {
            let corner = [0, 1].map(|axis| origin[axis] + tile[axis] * side);
            let size = [0, 1].map(|axis| side.min(origin[axis] + size[axis] - corner[axis]));
            let alone = slide.picture(corner, size, Threads::All).unwrap();
            for (y, line) in (corner[1]..corner[1] + size[1]).zip((0..).step_by(size[0] as usize)) {
                let (here, there) = (line..line + size[0] as usize, (y * 900 + corner[0]) as usize);
                let there = there..there + size[0] as usize;
                assert_eq!(
                    alone.planes[0].grey[here.clone()],
                    whole.planes[0].grey[there.clone()],
                    "{window} {corner:?}"
                );
                assert_eq!(alone.layers[here.clone()], whole.layers[there.clone()], "{window} {corner:?}");
                for (labels, of_whole) in alone.labels.iter().zip(&whole.labels) {
                    assert_eq!(labels.ids[here.clone()], of_whole.ids[there.clone()], "{window} {corner:?}");
                }
            }
        }
    }
    eprintln!("{count} windows");
}

#[test]
fn threads_and_order_change_nothing() {
    let recipe = recipe();
    let engine = engine(&recipe);
    let one = engine.slide(5, 0).unwrap().frame([1, 1], Threads::One).unwrap();
    let slide = engine.slide(5, 0).unwrap();
    slide.frame([3, 2], Threads::All).unwrap();
    slide.frame([0, 0], Threads::All).unwrap();
    assert_same(&one, &slide.frame([1, 1], Threads::All).unwrap());
    let other = engine.slide(5, 1).unwrap().frame([1, 1], Threads::All).unwrap();
    assert!(one.planes != other.planes, "another slide");
}

#[test]
fn every_object_has_one_row_and_its_mask_matches_the_labels() {
    let recipe = recipe();
    let engine = engine(&recipe);
    let slide = engine.slide(5, 0).unwrap();
    let mut rows = Vec::new();
    let mut layers = vec![0_u16; 900 * 700];
    for row in 0..slide.frames()[1] {
        for column in 0..slide.frames()[0] {
            rows.extend(slide.frame([column, row], Threads::All).unwrap().objects);
        }
    }
    let mut ids: Vec<_> = rows.iter().map(|row| (row.id, row.part)).collect();
    let rows_found = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), rows_found, "an object has two rows");
    assert!(rows_found > 100, "{rows_found}");
    // Objects centred outside the slide are visible but have no row; the layers are compared away from the border.
    for row in rows.iter().filter(|row| row.part == Part::Cytoplasm) {
        row.amodal.pixels(900).for_each(|pixel| layers[pixel] += 1);
    }
    let whole = part(&engine, [0, 0], [900, 700]);
    for row in &rows {
        let group = papsynth::truth::Group::ALL.iter().position(|group| *group == row.group()).unwrap();
        assert!(row.amodal.pixels(900).all(|pixel| whole.labels[group].ids[pixel] > 0), "{} {:?}", row.id, row.part);
    }
    let inside = |pixel: usize| (250..650).contains(&(pixel % 900)) && (250..450).contains(&(pixel / 900));
    assert!((0..layers.len()).filter(|&pixel| inside(pixel)).all(|pixel| layers[pixel] == whole.layers[pixel]));
}

#[test]
fn density_matches_fields_inside_the_deposit_and_is_lower_outside() {
    let mut recipe = Preset::Lbc.recipe();
    (recipe.scan.width_px, recipe.scan.height_px) = (60_000, 60_000);
    recipe.scan.deposit.density_variation = 0.0.into();
    let engine = engine(&recipe);
    let count = |slide: &papsynth::Slide<'_>, origin, size: u32| {
        let found = slide.objects(origin, [size; 2]).unwrap();
        found.iter().filter(|o| o.body.kind() == papsynth::scene::ObjectKind::Cell).count() as f64
    };
    let fields = 24;
    let scenes = (0..fields).map(|index| engine.scene(papsynth::key::Key { seed: 3, index }).unwrap());
    let cells: u64 = scenes.map(|scene| scene.cells.values().map(|count| count.in_field).sum::<u64>()).sum();
    let wanted = cells as f64 / (fields as f64 * 1376.0 * 1038.0);
    let side = 8000;
    let (mut inside, mut beyond) = (0.0, 0.0);
    for number in 0..3 {
        let slide = engine.slide(3, number).unwrap();
        inside += count(&slide, [24_000, 26_000], side) / 3.0;
        beyond += count(&slide, [0, 0], 4000) / 3.0;
    }
    // The count includes objects that extend into the region from outside.
    let found = inside / (f64::from(side + 300) * f64::from(side + 300));
    assert!((found / wanted - 1.0).abs() < 0.2, "{found} {wanted}");
    assert!(beyond / f64::from(4300 * 4300) < 0.05 * wanted, "{beyond}");
}

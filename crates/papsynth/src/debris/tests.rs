//! Properties of all kinds of debris.

use proptest::prelude::*;
use serde_json::Value;

use super::*;
use crate::key::Key;
use crate::model::Model;
use crate::phantom::noise_fields::NoiseFieldGenerator;
use crate::recipe::{Optics, Preset, Recipe};
use crate::scene::{self, Object, Scene};
use crate::truth::traits::Trait;

const KEY: Key = Key { seed: 17, index: 3 };

/// Returns a recipe for a small field with a few cells and this debris, on a coarse grid.
fn recipe(debris: Debris) -> Recipe {
    let mut recipe = Preset::Lbc.recipe();
    recipe.field.width_px = 96.0.into();
    recipe.field.height_px = 72.0.into();
    recipe.field.pixel_um = 0.5.into();
    recipe.optics = Optics::gaussian();
    recipe.slide.spacing_um = 1.0.into();
    for mix in recipe.cells.values_mut() {
        mix.count = 1.0.into();
    }
    recipe.debris = debris;
    recipe
}

fn draw(debris: &Debris) -> Scene {
    scene::draw(&recipe(debris.clone()), &Model::builtin(), None, KEY).unwrap()
}

/// Draws the phantoms of all objects except cells.
fn phantoms(scene: &Scene) -> Vec<(ObjectKind, Phantom)> {
    let generator = NoiseFieldGenerator::new();
    let noise_fields = generator.fields(scene.key);
    let made = |object: &Object| {
        Some((object.body.kind(), crate::phantom::debris(&scene.of_phantoms(), &noise_fields, object)?))
    };
    scene.objects.iter().filter_map(made).collect()
}

/// Sets the number of objects or clusters (with four members each) of a kind. Returns the number of objects.
fn counted(debris: &mut Debris, kind: ObjectKind, count: f64) -> usize {
    let Some(number) = debris.count_mut(kind) else { return 0 };
    *number = count.into();
    (debris.candida.hyphae, debris.candida.yeasts) = (1.0.into(), 3.0.into());
    for members in [
        &mut debris.leukocytes.per_cluster,
        &mut debris.bacilli.per_cluster,
        &mut debris.dirt.per_cluster,
        &mut debris.trichomonads.per_group,
        &mut debris.red_cells.per_cluster,
    ] {
        *members = 4.0.into();
    }
    let clustered = matches!(
        kind,
        ObjectKind::Leukocyte
            | ObjectKind::Bacillus
            | ObjectKind::Dirt
            | ObjectKind::Candida
            | ObjectKind::Trichomonad
            | ObjectKind::RedCell
    );
    count as usize * if clustered { 4 } else { 1 }
}

#[test]
fn names_match_serialised_values() {
    for kind in ObjectKind::ALL {
        assert_eq!(serde_json::to_value(kind).unwrap(), kind.name());
    }
    let mut names = ObjectKind::ALL.map(ObjectKind::name);
    names.sort_unstable();
    assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
}

#[test]
fn counts_match_the_recipe() {
    let of_kind = |scene: &Scene, kind| scene.objects.iter().filter(|o| o.body.kind() == kind).count();
    let empty = draw(&Debris::none());
    assert_eq!(of_kind(&empty, ObjectKind::Cell), empty.objects.len());
    assert!(empty.objects.iter().all(|object| object.coat.is_none()));
    for kind in ObjectKind::ALL.into_iter().skip(1) {
        let mut debris = Debris::none();
        let expected = counted(&mut debris, kind, 3.0);
        let scene = draw(&debris);
        assert_eq!(of_kind(&scene, kind), expected, "{kind:?}");
        assert_eq!(
            of_kind(&scene, kind) + of_kind(&scene, ObjectKind::Cell),
            scene.objects.len(),
            "{kind:?}: no other debris"
        );
        assert_eq!(scene.objects[..2], empty.objects[..2], "{kind:?} changes no cell");
    }
    let mut debris = Debris::none();
    debris.clue_cells.fraction = 1.0.into();
    assert!(draw(&debris).objects.iter().all(|object| object.coat.is_some()));
}

#[test]
fn a_phantom_does_not_depend_on_other_objects() {
    // Positions of clumps at leukocytes depend on these.
    let apart =
        || Debris { smudges: Smudges { at_leukocytes: 0.0.into(), ..Debris::none().smudges }, ..Debris::none() };
    let mut all = apart();
    for kind in ObjectKind::ALL {
        counted(&mut all, kind, 2.0);
    }
    let among = phantoms(&draw(&all));
    for kind in ObjectKind::ALL.into_iter().skip(1) {
        let mut debris = apart();
        counted(&mut debris, kind, 1.0);
        let alone = phantoms(&draw(&debris));
        let same = among.iter().filter(|(other, _)| *other == kind);
        for ((_, alone), (_, among)) in alone.iter().zip(same) {
            let tiles = |phantom: &Phantom| -> Vec<_> {
                phantom.pieces.iter().map(|p| (p.absorbance.clone(), p.coverage.clone())).collect()
            };
            assert_eq!(tiles(alone), tiles(among), "{kind:?}");
        }
    }
}

#[test]
fn absorbing_pixels_are_covered_and_areas_match_the_coverage() {
    let mut all = Debris::none();
    for kind in ObjectKind::ALL {
        counted(&mut all, kind, 6.0);
    }
    for (kind, phantom) in phantoms(&draw(&all)) {
        let whole = &phantom.pieces[0];
        assert!(whole.coverage.values.iter().all(|share| (0.0..=1.0).contains(share)), "{kind:?}");
        let covered: f64 = whole.coverage.values.iter().map(|share| f64::from(*share)).sum();
        // Some kinds return the exact area of their shape, which differs slightly from the pixel coverage.
        assert!((whole.area_px / covered - 1.0).abs() < 0.25, "{kind:?}: {} {covered}", whole.area_px);
        let same = whole.absorbance.values.len() == whole.coverage.values.len();
        assert!(same, "{kind:?}");
        for (value, share) in whole.absorbance.values.iter().zip(&whole.coverage.values) {
            assert!(value.is_finite() && *value >= 0.0, "{kind:?}");
            assert!(*share > 0.0 || *value == 0.0, "{kind:?} absorbs outside its coverage");
        }
    }
}

#[test]
fn uniform_objects_have_the_specified_absorbance() {
    let mut debris = Debris::none();
    for kind in [
        ObjectKind::Bacillus,
        ObjectKind::Speckle,
        ObjectKind::Dirt,
        ObjectKind::Crystal,
        ObjectKind::Dust,
        ObjectKind::Scratch,
    ] {
        counted(&mut debris, kind, 5.0);
    }
    let scene = draw(&debris);
    let bodies = scene.objects.iter().filter(|object| object.body.kind() != ObjectKind::Cell);
    for ((kind, phantom), object) in phantoms(&scene).iter().zip(bodies) {
        let [whole] = &phantom.pieces[..] else { panic!("{kind:?}") };
        let (mut absorbed, mut covered) = (0.0, 0.0);
        for (value, share) in whole.absorbance.values.iter().zip(&whole.coverage.values) {
            absorbed += f64::from(*value);
            covered += f64::from(*share);
        }
        let expected = object.body.absorbance();
        assert!((absorbed / covered / expected - 1.0).abs() < 1e-3, "{kind:?}: {} {expected}", absorbed / covered);
    }
}

#[test]
fn flecks_of_dirt_have_similar_directions_in_a_field() {
    let mut debris = Debris::none();
    counted(&mut debris, ObjectKind::Dirt, 30.0);
    debris.dirt.aligned = 1.0.into();
    let scene = draw(&debris);
    let flecks = scene.objects.iter().filter(|object| object.body.kind() == ObjectKind::Dirt);
    let directions: Vec<f64> = flecks.map(|fleck| fleck.rotation_deg.to_radians()).collect();
    let [x, y] = [libm::cos, libm::sin].map(|of| directions.iter().map(|angle| of(*angle)).sum::<f64>());
    // Normal deviates of 33 degrees have a mean resultant length of 0.85.
    let length = libm::hypot(x, y) / directions.len() as f64;
    assert!(directions.len() > 50 && (0.7..0.97).contains(&length), "{} {length}", directions.len());
}

#[test]
fn sizes_match_the_recipe() {
    let mut debris = Debris::none();
    counted(&mut debris, ObjectKind::RedCell, 4.0);
    debris.red_cells.diameter_um = 7.0.into();
    counted(&mut debris, ObjectKind::Bubble, 4.0);
    debris.bubbles.radius_um = 12.0.into();
    counted(&mut debris, ObjectKind::BareNucleus, 4.0);
    debris.bare_nuclei.radius_um = 3.6.into();
    let disc = |radius_um: f64| core::f64::consts::PI * radius_um * radius_um;
    for (kind, phantom) in phantoms(&draw(&debris)) {
        let area_um2 = phantom.pieces[0].area_px * 0.25;
        let (least, most) = match kind {
            // Red cells are slightly elliptical.
            ObjectKind::RedCell => (0.82 * disc(3.5), 1.05 * disc(3.5)),
            ObjectKind::Bubble => (0.98 * disc(12.0), 1.02 * disc(12.0)),
            _ => (0.9 * disc(3.6), 1.1 * disc(3.6)),
        };
        assert!((least..=most).contains(&area_um2), "{kind:?}: {area_um2} not in {least} to {most}");
    }
}

#[test]
fn a_coat_belongs_to_its_cell() {
    let mut debris = Debris::none();
    debris.clue_cells.fraction = 1.0.into();
    debris.clue_cells.overhang_um = 0.0.into();
    let engine = |debris: Debris| {
        crate::Engine::new(&recipe(debris), &Model::builtin(), &crate::Inputs::default()).unwrap().frame(KEY).unwrap()
    };
    let (coated, bare) = (engine(debris), engine(Debris::none()));
    let rows = |frame: &crate::Frame| frame.finished.truth.objects.clone();
    for (coated, bare) in rows(&coated).iter().zip(&rows(&bare)) {
        assert_eq!(coated.amodal, bare.amodal, "a coat does not change the outline of the cell");
        assert!(coated.traits.contains(Trait::Clue), "{}", coated.traits);
        assert!(!bare.traits.contains(Trait::Clue));
    }
    let sum = |frame: &crate::Frame| frame.planes[0].noise_free.iter().map(|v| f64::from(*v)).sum::<f64>();
    assert!(sum(&coated) < sum(&bare), "bacteria absorb");
}

/// Collects the paths of all numbers and distributions of a JSON value.
fn numbers(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Number(_) => found.push(path.to_owned()),
        Value::Object(map)
            if ["uniform", "normal", "log_normal", "choice"].iter().any(|law| map.contains_key(*law)) =>
        {
            found.push(path.to_owned());
        }
        Value::Object(map) => map.iter().for_each(|(name, inner)| numbers(inner, &format!("{path}/{name}"), found)),
        _ => {}
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    #[test]
    fn every_accepted_recipe_can_be_drawn(picks in proptest::collection::vec(0_usize..14, 400)) {
        const VALUES: [f64; 13] = [0.0, 0.02, 0.1, 0.3, 0.5, 1.0, 2.0, 5.0, 12.0, 30.0, 100.0, 500.0, -3.0];
        const FEW: f64 = 3.0;
        let mut json = serde_json::to_value(Debris::default()).unwrap();
        let mut paths = Vec::new();
        numbers(&json, "", &mut paths);
        for (path, pick) in paths.iter().zip(picks) {
            let Some(value) = VALUES.get(pick) else { continue };
            let counts = ["count", "clusters", "colonies", "groups", "strands", "per_", "hyphae", "yeasts", "fraction"];
            let value = if counts.iter().any(|word| path.contains(word)) { value.min(FEW) } else { *value };
            let before = json.pointer(path).cloned().unwrap();
            *json.pointer_mut(path).unwrap() = serde_json::json!(value);
            let accepted = serde_json::from_value(json.clone()).is_ok_and(|debris| recipe(debris).problems().is_empty());
            if !accepted {
                *json.pointer_mut(path).unwrap() = before;
            }
        }
        let debris: Debris = serde_json::from_value(json).unwrap();
        for (kind, phantom) in phantoms(&draw(&debris)) {
            for piece in &phantom.pieces {
                prop_assert!(piece.absorbance.values.iter().all(|v| v.is_finite() && *v >= 0.0), "{:?}", kind);
                prop_assert!(piece.area_px.is_finite() && piece.phase_rad.is_finite(), "{:?}", kind);
            }
        }
    }
}

/// Returns the largest distance of a part of a phantom from its centre, µm.
fn reach_um(scene: &Scene, object: &Object, phantom: &Phantom) -> f64 {
    let n = scene.oversampling();
    let mut farthest = 0.0_f64;
    for piece in &phantom.pieces {
        let step = n / piece.step;
        for tile in [&piece.absorbance, &piece.coverage] {
            let grid = crate::scene::View { pixel_um: scene.view.pixel_um / step as f64, ..scene.view };
            let centre = grid.to_px(object.centre_um);
            let mut index = 0;
            tile.clone().for_each(|p, value| {
                if *value != 0.0 && tile.values[index] != 0.0 {
                    let off = (p[0] - centre[0]).abs().max((p[1] - centre[1]).abs());
                    farthest = farthest.max(off * grid.pixel_um);
                }
                index += 1;
            });
        }
    }
    farthest
}

#[test]
fn at_most_one_percent_of_debris_exceeds_its_maximum_radius() {
    for kind in ObjectKind::ALL.into_iter().filter(|kind| *kind != ObjectKind::Cell) {
        let mut debris = Debris::none();
        counted(&mut debris, kind, 150.0);
        let scene = draw(&debris);
        let generator = NoiseFieldGenerator::new();
        let noise_fields = generator.fields(scene.key);
        let (mut beyond, mut largest, mut total) = (0, 0.0_f64, 0);
        for object in &scene.objects {
            let Some(phantom) = crate::phantom::debris(&scene.of_phantoms(), &noise_fields, object) else { continue };
            let limit_um = object.body.reach_um(scene.view.pixel_um) + 2.0 * scene.view.pixel_um;
            let ratio = reach_um(&scene, object, &phantom) / limit_um;
            (total, largest) = (total + 1, largest.max(ratio));
            beyond += usize::from(ratio > 1.0);
        }
        // Slides crop objects at their maximum radius.
        assert!(beyond * 200 <= total, "{}: {beyond} of {total}", kind.name());
        assert!(largest > 0.25, "{}: {largest}", kind.name());
    }
}

#[test]
fn at_most_half_a_percent_of_cells_exceeds_its_maximum_radius() {
    let mut beyond = 0;
    let (mut total, mut largest) = (0, 0.0_f64);
    for preset in [Preset::Lbc, Preset::HighGrade, Preset::Endocervical, Preset::Oral, Preset::Atrophic] {
        let mut recipe = preset.recipe();
        (recipe.field.width_px, recipe.field.height_px) = (1600.0.into(), 1200.0.into());
        recipe.field.pixel_um = 0.5.into();
        recipe.debris = Debris::none();
        let model = Model::builtin();
        let scene = scene::draw(&recipe, &model, None, KEY).unwrap();
        let timer = crate::profile::StageTimer(None);
        let settings = crate::phantom::PhantomSettings::of(&recipe);
        let assets = crate::phantom::PhantomAssets::new(settings, &model, timer).unwrap();
        let noise_fields = assets.noise_fields.fields(scene.key);
        let objects: Vec<&Object> = scene.objects.iter().collect();
        for (object, phantom) in
            objects.iter().zip(crate::phantom::make(&assets, &scene.of_phantoms(), &noise_fields, &objects).unwrap())
        {
            let ratio = reach_um(&scene, object, &phantom) / object.body.reach_um(scene.view.pixel_um);
            (total, largest) = (total + 1, largest.max(ratio));
            beyond += usize::from(ratio > 1.0);
        }
    }
    assert!(beyond * 100 <= total && largest > 0.6, "{beyond} of {total}, {largest}");
}

/// Draws a scene with this many clusters of leukocytes, on a fine grid.
fn leukocytes(clusters: f64, members: f64) -> Scene {
    let mut debris = Debris::none();
    (debris.leukocytes.clusters, debris.leukocytes.per_cluster) = (clusters.into(), members.into());
    let mut recipe = recipe(debris);
    recipe.field.pixel_um = 0.25.into();
    scene::draw(&recipe, &Model::builtin(), None, KEY).unwrap()
}

/// Returns the leukocytes of a scene with the clusters and centres of their objects, µm.
fn bodies(scene: &Scene) -> Vec<(u32, [f64; 2], &Leukocyte)> {
    let objects = scene.objects.iter().filter_map(|object| match &object.body {
        Body::Leukocyte(body) => Some((object.cluster, object.centre_um, body)),
        _ => None,
    });
    objects.collect()
}

/// Returns the squared distance of two points.
fn square(a: [f64; 2], b: [f64; 2]) -> f64 {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    dx * dx + dy * dy
}

#[test]
fn nuclei_of_leukocytes_have_the_measured_areas() {
    let scene = leukocytes(300.0, 1.0);
    let intact: Vec<bool> = bodies(&scene).iter().map(|(.., body)| !body.degenerated).collect();
    let [mut all, mut whole_cells] = [Vec::new(), Vec::new()];
    let drawn = phantoms(&scene).into_iter().filter(|(kind, _)| *kind == ObjectKind::Leukocyte);
    for ((_, phantom), intact) in drawn.zip(intact) {
        let [whole, nucleus] = &phantom.pieces[..] else { panic!("a leukocyte has a cytoplasm and a nucleus") };
        assert!(phantom.traits.contains(&Trait::Degenerated) != intact);
        let mut values: Vec<f32> = nucleus.absorbance.values.iter().copied().filter(|value| *value > 0.0).collect();
        values.sort_by(f32::total_cmp);
        let dark = values[values.len() * 9 / 10];
        let inside = values.iter().filter(|value| **value > 0.5 * dark).count();
        let grid_um = scene.view.pixel_um / (scene.oversampling() / nucleus.step) as f64;
        if intact && !phantom.traits.contains(&Trait::Histiocyte) {
            all.push(inside as f64 * grid_um * grid_um);
            whole_cells.push(whole.area_px * grid_um * grid_um);
        }
        // The mask of the object contains its nucleus.
        for (value, share) in nucleus.absorbance.values.iter().zip(&whole.coverage.values) {
            assert!(*value == 0.0 || *share > 0.0);
        }
    }
    let quantile = |areas: &mut Vec<f64>, fraction: f64| {
        areas.sort_by(f64::total_cmp);
        areas[(fraction * (areas.len() - 1) as f64).round() as usize]
    };
    // Measured at 10 %, 50 % and 90 %: 26, 39 and 51 µm², with the darkest part of the cytoplasm.
    for (fraction, least, most) in [(0.1, 18.0, 32.0), (0.5, 30.0, 44.0), (0.9, 38.0, 58.0)] {
        let area = quantile(&mut all, fraction);
        assert!((least..=most).contains(&area), "{fraction}: {area}");
    }
    // Measured: 122 µm² with an absorbance above 0.045, which includes the blur of the lens.
    let cell = quantile(&mut whole_cells, 0.5);
    assert!((80.0..=130.0).contains(&cell), "{cell}");
}

#[test]
fn clumps_of_leukocytes_are_compact_and_their_members_touch() {
    let mut debris = Debris::none();
    (debris.leukocytes.clusters, debris.leukocytes.per_cluster) = (20.0.into(), 24.0.into());
    (debris.leukocytes.touching, debris.leukocytes.histiocytes) = (1.0.into(), 0.0.into());
    let scene = draw(&debris);
    let bodies = bodies(&scene);
    for cluster in 1..=20 {
        let members: Vec<_> = bodies.iter().filter(|(of, ..)| *of == cluster).collect();
        assert_eq!(members.len(), 24);
        let mut apart = 0;
        let diameter = members.iter().map(|(.., body)| body.cytoplasm_diameter_um).sum::<f64>() / 24.0;
        let mut nearest = Vec::new();
        for (i, (_, at, body)) in members.iter().enumerate().skip(1) {
            let before = members[..i].iter().map(|(_, other, _)| square(*at, *other).sqrt()).fold(f64::MAX, f64::min);
            assert!(before <= 0.98 * body.cytoplasm_diameter_um + 1e-9, "{before}");
            apart += usize::from(before >= 0.56 * body.cytoplasm_diameter_um - 1e-9);
            nearest.push(before);
        }
        assert!(apart >= 20, "{apart} of 23 have a minimum distance");
        // Distances differ: clumps are no lattice.
        let mean = nearest.iter().sum::<f64>() / nearest.len() as f64;
        let spread = (nearest.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>() / nearest.len() as f64).sqrt();
        assert!(spread > 0.06 * mean, "{spread} of {mean}");
        let middle = members.iter().fold([0.0; 2], |m, (_, at, _)| [m[0] + at[0] / 24.0, m[1] + at[1] / 24.0]);
        let moment = members.iter().map(|(_, at, _)| square(*at, middle)).sum::<f64>() / 24.0;
        // A disc of 24 touching discs has a standard deviation of 1.7 diameters.
        assert!(moment.sqrt() < 2.4 * diameter, "{} of {diameter}", moment.sqrt());
    }
}

#[test]
fn sizes_of_clusters_of_leukocytes_have_a_heavy_tail() {
    let mut rng = KEY.stream("test", 0, "clusters");
    let members = Debris::default().leukocytes.per_cluster;
    let sizes: Vec<usize> = (0..4000).map(|_| members.draw_count(&mut rng).max(1)).collect();
    let share = |from: usize| sizes.iter().filter(|size| **size >= from).count() as f64 / 4000.0;
    assert!((0.28..0.44).contains(&share(2)), "{}", share(2));
    assert!((0.008..0.03).contains(&share(11)), "{}", share(11));
}

#[test]
fn every_variant_of_leukocytes_and_debris_occurs() {
    let scene = leukocytes(400.0, 1.0);
    let bodies = bodies(&scene);
    let share = |which: fn(&Leukocyte) -> bool| {
        bodies.iter().filter(|(.., body)| which(body)).count() as f64 / bodies.len() as f64
    };
    assert!((0.36..0.52).contains(&share(|body| body.degenerated)));
    assert!((0.03..0.12).contains(&share(|body| body.pyknotic)));
    assert!((0.01..0.08).contains(&share(|body| body.form == NucleusForm::Kidney)));
    assert!((0.22..0.38).contains(&share(|body| body.remains)));
    assert!(bodies.iter().all(|(.., body)| body.degenerated || !body.pyknotic));
    let mut debris = Debris::none();
    debris.smudges.count = 200.0.into();
    let scene = draw(&debris);
    let fibrous = scene.objects.iter().filter(|o| matches!(&o.body, Body::Smudge(smudge) if smudge.fibrous)).count();
    assert!((8..36).contains(&fibrous), "{fibrous}");
    let folded = scene.objects.iter().filter(|o| matches!(&o.body, Body::Smudge(smudge) if smudge.folded)).count();
    assert!((4..24).contains(&folded), "{folded}");
}

#[test]
fn debris_collects_at_leukocytes() {
    let mut debris = Debris::none();
    (debris.leukocytes.clusters, debris.leukocytes.per_cluster) = (3.0.into(), 5.0.into());
    debris.smudges.count = 200.0.into();
    let near = |debris: &Debris| {
        let mut recipe = recipe(debris.clone());
        (recipe.field.width_px, recipe.field.height_px) = (600.0.into(), 450.0.into());
        let scene = scene::draw(&recipe, &Model::builtin(), None, KEY).unwrap();
        let leukocytes = bodies(&scene);
        let clumps = scene.objects.iter().filter(|object| object.body.kind() == ObjectKind::Smudge);
        let near = |object: &&Object| {
            leukocytes.iter().any(|(_, centre_um, _)| square(*centre_um, object.centre_um) < 10.0 * 10.0)
        };
        (clumps.clone().filter(near).count(), clumps.count())
    };
    debris.smudges.at_leukocytes = 1.0.into();
    let all = near(&debris);
    debris.smudges.at_leukocytes = 0.0.into();
    let none = near(&debris);
    assert!(all.0 >= 190 && all.1 == 200 && none.0 < 40 && none.1 == 200, "{all:?} {none:?}");
    // Without leukocytes, clumps stay where they are.
    debris.leukocytes.clusters = 0.0.into();
    let positions = |at: f64| {
        let smudges = Smudges { at_leukocytes: at.into(), ..debris.smudges.clone() };
        draw(&Debris { smudges, ..debris.clone() }).objects
    };
    assert_eq!(positions(1.0), positions(0.0));
}

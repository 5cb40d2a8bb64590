//! Recipe, model, seed and index determine an image, independent of threads, order, and other objects on the slide.

#![expect(clippy::cast_possible_truncation, reason = "a small program with small numbers")]

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Clusters, Layout, Number, Preset, Recipe};
use papsynth::scene::ObjectKind;
use papsynth::truth::{Group, Part};
use papsynth::{Engine, Error, Frame, Inputs, Threads};

fn small(preset: Preset) -> Recipe {
    let mut recipe = preset.recipe();
    recipe.field.width_px = Number::Fixed(220.0);
    recipe.field.height_px = Number::Fixed(180.0);
    for mix in recipe.cells.values_mut() {
        mix.count = Number::uniform(1.0, 3.0).into();
    }
    if let Layout::Clusters(Clusters { radius_um, .. }) = &mut recipe.layout {
        *radius_um = Number::Fixed(15.0);
    }
    recipe.slide.spacing_um = Number::Fixed(4.0);
    recipe
}

fn engine(recipe: &Recipe) -> Engine {
    Engine::new(recipe, &Model::builtin(), &Inputs::default()).unwrap()
}

fn frame(engine: &Engine, index: u64, threads: Threads) -> Frame {
    let mut planes = Vec::new();
    let finished = engine
        .stream::<Error>(Key { seed: 5, index }, threads, |plane| {
            planes.push(plane.clone());
            Ok(())
        })
        .unwrap();
    Frame { planes, finished }
}

fn assert_same(a: &Frame, b: &Frame, what: &str) {
    assert_eq!(a.planes, b.planes, "{what}");
    assert_eq!(a.finished.scene, b.finished.scene, "{what}");
    assert_eq!(a.finished.truth, b.finished.truth, "{what}");
    assert_eq!(a.finished.all_in_focus, b.finished.all_in_focus, "{what}");
}

#[test]
fn threads_and_order_change_nothing() {
    for preset in Preset::ALL {
        let engine = engine(&small(preset));
        let forwards: Vec<Frame> = (0..2).map(|index| frame(&engine, index, Threads::One)).collect();
        for index in (0..2).rev() {
            for threads in [2, 8] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let again = pool.install(|| frame(&engine, index, Threads::All));
                assert_same(&forwards[index as usize], &again, &format!("{} {index} on {threads}", preset.name()));
            }
        }
        let alone = frame(&self::engine(&small(preset)), 1, Threads::One);
        assert_same(&forwards[1], &alone, &format!("{}: the second frame alone", preset.name()));
    }
}

#[test]
fn adding_a_speckle_changes_no_other_object() {
    let mut recipe = small(Preset::Lbc);
    recipe.debris.speckles.count = Number::Fixed(5.0).into();
    recipe.debris.out_of_focus.count = Number::Fixed(0.0).into();
    let few = frame(&engine(&recipe), 0, Threads::One);
    recipe.debris.speckles.count = Number::Fixed(6.0).into();
    let more = frame(&engine(&recipe), 0, Threads::One);
    let others = |frame: &Frame| {
        frame
            .finished
            .truth
            .objects
            .iter()
            .filter(|o| o.kind != ObjectKind::Speckle)
            // Ids depend on the number of objects of other kinds.
            .map(|o| (o.kind, o.part, o.amodal.clone()))
            .collect::<Vec<_>>()
    };
    assert_eq!(others(&few), others(&more));
    let scene = |frame: &Frame| {
        frame
            .finished
            .scene
            .objects
            .iter()
            .filter(|o| o.body.kind() == ObjectKind::Speckle)
            .cloned()
            .collect::<Vec<_>>()
    };
    assert_eq!(scene(&few)[..], scene(&more)[..5]);
}

#[test]
fn a_distribution_of_a_camera_parameter_changes_no_object() {
    let mut recipe = small(Preset::Lbc);
    let before = engine(&recipe).scene(Key { seed: 5, index: 0 }).unwrap();
    recipe.camera.read_noise_e = Number::uniform(5.0, 9.0);
    let after = engine(&recipe).scene(Key { seed: 5, index: 0 }).unwrap();
    assert_eq!(before.objects, after.objects);
    assert_eq!(before.background, after.background);
    assert_ne!(before.camera, after.camera);
}

#[test]
fn ground_truth_is_consistent() {
    let mut recipe = small(Preset::HighGrade);
    recipe.focus.planes = Number::Fixed(3.0);
    let frame = frame(&engine(&recipe), 1, Threads::All);
    let truth = &frame.finished.truth;
    assert_eq!(frame.planes.len(), 3);
    let width = frame.finished.scene.view.width;
    let labels = Group::ALL.map(|group| truth.labels(group));
    for object in &truth.objects {
        assert!(object.amodal.area() > 0);
        assert_eq!(object.detectability.len(), 3);
        assert_eq!(object.defocus_um.len(), 3);
        let labels = &labels[Group::ALL.iter().position(|group| *group == object.group()).unwrap()];
        assert!(object.visible.pixels(width).all(|p| labels.ids[p] == object.id));
        let inside: std::collections::BTreeSet<usize> = object.amodal.pixels(width).collect();
        assert!(
            object.visible.pixels(width).all(|p| inside.contains(&p)),
            "the visible mask is inside the complete mask"
        );
        if !object.truncated {
            let px = object.area_um2 / (0.25 * 0.25);
            let tolerance = 0.05 * px + 12.0;
            assert!(
                (object.amodal.area() as f64 - px).abs() < tolerance,
                "{:?} {}: {px} {}",
                object.kind,
                object.id,
                object.amodal.area()
            );
        }
    }
    let cells: Vec<_> = truth.objects.iter().filter(|o| o.part == Part::Cytoplasm).collect();
    for nucleus in truth.objects.iter().filter(|o| o.part == Part::Nucleus) {
        let cell = cells.iter().find(|cell| cell.id == nucleus.id);
        assert!(cell.is_some(), "a nucleus has the id of its cell");
    }
    let covered = truth.layers().iter().map(|&l| u64::from(l)).sum::<u64>();
    assert_eq!(covered, cells.iter().map(|c| c.amodal.area()).sum::<u64>());
    for object in truth.objects.iter().filter(|o| o.mean_absorbance > 0.1 && o.amodal.area() > 20) {
        assert!(object.detectability.iter().all(|d| *d > 0.0), "{:?} darkens the image", object.kind);
    }
}

#[test]
fn planes_out_of_focus_are_blurred() {
    let mut recipe = small(Preset::Sparse);
    recipe.focus.planes = Number::Fixed(9.0);
    recipe.focus.step_um = Number::Fixed(2.0);
    recipe.slide.depth_um = Number::Fixed(0.0);
    recipe.slide.stacking_um = Number::Fixed(0.0);
    recipe.debris.out_of_focus.count = Number::Fixed(0.0).into();
    let frame = frame(&engine(&recipe), 2, Threads::One);
    let roughness: Vec<f64> = frame
        .planes
        .iter()
        .map(|plane| {
            plane
                .noise_free
                .chunks_exact(frame.finished.scene.view.width)
                .flat_map(|row| row.windows(2))
                .map(|w| f64::from((w[1] - w[0]).abs()))
                .sum()
        })
        .collect();
    let sharpest = (0..9).max_by(|a, b| roughness[*a].total_cmp(&roughness[*b])).unwrap();
    assert_eq!(sharpest, 4, "all objects are at depth 0: {roughness:?}");
    assert!(roughness[0] < 0.8 * roughness[4] && roughness[8] < 0.8 * roughness[4]);
}

#[test]
fn an_unknown_class_is_reported_with_the_known_classes() {
    let mut recipe = small(Preset::Sparse);
    let mix = recipe.cells["intermediate"].clone();
    recipe.cells.insert("intermedate".to_owned(), mix);
    let message = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap_err().to_string();
    assert!(message.contains("`intermedate`") && message.contains("intermediate"), "{message}");
}

//! Outlines of cells against those of real cells.

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::Preset;
use papsynth::truth::{Mask, Part, Truth};
use papsynth::{Engine, Inputs};

/// Largest distance of an outline from a chord that counts as straight, in diameters of the cell.
const TOLERANCE: f64 = 0.015;

/// Percentile 95 and maximum of the longest straight run of 70 real outlines of cytoplasm, in diameters of a circle of
/// the same area, measured with [`straight_run`].
const REAL: [f64; 2] = [0.74, 0.86];

/// Returns the length of the longest chord of an outline, of points at steps of about one pixel, from which no point
/// between its ends is farther than `tolerance`.
fn straight_run(outline: &[[f64; 2]], tolerance: f64) -> f64 {
    let count = outline.len();
    let at = |i: usize| outline[i % count];
    let chord = |i: usize, k: usize| [at(i + k)[0] - at(i)[0], at(i + k)[1] - at(i)[1]];
    let length = |i: usize, k: usize| libm::hypot(chord(i, k)[0], chord(i, k)[1]);
    let straight = |i: usize, k: usize| {
        let ([x, y], length) = (chord(i, k), length(i, k));
        (1..k).all(|j| {
            let [u, v] = chord(i, j);
            let (away, along) = ((u * y - v * x).abs() / length, (u * x + v * y) / length);
            away <= tolerance && (-tolerance..=length + tolerance).contains(&along)
        })
    };
    let (mut longest, mut steps) = (0.0_f64, 2);
    for i in 0..count {
        // Only chords over at least as many points as the longest one.
        while steps < count / 2 && straight(i, steps) {
            longest = longest.max(length(i, steps));
            steps += 1;
        }
    }
    longest
}

/// Returns the outline of a mask; none if frayed parts of the cell are separate.
fn outline(mask: &Mask) -> Option<Vec<[f64; 2]>> {
    let bounds = mask.bounds().unwrap();
    let width = bounds.width as usize + 2;
    let mut values = vec![0.0; width * (bounds.height as usize + 2)];
    for run in mask.runs() {
        let row = (run.y - bounds.y + 1) as usize * width;
        values[row + (run.x0 - bounds.x + 1) as usize..row + (run.x1 - bounds.x + 1) as usize].fill(1.0);
    }
    let traced = fsd_shape::trace(&values, width, 0.5).ok()?;
    Some(fsd_shape::resample_along(&traced, traced.len()))
}

#[test]
fn no_cell_has_a_longer_straight_border_than_real_cells() {
    let mut recipe = Preset::ExtendedFocus.recipe();
    recipe.focus.planes = 1.into();
    let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap();
    let mut runs = Vec::new();
    for index in 0..5 {
        let truth = engine.frame(Key { seed: 5, index }).unwrap().finished.truth;
        for object in truth.objects.iter().filter(|o| o.part == Part::Cytoplasm && !o.truncated) {
            let diameter = 2.0 * (object.amodal.area() as f64 / core::f64::consts::PI).sqrt();
            let Some(outline) = outline(&object.amodal) else { continue };
            runs.push(straight_run(&outline, TOLERANCE * diameter) / diameter);
        }
    }
    runs.sort_by(f64::total_cmp);
    let (count, largest) = (runs.len(), runs[runs.len() - 1]);
    assert!(count > 40, "{count}");
    let found = [runs[count * 95 / 100], largest];
    assert!(found.iter().zip(REAL).all(|(found, real)| *found <= real), "{found:?}");
    // A square has a side of 0.89 diameters.
    let square: Vec<[f64; 2]> = (0..400_usize)
        .map(|i| ((i % 100) as f64, i / 100))
        .map(|(t, side)| [[t, 0.0], [100.0, t], [100.0 - t, 100.0], [0.0, 100.0 - t]][side])
        .collect();
    assert!((straight_run(&square, 1.0) - 100.0).abs() < 4.0);
}

/// Returns the length of a mask over its width, from its second moments.
fn length_over_width(mask: &Mask) -> f64 {
    let points = || mask.runs().iter().flat_map(|run| (run.x0..run.x1).map(|x| [f64::from(x), f64::from(run.y)]));
    let count = mask.area() as f64;
    let mean = [0, 1].map(|axis| points().map(|p| p[axis]).sum::<f64>() / count);
    let moment = |i: usize, j: usize| points().map(|p| (p[i] - mean[i]) * (p[j] - mean[j])).sum::<f64>() / count;
    let [xx, yy, xy] = [moment(0, 0), moment(1, 1), moment(0, 1)];
    let root = libm::hypot(0.5 * (xx - yy), xy);
    ((0.5 * (xx + yy) + root) / (0.5 * (xx + yy) - root)).sqrt()
}

#[test]
fn a_stretched_cell_keeps_its_area_and_holds_its_nucleus() {
    const ELONGATION: f64 = 2.0;
    let truth_of = |elongation: f64| {
        let mut recipe = Preset::Lbc.recipe();
        recipe.cytoplasm.elongation = elongation.into();
        (recipe.cytoplasm.folds.flap, recipe.cytoplasm.folds.roll) = (0.into(), 0.into());
        recipe.cytoplasm.folds.folded_over = 0.into();
        let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap();
        engine.frame(Key { seed: 7, index: 0 }).unwrap().finished.truth
    };
    let [round, long] = [1.0, ELONGATION].map(truth_of);
    // Truncated cells can be absent from one of the images, so that cells have other identifiers.
    let whole = |truth: &Truth, centre_um: [f64; 2], part: Part| {
        let found = truth.objects.iter().find(|o| o.centre_um == centre_um && o.part == part && !o.truncated);
        found.map(|o| o.amodal.clone())
    };
    let (mut ratios, mut outside, mut nuclei) = (Vec::new(), 0, 0);
    for object in long.objects.iter().filter(|o| o.part == Part::Cytoplasm && !o.truncated) {
        let Some(before) = whole(&round, object.centre_um, Part::Cytoplasm) else { continue };
        let areas = [&before, &object.amodal].map(|mask| mask.area() as f64);
        assert!((areas[1] / areas[0] - 1.0).abs() < 0.1, "cell {}: {areas:?}", object.id);
        ratios.push(length_over_width(&object.amodal) / length_over_width(&before));
        let nucleus = whole(&long, object.centre_um, Part::Nucleus).unwrap();
        outside += Mask::union([&nucleus, &object.amodal]).area() - object.amodal.area();
        nuclei += nucleus.area();
    }
    assert!(outside * 50 <= nuclei, "{outside} of {nuclei} pixels of nuclei are outside of their cells");
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    assert!(ratios.len() > 10 && (0.8 * ELONGATION..1.2 * ELONGATION).contains(&median), "{ratios:?}");
}

//! Comparisons of fields that are known to be similar or different.

use std::sync::atomic::{AtomicBool, Ordering};

use papsynth_judge::{
    Conclusion, Control, Error, FeatureKind, FeatureSet, Field, FieldImage, Judge, JudgeParams, Measurer,
    MeasurerParams, NucleiAnnotation, NucleiFrom, Progress, Report, TwoSampleParams,
};

use crate::support::Toy;

const FIELDS: u64 = 8;

fn fields(toy: Toy, seed: u64) -> Vec<Field> {
    measured(&toy.images(FIELDS, seed))
}

fn measured(images: &[FieldImage]) -> Vec<Field> {
    let measurer =
        Measurer::new(&MeasurerParams { nuclei_from: NucleiFrom::Points, ..MeasurerParams::default() }).unwrap();
    images.iter().map(|p| measurer.measure(p).unwrap()).collect()
}

fn judge() -> Judge {
    Judge::new(&JudgeParams { seed: 3, ..JudgeParams::quick() }).unwrap()
}

fn test<'a>(report: &'a Report, name: &str) -> &'a papsynth_judge::Test<papsynth_judge::TwoSample> {
    report.two_sample.iter().find(|t| t.name == name).unwrap()
}

#[test]
fn fields_of_the_same_kind_are_not_distinguishable() {
    let report = judge().compare(&fields(Toy::default(), 100), &fields(Toy::default(), 200)).unwrap();
    assert_eq!(
        report.conclusion,
        Conclusion::NotDistinguishable,
        "{:?}",
        report.two_sample.iter().map(|t| (&t.name, t.result.auc)).collect::<Vec<_>>()
    );
    assert!(report.moments.iter().flat_map(|t| &t.result.descriptors).all(|d| d.within));
}

#[test]
fn the_most_important_feature_is_of_the_changed_kind() {
    let real = fields(Toy::default(), 100);
    for (toy, name, kinds) in [
        (Toy { blur: 2.2, ..Toy::default() }, "nuclei", vec![FeatureKind::Border]),
        (
            Toy { blur: 2.2, ..Toy::default() },
            "patches",
            vec![FeatureKind::Edges, FeatureKind::Spectrum, FeatureKind::Texture],
        ),
        (Toy { nucleus_px: 12.5, ..Toy::default() }, "nuclei", vec![FeatureKind::Shape]),
        (Toy { noise: 3.0, ..Toy::default() }, "patches", vec![FeatureKind::Noise, FeatureKind::Texture]),
        (Toy { nucleus_a: 0.6, ..Toy::default() }, "nuclei", vec![FeatureKind::Absorbance]),
    ] {
        let report = judge().compare(&real, &fields(toy, 200)).unwrap();
        let found = test(&report, name);
        assert_eq!(
            (report.conclusion, found.conclusion),
            (Conclusion::Distinguishable, Conclusion::Distinguishable),
            "{toy:?}"
        );
        let [low, high] = found.result.interval;
        assert!(
            found.result.auc > 0.8 && low <= found.result.auc && found.result.auc <= high,
            "{toy:?} {}",
            found.result.auc
        );
        assert!(
            kinds.contains(&found.result.distinguishing_features[0].kind),
            "{toy:?} {:?}",
            found.result.distinguishing_features[0]
        );
    }
}

#[test]
fn uniform_noise_and_blurred_copies_are_distinguishable() {
    let images = Toy::default().images(FIELDS, 100);
    let real = measured(&images);
    let noise = |p: &FieldImage| {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f32::from(u8::try_from(state >> 56).unwrap())
        };
        FieldImage {
            grey: p.grey.iter().map(|_| next()).collect(),
            nuclei: NucleiAnnotation::Points(Vec::new()),
            ..p.clone()
        }
    };
    let noise: Vec<FieldImage> = images.iter().map(noise).collect();
    let report = judge().compare(&real, &measured(&noise)).unwrap();
    assert_eq!(test(&report, "patches").conclusion, Conclusion::Distinguishable);
    // Noise has no nuclei.
    assert!(report.warnings.iter().any(|w| w.starts_with("nuclei: not compared")), "{:?}", report.warnings);

    let blurred: Vec<FieldImage> =
        images.iter().map(|p| FieldImage { grey: blur(&p.grey, p.width), ..p.clone() }).collect();
    let report = judge().compare(&real, &measured(&blurred)).unwrap();
    assert_eq!(report.conclusion, Conclusion::Distinguishable);
    assert!(test(&report, "patches").result.auc > 0.99);
}

/// A mean filter of 3 x 3 pixels, twice: approximately a Gaussian of 1.15 pixels.
fn blur(grey: &[f32], width: usize) -> Vec<f32> {
    let once = |grey: &[f32]| -> Vec<f32> {
        let height = grey.len() / width;
        let at = |x: usize, y: usize| {
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            let cells: Vec<f32> = rows
                .flat_map(|v| (x.saturating_sub(1)..(x + 2).min(width)).map(move |u| grey[v * width + u]))
                .collect();
            cells.iter().sum::<f32>() / cells.len() as f32
        };
        (0..grey.len()).map(|i| at(i % width, i / width)).collect()
    };
    once(&once(grey))
}

#[test]
fn nuclei_of_another_grade_in_similar_fields_are_distinguishable() {
    let real = fields(Toy::default(), 100);
    let other = fields(Toy { nucleus_px: 13.0, nucleus_a: 0.42, ..Toy::default() }, 200);
    let mut swapped = fields(Toy::default(), 300);
    for (field, other) in swapped.iter_mut().zip(other) {
        field.nuclei = other.nuclei;
    }
    let report = judge().compare(&real, &swapped).unwrap();
    assert_eq!(test(&report, "nuclei").conclusion, Conclusion::Distinguishable);
    assert_eq!(test(&report, "patches").conclusion, Conclusion::NotDistinguishable);
}

#[test]
fn nuclei_of_common_groups_are_tested_separately() {
    let grouped = |seed: u64| {
        let images = Toy::default().images(FIELDS, seed);
        let named = images
            .into_iter()
            .enumerate()
            .map(|(i, p)| FieldImage { group: if i < 4 { "N" } else { "H" }.to_owned(), ..p });
        measured(&named.collect::<Vec<_>>())
    };
    let (real, mut synthetic) = (grouped(100), grouped(200));
    let names = |report: &Report| report.two_sample.iter().map(|t| t.name.clone()).collect::<Vec<_>>();
    let report = judge().compare(&real, &synthetic).unwrap();
    assert_eq!(names(&report), ["nuclei", "cells", "patches", "nuclei of group H", "nuclei of group N"]);
    synthetic.retain(|f| f.group == "N");
    assert_eq!(names(&judge().compare(&real, &synthetic).unwrap()).last().unwrap(), "nuclei of group N");
}

#[test]
fn a_report_depends_on_the_seed_and_not_on_the_number_of_threads() {
    let (real, synthetic) = (fields(Toy::default(), 100), fields(Toy { blur: 1.4, ..Toy::default() }, 200));
    let with = |threads: usize, seed: u64| {
        let judge = Judge::new(&JudgeParams { seed, ..JudgeParams::quick() }).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| serde_json::to_string(&judge.compare(&real, &synthetic).unwrap()).unwrap())
    };
    assert_eq!(with(1, 0), with(5, 0));
    assert_ne!(with(1, 0), with(1, 1));
}

#[test]
fn a_report_is_read_back_and_its_page_is_self_contained() {
    let report = judge().compare(&fields(Toy::default(), 100)[..3], &fields(Toy::default(), 200)[..2]).unwrap();
    let text = serde_json::to_string(&report).unwrap();
    let back: Report = serde_json::from_str(&text).unwrap();
    assert_eq!(serde_json::to_string(&back).unwrap(), text);
    let page = report.to_html();
    for wanted in ["<!doctype html>", "data:image/png;base64,", "<svg ", "Synthetic, look most real", "</html>"] {
        assert!(page.contains(wanted), "{wanted}");
    }
    for loaded in ["http:", "https:", "<script", "<link", "@import", "url("] {
        assert!(!page.contains(loaded), "{loaded}");
    }
    assert_eq!(page.matches("src=\"").count(), page.matches("src=\"data:image/png;base64,").count());
    // JSON contains no crops.
    assert!(!text.contains("base64"));
}

#[test]
fn too_few_fields_and_other_measurement_parameters_are_errors() {
    let real = fields(Toy::default(), 100);
    assert_eq!(judge().compare(&real[..1], &real).unwrap_err(), Error::Fields { side: "real", count: 1, least: 2 });
    assert_eq!(judge().compare(&real, &[]).unwrap_err(), Error::Fields { side: "synthetic", count: 0, least: 2 });
    let measurer = Measurer::new(&MeasurerParams { pixel_um: 0.25, ..MeasurerParams::default() }).unwrap();
    let other =
        [measurer.measure(&Toy::default().image(1)).unwrap(), measurer.measure(&Toy::default().image(2)).unwrap()];
    assert!(matches!(judge().compare(&real, &other), Err(Error::Measurer { .. })));
    for (params, field) in [
        (JudgeParams { paper_nuclei: 7, ..JudgeParams::default() }, "paper_nuclei"),
        (
            JudgeParams {
                two_sample: TwoSampleParams { folds: 1, ..TwoSampleParams::default() },
                ..JudgeParams::default()
            },
            "two_sample.folds",
        ),
    ] {
        assert!(matches!(Judge::new(&params), Err(Error::Parameter { field: found, .. }) if found == field));
    }
}

#[test]
fn the_same_images_on_both_sides_are_a_warning() {
    let real = fields(Toy::default(), 100);
    let report = judge().compare(&real, &real).unwrap();
    assert!(
        report.warnings[0].starts_with("both sides are the same 8 images (toy 100, toy 101, toy 102, …)"),
        "{report:?}"
    );
    assert_eq!(report.conclusion, Conclusion::NotDistinguishable);
    let text = report.to_text();
    assert!(text.contains("chance") && text.contains("warning: both sides are the same"), "{text}");
    assert!(report.to_html().contains("Warning: both sides are the same"));
    let mut other = fields(Toy::default(), 200);
    other[3] = real[5].clone();
    let report = judge().compare(&real, &other).unwrap();
    assert!(report.warnings[0].starts_with("1 image is on both sides (toy 105)"), "{:?}", report.warnings);
}

#[test]
fn features_are_described_and_importances_are_fractions() {
    let report =
        judge().compare(&fields(Toy::default(), 100), &fields(Toy { blur: 2.2, ..Toy::default() }, 200)).unwrap();
    let found = test(&report, "nuclei");
    let first = &found.result.distinguishing_features[0];
    assert_ne!(first.feature, first.description);
    let sum: f64 = found.result.distinguishing_features.iter().map(|f| f.importance).sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    let (text, page) = (report.to_text(), report.to_html());
    assert!(text.contains(&first.description) && page.contains(&first.description), "{text}");
    assert!(text.contains("% of pairs the synthetic one looks more synthetic"), "{text}");
}

#[test]
fn a_comparison_reports_its_phases_and_stops() {
    let (real, synthetic) = (fields(Toy::default(), 100), fields(Toy::default(), 200));
    let stop = AtomicBool::new(false);
    let phases = std::sync::Mutex::new(Vec::<String>::new());
    let note = |p: Progress| {
        assert!(p.done >= 1 && p.done <= p.total, "{p:?}");
        let mut phases = phases.lock().unwrap();
        if phases.last().is_none_or(|last| last != p.phase) {
            phases.push(p.phase.to_owned());
        }
    };
    judge().compare_with(&real, &synthetic, &Control { stop: &stop, report: &note }).unwrap();
    let expected = ["classifying nuclei", "classifying cells", "classifying patches", "comparing nuclear texture"];
    assert_eq!(*phases.lock().unwrap(), expected);
    let end = |p: Progress| stop.store(p.phase == "classifying patches", Ordering::Relaxed);
    let control = Control { stop: &stop, report: &end };
    assert_eq!(judge().compare_with(&real, &synthetic, &control).unwrap_err(), Error::Stopped);
}

#[test]
fn the_first_set_of_features_has_no_texture_of_cytoplasm() {
    let (real, synthetic) = (fields(Toy::default(), 1), fields(Toy::default(), 2));
    let kinds = |features: FeatureSet| {
        let judge = Judge::new(&JudgeParams { features, ..JudgeParams::quick() }).unwrap();
        let report = judge.compare(&real, &synthetic).unwrap();
        let kinds = test(&report, "patches").result.kinds.clone();
        kinds.iter().any(|kind| kind.kind == FeatureKind::Cytoplasm)
    };
    assert!(!kinds(FeatureSet::First));
    let measured = real[0].patches.features.iter().any(|f| f.kind == FeatureKind::Cytoplasm);
    assert!(measured);
}

#[test]
fn the_papers_number_of_nuclei_is_thirty() {
    assert_eq!(JudgeParams::default().paper_nuclei, 30);
}

//! What the judge says of fields that are known to be alike or not.

use papsynth_judge::{
    Error, Family, Field, Gauge, GaugeParams, Judge, JudgeParams, Known, NucleiFrom, Picture, Report, TwoSampleParams,
    Verdict,
};

use crate::support::Toy;

const FIELDS: u64 = 8;

fn fields(toy: Toy, seed: u64) -> Vec<Field> {
    measured(&toy.pictures(FIELDS, seed))
}

fn measured(pictures: &[Picture]) -> Vec<Field> {
    let gauge = Gauge::new(&GaugeParams { nuclei_from: NucleiFrom::Points, ..GaugeParams::default() }).unwrap();
    pictures.iter().map(|p| gauge.measure(p).unwrap()).collect()
}

fn judge() -> Judge {
    Judge::new(&JudgeParams { seed: 3, ..JudgeParams::quick() }).unwrap()
}

fn test<'a>(report: &'a Report, name: &str) -> &'a papsynth_judge::Test<papsynth_judge::TwoSample> {
    report.two_sample.iter().find(|t| t.name == name).unwrap()
}

#[test]
fn fields_of_the_same_kind_are_not_told_apart() {
    let report = judge().compare(&fields(Toy::default(), 100), &fields(Toy::default(), 200)).unwrap();
    assert_eq!(
        report.verdict,
        Verdict::NotToldApart,
        "{:?}",
        report.two_sample.iter().map(|t| (&t.name, t.result.auc)).collect::<Vec<_>>()
    );
    assert!(report.moments.iter().flat_map(|t| &t.result.descriptors).all(|d| d.within));
}

#[test]
fn what_differs_is_told_and_named() {
    let real = fields(Toy::default(), 100);
    for (toy, name, families) in [
        (Toy { blur: 2.2, ..Toy::default() }, "nuclei", vec![Family::Rim]),
        (Toy { blur: 2.2, ..Toy::default() }, "patches", vec![Family::Edges, Family::Spectrum, Family::Texture]),
        (Toy { nucleus_px: 12.5, ..Toy::default() }, "nuclei", vec![Family::Shape]),
        (Toy { noise: 3.0, ..Toy::default() }, "patches", vec![Family::Noise, Family::Texture]),
        (Toy { nucleus_a: 0.6, ..Toy::default() }, "nuclei", vec![Family::Stain]),
    ] {
        let report = judge().compare(&real, &fields(toy, 200)).unwrap();
        let found = test(&report, name);
        assert_eq!((report.verdict, found.verdict), (Verdict::ToldApart, Verdict::ToldApart), "{toy:?}");
        let [low, high] = found.result.interval;
        assert!(
            found.result.auc > 0.8 && low <= found.result.auc && found.result.auc <= high,
            "{toy:?} {}",
            found.result.auc
        );
        assert!(families.contains(&found.result.giveaways[0].family), "{toy:?} {:?}", found.result.giveaways[0]);
    }
}

#[test]
fn uniform_noise_and_a_blurred_copy_are_told_apart() {
    let pictures = Toy::default().pictures(FIELDS, 100);
    let real = measured(&pictures);
    let noise = |p: &Picture| {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            f32::from(u8::try_from(state >> 56).unwrap())
        };
        Picture { grey: p.grey.iter().map(|_| next()).collect(), nuclei: Known::Points(Vec::new()), ..p.clone() }
    };
    let noise: Vec<Picture> = pictures.iter().map(noise).collect();
    let report = judge().compare(&real, &measured(&noise)).unwrap();
    assert_eq!(test(&report, "patches").verdict, Verdict::ToldApart);
    // Noise has no nuclei: nothing is said of them, and that is said.
    assert!(report.notes.iter().any(|n| n.starts_with("nuclei: fewer than two fields")), "{:?}", report.notes);

    let blurred: Vec<Picture> =
        pictures.iter().map(|p| Picture { grey: blur(&p.grey, p.width), ..p.clone() }).collect();
    let report = judge().compare(&real, &measured(&blurred)).unwrap();
    assert_eq!(report.verdict, Verdict::ToldApart);
    assert!(test(&report, "patches").result.auc > 0.99);
}

/// The mean of 3 x 3 pixels, twice: a Gaussian of 1.15 pixels, about.
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
fn nuclei_of_another_grade_in_the_same_fields_are_told_apart() {
    let real = fields(Toy::default(), 100);
    let other = fields(Toy { nucleus_px: 13.0, nucleus_a: 0.42, ..Toy::default() }, 200);
    let mut swapped = fields(Toy::default(), 300);
    for (field, other) in swapped.iter_mut().zip(other) {
        field.nuclei = other.nuclei;
    }
    let report = judge().compare(&real, &swapped).unwrap();
    assert_eq!(test(&report, "nuclei").verdict, Verdict::ToldApart);
    assert_eq!(test(&report, "patches").verdict, Verdict::NotToldApart);
}

#[test]
fn groups_that_both_sides_have_are_looked_at_apart() {
    let grouped = |seed: u64| {
        let pictures = Toy::default().pictures(FIELDS, seed);
        let named = pictures
            .into_iter()
            .enumerate()
            .map(|(i, p)| Picture { group: if i < 4 { "N" } else { "H" }.to_owned(), ..p });
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
fn the_numbers_are_the_same_with_any_number_of_threads_and_another_seed_changes_them() {
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
fn a_report_is_read_back_and_its_page_needs_nothing_else() {
    let report = judge().compare(&fields(Toy::default(), 100)[..3], &fields(Toy::default(), 200)[..2]).unwrap();
    let text = serde_json::to_string(&report).unwrap();
    let back: Report = serde_json::from_str(&text).unwrap();
    assert_eq!(serde_json::to_string(&back).unwrap(), text);
    let page = report.to_html();
    for wanted in ["<!doctype html>", "data:image/png;base64,", "<svg ", "Synthetic, most convincing", "</html>"] {
        assert!(page.contains(wanted), "{wanted}");
    }
    for loaded in ["http:", "https:", "<script", "<link", "@import", "url("] {
        assert!(!page.contains(loaded), "{loaded}");
    }
    assert_eq!(page.matches("src=\"").count(), page.matches("src=\"data:image/png;base64,").count());
    // No crops in the numbers.
    assert!(!text.contains("base64"));
}

#[test]
fn too_few_fields_and_other_gauges_are_refused() {
    let real = fields(Toy::default(), 100);
    assert_eq!(judge().compare(&real[..1], &real).unwrap_err(), Error::Fields { side: "real", count: 1, least: 2 });
    assert_eq!(judge().compare(&real, &[]).unwrap_err(), Error::Fields { side: "synthetic", count: 0, least: 2 });
    let gauge = Gauge::new(&GaugeParams { pixel_um: 0.25, ..GaugeParams::default() }).unwrap();
    let other =
        [gauge.measure(&Toy::default().picture(1)).unwrap(), gauge.measure(&Toy::default().picture(2)).unwrap()];
    assert!(matches!(judge().compare(&real, &other), Err(Error::Gauge { .. })));
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
fn the_papers_number_of_nuclei_is_thirty() {
    assert_eq!(JudgeParams::default().paper_nuclei, 30);
}

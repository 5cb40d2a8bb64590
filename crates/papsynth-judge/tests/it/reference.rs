//! Tests on real fields in the folder `PAPSYNTH_REFERENCE`, which are not part of the project.

use std::fs;
use std::path::{Path, PathBuf};

use papsynth_judge::{
    Conclusion, Field, FieldImage, Judge, JudgeParams, Measurer, MeasurerParams, NucleiAnnotation, NucleiFrom, Report,
    TwoSampleParams,
};
use rayon::prelude::*;

fn reference() -> Option<PathBuf> {
    let Some(root) = std::env::var_os("PAPSYNTH_REFERENCE") else {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "PAPSYNTH_REFERENCE is not set");
        eprintln!("skipped: PAPSYNTH_REFERENCE is not set");
        return None;
    };
    Some(PathBuf::from(root).join("cervix93"))
}

/// Reads all fields, ordered by grade.
fn pictures(folder: &Path) -> Vec<FieldImage> {
    let table = fs::read_to_string(folder.join("frames.csv")).unwrap();
    let rows: Vec<(&str, &str)> = table.lines().skip(1).filter_map(|line| line.split_once(',')).collect();
    let picture = |(name, group): &(&str, &str)| {
        let image = image::open(folder.join(format!("{name}.png"))).unwrap().to_luma8();
        let points = fs::read_to_string(folder.join(format!("{name}.csv"))).unwrap();
        let point = |line: &str| {
            let (y, x) = line.split_once(',').unwrap();
            [x.parse().unwrap(), y.parse().unwrap()]
        };
        FieldImage {
            name: (*name).to_owned(),
            group: (*group).to_owned(),
            width: image.width() as usize,
            grey: image.into_raw().into_iter().map(f32::from).collect(),
            full_scale: 255.0,
            nuclei: NucleiAnnotation::Points(points.lines().map(point).collect()),
            ..FieldImage::default()
        }
    };
    rows.par_iter().map(picture).collect()
}

fn measured(pictures: &[FieldImage], nuclei_from: NucleiFrom) -> Vec<Field> {
    let measurer = Measurer::new(&MeasurerParams { nuclei_from, ..MeasurerParams::default() }).unwrap();
    pictures.par_iter().map(|p| measurer.measure(p).unwrap()).collect()
}

fn judged(real: &[Field], synthetic: &[Field]) -> Report {
    let two_sample = TwoSampleParams { trees: 60, half_splits: 4, permuted: 0, ..TwoSampleParams::default() };
    Judge::new(&JudgeParams { two_sample, ..JudgeParams::default() }).unwrap().compare(real, synthetic).unwrap()
}

fn conclusions(report: &Report) -> Vec<(String, Conclusion, f64)> {
    report.two_sample.iter().map(|t| (t.name.clone(), t.conclusion, t.result.auc)).collect()
}

#[test]
fn recall_and_precision_of_the_segmentation_are_high() {
    let Some(folder) = reference() else { return };
    let pictures = pictures(&folder);
    let fields = measured(&pictures, NucleiFrom::Search);
    let (mut marked, mut found, mut both) = (0, 0, 0);
    for (picture, field) in pictures.iter().zip(&fields) {
        let NucleiAnnotation::Points(points) = &picture.nuclei else { unreachable!() };
        let mut free: Vec<[f64; 2]> = field.nuclei.places.clone();
        marked += points.len();
        found += free.len();
        for p in points {
            let far = |q: &[f64; 2]| (q[0] - p[0]) * (q[0] - p[0]) + (q[1] - p[1]) * (q[1] - p[1]);
            let nearest = (0..free.len()).min_by(|a, b| far(&free[*a]).total_cmp(&far(&free[*b])));
            if let Some(i) = nearest.filter(|i| far(&free[*i]) < 15.0 * 15.0) {
                free.swap_remove(i);
                both += 1;
            }
        }
    }
    let (recall, precision) = (f64::from(both) / marked as f64, f64::from(both) / found as f64);
    eprintln!("{marked} annotated nuclei: recall {recall:.3}; {found} segmented nuclei: precision {precision:.3}");
    assert!(recall > 0.78 && precision > 0.7, "{recall} {precision}");
}

#[test]
fn halves_of_the_real_fields_are_not_distinguishable_and_grades_are() {
    let Some(folder) = reference() else { return };
    let fields = measured(&pictures(&folder), NucleiFrom::Points);
    // Every other field of each grade.
    let half = |odd: usize| {
        fields.iter().enumerate().filter(|(i, _)| i % 2 == odd).map(|(_, f)| f.clone()).collect::<Vec<Field>>()
    };
    let report = judged(&half(0), &half(1));
    eprintln!("halves: {:?}", conclusions(&report));
    assert_eq!(report.conclusion, Conclusion::NotDistinguishable, "{:?}", conclusions(&report));

    let of = |group: &str| fields.iter().filter(|f| f.group == group).cloned().collect::<Vec<Field>>();
    let (negative, mut swapped, high) = (of("N"), of("N"), of("H"));
    // Nuclei of high grade in negative fields.
    for (field, other) in swapped.iter_mut().zip(high.iter().cycle()) {
        field.nuclei = other.nuclei.clone();
    }
    let report = judged(&negative, &swapped);
    eprintln!("nuclei of high grade in negative fields: {:?}", conclusions(&report));
    assert_eq!(report.two_sample[0].conclusion, Conclusion::Distinguishable);
    assert!(report.two_sample[0].result.auc > 0.9);
}

//! Measurements of images with known properties.

use papsynth_judge::{
    Control, Detail, Error, Field, FieldImage, Measurer, MeasurerParams, NucleiAnnotation, NucleiFrom, Progress,
    Statistics, describe,
};

use crate::support::Toy;

fn measurer(nuclei_from: NucleiFrom) -> Measurer {
    Measurer::new(&MeasurerParams { nuclei_from, ..MeasurerParams::default() }).unwrap()
}

fn close(value: f64, wanted: f64, within: f64) {
    assert!((value - wanted).abs() <= within, "{value}, not {wanted} ± {within}");
}

fn middle(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn measurements_of_toy_fields_equal_their_parameters() {
    let toy = Toy { width: 640, height: 480, cells: 7, ..Toy::default() };
    let fields: Vec<_> = toy.images(6, 1).iter().map(|p| measurer(NucleiFrom::Points).measure(p).unwrap()).collect();
    let of = |f: &dyn Fn(&Statistics) -> f64| middle(fields.iter().map(|field| f(&field.statistics)).collect());
    // 1 − 0.03 x² − 0.01 y², whose mean is 1 − 0.04/3.
    close(of(&|s| s.background_dn), 230.0 * (1.0 - 0.04 / 3.0), 0.5);
    close(of(&|s| s.background_x2), -0.03, 0.002);
    close(of(&|s| s.background_y2), -0.01, 0.002);
    close(of(&|s| s.background_valley), 0.0405, 0.003);
    // Rounding to grey levels adds 1/12.
    close(of(&|s| s.noise_dn), (4.0_f64 + 1.0 / 12.0).sqrt(), 0.04);
    close(of(&|s| s.noise_across), 0.0, 0.01);
    close(of(&|s| s.noise_down), 0.0, 0.01);
    close(of(&|s| s.edge_sigma_p50), 1.2, 0.1);
    close(of(&|s| s.nucleus_um2), std::f64::consts::PI * 100.0 * 0.33 * 0.33, 5.0);
    assert!(of(&|s| s.circularity) > 0.95);
    assert!(of(&|s| s.solidity) > 0.97);
    assert!(of(&|s| s.corners) == 0.0);
    let nuclei: usize = fields.iter().map(|f| f.nuclei.len()).sum();
    assert!(nuclei >= 38, "{nuclei} of 42 nuclei");
    for (name, wanted, within) in
        [("core above surroundings", 0.35, 0.06), ("rim sigma, px", 1.2, 0.45), ("nucleus solidity", 0.97, 0.03)]
    {
        close(middle(fields.iter().flat_map(|f| f.nuclei.column(name)).collect()), wanted, within);
    }
}

#[test]
fn nuclei_from_search_points_and_masks_agree() {
    let image = Toy { cells: 4, ..Toy::default() }.image(11);
    let NucleiAnnotation::Points(points) = &image.nuclei else { unreachable!() };
    let found = measurer(NucleiFrom::Search).measure(&image).unwrap();
    let marked = measurer(NucleiFrom::Points).measure(&image).unwrap();
    assert_eq!(found.nuclei, marked.nuclei);
    assert_eq!(found.nuclei.len(), 4);
    let inside = |i: usize| {
        let (x, y) = ((i % image.width) as f64, (i / image.width) as f64);
        let near = |p: &[f64; 2]| (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y) < 100.0;
        points.iter().position(near).map_or(0, |i| u32::try_from(i).unwrap() + 1)
    };
    let masks =
        FieldImage { nuclei: NucleiAnnotation::Masks((0..image.grey.len()).map(inside).collect()), ..image.clone() };
    let given = measurer(NucleiFrom::Masks).measure(&masks).unwrap();
    assert_eq!(given.nuclei.len(), 4);
    for (a, b) in given.nuclei.places.iter().zip(&found.nuclei.places) {
        assert!((a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1.5, "{a:?} {b:?}");
    }
    // Points are the centres of masks.
    assert_eq!(measurer(NucleiFrom::Points).measure(&masks).unwrap().nuclei, marked.nuclei);
}

#[test]
fn statistics_do_not_depend_on_the_detail() {
    let image = Toy::default().image(3);
    let everything = measurer(NucleiFrom::Search).measure(&image).unwrap();
    let params = MeasurerParams { detail: Detail::Statistics, ..MeasurerParams::default() };
    let short = Measurer::new(&params).unwrap().measure(&image).unwrap();
    assert_eq!(format!("{:?}", short.statistics), format!("{:?}", everything.statistics));
    assert!(short.patches.is_empty() && !everything.patches.is_empty());
}

#[test]
fn measurements_do_not_depend_on_the_grey_scale_and_on_black_borders() {
    let image = Toy::default().image(5);
    let plain = measurer(NucleiFrom::Points).measure(&image).unwrap();
    let deep =
        FieldImage { grey: image.grey.iter().map(|g| g * 257.0).collect(), full_scale: 65_535.0, ..image.clone() };
    let deep = measurer(NucleiFrom::Points).measure(&deep).unwrap();
    close(deep.statistics.background_dn, plain.statistics.background_dn, 1e-3);
    assert_eq!(deep.nuclei.places, plain.nuclei.places);
    // Two black rows below, three black columns to the left.
    let mut grey = Vec::new();
    for row in image.grey.chunks(image.width) {
        grey.extend([0.0; 3]);
        grey.extend_from_slice(row);
    }
    grey.extend(vec![1.0; 2 * (image.width + 3)]);
    let NucleiAnnotation::Points(points) = &image.nuclei else { unreachable!() };
    let nuclei = NucleiAnnotation::Points(points.iter().map(|p| [p[0] + 3.0, p[1]]).collect());
    let framed = FieldImage { grey, width: image.width + 3, nuclei, ..image.clone() };
    let framed = measurer(NucleiFrom::Points).measure(&framed).unwrap();
    assert_eq!((framed.width, framed.height), (plain.width, plain.height));
    assert_eq!(framed.nuclei, plain.nuclei);
    // Unknown values are NaN, which is not equal to itself.
    let bits = |field: &Field| field.patches.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!((framed.patches.features.clone(), bits(&framed)), (plain.patches.features.clone(), bits(&plain)));
    assert_eq!(framed.patches.places, plain.patches.places);
}

#[test]
fn invalid_images_are_errors() {
    let good = Toy::default().image(1);
    let refused = |image: FieldImage| measurer(NucleiFrom::Masks).measure(&image).unwrap_err();
    let [mut nan, mut negative, mut bright] = [good.grey.clone(), good.grey.clone(), good.grey.clone()];
    nan[7] = f32::NAN;
    negative[7] = -1.0;
    bright[7] = 256.0;
    for grey in [nan, negative, bright, vec![7.0; good.grey.len()]] {
        assert!(matches!(refused(FieldImage { grey, ..good.clone() }), Error::Image { .. }));
    }
    for width in [0, 31, 319] {
        let message = refused(FieldImage { width, ..good.clone() }).to_string();
        assert!(message.contains(&format!(" {width} x ")) && message.contains("expected 32 x 32 or more"), "{message}");
    }
    for full_scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(refused(FieldImage { full_scale, ..good.clone() }), Error::Image { .. }));
    }
    assert!(matches!(
        refused(FieldImage { nuclei: NucleiAnnotation::Masks(vec![1; 7]), ..good.clone() }),
        Error::Image { .. }
    ));
    assert!(matches!(
        refused(FieldImage { nuclei: NucleiAnnotation::Points(vec![[f64::NAN, 1.0]]), ..good }),
        Error::Image { .. }
    ));
}

#[test]
fn parameters_have_ranges() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY, 11.0] {
        let params = MeasurerParams { pixel_um: bad, ..MeasurerParams::default() };
        assert!(matches!(Measurer::new(&params), Err(Error::Parameter { field: "pixel_um", .. })));
    }
    let mut params = MeasurerParams::default();
    params.nuclei.largest_um2 = 10.0;
    let message = Measurer::new(&params).unwrap_err().to_string();
    assert_eq!(message, "nuclei.largest_um2 = 10 is out of range: expected nuclei.smallest_um2 to 100000 um2");
}

#[test]
fn coarsening_keeps_the_mean_and_moves_the_annotation() {
    let image = Toy::default().image(2);
    let coarse = image.coarsened(1.6);
    assert_eq!((coarse.width, coarse.height()), (200, 150));
    let mean = |p: &FieldImage| p.grey.iter().map(|g| f64::from(*g)).sum::<f64>() / p.grey.len() as f64;
    close(mean(&coarse), mean(&image), 0.01);
    let (NucleiAnnotation::Points(fine), NucleiAnnotation::Points(moved)) = (&image.nuclei, &coarse.nuclei) else {
        unreachable!()
    };
    for (a, b) in fine.iter().zip(moved) {
        close(b[0], (a[0] + 0.5) / 1.6 - 0.5, 1e-12);
    }
    assert_eq!(image.coarsened(1.0), image);
    // Whole factors are means of squares.
    let halved = image.coarsened(2.0);
    let square = [0, 1, 320, 321].map(|i| f64::from(image.grey[10 * 320 + 14 + i])).iter().sum::<f64>() / 4.0;
    close(f64::from(halved.grey[5 * 160 + 7]), square, 1e-4);
}

#[test]
fn the_source_of_nuclei_follows_the_annotation() {
    for (known, from) in [
        (NucleiAnnotation::None, NucleiFrom::Search),
        (NucleiAnnotation::Points(vec![]), NucleiFrom::Points),
        (NucleiAnnotation::Masks(vec![]), NucleiFrom::Masks),
    ] {
        assert_eq!(NucleiFrom::of(&known), from);
        assert!(NucleiFrom::ALL.contains(&from));
    }
}

#[test]
fn every_feature_and_statistic_has_its_own_description() {
    let toy = Toy { width: 640, height: 480, cells: 7, ..Toy::default() };
    let field = measurer(NucleiFrom::Points).measure(&toy.image(1)).unwrap();
    for table in [&field.nuclei, &field.cells, &field.patches] {
        assert!(!table.is_empty());
        let described: std::collections::BTreeSet<String> = table.features.iter().map(|f| describe(&f.name)).collect();
        assert_eq!(described.len(), table.features.len());
        for feature in &table.features {
            assert_ne!(describe(&feature.name), feature.name);
        }
    }
    for (name, _) in field.statistics.scalars() {
        assert!(describe(name) != name || name == "coverage", "{name}");
    }
}

#[test]
fn fields_are_measured_in_parallel_until_the_stop_flag_is_set() {
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
    let images = Toy::default().images(4, 1);
    let (stop, done) = (AtomicBool::new(false), AtomicUsize::new(0));
    let count = |p: Progress| {
        assert_eq!((p.phase, p.total), ("measuring fields", 4));
        done.fetch_add(1, Ordering::Relaxed);
    };
    let measurer = measurer(NucleiFrom::Points);
    let read = |image: &FieldImage| Ok::<FieldImage, Error>(image.clone());
    let control = Control { stop: &stop, report: &count };
    let fields = measurer.measure_all(&images, read, &control).unwrap();
    assert_eq!(done.load(Ordering::Relaxed), 4);
    assert_eq!(fields[2].nuclei, measurer.measure(&images[2]).unwrap().nuclei);
    let control = Control { stop: &stop, report: &|_| stop.store(true, Ordering::Relaxed) };
    assert_eq!(measurer.measure_all(&images, read, &control), Err(Error::Stopped));
}

//! Arbitrary images do not cause panics.

use papsynth_judge::{
    FieldImage, Judge, JudgeParams, Measurer, MeasurerParams, NucleiAnnotation, NucleiFrom, TwoSampleParams,
};
use proptest::prelude::*;

fn grey(kind: u8, i: usize, width: usize, seed: u64) -> f32 {
    let (x, y) = (i % width, i / width);
    let noise = (seed ^ i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56;
    let level = match kind {
        0 => noise,
        1 => u64::from((x + y) % 2 == 0) * 255,
        2 => u64::from(x < width / 2) * 200 + noise / 64,
        3 => u64::from(i as u64 == seed % 997) * 255,
        4 => 230 - 200 * u64::from((x % 16) * (x % 16) + (y % 16) * (y % 16) < 90),
        _ => 255 * u64::from(noise > 2),
    };
    f32::from(u8::try_from(level.min(255)).unwrap())
}

fn image(kind: u8, width: usize, height: usize, seed: u64, known: u8) -> FieldImage {
    let pixels = width * height;
    let nuclei = match known {
        0 => NucleiAnnotation::None,
        1 => NucleiAnnotation::Points(
            (0..5).map(|k| [(seed % 400) as f64 - 50.0 * k as f64, 1e6 - 2e5 * k as f64]).collect(),
        ),
        _ => NucleiAnnotation::Masks((0..pixels).map(|i| u32::try_from((i / 37) % 5).unwrap()).collect()),
    };
    let grey = (0..pixels).map(|i| grey(kind, i, width, seed)).collect();
    FieldImage { name: "any".to_owned(), grey, width, nuclei, ..FieldImage::default() }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn any_image_is_measured_or_an_error(
        kind in 0_u8..6, known in 0_u8..3, width in 1_usize..120, height in 1_usize..120, seed: u64, pixel_um in 0.02_f64..10.0,
        from in 0_usize..3,
    ) {
        let nuclei_from = NucleiFrom::ALL[from];
        let measurer = Measurer::new(&MeasurerParams { pixel_um, nuclei_from, ..MeasurerParams::default() }).unwrap();
        let image = image(kind, width, height, seed, known);
        if let Ok(field) = measurer.measure(&image) {
            prop_assert_eq!(field.nuclei.values.len(), field.nuclei.len() * field.nuclei.features.len());
            prop_assert_eq!(field.patches.len(), 1);
            let parts: f64 = field.statistics.histogram.iter().sum();
            prop_assert!((parts - 1.0).abs() < 1e-9);
        }
        let coarse = image.coarsened(pixel_um);
        prop_assert!(coarse.grey.iter().all(|g| (0.0..=255.01).contains(g)));
    }

    #[test]
    fn any_sets_of_fields_are_compared(kinds in proptest::collection::vec(0_u8..6, 5), seed: u64) {
        let measurer = Measurer::new(&MeasurerParams::default()).unwrap();
        let measured: Vec<_> = kinds.iter().filter_map(|k| measurer.measure(&image(*k, 64, 48, seed ^ u64::from(*k), 0)).ok()).collect();
        let two_sample = TwoSampleParams { trees: 20, half_splits: 1, bootstrap: 10, permuted: 2, folds: 2 };
        let judge = Judge::new(&JudgeParams { two_sample, draws: 20, seed, ..JudgeParams::default() }).unwrap();
        if measured.len() >= 4 {
            let report = judge.compare(&measured[..2], &measured[2..]).unwrap();
            prop_assert!(report.to_html().ends_with("</html>\n"));
            let text = serde_json::to_string(&report).unwrap();
            prop_assert!(serde_json::from_str::<papsynth_judge::Report>(&text).is_ok());
        }
    }
}

//! Properties of synthesised textures.

use quilt_texture::{Acceptance, CentreBias, Error, Origin, QuiltParams, Quilter, Rng, Seam, Search, Source, Texture};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use rustfft::{FftPlanner, num_complex::Complex64};

const SEED: u64 = 0x9_0117;

type Generator = Xoshiro256PlusPlus;

fn rng() -> Generator {
    Xoshiro256PlusPlus::seed_from_u64(SEED)
}

fn disc(side: usize) -> Vec<f32> {
    let offset = |i: usize| (2 * i + 1) as f32 / side as f32 - 1.0;
    let square = |i: usize| offset(i % side) * offset(i % side) + offset(i / side) * offset(i / side);
    (0..side * side).map(|i| if square(i) < 1.0 { 1.0 } else { 0.0 }).collect()
}

fn noise(count: usize, rng: &mut Generator) -> Vec<f32> {
    (0..count).map(|_| (rng.next_u32() >> 8) as f32 / (1 << 24) as f32).collect()
}

/// Returns a periodic Matérn field of variance 1 and ν = 1, with the spectrum (1 + (2π f l)² / 2)^-2. For l = 2, its
/// autocorrelation at one to six pixels is similar to that of chromatin.
fn matern(side: usize, length_px: f64, rng: &mut Generator) -> Vec<f32> {
    let mut columns: Vec<Complex64> = (0..side * side)
        .map(|_| Complex64::from((0..12).map(|_| noise(1, rng)[0] as f64).sum::<f64>() - 6.0))
        .collect();
    let mut planner = FftPlanner::new();
    let (forward, inverse) = (planner.plan_fft_forward(side), planner.plan_fft_inverse(side));
    let transpose = |image: &[Complex64]| -> Vec<Complex64> {
        (0..side * side).map(|i| image[i % side * side + i / side]).collect()
    };
    forward.process(&mut columns);
    columns = transpose(&columns);
    forward.process(&mut columns);
    let frequency = |k: usize| k.min(side - k) as f64 / side as f64;
    let amplitude = |i: usize| {
        let (u, v) = (frequency(i % side), frequency(i / side));
        let x = core::f64::consts::TAU * length_px;
        1.0 / (1.0 + x * x * (u * u + v * v) / 2.0)
    };
    let power: f64 = (0..side * side).map(|i| amplitude(i) * amplitude(i)).sum();
    let scale = 1.0 / (side as f64 * power.sqrt());
    for (i, z) in columns.iter_mut().enumerate() {
        *z *= amplitude(i) * scale;
    }
    inverse.process(&mut columns);
    columns = transpose(&columns);
    inverse.process(&mut columns);
    #[expect(clippy::cast_possible_truncation, reason = "pixels are single precision")]
    let pixels = columns.iter().map(|z| z.re as f32).collect();
    pixels
}

/// Returns the mean product of pixels under the mask at lags of 0 to 6 px along x and y.
fn autocovariance(pixels: &[f32], mask: &[f32], width: usize) -> [f64; 7] {
    let mut result = [0.0; 7];
    for (lag, result) in result.iter_mut().enumerate() {
        let mut sums = [0.0, 0.0];
        for i in (0..pixels.len()).filter(|&i| mask[i] > 0.0) {
            let right = if i % width + lag < width { Some(i + lag) } else { None };
            let down = Some(i + lag * width).filter(|&j| j < pixels.len());
            for j in [right, down].into_iter().flatten().filter(|&j| mask[j] > 0.0) {
                sums[0] += f64::from(pixels[i]) * f64::from(pixels[j]);
                sums[1] += 1.0;
            }
        }
        *result = sums[0] / sums[1];
    }
    result
}

fn synthesise(sources: &[Source], params: &QuiltParams, target: &[f32], width: usize, rng: &mut Generator) -> Texture {
    let sources: Vec<&Source> = sources.iter().collect();
    Quilter::new(&sources, params).unwrap().synthesise(target, width, rng)
}

fn every_seam() -> [Seam; 3] {
    [Seam::Feather, Seam::MinCut { feather_px: 0 }, Seam::MinCut { feather_px: 2 }]
}

fn every_acceptance() -> [Acceptance; 3] {
    [
        Acceptance::Near { factor: 1.1, floor: 0.05 },
        Acceptance::Near { factor: 1.0, floor: 0.0 },
        Acceptance::Threshold { d_max: 0.3, max_tries: 50 },
    ]
}

#[test]
fn pixels_of_a_sharp_cut_are_pixels_of_a_source() {
    let mut rng = rng();
    let (mask, other) = (disc(40), disc(31));
    let images = [noise(1600, &mut rng), noise(961, &mut rng)];
    let sources = [Source::new(&images[0], &mask, 40).unwrap(), Source::new(&images[1], &other, 31).unwrap()];
    let target = disc(57);
    for acceptance in every_acceptance() {
        for centre_bias in [CentreBias::Off, CentreBias::Weighted { strength: 2.0 }] {
            let params = QuiltParams { acceptance, centre_bias, ..QuiltParams::default() };
            let texture = synthesise(&sources, &params, &target, 57, &mut rng);
            let mut used = [0, 0];
            for (i, &expected) in target.iter().enumerate() {
                match texture.origins[i] {
                    Some(Origin { source, pixel }) => {
                        assert!(expected > 0.0);
                        assert_eq!(texture.pixels[i], images[source][pixel]);
                        assert!([&mask, &other][source][pixel] >= 0.5);
                        used[source] += 1;
                    }
                    None => assert_eq!((expected, texture.pixels[i]), (0.0, 0.0)),
                }
            }
            assert!(used.iter().all(|&n| n > 50), "{used:?}");
        }
    }
}

#[test]
fn seam_weights_sum_to_one() {
    let mut rng = rng();
    let source = Source::new(&[0.7; 400], &[1.0; 400], 20).unwrap();
    let target = disc(33);
    for seam in every_seam() {
        for acceptance in every_acceptance() {
            let params = QuiltParams { seam, acceptance, ..QuiltParams::default() };
            let texture = synthesise(core::slice::from_ref(&source), &params, &target, 33, &mut rng);
            for (&v, &expected) in texture.pixels.iter().zip(&target) {
                assert_eq!(v, 0.7 * expected);
            }
        }
    }
}

#[test]
fn blended_pixels_are_in_the_range_of_the_sources() {
    let mut rng = rng();
    let source = Source::new(&noise(900, &mut rng), &disc(30), 30).unwrap();
    for seam in every_seam() {
        let params = QuiltParams { seam, ..QuiltParams::default() };
        let texture = synthesise(core::slice::from_ref(&source), &params, &[1.0; 2000], 40, &mut rng);
        assert!(texture.pixels.iter().all(|v| (0.0..=1.0).contains(v)));
        assert!(texture.origins.iter().all(Option::is_some));
    }
}

#[test]
fn a_regular_pattern_continues_across_seams() {
    let mut rng = rng();
    let pattern = |x: usize, y: usize| ((x + 2 * y) % 5) as f32;
    let image: Vec<f32> = (0..900).map(|i| pattern(i % 30, i / 30)).collect();
    let source = Source::new(&image, &[1.0; 900], 30).unwrap();
    for seam in every_seam() {
        for search in [Search::Direct, Search::Fft, Search::Auto] {
            let params = QuiltParams { seam, search, centre_bias: CentreBias::Off, ..QuiltParams::default() };
            let texture = synthesise(core::slice::from_ref(&source), &params, &[1.0; 60 * 45], 60, &mut rng);
            let phase = (0..5).find(|&p| pattern(p, 0) == texture.pixels[0]).unwrap();
            for (i, &v) in texture.pixels.iter().enumerate() {
                assert_eq!(v, pattern(i % 60 + phase, i / 60), "{seam:?} {search:?} {i}");
            }
        }
    }
}

#[test]
fn all_searches_find_the_same_best_candidate() {
    let mut images = rng();
    let sources: Vec<Source> =
        [40, 57].map(|side| Source::new(&noise(side * side, &mut images), &disc(side), side).unwrap()).into();
    let target = disc(70);
    let texture = |search, patch_px| {
        let params = QuiltParams {
            patch_px,
            // Only the best candidate, so that rounding errors have no effect.
            acceptance: Acceptance::Near { factor: 1.0, floor: 0.0 },
            search,
            ..QuiltParams::default()
        };
        synthesise(&sources, &params, &target, 70, &mut rng())
    };
    for patch_px in [7, 16] {
        let direct = texture(Search::Direct, patch_px);
        for search in [Search::Fft, Search::Auto] {
            assert!(direct == texture(search, patch_px), "{search:?} {patch_px}");
        }
    }
}

#[test]
fn variance_and_autocorrelation_are_preserved() {
    const DRAWS: usize = 120;
    let mut rng = rng();
    // Three nuclei of 40 px, as in the paper; one large texture.
    let nuclei = QuiltParams::default();
    let large = QuiltParams { patch_px: 20, overlap_px: 6, centre_bias: CentreBias::Off, ..QuiltParams::default() };
    for (params, side, mask, count, draws) in
        [(nuclei, 40, disc(40), 3, DRAWS), (large, 96, vec![1.0; 96 * 96], 1, DRAWS / 4)]
    {
        let (mut real, mut synthesised) = ([0.0; 7], [0.0; 7]);
        for _ in 0..draws {
            let images: Vec<_> = (0..count).map(|_| matern(side, 2.0, &mut rng)).collect();
            let sources: Vec<_> = images.iter().map(|i| Source::new(i, &mask, side).unwrap()).collect();
            let texture = synthesise(&sources, &params, &mask, side, &mut rng);
            let add = |sum: &mut [f64; 7], pixels: &[f32], weight: f64| {
                let covariance = autocovariance(pixels, &mask, side);
                sum.iter_mut().zip(covariance).for_each(|(s, c)| *s += weight * c);
            };
            images.iter().for_each(|image| add(&mut real, image, 1.0 / count as f64));
            add(&mut synthesised, &texture.pixels, 1.0);
        }
        let ratio = synthesised[0] / real[0];
        assert!((0.9..1.05).contains(&ratio), "variance ratio {ratio}");
        let squares = (1..7).map(|lag| synthesised[lag] / synthesised[0] - real[lag] / real[0]).map(|d| d * d);
        let rmse = (squares.sum::<f64>() / 6.0).sqrt();
        assert!(rmse <= 0.03, "autocorrelation off by {rmse}");
    }
}

#[test]
fn central_patches_come_from_the_centres_of_sources() {
    let target = disc(40);
    let depth = |i: usize| {
        let offset = |i: usize| (2 * i + 1) as f64 / 40.0 - 1.0;
        1.0 - (offset(i % 40) * offset(i % 40) + offset(i / 40) * offset(i / 40)).sqrt()
    };
    for acceptance in every_acceptance() {
        let difference = |centre_bias| {
            let mut rng = rng();
            let params = QuiltParams { acceptance, centre_bias, ..QuiltParams::default() };
            let mut sums = [0.0, 0.0];
            for _ in 0..20 {
                let sources: Vec<_> =
                    (0..3).map(|_| Source::new(&noise(1600, &mut rng), &target, 40).unwrap()).collect();
                let texture = synthesise(&sources, &params, &target, 40, &mut rng);
                for (i, origin) in texture.origins.iter().enumerate() {
                    if let Some(origin) = origin {
                        let away = depth(i) - depth(origin.pixel);
                        sums[0] += away * away;
                        sums[1] += 1.0;
                    }
                }
            }
            (sums[0] / sums[1]).sqrt()
        };
        let off = difference(CentreBias::Off);
        assert_eq!(off, difference(CentreBias::Weighted { strength: 0.0 }));
        let on = difference(CentreBias::Weighted { strength: 5.0 });
        assert!(on < 0.85 * off, "{acceptance:?}: {on} with, {off} without");
    }
}

#[test]
fn a_lower_threshold_or_feathering_reduces_differences_at_seams() {
    let mask = disc(40);
    let step = |d_max, seam| {
        let mut rng = rng();
        let params =
            QuiltParams { acceptance: Acceptance::Threshold { d_max, max_tries: 2000 }, seam, ..QuiltParams::paper() };
        let mut sums = [0.0, 0.0];
        for _ in 0..20 {
            let sources: Vec<_> = (0..3).map(|_| Source::new(&matern(40, 2.0, &mut rng), &mask, 40).unwrap()).collect();
            let texture = synthesise(&sources, &params, &mask, 40, &mut rng);
            for i in (0..1599).filter(|i| mask[*i] * mask[i + 1] > 0.0) {
                let (Some(here), Some(there)) = (texture.origins[i], texture.origins[i + 1]) else {
                    panic!("a pixel of the target is missing");
                };
                if there.source != here.source || there.pixel != here.pixel + 1 {
                    let d = f64::from(texture.pixels[i] - texture.pixels[i + 1]);
                    sums[0] += d * d;
                    sums[1] += 1.0;
                }
            }
        }
        sums[0] / sums[1]
    };
    let sharp = Seam::MinCut { feather_px: 0 };
    let any = step(1e9, sharp);
    let good = step(15.0 / 17.0, sharp);
    let best = step(0.0, sharp);
    assert!(best < good && good < any, "{best}, {good}, {any}");
    assert!(step(1e9, Seam::Feather) < any);
    assert!(step(1e9, Seam::MinCut { feather_px: 1 }) < any);
}

#[test]
fn the_same_seed_gives_the_same_texture() {
    let sources = [Source::new(&noise(1600, &mut rng()), &disc(40), 40).unwrap()];
    for params in [QuiltParams::default(), QuiltParams::paper()] {
        let draw = |rng: &mut Generator| synthesise(&sources, &params, &disc(40), 40, rng);
        assert_eq!(draw(&mut rng()), draw(&mut rng()));
        let mut rng = rng();
        assert_ne!(draw(&mut rng), draw(&mut rng));
    }
}

#[test]
fn targets_of_any_shape_are_filled() {
    let mut rng = rng();
    let sources = [Source::new(&noise(400, &mut rng), &disc(20), 20).unwrap()];
    let speckled: Vec<f32> = noise(50 * 41, &mut rng).iter().map(|v| if *v < 0.02 { 0.01 } else { 0.0 }).collect();
    for (target, width) in [
        (vec![1.0], 1),
        (vec![1.0; 7], 7),
        (vec![1.0; 64], 1),
        (vec![0.0; 900], 30),
        (vec![f32::NAN; 900], 30),
        (vec![], 5),
        (speckled, 50),
    ] {
        for params in [QuiltParams::default(), QuiltParams::paper()] {
            let texture = synthesise(&sources, &params, &target, width, &mut rng);
            assert_eq!((texture.pixels.len(), texture.width), (target.len(), width));
            for (origin, &expected) in texture.origins.iter().zip(&target) {
                assert_eq!(origin.is_some(), expected > 0.0);
            }
        }
    }
}

#[test]
fn too_small_sources_are_rejected() {
    let params = QuiltParams::default();
    assert_eq!(Quilter::new(&[], &params).unwrap_err(), Error::NoSource);
    let (large, small) =
        (Source::new(&[1.0; 400], &[1.0; 400], 20).unwrap(), Source::new(&[1.0; 120], &disc(20)[..120], 20).unwrap());
    let error = Quilter::new(&[&large, &small], &params).unwrap_err();
    assert!(matches!(error, Error::SourceTooSmall { index: 1, patch_px: 9 }));
}

#[test]
#[should_panic(expected = "a multiple of the width 7")]
fn a_partial_row_is_rejected() {
    let source = Source::new(&[1.0; 400], &[1.0; 400], 20).unwrap();
    let _ = synthesise(&[source], &QuiltParams::default(), &[1.0; 50], 7, &mut rng());
}

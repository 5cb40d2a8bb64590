//! Statistical properties of noise and camera. Bounds are in standard errors, with fixed seeds.

use ccd_noise::{Camera, CameraParams, NoiseField, PhotonNoise, ReadNoise};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

const KEY: u64 = 0x00e1_ec72_0000_0015;

/// Returns a 12-bit camera without fixed pattern.
fn twelve_bits() -> CameraParams {
    CameraParams { gain_dn_per_e: 3995.0 / 17_600.0, offset_dn: 100.0, bit_depth: 12, ..CameraParams::default() }
}

/// Returns the number of draws of a statistical test: 10⁵, or 10⁶ if `PAPSYNTH_TORTURE` is set. Both use the same
/// bounds in standard errors.
fn draws() -> usize {
    if std::env::var_os("PAPSYNTH_TORTURE").is_some() { 1_000_000 } else { 100_000 }
}

/// Returns deviates of one mean, in rows of 1000.
fn poisson(mean: f32, n: usize) -> Vec<f64> {
    let mut counts = vec![0.0; n];
    NoiseField::new(KEY).poisson_into(&vec![mean; n], 1000, [0, 0], &mut counts);
    counts.into_iter().map(f64::from).collect()
}

fn normal(key: u64, n: usize) -> Vec<f64> {
    let mut deviates = vec![0.0; n];
    NoiseField::new(key).normal_into(1000, [0, 0], &mut deviates);
    deviates.into_iter().map(f64::from).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Returns the mean of (value - centre)ᵖ.
fn moment(values: &[f64], centre: f64, p: i32) -> f64 {
    let power = |v: &f64| (0..p).fold(1.0, |m, _| m * (v - centre));
    values.iter().map(power).sum::<f64>() / values.len() as f64
}

fn variance(values: &[f64]) -> f64 {
    moment(values, mean(values), 2)
}

const MEANS: [f32; 13] = [0.01, 0.1, 1.0, 3.7, 10.0, 19.99, 20.0, 30.0, 200.0, 1e3, 17_850.0, 1e5, 1e6];

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small counts")]
fn index(count: f64) -> usize {
    count as usize
}

#[test]
fn poisson_deviates_follow_the_distribution() {
    for mu in MEANS {
        let counts = poisson(mu, draws());
        let n = counts.len() as f64;
        let mu = f64::from(mu);
        let probability = |k: f64| libm::exp(k * libm::log(mu) - mu - libm::lgamma(k + 1.0));
        let first = (mu - 8.0 * mu.sqrt()).floor().max(0.0);
        let bins = index(16.0 * mu.sqrt()) + 20;
        let mut observed = vec![0.0; bins];
        for k in &counts {
            assert!(k.fract() == 0.0 && *k >= 0.0);
            observed[index((k - first).max(0.0)).min(bins - 1)] += 1.0;
        }
        // Counts are pooled until 20 are expected.
        let (mut chi2, mut pools, mut left) = (0.0, 0.0, [0.0, 0.0, n]);
        for (i, o) in observed.iter().enumerate() {
            let expected = n * probability(first + i as f64);
            left = [left[0] + o, left[1] + expected, left[2] - expected];
            if left[1] >= 20.0 && left[2] >= 20.0 {
                chi2 += (left[0] - left[1]) * (left[0] - left[1]) / left[1];
                pools += 1.0;
                left = [0.0, 0.0, left[2]];
            }
        }
        let rest = left[1] + left[2];
        chi2 += (left[0] - rest) * (left[0] - rest) / rest;
        let z = (chi2 - pools) / f64::sqrt(2.0 * pools);
        assert!(z.abs() < 4.0, "mean {mu}: chi² {chi2} in {pools}, {z} standard errors");
    }
}

#[test]
fn poisson_moments_match_the_distribution() {
    for mu in MEANS {
        let counts = poisson(mu, draws());
        let (n, mu) = (counts.len() as f64, f64::from(mu));
        let bound = |what: &str, error: f64, variance: f64| {
            let z = error / (variance / n).sqrt();
            assert!(z.abs() < 4.0, "mean {mu}: {what}, {z} standard errors");
        };
        // Central moments of the distribution; the moment of order 2p gives the standard error of that of order p.
        let [m2, m3] = [mu, mu];
        let m4 = mu + 3.0 * mu * mu;
        let m6 = mu + 25.0 * mu * mu + 15.0 * mu * mu * mu;
        bound("mean", mean(&counts) - mu, m2);
        bound("variance", moment(&counts, mu, 2) - m2, m4 - m2 * m2);
        bound("skewness 1/√µ", moment(&counts, mu, 3) - m3, m6 - m3 * m3);
    }
}

#[test]
fn a_deviate_depends_only_on_mean_and_position() {
    let (width, field) = (333, NoiseField::new(KEY));
    let means: Vec<f32> = (0..width * 20).map(|i| [0.0, 3.0, 19.0, 25.0, 4e3][i * 7 % 5]).collect();
    let mut mixed = vec![0.0; means.len()];
    field.poisson_into(&means, width, [0, 0], &mut mixed);
    for mu in [0.0, 3.0, 19.0, 25.0, 4e3] {
        let mut uniform = vec![0.0; means.len()];
        field.poisson_into(&vec![mu; means.len()], width, [0, 0], &mut uniform);
        for i in (0..means.len()).filter(|&i| means[i] == mu) {
            assert_eq!(mixed[i], uniform[i], "mean {mu} at {i}");
        }
    }
}

#[test]
fn invalid_means_count_as_dark() {
    let means = [-0.0, f32::NAN, -5.0, f32::NEG_INFINITY, 5e3, f32::INFINITY, 0.0];
    let mut counts = [1.0; 7];
    NoiseField::new(KEY).poisson_into(&means, 7, [0, 0], &mut counts);
    assert_eq!([counts[0], counts[1], counts[2], counts[3], counts[6]], [0.0; 5]);
    assert!((4500.0..5500.0).contains(&counts[4]) && counts[5] > 16e6, "{counts:?}");
    let mut codes = [1; 7];
    Camera::new(&CameraParams { read_noise: ReadNoise::Same { e: 0.0 }, ..CameraParams::default() })
        .unwrap()
        .expose_window(&means, 7, [0, 0], KEY, &mut codes);
    assert_eq!([codes[0], codes[1], codes[2], codes[3], codes[5]], [0, 0, 0, 0, 255]);
}

#[test]
fn normal_deviates_are_normal() {
    let n = draws();
    let mut deviates = normal(KEY, n);
    // Mean and variance of xᵖ.
    for (p, expected, var) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
        let z = (moment(&deviates, 0.0, p) - expected) / (var / n as f64).sqrt();
        assert!(z.abs() < 4.0, "moment {p}: {z} standard errors");
    }
    deviates.sort_by(f64::total_cmp);
    let below = |x: f64| 0.5 * libm::erfc(-x / std::f64::consts::SQRT_2);
    let distance =
        deviates.iter().enumerate().map(|(i, &x)| (below(x) - (i as f64 + 0.5) / n as f64).abs()).fold(0.0, f64::max);
    // Kolmogorov–Smirnov test at the 0.1 % level.
    assert!(distance < 1.95 / (n as f64).sqrt(), "{distance}");
}

fn assert_uncorrelated(what: &str, a: &[f64], b: &[f64]) {
    let covariance = a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len() as f64;
    let z = (covariance - mean(a) * mean(b)) / (variance(a) * variance(b) / a.len() as f64).sqrt();
    assert!(z.abs() < 4.0, "{what}: {z} standard errors");
}

#[test]
fn frames_and_neighbouring_pixels_are_independent() {
    let n = draws();
    let frame = normal(KEY, n);
    for (other, name) in [(KEY + 1, "next key"), (KEY ^ 1 << 63, "far key"), (!KEY, "inverse")] {
        assert_uncorrelated(name, &frame, &normal(other, n));
    }
    for lag in [1, 2, 3, 16, 63, 64, 65, 128, 999, 1000, 1001, 2000, 64_000] {
        assert_uncorrelated(&format!("lag {lag}"), &frame[lag..], &frame[..n - lag]);
        let squares: Vec<f64> = frame.iter().map(|x| x * x).collect();
        assert_uncorrelated(&format!("squares, lag {lag}"), &squares[lag..], &squares[..n - lag]);
    }
    // Shot noise and read noise of the same pixel.
    for mu in [2.0, 19.0, 25.0, 9000.0] {
        assert_uncorrelated("shot and read", &frame, &poisson(mu, n));
    }
}

fn noises() -> [PhotonNoise; 4] {
    [
        PhotonNoise::Exact,
        PhotonNoise::NormalAbove { mean_e: 0.0 },
        PhotonNoise::NormalAbove { mean_e: 400.0 },
        PhotonNoise::Off,
    ]
}

/// Returns means from dark to overexposed; every block contains all magnitudes.
fn scene(width: usize, height: usize) -> Vec<f32> {
    (0..width * height).map(|i| [0.0, 2.0, 19.0, 300.0, 500.0, 14e3, 3e4][i * i % 7]).collect()
}

#[test]
fn windows_match_the_frame() {
    let (width, height) = (301, 57);
    let electrons = scene(width, height);
    for photon_noise in noises() {
        let params = CameraParams { photon_noise, ..twelve_bits() };
        let camera = Camera::new(&params).unwrap();
        let mut frame = vec![0; electrons.len()];
        let saturated = camera.expose_window(&electrons, width, [40, 1000], KEY, &mut frame);
        let mut tiled = 0;
        for (top, rows) in [(0, 1), (1, 30), (31, 26)] {
            for (left, columns) in [(0, 63), (63, 1), (64, 130), (194, 107)] {
                let cut = |i: usize| (top + i / columns) * width + left + i % columns;
                let tile: Vec<f32> = (0..rows * columns).map(|i| electrons[cut(i)]).collect();
                let origin = [40 + left, 1000 + top].map(|at| u32::try_from(at).unwrap());
                let mut out = vec![0; tile.len()];
                tiled += camera.expose_window(&tile, columns, origin, KEY, &mut out);
                for (i, code) in out.into_iter().enumerate() {
                    assert_eq!(code, frame[cut(i)], "{photon_noise:?} at {}", cut(i));
                }
            }
        }
        assert_eq!(tiled, saturated);
    }
}

#[test]
fn expose_into_takes_one_word_as_key() {
    let (width, height) = (200, 10);
    let electrons = scene(width, height);
    let camera = Camera::new(&CameraParams::default()).unwrap();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(15);
    let (mut frame, mut again) = (vec![0; electrons.len()], vec![0; electrons.len()]);
    camera.expose_into(&electrons, width, &mut frame, &mut rng);
    let mut same = Xoshiro256PlusPlus::seed_from_u64(15);
    camera.expose_window(&electrons, width, [0, 0], same.next_u64(), &mut again);
    assert_eq!(frame, again);
    camera.expose_into(&electrons, width, &mut again, &mut rng);
    assert_ne!(frame, again);
    same.next_u64();
    assert_eq!(rng.next_u64(), same.next_u64());
}

/// 12 bits leave room for 50 levels of two frames each.
#[test]
fn photon_transfer_curve_gives_the_gain() {
    let params = twelve_bits();
    let n = 256 * 320;
    for photon_noise in [PhotonNoise::Exact, PhotonNoise::NormalAbove { mean_e: 300.0 }] {
        let camera = Camera::new(&CameraParams { photon_noise, ..params.clone() }).unwrap();
        let expose = |electrons: f32, key: u64| -> Vec<f64> {
            let mut out = vec![0; n];
            let saturated = camera.expose_window(&vec![electrons; n], 320, [0, 0], key, &mut out);
            assert_eq!(saturated, 0);
            out.into_iter().map(f64::from).collect()
        };
        let mut points = Vec::new();
        for level in 0..50_u16 {
            let electrons = 330.0 * f32::from(level);
            let key = 2 * u64::from(level);
            let (a, b) = (expose(electrons, key), expose(electrons, key + 1));
            let difference: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            points.push((0.5 * (mean(&a) + mean(&b)), 0.5 * variance(&difference)));
        }
        let (dark, dark_variance) = points[0];
        assert!((dark - params.offset_dn).abs() < 0.02, "{dark}");
        // EMVA 1288: a line through the origin, above dark.
        let [xy, xx] = points.iter().fold([0.0; 2], |[xy, xx], (m, v)| {
            let (x, y) = (m - dark, v - dark_variance);
            [xy + x * y, xx + x * x]
        });
        let gain = xy / xx;
        assert!((gain / params.gain_dn_per_e - 1.0).abs() < 0.01, "{gain}");
        let read_noise = (dark_variance - 1.0 / 12.0).sqrt() / gain;
        assert!((read_noise / params.read_noise.rms_e() - 1.0).abs() < 0.02, "{read_noise}");
        // Shot-noise limited SNR, without read noise and quantisation noise.
        let (m, v) = points[40];
        let snr = (m - dark) / (v - dark_variance).sqrt();
        assert!((snr / f64::sqrt(330.0 * 40.0) - 1.0).abs() < 0.01, "{snr}");
    }
}

#[test]
fn quantisation_adds_one_twelfth() {
    let n = draws();
    for sigma_dn in [0.5, 1.0, 3.0] {
        let params = CameraParams {
            gain_dn_per_e: 0.1,
            read_noise: ReadNoise::Same { e: sigma_dn * 10.0 },
            photon_noise: PhotonNoise::Off,
            ..CameraParams::default()
        };
        let camera = Camera::new(&params).unwrap();
        let mut codes = vec![0; n];
        camera.expose_window(&vec![1003.0; n], 1000, [0, 0], KEY, &mut codes);
        let codes: Vec<f64> = codes.into_iter().map(f64::from).collect();
        let (expected, z) = (sigma_dn * sigma_dn + 1.0 / 12.0, (2.0 / n as f64).sqrt());
        // At a standard deviation of half a grey level, the rounding error still depends on the noise: 1 %.
        let error = variance(&codes) / expected - 1.0;
        assert!(error.abs() < 4.0 * z + if sigma_dn < 1.0 { 0.01 } else { 0.0 }, "{error}");
        // The mean of rounded values is off by up to exp(-2π²σ²)/π: 0.0023 at half a grey level.
        let bound = 0.0023 + 4.0 * (expected / n as f64).sqrt();
        assert!((mean(&codes) - 100.3).abs() < bound, "{}", mean(&codes));
    }
}

#[test]
fn combined_normal_deviate_has_the_summed_variance() {
    let n = draws();
    let params = CameraParams {
        full_well_e: 1e5,
        gain_dn_per_e: 2.0,
        offset_dn: 500.0,
        read_noise: ReadNoise::Same { e: 20.0 },
        bit_depth: 16,
        photon_noise: PhotonNoise::NormalAbove { mean_e: 50.0 },
        ..CameraParams::default()
    };
    let camera = Camera::new(&params).unwrap();
    let exact = Camera::new(&CameraParams { photon_noise: PhotonNoise::Exact, ..params }).unwrap();
    for (mu, same) in [(49.9, true), (50.0, false), (900.0, false)] {
        let (mut codes, mut exact_codes) = (vec![0; n], vec![0; n]);
        camera.expose_window(&vec![mu; n], 1000, [0, 0], KEY, &mut codes);
        exact.expose_window(&vec![mu; n], 1000, [0, 0], KEY, &mut exact_codes);
        assert_eq!(codes == exact_codes, same, "mean {mu}");
        let codes: Vec<f64> = codes.into_iter().map(|c| f64::from(c) - 500.0).collect();
        let expected = 4.0 * (f64::from(mu) + 400.0) + 1.0 / 12.0;
        let z = (variance(&codes) / expected - 1.0) / (2.0 / n as f64).sqrt();
        assert!(z.abs() < 4.0, "mean {mu}: {z} standard errors");
        let z = (mean(&codes) - 2.0 * f64::from(mu)) / (expected / n as f64).sqrt();
        assert!(z.abs() < 4.0, "mean {mu}: {z} standard errors");
    }
}

#[test]
fn levels_stay_in_range_and_saturated_pixels_are_counted() {
    let electrons = [0.0, 0.0, 9_000.0, 17_590.0, 18_500.0, 1e9];
    for (bit_depth, photon_noise) in (8..=16).zip(noises().into_iter().cycle()) {
        let params = CameraParams {
            gain_dn_per_e: f64::from((1_u32 << bit_depth) - 1) / 17_600.0,
            read_noise: ReadNoise::Same { e: 300.0 },
            bit_depth,
            photon_noise,
            ..CameraParams::default()
        };
        let camera = Camera::new(&params).unwrap();
        let image: Vec<f32> = electrons.iter().copied().cycle().take(6 * 500).collect();
        let mut codes = vec![0; image.len()];
        let saturated = camera.expose_window(&image, 60, [0, 0], KEY, &mut codes);
        let highest = codes.iter().filter(|&&c| c == camera.max_dn()).count();
        assert_eq!(u32::from(camera.max_dn()), (1 << bit_depth) - 1);
        assert!(codes.iter().all(|&c| c <= camera.max_dn()));
        assert!(codes.contains(&0) && highest >= 500 && saturated >= highest, "{saturated}");
        assert!(saturated < 2000, "{saturated}");
    }
}

#[test]
fn charge_is_limited_to_the_full_well() {
    let params = CameraParams {
        full_well_e: 10_000.0,
        gain_dn_per_e: 0.01,
        read_noise: ReadNoise::Same { e: 0.0 },
        ..CameraParams::default()
    };
    let camera = Camera::new(&params).unwrap();
    let mut codes = [0; 4];
    assert_eq!(camera.expose_window(&[5e3, 2e4, 1e6, 0.0], 4, [0, 0], KEY, &mut codes), 2);
    assert_eq!([codes[1], codes[2], codes[3]], [100, 100, 0]);
}

#[test]
fn noise_free_levels_match_the_model() {
    let camera = Camera::new(&CameraParams::paper()).unwrap();
    assert!((camera.electrons_per_dn() - 70.0).abs() < 1e-12);
    assert_eq!(camera.max_dn(), 255);
    let electrons = [0.0, 35.0, 70.0, 105.0, 17_849.0, 18_000.0, -1.0];
    let mut dn = [0.0; 7];
    camera.mean_dn_into(&electrons, &mut dn);
    for (dn, expected) in dn.iter().zip([0.0, 0.5, 1.0, 1.5, 254.985_7, 255.0, 0.0]) {
        assert!((dn - expected).abs() < 1e-4, "{dn} for {expected}");
    }
    let params = CameraParams {
        gain_dn_per_e: 1.0,
        read_noise: ReadNoise::Same { e: 0.0 },
        photon_noise: PhotonNoise::Off,
        ..CameraParams::paper()
    };
    let (camera, mut codes) = (Camera::new(&params).unwrap(), [0; 7]);
    let high = camera.expose_window(&[-3.0, 0.49, 0.5, 1.5, 254.49, 254.5, 300.0], 7, [0, 0], KEY, &mut codes);
    assert_eq!((codes, high), ([0, 0, 1, 2, 254, 255, 255], 2));
}

/// Pins the output bytes, independent of vector instructions.
#[test]
fn bits_are_pinned() {
    let electrons = scene(301, 57);
    let hashes = noises().map(|photon_noise| {
        let params = CameraParams { photon_noise, ..twelve_bits() };
        let mut out = vec![0; electrons.len()];
        Camera::new(&params).unwrap().expose_window(&electrons, 301, [3, 5], KEY, &mut out);
        out.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, &c| (h ^ u64::from(c)).wrapping_mul(0x100_0000_01b3))
    });
    let pinned = [0x9c27_1bef_ef5a_4c7a, 0xb81f_36bc_365e_80f1, 0x275e_4e69_0627_f025, 0x42fb_1cea_a94e_45c3];
    assert_eq!(hashes, pinned);
}

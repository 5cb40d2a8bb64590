//! Tests of the linear camera of EMVA 1288, and of photon transfer on simulated frames.

use ccd_noise::calibrate::{Calibration, CalibrationParams, LightLevel, PhotonTransfer, Saturation, Shading};
use ccd_noise::{Binning, Blooming, Camera, CameraParams, Error, PhotonNoise, ReadNoise, SaturatedRun};

const KEY: u64 = 0x00e1_ec72_0000_1288;
const WIDTH: usize = 320;
const PIXELS: usize = 256 * WIDTH;

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn variance(values: &[f64]) -> f64 {
    let centre = mean(values);
    values.iter().map(|v| (v - centre) * (v - centre)).sum::<f64>() / values.len() as f64
}

#[expect(clippy::cast_possible_truncation, reason = "pixels are single precision")]
fn flat(camera: &Camera, electrons: f64, key: u64) -> Vec<u16> {
    let mut out = vec![0; PIXELS];
    camera.expose_window(&vec![electrons as f32; PIXELS], WIDTH, [0, 0], key, &mut out);
    out
}

fn levels(frame: &[u16]) -> Vec<f64> {
    frame.iter().copied().map(f64::from).collect()
}

/// Calibrates on `flats` levels of two frames each, up to `brightest` of saturation, and `frames` of dark and of half.
fn measure(params: &CameraParams, shading: Shading, flats: u32, brightest: f64, frames: u64) -> Calibration {
    let camera = Camera::new(params).unwrap();
    let mut transfer = PhotonTransfer::new(&CalibrationParams {
        bit_depth: params.bit_depth,
        shading,
        ..CalibrationParams::default()
    })
    .unwrap();
    let mut key = KEY;
    let mut add = |fraction: f64, frames: u64| {
        let electrons = fraction * camera.saturation_capacity_e();
        let frames: Vec<Vec<u16>> = (key..key + frames).map(|key| flat(&camera, electrons, key)).collect();
        key += 1000;
        let frames: Vec<&[u16]> = frames.iter().map(Vec::as_slice).collect();
        let photons = electrons / params.quantum_efficiency;
        transfer
            .add(&frames, WIDTH, if fraction > 0.0 { LightLevel::Photons(photons) } else { LightLevel::Dark })
            .unwrap();
    };
    add(0.0, frames);
    for level in 1..=flats {
        add(brightest * f64::from(level) / f64::from(flats), 2);
    }
    add(0.5, frames);
    transfer.calibration().unwrap()
}

fn assert_within(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!((found / expected - 1.0).abs() < tolerance, "{what}: found {found}, expected {expected}");
}

/// Returns whether the converter reaches its highest level below the full-well capacity.
fn is_limited_by_converter(params: &CameraParams) -> bool {
    params.offset_dn + params.gain_dn_per_e * params.full_well_e >= libm::exp2(f64::from(params.bit_depth)) - 1.0
}

#[test]
fn photon_transfer_recovers_the_camera() {
    for params in [CameraParams::orca_05g(), CameraParams::scmos()] {
        let found = measure(&params, Shading::Kept, 50, 1.05, 64);
        let dark_noise = (params.read_noise.rms_e() * params.read_noise.rms_e() + params.dark_e()).sqrt();
        assert_within("gain", found.gain_dn_per_e, params.gain_dn_per_e, 0.01);
        assert_within("quantum efficiency", found.quantum_efficiency.unwrap(), params.quantum_efficiency, 0.01);
        assert_within("dark noise", found.dark_noise_e, dark_noise, 0.02);
        assert_within("DSNU", found.dsnu_e, params.dsnu_e, 0.02);
        assert_within("PRNU", found.prnu, params.prnu, 0.02);
        let offset = params.offset_dn + params.gain_dn_per_e * params.dark_e();
        assert!((found.offset_dn - offset).abs() < 0.03, "{}", found.offset_dn);
        assert!(found.linearity_error.unwrap() < 0.002, "{:?}", found.linearity_error);
        // The variance maximum lies 2 to 6 % below saturation, where clipping begins to reduce the variance.
        let Saturation::Reached { e, .. } = found.saturation else { panic!("{:?}", found.saturation) };
        let camera = Camera::new(&params).unwrap();
        assert_within("saturation", e, 0.96 * camera.saturation_capacity_e(), 0.03);
        // A camera with the measured parameters gives the same measurement.
        let copy = found.camera(7);
        assert!(is_limited_by_converter(&copy) && copy.serial == 7);
        assert_within("full well", copy.full_well_e, params.full_well_e, 0.02);
        let again = measure(&copy, Shading::Kept, 12, 1.05, 8);
        assert_within("gain, copy", again.gain_dn_per_e, params.gain_dn_per_e, 0.02);
        assert_within("PRNU, copy", again.prnu, params.prnu, 0.03);
    }
}

#[test]
fn few_flats_below_saturation_suffice() {
    let params = CameraParams::orca_05g();
    let found = measure(&params, Shading::Removed { side_px: 15 }, 3, 0.8, 8);
    assert_within("gain", found.gain_dn_per_e, params.gain_dn_per_e, 0.01);
    assert_within("DSNU", found.dsnu_e, params.dsnu_e, 0.03);
    assert_within("PRNU", found.prnu, params.prnu, 0.03);
    let Saturation::NotReached { e, .. } = found.saturation else { panic!("{:?}", found.saturation) };
    assert_within("brightest", e, 0.8 * Camera::new(&params).unwrap().saturation_capacity_e(), 0.01);
    assert!(is_limited_by_converter(&found.camera(1)));
}

/// Relative exposure gives linearity, but not quantum efficiency.
#[test]
fn relative_light_gives_linearity_only() {
    let camera = Camera::new(&CameraParams::orca_05g()).unwrap();
    let params = CalibrationParams { bit_depth: 12, ..CalibrationParams::default() };
    // The second camera has a nonlinear response.
    for (bend, least, most) in [(0.0, 0.0, 0.003), (0.03, 0.005, 0.05)] {
        let mut transfer = PhotonTransfer::new(&params).unwrap();
        for step in 0..5_u32 {
            let time = f64::from(step);
            let frames = [0, 1].map(|i| flat(&camera, 3e3 * time * (1.0 - bend * time), u64::from(2 * step + i)));
            let light = if step > 0 { LightLevel::Relative(time) } else { LightLevel::Dark };
            transfer.add(&[&frames[0], &frames[1]], WIDTH, light).unwrap();
        }
        let found = transfer.calibration().unwrap();
        assert_eq!(found.quantum_efficiency, None);
        let error = found.linearity_error.unwrap();
        assert!((least..most).contains(&error), "{error}");
    }
}

/// The full well clips below the converter range: the brightest level has no noise.
#[test]
fn full_well_capacity_is_measured() {
    let params = CameraParams { full_well_e: 9_000.0, ..CameraParams::orca_05g() };
    let found = measure(&params, Shading::Kept, 20, 1.3, 4);
    assert!(matches!(found.saturation, Saturation::Reached { .. }), "{:?}", found.saturation);
    assert_within("full well", found.camera(1).full_well_e, 9_000.0, 0.01);
    assert!(!is_limited_by_converter(&found.camera(1)));
}

#[test]
fn shading_is_not_counted_as_prnu() {
    let params = CameraParams::orca_05g();
    let camera = Camera::new(&params).unwrap();
    let light: Vec<f32> = (0..PIXELS).map(|i| 8e3 * (1.0 - 0.2 * (i % WIDTH) as f32 / WIDTH as f32)).collect();
    for (shading, least, most) in [(Shading::Removed { side_px: 11 }, 0.97, 1.03), (Shading::Kept, 5.0, 20.0)] {
        let params = CalibrationParams { bit_depth: 12, shading, ..CalibrationParams::default() };
        let mut transfer = PhotonTransfer::new(&params).unwrap();
        for (fraction, kind, keys) in [(0.0, LightLevel::Dark, 0..16), (1.0, LightLevel::Unknown, 16..32)] {
            let light: Vec<f32> = light.iter().map(|e| fraction * e).collect();
            let frames: Vec<Vec<u16>> = keys
                .map(|key| {
                    let mut out = vec![0; PIXELS];
                    camera.expose_window(&light, WIDTH, [0, 0], key, &mut out);
                    out
                })
                .collect();
            let frames: Vec<&[u16]> = frames.iter().map(Vec::as_slice).collect();
            transfer.add(&frames, WIDTH, kind).unwrap();
        }
        let found = transfer.calibration().unwrap();
        assert!((least..most).contains(&(found.prnu / 0.007)), "{shading:?}: {}", found.prnu);
        assert_eq!((found.quantum_efficiency, found.linearity_error), (None, None));
        assert_eq!(found.camera(1).quantum_efficiency, CameraParams::default().quantum_efficiency);
    }
}

#[test]
fn unusable_frames_are_rejected() {
    let params = CalibrationParams { bit_depth: 8, shading: Shading::Kept, ..CalibrationParams::default() };
    let fresh = || PhotonTransfer::new(&params).unwrap();
    let assert_message = |error: Error, words: &str| assert!(error.to_string().contains(words), "{error}");
    let (dark, lit, full) = ([10, 12, 11, 9], [50, 61, 55, 48], [255; 4]);
    let (dark_2, lit_2) = ([11, 10, 12, 10], [58, 49, 51, 57]);

    let mut transfer = fresh();
    assert_message(
        transfer.add(&[&dark], 2, LightLevel::Dark).unwrap_err(),
        "too few frames in this level: 1, expected at least 2",
    );
    assert_message(transfer.add(&[&dark, &dark[..2]], 2, LightLevel::Dark).unwrap_err(), "2 x 1 pixels (2 in total)");
    assert_message(transfer.add(&[&dark, &dark], 3, LightLevel::Dark).unwrap_err(), "3 x 1 pixels (4 in total)");
    assert_message(transfer.add(&[&dark, &dark], 0, LightLevel::Dark).unwrap_err(), "0 x 0");
    assert_message(
        transfer.add(&[&dark, &[300; 4]], 2, LightLevel::Dark).unwrap_err(),
        "frames is 300; it must be from 0 to 2^bit_depth",
    );
    assert_message(
        transfer.add(&[&dark, &[0; 4]], 2, LightLevel::Dark).unwrap_err(),
        "50.0 % of the dark frames' pixels are at 0",
    );
    assert_message(transfer.add(&[&lit, &lit], 2, LightLevel::Photons(0.0)).unwrap_err(), "light is 0");
    assert_message(transfer.calibration().unwrap_err(), "no dark frames");
    // A rejected frame does not set the expected size.
    transfer.add(&[&dark, &dark_2], 2, LightLevel::Dark).unwrap();
    assert_message(
        transfer.add(&[&lit, &lit_2], 4, LightLevel::Unknown).unwrap_err(),
        "4 x 1 pixels (4 in total), but the previous frames",
    );
    assert_message(transfer.calibration().unwrap_err(), "too few levels with light: 0");
    transfer.add(&[&full, &full], 2, LightLevel::Unknown).unwrap();
    assert_message(transfer.calibration().unwrap_err(), "all levels of flats are saturated (1 in total)");
    let mut unchanged = fresh();
    unchanged.add(&[&dark, &dark_2], 2, LightLevel::Dark).unwrap();
    unchanged.add(&[&dark, &dark_2], 2, LightLevel::Unknown).unwrap();
    assert_message(unchanged.calibration().unwrap_err(), "do not increase with light");
    unchanged.add(&[&lit, &lit_2], 2, LightLevel::Unknown).unwrap();
    unchanged.calibration().unwrap();
    // The only unsaturated level is too bright for the fit.
    let mut bright = fresh();
    bright.add(&[&dark, &dark_2], 2, LightLevel::Dark).unwrap();
    bright.add(&[&[200, 190, 210, 205], &[190, 212, 190, 225]], 2, LightLevel::Unknown).unwrap();
    bright.add(&[&full, &full], 2, LightLevel::Unknown).unwrap();
    assert_message(
        bright.calibration().unwrap_err(),
        "too few levels with light up to `fit_to` of saturation: 0, expected at least 1",
    );

    for (params, field) in [
        (CalibrationParams { bit_depth: 17, ..params.clone() }, "bit_depth"),
        (CalibrationParams { fit_to: f64::NAN, ..params.clone() }, "fit_to"),
        (CalibrationParams { shading: Shading::Removed { side_px: 4 }, ..params.clone() }, "shading.side_px"),
    ] {
        assert_message(PhotonTransfer::new(&params).unwrap_err(), field);
    }
    let mut small = PhotonTransfer::new(&CalibrationParams::default()).unwrap();
    assert_message(
        small.add(&[&dark, &dark], 2, LightLevel::Dark).unwrap_err(),
        "shading.side_px is 15; it must be less than the width",
    );
}

#[test]
fn default_fit_range_is_that_of_emva_1288() {
    let params = CalibrationParams::default();
    assert_eq!((params.fit_to, params.bit_depth), (0.7, 16));
}

/// Measured temporal noise and spatial nonuniformity equal the predictions of [`Camera`].
#[test]
fn noise_and_nonuniformity_match_predictions() {
    // The variance of log-normal read noise converges slowly: its root differs by 0.8 % between cameras.
    const CAMERAS: u64 = 16;
    for photon_noise in [PhotonNoise::Exact, PhotonNoise::NormalAbove { mean_e: 300.0 }, PhotonNoise::Off] {
        let camera = |serial: u64| {
            let params = CameraParams {
                photon_noise,
                dark_current_e_per_s: 400.0,
                exposure_s: 1.0,
                prnu: 0.02,
                dsnu_e: 12.0,
                serial,
                ..CameraParams::scmos()
            };
            Camera::new(&params).unwrap()
        };
        for electrons in [0.0, 100.0, 9_000.0] {
            let (mut in_time, mut over_pixels) = (0.0, 0.0);
            for (serial, camera) in (1..=CAMERAS).map(|serial| (serial, camera(serial))) {
                let [a, b] = [2 * serial - 1, 2 * serial].map(|key| levels(&flat(&camera, electrons, key)));
                let difference: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
                let temporal = variance(&difference) / 2.0;
                let mean_image: Vec<f64> = a.iter().zip(&b).map(|(a, b)| (a + b) / 2.0).collect();
                in_time += temporal / CAMERAS as f64;
                over_pixels += (variance(&mean_image) - temporal / 2.0) / CAMERAS as f64;
                let spread = (camera.temporal_noise_dn(electrons), camera.nonuniformity_dn(electrons));
                let error = ((spread.0 * spread.0 + spread.1 * spread.1) / PIXELS as f64).sqrt();
                let z = (mean(&a) - camera.expected_dn(electrons)) / error;
                assert!(z.abs() < 4.0, "{photon_noise:?}, {electrons}: {z} standard errors");
            }
            let camera = camera(1);
            assert_within("in time", in_time.sqrt(), camera.temporal_noise_dn(electrons), 0.01);
            assert_within("over pixels", over_pixels.sqrt(), camera.nonuniformity_dn(electrons), 0.03);
            let mut expected = [0.0];
            #[expect(clippy::cast_possible_truncation, reason = "frames take single precision")]
            camera.mean_dn_into(&[electrons as f32], &mut expected);
            assert!((f64::from(expected[0]) - camera.expected_dn(electrons)).abs() < 0.01);
        }
    }
}

/// With shot noise only, SNR = √µ.
#[test]
fn shot_noise_limited_snr_is_the_square_root() {
    let params = CameraParams {
        read_noise: ReadNoise::Same { e: 0.0 },
        gain_dn_per_e: 3.0,
        bit_depth: 16,
        ..CameraParams::default()
    };
    let camera = Camera::new(&params).unwrap();
    for electrons in [100.0, 1e3, 1e4] {
        let levels = levels(&flat(&camera, electrons, KEY));
        assert_within("SNR", mean(&levels) / variance(&levels).sqrt(), electrons.sqrt(), 0.01);
    }
}

/// The fixed pattern depends on the camera and the pixel, the noise on the frame.
#[test]
fn fixed_pattern_depends_on_the_serial_number() {
    let params = CameraParams { photon_noise: PhotonNoise::Off, prnu: 0.05, dsnu_e: 30.0, ..CameraParams::scmos() };
    let quiet = CameraParams { read_noise: ReadNoise::Same { e: 0.0 }, ..params.clone() };
    let camera = Camera::new(&quiet).unwrap();
    let frame = flat(&camera, 5e3, 1);
    assert_eq!(frame, flat(&camera, 5e3, 2));
    let other = flat(&Camera::new(&CameraParams { serial: 2, ..quiet.clone() }).unwrap(), 5e3, 1);
    let correlation = |a: &[f64], b: &[f64]| {
        let product: Vec<f64> = a.iter().zip(b).map(|(a, b)| a * b).collect();
        (mean(&product) - mean(a) * mean(b)) / (variance(a) * variance(b)).sqrt()
    };
    let bound = 4.0 / (PIXELS as f64).sqrt();
    assert!(correlation(&levels(&frame), &levels(&other)).abs() < bound);
    // Response and offset are independent of each other, and of the noise of a frame whose key is the serial number.
    let dark = levels(&flat(&camera, 0.0, 1));
    let light: Vec<f64> = levels(&frame).iter().zip(&dark).map(|(l, d)| l - d).collect();
    assert!(correlation(&light, &dark).abs() < bound);
    let even = Camera::new(&CameraParams { prnu: 0.0, dsnu_e: 0.0, ..params.clone() }).unwrap();
    let noise = levels(&flat(&even, 5e3, quiet.serial));
    assert!(correlation(&levels(&frame), &noise).abs() < bound);

    // Read noise has the specified median and root mean square over pixels.
    let frames: Vec<Vec<f64>> = (0..64).map(|key| levels(&flat(&even, 5e3, key))).collect();
    let mut deviations: Vec<f64> = (0..PIXELS)
        .map(|i| variance(&frames.iter().map(|f| f[i]).collect::<Vec<_>>()) * 64.0 / 63.0 - 1.0 / 12.0)
        .map(|v| v.max(0.0).sqrt() / params.gain_dn_per_e)
        .collect();
    let squares: Vec<f64> = deviations.iter().map(|d| d * d).collect();
    assert_within("rms", mean(&squares).sqrt(), 1.6, 0.02);
    deviations.sort_by(f64::total_cmp);
    assert_within("median", deviations[PIXELS / 2], 1.0, 0.02);
}

/// Windows of a camera with a fixed pattern, and the runs of its saturated pixels.
#[test]
fn windows_and_saturated_runs_match_the_frame() {
    let (width, height) = (301, 40);
    let electrons: Vec<f32> =
        (0..width * height).map(|i| [100.0, 9e3, 17_400.0, 17_650.0, 3e4][i * i / 3 % 5]).collect();
    for params in [CameraParams::orca_05g(), CameraParams::default()] {
        let camera = Camera::new(&params).unwrap();
        let mut frame = vec![0; electrons.len()];
        let mut runs = vec![SaturatedRun { y: 0, x0: 900, x1: 901 }];
        let count = camera.expose_window_marking(&electrons, width, [40, 1000], KEY, &mut frame, &mut runs);
        assert_eq!(runs.remove(0).x0, 900);
        let mut unmarked = vec![0; electrons.len()];
        assert_eq!(camera.expose_window(&electrons, width, [40, 1000], KEY, &mut unmarked), count);
        assert_eq!(frame, unmarked);
        assert!(runs.is_sorted() && runs.windows(2).all(|w| w[0].y < w[1].y || w[0].x1 < w[1].x0));
        let marked: Vec<usize> =
            runs.iter().flat_map(|r| (r.x0..r.x1).map(|x| (r.y as usize - 1000) * width + x as usize - 40)).collect();
        assert_eq!(marked.len(), count);
        let highest: Vec<usize> = (0..frame.len()).filter(|&i| frame[i] == camera.max_dn()).collect();
        assert_eq!(marked, highest, "the converter saturates before the full well");
        for (left, top, columns, rows) in [(0, 0, 64, 7), (63, 7, 238, 33), (170, 3, 1, 20)] {
            let cut = |i: usize| (top + i / columns) * width + left + i % columns;
            let tile: Vec<f32> = (0..rows * columns).map(|i| electrons[cut(i)]).collect();
            let mut out = vec![0; tile.len()];
            let origin = [40 + left, 1000 + top].map(|at| u32::try_from(at).unwrap());
            camera.expose_window(&tile, columns, origin, KEY, &mut out);
            assert!(out.iter().enumerate().all(|(i, &code)| code == frame[cut(i)]));
        }
    }
}

#[test]
fn blooming_conserves_charge() {
    let (width, height) = (96_usize, 200_usize);
    let mut electrons = vec![2_000.0; width * height];
    for y in 95..105 {
        electrons[y * width + 40..][..8].fill(60_000.0);
    }
    let quiet = CameraParams {
        gain_dn_per_e: 1.0,
        offset_dn: 0.0,
        bit_depth: 16,
        full_well_e: 18_000.0,
        read_noise: ReadNoise::Same { e: 0.0 },
        ..CameraParams::default()
    };
    let sum = |frame: &[u16]| frame.iter().map(|&dn| u64::from(dn)).sum::<u64>();
    for photon_noise in [PhotonNoise::Exact, PhotonNoise::NormalAbove { mean_e: 100.0 }, PhotonNoise::Off] {
        let expose = |blooming, full_well_e| {
            let camera = Camera::new(&CameraParams { photon_noise, blooming, full_well_e, ..quiet.clone() }).unwrap();
            assert_eq!(camera.needs_whole_frame(), blooming != Blooming::Off);
            let (mut frame, mut runs) = (vec![0; electrons.len()], Vec::new());
            let exposure = camera.expose_frame(&electrons, width, KEY, &mut frame, &mut runs);
            let marked: usize = runs.iter().map(|r| (r.x1 - r.x0) as usize).sum();
            assert_eq!(marked, exposure.saturated);
            (frame, exposure, runs)
        };
        // A full well that is never reached gives the collected charge.
        let (collected, none, _) = expose(Blooming::On { vertical: 1.0, anti_blooming: 0.0 }, 1e6);
        assert_eq!((none.saturated, none.drained_e, none.escaped_e), (0, 0, 0));
        for vertical in [1.0, 0.95] {
            let (bloomed, all, runs) = expose(Blooming::On { vertical, anti_blooming: 0.0 }, 18_000.0);
            assert_eq!((sum(&bloomed), all.drained_e, all.escaped_e), (sum(&collected), 0, 0));
            assert!(bloomed.iter().all(|&dn| dn <= 18_000));
            assert!(all.saturated > 80 && runs.iter().any(|r| r.y < 90) && runs.iter().any(|r| r.y > 110));
            let (drained, part, _) = expose(Blooming::On { vertical, anti_blooming: 0.6 }, 18_000.0);
            assert_eq!(sum(&drained) + part.drained_e + part.escaped_e, sum(&collected));
            assert!(part.drained_e > 0 && (80..all.saturated).contains(&part.saturated));
        }
        let (clipped, off, runs) = expose(Blooming::Off, 18_000.0);
        assert_eq!((off.saturated, runs.len(), runs[0].x0, runs[0].x1), (80, 10, 40, 48));
        let (drained, _, _) = expose(Blooming::On { vertical: 1.0, anti_blooming: 1.0 }, 18_000.0);
        if photon_noise != (PhotonNoise::NormalAbove { mean_e: 100.0 }) {
            assert_eq!(clipped, drained);
        }
    }
}

/// Blooming does not change frames without full pixels.
#[test]
fn blooming_does_not_change_unsaturated_frames() {
    for params in [CameraParams::default(), CameraParams::orca_05g(), CameraParams::scmos()] {
        let camera = Camera::new(&params).unwrap();
        let blooming = Blooming::On { vertical: 0.95, anti_blooming: 0.0 };
        let blooms = Camera::new(&CameraParams { blooming, ..params }).unwrap();
        let electrons = vec![9_000.0; 130 * 20];
        let (mut a, mut b) = (vec![0; electrons.len()], vec![0; electrons.len()]);
        camera.expose_frame(&electrons, 130, KEY, &mut a, &mut Vec::new());
        blooms.expose_frame(&electrons, 130, KEY, &mut b, &mut Vec::new());
        assert_eq!(a, b);
    }
}

#[test]
fn binned_camera_matches_binned_frames() {
    let params = CameraParams {
        dark_current_e_per_s: 500.0,
        exposure_s: 0.2,
        prnu: 0.03,
        dsnu_e: 30.0,
        read_noise: ReadNoise::PerPixel { median_e: 6.0, rms_e: 9.0 },
        ..CameraParams::orca_05g()
    };
    let camera = Camera::new(&params).unwrap();
    let side = 2;
    let digital = Camera::new(&params.binned(Binning::Digital { side }).unwrap()).unwrap();
    // Reference: rounded averages of four pixels in two frames.
    let electrons = 2_000.0;
    let average = |key: u64| -> Vec<f64> {
        let frame = levels(&flat(&camera, electrons, key));
        (0..PIXELS / 4)
            .map(|i| 2 * WIDTH * (i / (WIDTH / 2)) + 2 * (i % (WIDTH / 2)))
            .map(|i| ((frame[i] + frame[i + 1] + frame[i + WIDTH] + frame[i + WIDTH + 1]) / 4.0 + 0.5).floor())
            .collect()
    };
    let statistics = |a: &[f64], b: &[f64]| {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        let in_time = variance(&difference) / 2.0;
        let mean_image: Vec<f64> = a.iter().zip(b).map(|(a, b)| (a + b) / 2.0).collect();
        (mean(&mean_image), in_time.sqrt(), (variance(&mean_image) - in_time / 2.0).sqrt())
    };
    let slow = statistics(&average(1), &average(2));
    let fast = statistics(&levels(&flat(&digital, 4.0 * electrons, 3)), &levels(&flat(&digital, 4.0 * electrons, 4)));
    // Rounding of halves upwards, in one of four cases, adds 1/8 of a level to the mean of the reference.
    assert!((fast.0 + 0.125 - slow.0).abs() < 0.1, "{fast:?} {slow:?}");
    assert_within("in time", fast.1, slow.1, 0.02);
    assert_within("in time, predicted", digital.temporal_noise_dn(4.0 * electrons), slow.1, 0.02);
    assert_within("over pixels", fast.2, slow.2, 0.03);

    let charge = params.binned(Binning::Charge { side }).unwrap();
    let n = 4.0;
    assert_eq!(charge.read_noise, params.read_noise);
    assert_eq!(charge.full_well_e, n * params.full_well_e);
    assert_eq!(charge.gain_dn_per_e, params.gain_dn_per_e / n);
    assert_eq!((charge.prnu, charge.dsnu_e), (params.prnu / 2.0, params.dsnu_e * 2.0));
    assert_eq!(charge.dark_e(), n * params.dark_e());
    for binning in [Binning::Charge { side: 1 }, Binning::Digital { side: 1 }] {
        assert_eq!(params.binned(binning).unwrap(), params);
    }
    for side in [0, 9] {
        let error = params.binned(Binning::Charge { side }).unwrap_err().to_string();
        assert!(error.starts_with("binning.side is "), "{error}");
    }
    let electrons: Vec<f32> = (0..5 * 7).map(|i| i as f32).collect();
    let (binned, width) = Binning::Charge { side }.sum_electrons(&electrons, 5);
    assert_eq!((width, binned.len()), (2, 6));
    assert_eq!(binned[..3], [0.0 + 1.0 + 5.0 + 6.0, 2.0 + 3.0 + 7.0 + 8.0, 10.0 + 11.0 + 15.0 + 16.0]);
}

/// Pins the output bytes, with fixed pattern and blooming.
#[test]
fn bits_are_pinned() {
    let electrons: Vec<f32> = (0..301 * 57).map(|i| [0.0, 2.0, 19.0, 300.0, 500.0, 14e3, 4e4][i * i / 3 % 7]).collect();
    let hash = |codes: &[u16]| {
        codes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, &c| (h ^ u64::from(c)).wrapping_mul(0x100_0000_01b3))
    };
    let blooming = Blooming::On { vertical: 0.95, anti_blooming: 0.3 };
    let hashes = [
        CameraParams::orca_05g(),
        CameraParams::scmos(),
        CameraParams { blooming, ..CameraParams::orca_05g() },
        CameraParams { blooming, ..CameraParams::scmos() },
    ]
    .map(|params| {
        let mut out = vec![0; electrons.len()];
        Camera::new(&params).unwrap().expose_frame(&electrons, 301, KEY, &mut out, &mut Vec::new());
        hash(&out)
    });
    let pinned = [0xa00f_1cfe_57c3_09d1, 0x6f82_463c_ac0a_b531, 0xe013_1959_e926_12b1, 0x02f1_9993_fa65_2d68];
    assert_eq!(hashes, pinned, "{hashes:#x?}");
}

//! Tests of Gibson and Lanni's point spread function against reference arrays, and of the Airy disc against its
//! constants.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "radii of a few pixels")]

use crate::support::array;
use optics_psf::{GibsonLanni, GibsonLanniParams};

/// Pixel size of the arrays in µm, and pixels from the axis outwards.
const PIXEL_UM: f64 = 0.0625;
const PIXELS: usize = 65;

/// Returns one row per z. Pixels are means over 3 x 3 positions, interpolated linearly between radii a third of a pixel
/// apart, as in the arrays.
fn pixels(params: &GibsonLanniParams, z_um: &[f64]) -> Vec<f64> {
    let radii: Vec<f64> = (0..3 * PIXELS + 3).map(|i| i as f64 * PIXEL_UM / 3.0).collect();
    let profile = GibsonLanni::new(params).unwrap().profile(&radii, z_um).unwrap();
    let pixel = |row: &[f64], x: usize| {
        let places = (0..9).map(|k| {
            let (x, y) = (3.0 * x as f64 + f64::from(k % 3) - 1.0, f64::from(k / 3) - 1.0);
            let r = (x * x + y * y).sqrt();
            let i = r as usize;
            row[i] + (r - i as f64) * (row[i + 1] - row[i])
        });
        places.sum::<f64>() / 9.0
    };
    profile.chunks_exact(radii.len()).flat_map(|row| (0..PIXELS).map(move |x| pixel(row, x))).collect()
}

#[test]
fn agrees_with_the_reference_arrays() {
    let mounted = |depth_um| GibsonLanniParams { depth_um, ..GibsonLanniParams::default() };
    let dry = GibsonLanniParams { mount_index: 1.0, ..GibsonLanniParams::default() };
    let z = |from: i32, to: i32| (4 * from..=4 * to).map(|i| 0.25 * f64::from(i)).collect::<Vec<_>>();
    for (name, params, z_um, peak_um) in [
        ("psfmodels_dry095_scalar_xz", dry, z(-5, 5), 0.0),
        ("psfmodels_mounted_pz0_scalar_xz", mounted(0.0), z(-6, 20), 0.0),
        ("psfmodels_mounted_pz5_scalar_xz", mounted(5.0), z(-6, 20), 4.25),
        ("psfmodels_mounted_pz10_scalar_xz", mounted(10.0), z(-6, 20), 9.0),
    ] {
        // The arrays have 1/4 where a perfect lens has 1.
        let Some(reference) = array(name) else { return };
        let found = pixels(&params, &z_um);
        let peak = reference.iter().copied().fold(0.0, f64::max);
        let worst = found.iter().zip(&reference).map(|(v, r)| (0.25 * v - r).abs() / peak).fold(0.0, f64::max);
        assert!(worst < 2e-4, "{name}: {worst}");
        let axis = |rows: &[f64]| {
            let values = rows.iter().step_by(PIXELS).enumerate();
            z_um[values.max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0]
        };
        assert_eq!((axis(&found), axis(&reference)), (peak_um, peak_um), "{name}");
    }
}

/// Returns the intensity in focus at distances in units of λ/NA.
fn airy(r: &[f64]) -> Vec<f64> {
    let params = GibsonLanniParams { na: 0.5, wavelength_um: 0.5, ..GibsonLanniParams::default() };
    GibsonLanni::new(&params).unwrap().profile(r, &[0.0]).unwrap()
}

#[test]
fn airy_disc_has_correct_zeros_width_and_energy() {
    let r: Vec<f64> = (0..40_000).map(|i| f64::from(i) * 1e-4).collect();
    let intensity = airy(&r);
    assert!((intensity[0] - 1.0).abs() < 1e-12);
    let dark: Vec<f64> = (1..r.len() - 1)
        .filter(|&i| intensity[i] < intensity[i - 1] && intensity[i] < intensity[i + 1])
        .map(|i| r[i])
        .collect();
    assert!((dark[0] - 0.6098).abs() < 1e-3 && (dark[1] - 1.1166).abs() < 1e-3, "{dark:?}");
    let half = intensity.iter().position(|v| *v < 0.5).unwrap();
    assert!((2.0 * r[half] - 0.5145).abs() < 1e-3);
    // Σ I 2πr dr; the total is 1/π in these units: ∫ (2J₁(q)/q)² q dq = 2 with q = 2πr.
    let energy = |to: f64| {
        let inside = r.iter().zip(&intensity).take_while(|(r, _)| **r <= to);
        inside.map(|(r, v)| v * r * 1e-4).sum::<f64>() * core::f64::consts::TAU * core::f64::consts::PI
    };
    assert!((energy(dark[0]) - 0.8378).abs() < 1e-4, "{}", energy(dark[0]));
    assert!((energy(dark[1]) - 0.9099).abs() < 1e-4, "{}", energy(dark[1]));
}

#[test]
fn invalid_lenses_are_rejected_by_field() {
    let default = GibsonLanniParams::default();
    let cases = [
        ("na is 1.2", GibsonLanniParams { na: 1.2, ..default.clone() }),
        ("wavelength_um is NaN", GibsonLanniParams { wavelength_um: f64::NAN, ..default.clone() }),
        ("depth_um is -1", GibsonLanniParams { depth_um: -1.0, ..default.clone() }),
        ("mount_index", GibsonLanniParams { mount_index: 0.5, ..default.clone() }),
        ("immersion_index[1]", GibsonLanniParams { immersion_index: [1.0, 7.0], ..default.clone() }),
        ("cover_um[0]", GibsonLanniParams { cover_um: [-170.0, 170.0], ..default.clone() }),
        ("cover_index[0]", GibsonLanniParams { cover_index: [0.0, 1.5], ..default.clone() }),
        ("working_distance_um", GibsonLanniParams { working_distance_um: f64::INFINITY, ..default.clone() }),
    ];
    for (name, params) in cases {
        let message = GibsonLanni::new(&params).unwrap_err().to_string();
        assert!(message.starts_with(name), "{name}: {message}");
    }
    let psf = GibsonLanni::new(&default).unwrap();
    assert!(psf.profile(&[f64::NAN], &[0.0]).unwrap_err().to_string().starts_with("r_um"));
    assert!(psf.profile(&[0.0], &[f64::INFINITY]).unwrap_err().to_string().starts_with("z_um"));
}

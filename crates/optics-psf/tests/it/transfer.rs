//! Tests of the transfer functions: invariants, and a reference table.

use crate::support;
use core::f64::consts::{PI, TAU};

use crate::support::microscope;
use optics_psf::{Error, Microscope, MicroscopeParams, Transfer, Zernike};

fn transfer(condenser_na: f64, depth_um: f64) -> Transfer {
    microscope(condenser_na).transfer(depth_um, 0.0).unwrap()
}

#[test]
fn transfer_matches_the_reference_table() {
    let Some(path) = support::fixture("ref_wotf_radial.csv") else { return };
    let text = std::fs::read_to_string(path).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|line| line.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    let mut column = 1;
    for condenser_na in [0.3, 0.6, 0.9, 0.95] {
        for depth in [0.0, 1.0, 3.0, 6.0] {
            let transfer = transfer(condenser_na, -depth);
            for row in &rows {
                let f = [row[0], 0.0];
                let (a, p) = (transfer.absorption(f), transfer.phase(f));
                assert!((a[0] - row[column]).abs() < 1e-3 && a[1] == 0.0, "{condenser_na} {depth} {f:?}");
                assert!((p[0] - row[column + 1]).abs() < 1e-3 && p[1] == 0.0, "{condenser_na} {depth} {f:?}");
            }
            column += 2;
        }
    }
}

#[test]
fn constants_pass_and_frequencies_beyond_the_cutoff_do_not() {
    for (condenser_na, depth, stage) in [(0.4, 0.0, 0.0), (0.6, 3.0, -1.0), (1.2, -2.0, 0.5)] {
        let microscope = microscope(condenser_na);
        let transfer = microscope.transfer(depth, stage).unwrap();
        assert_eq!((transfer.absorption([0.0; 2]), transfer.phase([0.0; 2])), ([1.0, 0.0], [0.0, 0.0]));
        let cutoff = (0.95 + condenser_na.min(0.95)) / 0.57;
        assert!((microscope.cutoff() - cutoff).abs() < 1e-12);
        for beyond in [cutoff * (1.0 + 1e-9), 2.0 * cutoff, 1e9] {
            assert_eq!(transfer.absorption([0.0, beyond]), [0.0; 2]);
            assert_eq!(transfer.phase([beyond, 0.0]), [0.0; 2]);
        }
    }
}

#[test]
fn full_aperture_in_focus_is_incoherent() {
    let transfer = transfer(0.95, 0.0);
    for i in 0..200 {
        let v = f64::from(i) / 200.0;
        let expected = 2.0 / PI * (libm::acos(v) - v * (1.0 - v * v).sqrt());
        let found = transfer.absorption([0.0, v * 2.0 * 0.95 / 0.57])[0];
        assert!((found - expected).abs() < 5e-4, "{v}: {found} {expected}");
    }
}

#[test]
fn narrow_aperture_is_coherent() {
    let transfer = transfer(1e-4, -3.0);
    let gamma = |f: f64| ((1.515 / 0.57) * (1.515 / 0.57) - f * f).sqrt();
    // At the table entries only: linear interpolation flattens fringes.
    for i in 0..390 {
        let f = f64::from(i) / 400.0 * microscope(1e-4).cutoff();
        let turn = TAU * 3.0 * (gamma(f) - gamma(0.0));
        assert!((transfer.absorption([f, 0.0])[0] - libm::cos(turn)).abs() < 1e-4, "{f}");
        assert!((transfer.phase([f, 0.0])[0] - libm::sin(turn)).abs() < 1e-4, "{f}");
    }
}

#[test]
fn large_defocus_has_the_geometric_limit() {
    let sin = 0.3_f64 / 1.515;
    let q = TAU * 0.05 * 10.0 * sin / (1.0 - sin * sin).sqrt();
    let expected = 2.0 * libm::j1(q) / q;
    assert!((expected - 0.9505).abs() < 1e-4);
    assert!((transfer(0.3, 10.0).absorption([0.05, 0.0])[0] - expected).abs() < 5e-4);
    assert!((TAU * 0.05 * microscope(0.3).cone_radius_um(10.0, 0.0) - q).abs() < 1e-12);
    // A depth in the mountant and a stage position in air, with opposite effects.
    let tan = |sin: f64| sin / (1.0 - sin * sin).sqrt();
    for (depth, stage) in [(3.0, 0.0), (0.0, 2.0), (4.0, -1.0), (4.0, 3.0)] {
        let expected: f64 = depth * tan(0.6 / 1.515) - stage * tan(0.6);
        assert!((microscope(0.6).cone_radius_um(depth, stage) - expected.abs()).abs() < 1e-9, "{depth} {stage}");
    }
}

#[test]
fn phase_transfer_changes_sign_through_focus() {
    for (depth, stage) in [(2.0, 0.0), (3.0, -1.3), (0.0, 4.0)] {
        let microscope = microscope(0.6);
        let (a, b) = (microscope.transfer(depth, stage).unwrap(), microscope.transfer(-depth, -stage).unwrap());
        for i in 0..100 {
            let f = [0.027 * f64::from(i), 0.01];
            assert!((a.absorption(f)[0] - b.absorption(f)[0]).abs() < 1e-12);
            assert!((a.phase(f)[0] + b.phase(f)[0]).abs() < 1e-12);
        }
    }
}

#[test]
fn stage_movement_in_air_focuses_a_larger_depth() {
    // Paraxially, lowering the stage by −d/n compensates a depth d in index n.
    let params = MicroscopeParams { na: 0.2, condenser_na: 0.15, ..MicroscopeParams::default() };
    let microscope = Microscope::new(&params).unwrap();
    let focused = microscope.transfer(-40.0, -40.0 / 1.515).unwrap();
    let (rest, defocused) = (microscope.transfer(0.0, 0.0).unwrap(), microscope.transfer(-40.0, 0.0).unwrap());
    for i in 0..20 {
        let f = [0.03 * f64::from(i), 0.0];
        assert!((focused.absorption(f)[0] - rest.absorption(f)[0]).abs() < 1e-2);
    }
    assert!((defocused.absorption([0.3, 0.0])[0] - rest.absorption([0.3, 0.0])[0]).abs() > 0.3);
}

#[test]
fn symmetric_aberrations_do_not_depend_on_the_table() {
    let round = Zernike { defocus: 0.1, spherical: -0.05, ..Zernike::default() };
    let sided = Zernike { astigmatism: [0.0, 1e-12], ..round };
    let make = |zernike| {
        let params = MicroscopeParams { condenser_na: 0.6, bandwidth_um: 0.0, zernike, ..MicroscopeParams::default() };
        Microscope::new(&params).unwrap().transfer(1.0, 0.0).unwrap()
    };
    let (a, b) = (make(round), make(sided));
    for i in 0..100 {
        let f = [0.02 * f64::from(i), 0.011 * f64::from(i)];
        for k in 0..2 {
            // The table with directions has a third of the entries.
            assert!((a.absorption(f)[k] - b.absorption(f)[k]).abs() < 4e-3, "{f:?}");
            assert!((a.phase(f)[k] - b.phase(f)[k]).abs() < 4e-3, "{f:?}");
        }
    }
}

#[test]
fn transfer_with_coma_gives_real_images() {
    let zernike = Zernike { coma: [0.2, 0.1], astigmatism: [0.1, 0.0], ..Zernike::default() };
    let params = MicroscopeParams { condenser_na: 0.6, bandwidth_um: 0.0, zernike, ..MicroscopeParams::default() };
    let transfer = Microscope::new(&params).unwrap().transfer(1.5, 0.0).unwrap();
    let mut imaginary = 0.0_f64;
    for i in 1..60 {
        let f = [0.03 * f64::from(i), -0.02 * f64::from(i)];
        let ([a, b], [c, d]) = (transfer.absorption(f), transfer.absorption(f.map(|f| -f)));
        assert!((a - c).abs() < 1e-12 && (b + d).abs() < 1e-12);
        let ([a, b], [c, d]) = (transfer.phase(f), transfer.phase(f.map(|f| -f)));
        assert!((a - c).abs() < 1e-12 && (b + d).abs() < 1e-12);
        imaginary = imaginary.max(transfer.absorption(f)[1].abs());
    }
    assert!(imaginary > 0.02);
}

#[test]
fn bandwidth_reduces_fringe_contrast() {
    let make = |bandwidth_um| {
        let params = MicroscopeParams { condenser_na: 0.1, bandwidth_um, ..MicroscopeParams::default() };
        Microscope::new(&params).unwrap().transfer(20.0, 0.0).unwrap()
    };
    // A wide band reduces the contrast of the third fringe; a narrow band does not.
    let swing = |transfer: &Transfer| {
        (0..150).map(|i| transfer.absorption([0.4 + 0.002 * f64::from(i), 0.0])[0]).fold(0.0, f64::max)
    };
    let (none, narrow, wide) = (swing(&make(0.0)), swing(&make(0.002)), swing(&make(0.2)));
    assert!((none - narrow).abs() < 2e-3 && wide < 0.8 * none, "{none} {narrow} {wide}");
}

#[test]
fn light_outside_the_objectives_aperture_is_lost() {
    let (full, open) = (transfer(0.95, 2.0), transfer(1.2, 2.0));
    assert_eq!(full.absorption([1.0, 0.3]), open.absorption([1.0, 0.3]));
}

#[test]
fn strehl_ratios_of_cover_glass_and_small_aberrations() {
    /// |∫ exp 2πiW|² over the pupil, relative to W = 0.
    fn strehl(microscope: &Microscope, stage_um: f64) -> f64 {
        let (na, points) = (microscope.params().na, 20_000);
        let mut sum = [0.0; 2];
        for i in 0..points {
            let r = na * ((f64::from(i) + 0.5) / f64::from(points)).sqrt();
            let angle = f64::from(i) * 2.399_963_229_728_653;
            let waves = microscope.waves([r * libm::cos(angle), r * libm::sin(angle)], 0.0, stage_um);
            sum[0] += libm::cos(TAU * waves);
            sum[1] += libm::sin(TAU * waves);
        }
        (sum[0] * sum[0] + sum[1] * sum[1]) / (f64::from(points) * f64::from(points))
    }
    for (cover_error_um, expected) in [(5.0, 0.760), (10.0, 0.441)] {
        let params = MicroscopeParams { cover_error_um, bandwidth_um: 0.0, ..MicroscopeParams::default() };
        let microscope = Microscope::new(&params).unwrap();
        let best = (-300..=300).map(|i| strehl(&microscope, 0.01 * f64::from(i))).fold(0.0, f64::max);
        assert!((best / expected - 1.0).abs() < 0.01, "{cover_error_um}: {best}");
    }
    let small =
        |zernike| strehl(&Microscope::new(&MicroscopeParams { zernike, ..MicroscopeParams::default() }).unwrap(), 0.0);
    let marechal = libm::exp(-(TAU * 0.05) * (TAU * 0.05));
    assert!((marechal - 0.90602).abs() < 1e-5);
    // Squares of orthonormal terms add, for every pair of terms.
    for (i, j) in (0..6).flat_map(|i| (i..6).map(move |j| (i, j))) {
        let [defocus, a, b, c, d, spherical] = core::array::from_fn(|k| match (k == i, k == j) {
            (true, true) => 0.05,
            (true, false) => 0.03,
            (false, true) => 0.04,
            _ => 0.0,
        });
        let found = small(Zernike { defocus, astigmatism: [a, b], coma: [c, d], spherical });
        assert!((found / marechal - 1.0).abs() < 3e-3, "{i} {j}: {found}");
    }
}

#[test]
fn defaults_match_the_paper() {
    let params = MicroscopeParams::default();
    assert_eq!((params.na, params.wavelength_um, params.pixel_um), (0.95, 0.57, 0.25));
    assert_eq!(Microscope::new(&params).unwrap().pitch_um(), 0.125);
    assert_eq!(*Microscope::new(&params).unwrap().params(), params);
}

#[test]
fn invalid_microscopes_are_rejected_by_field() {
    let default = MicroscopeParams::default();
    let cases: [(&str, MicroscopeParams); 14] = [
        ("na is 1.2", MicroscopeParams { na: 1.2, ..default.clone() }),
        ("na is 0", MicroscopeParams { na: 0.0, ..default.clone() }),
        ("na is 1.515", MicroscopeParams { na: 1.515, immersion_index: 1.515, ..default.clone() }),
        ("condenser_na", MicroscopeParams { condenser_na: 1.6, ..default.clone() }),
        ("wavelength_um is 0", MicroscopeParams { wavelength_um: 0.0, ..default.clone() }),
        ("wavelength_um is NaN", MicroscopeParams { wavelength_um: f64::NAN, ..default.clone() }),
        ("bandwidth_um", MicroscopeParams { bandwidth_um: 0.3, ..default.clone() }),
        ("mount_index", MicroscopeParams { mount_index: f64::INFINITY, ..default.clone() }),
        ("immersion_index", MicroscopeParams { immersion_index: 0.9, ..default.clone() }),
        ("cover_error_um", MicroscopeParams { cover_error_um: 170.0, ..default.clone() }),
        (
            "zernike.coma[1]",
            MicroscopeParams { zernike: Zernike { coma: [0.0, 9.0], ..Zernike::default() }, ..default.clone() },
        ),
        ("pixel_um", MicroscopeParams { pixel_um: -0.25, ..default.clone() }),
        ("oversampling is 0", MicroscopeParams { oversampling: 0, ..default.clone() }),
        ("stray_light is 1", MicroscopeParams { stray_light: 1.0, ..default.clone() }),
    ];
    for (name, params) in cases {
        let message = Microscope::new(&params).unwrap_err().to_string();
        assert!(message.starts_with(name), "{name}: {message}");
    }
    let far = microscope(0.4).transfer(0.0, f64::NAN);
    assert!(matches!(far, Err(Error::OutOfRange { field: "stage_um", .. })));
}

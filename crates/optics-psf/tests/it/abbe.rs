//! Tests of Abbe's integration against reference arrays, and of invariants.

use crate::support;
use core::f64::consts::LN_10;

use crate::support::{SIDE, absorbing, array, microscope, phase_object, relative, shifted, single, soft_disk, worst};
use optics_psf::{Abbe, AbbeParams, Error, Layer, Source};

fn abbe(condenser_na: f64, source: Source) -> Abbe {
    let params = AbbeParams { width: SIDE, height: SIDE, source };
    Abbe::new(&microscope(condenser_na), &params).unwrap()
}

const FULL: Source = Source::Lattice { stride: 1 };

#[test]
fn full_lattice_matches_the_reference_and_few_points_converge() {
    for (object, name, condenser_na) in
        [("disk", "060", 0.6), ("disk", "090", 0.9), ("asym", "060", 0.6), ("asym", "090", 0.9)]
    {
        let Some(absorbance) = array(&format!("ref_{object}_absorbance")) else { return };
        for z in [0, 2, 5, -3] {
            let Some(reference) = array(&format!("ref_abbe_{object}_nac{name}_z{z:+}")) else { return };
            let image =
                |source| abbe(condenser_na, source).image(&[absorbing(-f64::from(z), &absorbance)], 0.0).unwrap();
            let error = worst(&image(FULL), &reference);
            assert!(error < 1e-9, "{object} {name} {z}: {error}");
            let few = |points| relative(&image(Source::Vogel { points }), &reference);
            assert!(few(32) > 2.2 * few(128), "{object} {name} {z}: {} {}", few(32), few(128));
        }
    }
}

#[test]
fn an_integration_ends_before_any_of_its_transforms() {
    let abbe = abbe(0.6, Source::Vogel { points: 3 });
    let layer = |depth_um: f64| Layer::new(depth_um, vec![[0.9, 0.1]; SIDE * SIDE]).unwrap();
    let layers = [layer(0.0), layer(2.0)];
    let calls = core::cell::Cell::new(0);
    let image = |most: usize| {
        calls.set(0);
        let goes_on = || calls.replace(calls.get() + 1) < most;
        abbe.image_while(&layers, 0.0, &goes_on).unwrap()
    };
    // One step between the layers and one to the image, for each direction.
    let all = 2 * abbe.directions();
    assert_eq!(image(all), Some(abbe.image(&layers, 0.0).unwrap()));
    assert_eq!(calls.get(), all);
    for most in [0, 1, all - 1] {
        assert_eq!(image(most), None);
        assert_eq!(calls.get(), most + 1);
    }
}

#[test]
fn two_layers_match_the_reference() {
    let (Some(disk), Some(asym)) = (array("ref_disk_absorbance"), array("ref_asym_absorbance")) else { return };
    let Some(reference) = array("ref_multislice2_nac060") else { return };
    let below: Vec<f64> = shifted(&disk, -10, 6).iter().map(|a| 0.6 * a).collect();
    // The arrays count z from the focal plane, away from the objective.
    let layers = [absorbing(3.0, &shifted(&asym, 8, -4)), absorbing(-2.0, &below)];
    let image = abbe(0.6, Source::Lattice { stride: 2 }).image(&layers, 0.0).unwrap();
    assert!(worst(&image, &reference) < 1e-9, "{}", worst(&image, &reference));
}

#[test]
fn refracting_objects_match_the_reference() {
    for z in [0, 2, -2] {
        let Some(reference) = array(&format!("ref_abbe_phase_nac060_z{z:+}")) else { return };
        let (absorbance, phase) = phase_object();
        let amplitude = absorbance.iter().zip(&phase).map(|(a, p)| {
            let root = libm::exp10(-0.5 * a);
            [root * libm::cos(*p), root * libm::sin(*p)]
        });
        let layer = Layer::new(-f64::from(z), amplitude.collect()).unwrap();
        let image = abbe(0.6, FULL).image(&[layer], 0.0).unwrap();
        assert!(worst(&image, &reference) < 1e-9, "{z}: {}", worst(&image, &reference));
        let layer = Layer::from_absorbance(-f64::from(z), &single(&absorbance), &single(&phase)).unwrap();
        let image = abbe(0.6, FULL).image(&[layer], 0.0).unwrap();
        assert!(worst(&image, &reference) < 1e-6, "{z}: {}", worst(&image, &reference));
    }
}

#[test]
fn empty_slide_has_unit_intensity() {
    let clear = vec![[1.0, 0.0]; SIDE * SIDE];
    for source in [Source::Vogel { points: 7 }, Source::Lattice { stride: 9 }, Source::Axis] {
        let layers = [4.0, -1.0].map(|z| Layer::new(z, clear.clone()).unwrap());
        let image = abbe(0.6, source).image(&layers, 1.0).unwrap();
        assert!(image.iter().all(|v| (v - 1.0).abs() < 1e-12));
    }
    assert_eq!(abbe(0.6, Source::Axis).image(&[], 0.0).unwrap(), vec![1.0; SIDE * SIDE]);
    let opaque = Layer::new(0.0, vec![[0.0; 2]; SIDE * SIDE]).unwrap();
    assert_eq!(abbe(0.6, Source::Axis).image(&[opaque], 0.0).unwrap(), vec![0.0; SIDE * SIDE]);
}

#[test]
fn weak_objects_obey_the_transfer_function() {
    let disk: Vec<f64> = soft_disk(3.0, 1e-4, 0.12);
    for z in [0.0, 3.0] {
        let image = abbe(0.6, FULL).image(&[absorbing(z, &disk)], 0.0).unwrap();
        let transfer = microscope(0.6).transfer(z, 0.0).unwrap();
        // ln 10 · H_A ⊗ A along the central row, one frequency at a time.
        let f = |i: i32| f64::from(i) / (SIDE as f64 * 0.125);
        let mut coefficients = support::coefficients(&disk, 44).into_iter();
        let mut spectrum = Vec::new();
        for ky in -44..=44 {
            for kx in -44..=44 {
                let coefficient = coefficients.next().unwrap();
                let h = transfer.absorption([f(kx), f(ky)])[0];
                if h != 0.0 {
                    spectrum.push((kx, ky, coefficient.map(|c| h * c)));
                }
            }
        }
        let (mut error, mut contrast) = (0.0, 0.0);
        for x in 0..SIDE {
            let y = SIDE / 2;
            let mut blurred = 0.0;
            for &(kx, ky, [re, im]) in &spectrum {
                let turn = core::f64::consts::TAU * (f64::from(kx) * x as f64 + f64::from(ky) * y as f64) / SIDE as f64;
                blurred += re * libm::cos(turn) - im * libm::sin(turn);
            }
            let darkening = LN_10 * blurred / (SIDE * SIDE) as f64;
            let found = 1.0 - image[y * SIDE + x];
            error += (found - darkening) * (found - darkening);
            contrast += found * found;
        }
        assert!((error / contrast).sqrt() < 4e-3, "{z}: {}", (error / contrast).sqrt());
    }
}

#[test]
fn image_follows_shifts_and_reflections_of_the_object() {
    let Some(asym) = array("ref_asym_absorbance") else { return };
    let abbe = abbe(0.6, Source::Lattice { stride: 6 });
    let image = |a: &[f64]| abbe.image(&[absorbing(2.0, a)], 0.0).unwrap();
    let plain = image(&asym);
    assert!(worst(&image(&shifted(&asym, 5, -9)), &shifted(&plain, 5, -9)) < 1e-12);
    // Reflection in the diagonal, and in column 0 of the periodic grid.
    let turned = |a: &[f64]| (0..SIDE * SIDE).map(|i| a[(i % SIDE) * SIDE + i / SIDE]).collect::<Vec<_>>();
    let mirrored =
        |a: &[f64]| (0..SIDE * SIDE).map(|i| a[i / SIDE * SIDE + (SIDE - i % SIDE) % SIDE]).collect::<Vec<_>>();
    assert!(worst(&image(&turned(&asym)), &turned(&plain)) < 1e-12);
    assert!(worst(&image(&mirrored(&asym)), &mirrored(&plain)) < 1e-12);
    assert!(plain.iter().all(|v| *v >= 0.0));
}

#[test]
fn coherent_energy_does_not_depend_on_focus() {
    // A phase object loses only light blocked by the aperture; defocus blocks none.
    let (_, phase) = phase_object();
    let amplitude: Vec<[f64; 2]> = phase.iter().map(|p| [libm::cos(4.0 * p), libm::sin(4.0 * p)]).collect();
    let energy = |depth, stage| {
        let layer = Layer::new(depth, amplitude.clone()).unwrap();
        abbe(0.6, Source::Axis).image(&[layer], stage).unwrap().iter().sum::<f64>() / (SIDE * SIDE) as f64
    };
    let focused = energy(0.0, 0.0);
    for (depth, stage) in [(1.0, 0.0), (7.0, 0.0), (0.0, -3.0), (4.0, 2.0)] {
        assert!((energy(depth, stage) - focused).abs() < 1e-12);
    }
}

#[test]
fn invalid_grids_are_rejected_by_field() {
    let make = |params: AbbeParams| Abbe::new(&microscope(0.6), &params).unwrap_err().to_string();
    assert!(make(AbbeParams { width: 0, ..AbbeParams::default() }).starts_with("width is 0"));
    assert!(make(AbbeParams { height: 1 << 20, ..AbbeParams::default() }).starts_with("height"));
    let source = Source::Vogel { points: 0 };
    assert!(make(AbbeParams { source, ..AbbeParams::default() }).starts_with("source.points is 0"));
    let source = Source::Lattice { stride: 0 };
    assert!(make(AbbeParams { source, ..AbbeParams::default() }).starts_with("source.stride is 0"));
    assert!(matches!(Layer::new(f64::NAN, Vec::new()), Err(Error::OutOfRange { field: "depth_um", .. })));
    assert!(abbe(0.6, Source::Axis).image(&[], f64::INFINITY).is_err());
    let points = |source| abbe(0.6, source).directions();
    assert_eq!((points(AbbeParams::default().source), points(FULL), points(Source::Axis)), (64, 885, 1));
}

//! Tests of the product of filtered transmittances against Abbe's images, and of invariants.

use crate::support;
use crate::support::{SIDE, array, double, phase_object, relative, shifted, single, soft_disk, worst};
use optics_psf::{
    Abbe, AbbeParams, BrightField, BrightFieldParams, DepthOfFocus, FocusParams, Gaussian, Layer, MIN_TRANSMITTANCE,
    Microscope, MicroscopeParams, Padding, Zernike,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// Returns parameters with one sample per pixel, the arrays' 0.125 µm.
fn sampled(condenser_na: f64) -> MicroscopeParams {
    MicroscopeParams {
        condenser_na,
        bandwidth_um: 0.0,
        pixel_um: 0.125,
        oversampling: 1,
        ..MicroscopeParams::default()
    }
}

fn field(microscope: &MicroscopeParams, depths_um: &[f64], stages_um: &[f64]) -> BrightField {
    field_with(
        microscope,
        BrightFieldParams {
            depths_um: depths_um.to_vec(),
            stages_um: stages_um.to_vec(),
            ..BrightFieldParams::default()
        },
    )
}

fn field_with(microscope: &MicroscopeParams, params: BrightFieldParams) -> BrightField {
    let params = BrightFieldParams { width: SIDE, height: SIDE, padding: Padding::Periodic, ..params };
    BrightField::new(&Microscope::new(microscope).unwrap(), &params).unwrap()
}

/// Returns the first image of slabs of absorbance.
fn image(field: &BrightField, slabs: &[&[f64]]) -> Vec<f64> {
    let mut specimen = field.specimen();
    for (k, slab) in slabs.iter().enumerate() {
        field.set_absorbance(&mut specimen, k, &single(slab));
    }
    double(&field.image(&mut specimen, 0))
}

fn noise(seed: u64, most: f64) -> Vec<f64> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    (0..SIDE * SIDE).map(|_| most * f64::from(rng.next_u32() >> 8) / 16_777_216.0).collect()
}

/// The paper's model: a Gaussian on absorbance (Eq. 14), then Eq. 11.
fn paper_model(params: &FocusParams, depth_um: f64, absorbance: &[f64]) -> Vec<f64> {
    // A pixel of the paper is two samples.
    let sigma_px = 2.0 * DepthOfFocus::new(params).unwrap().sigma_px(depth_um);
    let blurred = Gaussian::new(sigma_px).unwrap().blur(&single(absorbance), SIDE, optics_psf::Border::Zero);
    blurred.iter().map(|a| libm::exp10(-f64::from(*a))).collect()
}

#[test]
fn one_slab_is_within_1_2_percent_of_abbe_but_the_paper_model_is_not() {
    for (object, name, condenser_na) in
        [("disk", "060", 0.6), ("disk", "090", 0.9), ("asym", "060", 0.6), ("asym", "090", 0.9)]
    {
        let Some(absorbance) = array(&format!("ref_{object}_absorbance")) else { return };
        for z in [0, 2, 5, -3] {
            let Some(reference) = array(&format!("ref_abbe_{object}_nac{name}_z{z:+}")) else { return };
            let found = image(&field(&sampled(condenser_na), &[z.into()], &[0.0]), &[&absorbance]);
            let error = relative(&found, &reference);
            let bound = if z == 0 { 0.002 } else { 0.012 };
            assert!(error < bound, "{object} {name} {z}: {error}");
            if z == 2 {
                let in_pixels = relative(&paper_model(&FocusParams::paper(), 2.0, &absorbance), &reference);
                let in_um = relative(&paper_model(&FocusParams::paper_in_micrometres(), 2.0, &absorbance), &reference);
                assert!(in_pixels > 0.05 && in_um > 0.35, "{object} {name}: {in_pixels} {in_um}");
            }
        }
    }
}

#[test]
fn in_focus_every_aperture_is_within_0_2_percent_of_many_directions() {
    // The stored arrays have 900 directions. 1024 directions on a spiral differ from them by at most 0.1 %. The error
    // of (1 − W₀ ⊗ a)² with an open condenser, 0.4 % at 0.9, is therefore real: twice-scattered light interferes less
    // there.
    let objects = [array("ref_disk_absorbance"), array("ref_asym_absorbance")];
    for object in objects.into_iter().flatten() {
        for condenser_na in [0.41, 0.75, 0.9, 0.95] {
            let params = sampled(condenser_na);
            let source = optics_psf::Source::Vogel { points: 1024 };
            let abbe = AbbeParams { width: SIDE, height: SIDE, source };
            let abbe = Abbe::new(&Microscope::new(&params).unwrap(), &abbe).unwrap();
            let reference = abbe.image(&[support::absorbing(0.0, &object)], 0.0).unwrap();
            let error = relative(&image(&field(&params, &[0.0], &[0.0]), &[&object]), &reference);
            assert!(error < 0.0022, "{condenser_na}: {error}");
        }
    }
}

#[test]
fn two_slabs_are_within_2_percent_of_abbe() {
    let (Some(disk), Some(asym)) = (array("ref_disk_absorbance"), array("ref_asym_absorbance")) else { return };
    let Some(reference) = array("ref_multislice2_nac060") else { return };
    let below: Vec<f64> = shifted(&disk, -10, 6).iter().map(|a| 0.6 * a).collect();
    let found = image(&field(&sampled(0.6), &[-2.0, 3.0], &[0.0]), &[&below, &shifted(&asym, 8, -4)]);
    let error = relative(&found, &reference);
    assert!(error < 0.02, "{error}");
}

#[test]
fn halos_are_within_2_5_percent_of_abbe_and_invert_through_focus() {
    let (absorbance, phase) = phase_object();
    for z in [0, 2, -2] {
        let Some(reference) = array(&format!("ref_abbe_phase_nac060_z{z:+}")) else { return };
        let field = field(&sampled(0.6), &[-f64::from(z)], &[0.0]);
        let mut specimen = field.specimen();
        field.set_absorbance(&mut specimen, 0, &single(&absorbance));
        let without = relative(&double(&field.image(&mut specimen, 0)), &reference);
        field.set_phase(&mut specimen, 0, &single(&phase));
        let with = relative(&double(&field.image(&mut specimen, 0)), &reference);
        assert!(with < 0.025, "{z}: {with}");
        assert!(z == 0 || without > 0.1, "{z}: {without}");
    }
}

#[test]
fn asymmetric_aberrations_match_abbe() {
    let Some(asym) = array("ref_asym_absorbance") else { return };
    let zernike = Zernike { coma: [0.08, -0.04], astigmatism: [0.0, 0.06], spherical: 0.03, ..Zernike::default() };
    let params = MicroscopeParams { zernike, ..sampled(0.6) };
    let source = optics_psf::Source::Lattice { stride: 2 };
    let abbe = AbbeParams { width: SIDE, height: SIDE, source };
    let abbe = Abbe::new(&Microscope::new(&params).unwrap(), &abbe).unwrap();
    let half: Vec<f64> = asym.iter().map(|a| 0.5 * a).collect();
    let phase: Vec<f64> = half.iter().map(|a| 0.5 * a).collect();
    for stage in [0.0, 1.0] {
        let layer = Layer::from_absorbance(1.0, &single(&half), &single(&phase)).unwrap();
        let reference = abbe.image(&[layer], stage).unwrap();
        let field = field(&params, &[1.0], &[stage]);
        let mut specimen = field.specimen();
        field.set_absorbance(&mut specimen, 0, &single(&half));
        field.set_phase(&mut specimen, 0, &single(&phase));
        let error = relative(&double(&field.image(&mut specimen, 0)), &reference);
        assert!(error < 0.015, "{stage}: {error}");
        let plain = image(&self::field(&sampled(0.6), &[1.0], &[stage]), &[&half]);
        assert!(relative(&plain, &reference) > 0.05);
    }
}

#[test]
fn light_is_conserved() {
    // Single precision; beyond 2 µm a slab is W ⊗ T alone.
    let a = noise(0xF1A7, 0.4);
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let transmitted: Vec<f64> = a.iter().map(|a| libm::exp10(-a)).collect();
    for depth in [2.5, -6.0] {
        let found = image(&field(&sampled(0.4), &[depth], &[0.0]), &[&a]);
        assert!((mean(&found) - mean(&transmitted)).abs() < 2e-6);
        let found = image(
            &field(&MicroscopeParams { pixel_um: 0.25, oversampling: 2, ..sampled(0.4) }, &[depth], &[0.0]),
            &[&a],
        );
        assert!((mean(&found) - mean(&transmitted)).abs() < 2e-6);
    }
}

#[test]
fn image_follows_shifts_and_reflections_of_the_object() {
    let (near, far) = (noise(1, 0.3), noise(2, 0.3));
    let field = field(&sampled(0.6), &[0.4, 3.0], &[0.0]);
    let plain = image(&field, &[&near, &far]);
    let turned = |a: &[f64]| (0..SIDE * SIDE).map(|i| a[(i % SIDE) * SIDE + i / SIDE]).collect::<Vec<_>>();
    let mirrored =
        |a: &[f64]| (0..SIDE * SIDE).map(|i| a[i / SIDE * SIDE + (SIDE - i % SIDE) % SIDE]).collect::<Vec<_>>();
    let moved = |a: &[f64]| shifted(a, 11, -30);
    for change in [&turned as &dyn Fn(&[f64]) -> Vec<f64>, &mirrored, &moved] {
        // Rounding errors of single precision FFTs.
        assert!(worst(&image(&field, &[&change(&near), &change(&far)]), &change(&plain)) < 5e-6);
    }
}

#[test]
fn empty_slabs_have_unit_intensity_and_padding_is_empty_slide() {
    let params = sampled(0.6);
    let field = field(&params, &[0.0, 1.0, 4.0], &[0.0]);
    let mut specimen = field.specimen();
    assert_eq!(field.image(&mut specimen, 0), vec![1.0; SIDE * SIDE]);
    let disk = single(&soft_disk(3.0, 0.5, 0.12));
    field.set_absorbance(&mut specimen, 1, &disk);
    let alone = field.image(&mut specimen, 0);
    field.set_absorbance(&mut specimen, 2, &vec![0.0; SIDE * SIDE]);
    field.set_transmittance(&mut specimen, 0, &vec![1.0; SIDE * SIDE]);
    field.set_phase(&mut specimen, 0, &vec![0.0; SIDE * SIDE]);
    assert_eq!(field.image(&mut specimen, 0), alone);
    specimen.clear();
    assert_eq!(field.image(&mut specimen, 0), vec![1.0; SIDE * SIDE]);

    // The disc and its blur fit into the tile: the surroundings have no effect.
    let padded = BrightFieldParams {
        width: SIDE,
        height: SIDE,
        padding: Padding::Clear { px: 100 },
        depths_um: vec![1.0],
        ..BrightFieldParams::default()
    };
    let padded = BrightField::new(&Microscope::new(&params).unwrap(), &padded).unwrap();
    let mut specimen = padded.specimen();
    padded.set_absorbance(&mut specimen, 0, &disk);
    let larger = padded.image(&mut specimen, 0);
    assert!(worst(&double(&larger), &double(&alone)) < 2e-3);
}

#[test]
fn opaque_slides_are_dark_and_clipped_values_are_counted() {
    let deep = soft_disk(3.0, 3.0, 0.12);
    for (depth, most) in [(3.0, SIDE * SIDE), (0.0, 0)] {
        let field = field(&sampled(0.6), &[depth], &[0.0]);
        let mut specimen = field.specimen();
        field.set_absorbance(&mut specimen, 0, &single(&deep));
        let mut out = vec![0.0; SIDE * SIDE];
        let clipped = field.image_into(&mut specimen, 0, &mut out);
        let lowest = out.iter().copied().fold(1.0, f32::min);
        assert!(lowest >= MIN_TRANSMITTANCE);
        if most == 0 {
            // (1 − W₀ ⊗ a)² cannot be negative; at 0.001 it reaches the limit.
            assert!(lowest < 0.01);
        } else {
            assert!(clipped > 20 && lowest == MIN_TRANSMITTANCE, "{clipped} {lowest}");
            assert_eq!(out.iter().filter(|v| **v == MIN_TRANSMITTANCE).count(), clipped);
        }
        field.set_absorbance(&mut specimen, 0, &vec![9.0; SIDE * SIDE]);
        assert_eq!(field.image_into(&mut specimen, 0, &mut out), SIDE * SIDE);
        assert!(out.iter().all(|v| *v == MIN_TRANSMITTANCE));
    }
}

#[test]
fn additional_planes_do_not_change_others() {
    let params = MicroscopeParams { pixel_um: 0.25, oversampling: 2, ..sampled(0.4) };
    let slabs = [noise(3, 0.3), noise(4, 0.3), noise(5, 0.3)].map(|a| single(&a));
    let depths = [-3.0, 0.0, 1.0];
    let stack = |stages: &[f64]| {
        let field = field(&params, &depths, stages);
        let mut specimen = field.specimen();
        for (k, slab) in slabs.iter().enumerate() {
            field.set_absorbance(&mut specimen, k, slab);
        }
        field.set_phase(&mut specimen, 1, &slabs[0]);
        (0..stages.len()).map(|plane| field.image(&mut specimen, plane)).collect::<Vec<_>>()
    };
    let all = stack(&[-2.0, -0.5, 0.0, 1.0, 3.0]);
    assert_eq!(all[1], stack(&[-0.5])[0]);
    assert_eq!(all[2], stack(&[0.0, 9.0])[0]);
    assert_eq!(all[4], stack(&[3.0])[0]);
}

#[test]
fn stack_is_continuous_through_focus() {
    let Some(disk) = array("ref_disk_absorbance") else { return };
    let stages: Vec<f64> = (0..90).map(|i| 0.02 * f64::from(i)).collect();
    let field = field(&MicroscopeParams { pixel_um: 0.25, oversampling: 2, ..sampled(0.4) }, &[0.0], &stages);
    let mut specimen = field.specimen();
    field.set_absorbance(&mut specimen, 0, &single(&disk));
    let planes: Vec<Vec<f64>> = (0..stages.len()).map(|plane| double(&field.image(&mut specimen, plane))).collect();
    let steps: Vec<f64> = planes.windows(2).map(|pair| relative(&pair[0], &pair[1])).collect();
    for pair in steps.windows(2) {
        assert!((pair[1] - pair[0]).abs() < 8e-4, "{pair:?}");
    }
}

/// Returns means over squares of 2 x 2 samples.
fn pixels(fine: &[f64]) -> Vec<f64> {
    let mean = |i: usize| {
        let at = |dx, dy| fine[(i / 64 * 2 + dy) * SIDE + i % 64 * 2 + dx];
        0.25 * (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1))
    };
    (0..64 * 64).map(mean).collect()
}

#[test]
fn camera_lattice_error_is_below_a_thousandth() {
    let (Some(disk), Some(asym)) = (array("ref_disk_absorbance"), array("ref_asym_absorbance")) else { return };
    let specks: Vec<f64> = noise(0x5BEC, 1.0).iter().map(|v| if *v < 0.03 { 0.6 } else { 0.0 }).collect();
    for condenser_na in [0.4, 0.6, 0.9] {
        for z in [2.0, 3.0, 6.0] {
            let image = |params: MicroscopeParams| {
                let params = MicroscopeParams { condenser_na, ..params };
                let field = field(&params, &[0.0, z, -z, 1.2 * z], &[0.0]);
                self::image(&field, &[&asym, &disk, &shifted(&disk, -40, 9), &specks])
            };
            // With one sample per pixel, everything is computed on the object's lattice.
            let default = MicroscopeParams::default;
            let on_object = image(MicroscopeParams { pixel_um: 0.125, oversampling: 1, ..default() });
            let error = relative(&image(default()), &pixels(&on_object));
            assert!(error < 1e-3, "{condenser_na} {z}: {error}");
        }
    }
}

#[test]
fn pixels_are_means_over_samples() {
    let (Some(disk), Some(asym)) = (array("ref_disk_absorbance"), array("ref_asym_absorbance")) else { return };
    for (depth, object) in [(0.0, &asym), (1.2, &disk), (3.0, &asym)] {
        let fine = image(&field(&sampled(0.4), &[depth], &[0.0]), &[object]);
        let in_pixels = MicroscopeParams { pixel_um: 0.25, oversampling: 2, ..sampled(0.4) };
        let coarse = image(&field(&in_pixels, &[depth], &[0.0]), &[object]);
        assert!(relative(&coarse, &pixels(&fine)) < 1e-5, "{depth}");
    }
}

#[test]
fn stray_light_brightens_dark_regions() {
    let disk = soft_disk(3.0, 0.5, 0.12);
    let dark = image(&field(&sampled(0.6), &[1.0], &[0.0]), &[&disk]);
    let lit = image(&field(&MicroscopeParams { stray_light: 0.1, ..sampled(0.6) }, &[1.0], &[0.0]), &[&disk]);
    assert!(dark.iter().zip(&lit).all(|(d, l)| (l - (0.1 + 0.9 * d)).abs() < 1e-6));
}

#[test]
fn transmittances_give_the_same_image_as_absorbances() {
    let a = noise(8, 0.5);
    let params = BrightFieldParams { depths_um: vec![0.3, 2.5], ..BrightFieldParams::default() };
    let field = field_with(&sampled(0.6), params);
    let plain = image(&field, &[&a, &a]);
    let transmittance = single(&a.iter().map(|a| libm::exp10(-a)).collect::<Vec<_>>());
    let mut specimen = field.specimen();
    for slab in 0..2 {
        field.set_transmittance(&mut specimen, slab, &transmittance);
    }
    assert!(worst(&plain, &double(&field.image(&mut specimen, 0))) < 5e-6);
}

#[test]
fn slab_thickness_error_is_at_most_0_3_percent() {
    // A nucleus 3 µm thick: slices of 0.25 µm and slabs of 1 µm, both compared with Abbe's image of the slices.
    let Some(asym) = array("ref_asym_absorbance") else { return };
    let slices = |centre: f64, count: usize| {
        let depth = |k: usize| centre + 3.0 * ((k as f64 + 0.5) / count as f64 - 0.5);
        let slice: Vec<f64> = asym.iter().map(|a| a / count as f64).collect();
        ((0..count).map(depth).collect::<Vec<f64>>(), slice)
    };
    let source = optics_psf::Source::Lattice { stride: 4 };
    let abbe = AbbeParams { width: SIDE, height: SIDE, source };
    let abbe = Abbe::new(&Microscope::new(&sampled(0.4)).unwrap(), &abbe).unwrap();
    for centre in [0.0, 2.0, 5.0] {
        let (depths, slice) = slices(centre, 12);
        let layers: Vec<Layer> = depths.iter().map(|&z| support::absorbing(z, &slice)).collect();
        let reference = abbe.image(&layers, 0.0).unwrap();
        let error = |count: usize| {
            let (depths, slice) = slices(centre, count);
            relative(&image(&field(&sampled(0.4), &depths, &[0.0]), &vec![&slice[..]; count]), &reference)
        };
        assert!(error(3) < error(12) + 0.003, "{centre}");
    }
}

#[test]
fn invalid_fields_are_rejected_by_name() {
    let make = |params: BrightFieldParams| {
        BrightField::new(&Microscope::new(&MicroscopeParams::default()).unwrap(), &params).unwrap_err().to_string()
    };
    let default = BrightFieldParams::default();
    assert!(make(BrightFieldParams { width: 0, ..default.clone() }).starts_with("width is 0"));
    assert!(make(BrightFieldParams { height: 33, ..default.clone() }).starts_with("height is 33"));
    assert!(
        make(BrightFieldParams { padding: Padding::Clear { px: 1 << 20 }, ..default.clone() })
            .starts_with("padding.px")
    );
    assert!(
        make(BrightFieldParams { depths_um: vec![0.0, f64::NAN], ..default.clone() }).starts_with("depths_um is NaN")
    );
    assert!(make(BrightFieldParams { stages_um: vec![1e9], ..default }).starts_with("stages_um"));
}

//! Tests of patches against complete images and Abbe's images, and of invariants.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small images in single precision")]

use crate::support::{SIDE, absorbing, array, double, relative, shifted, single, soft_disk, worst};
use optics_psf::{
    Abbe, AbbeParams, BrightField, BrightFieldParams, Error, Factor, Focus, Layer, MIN_TRANSMITTANCE, Microscope,
    MicroscopeParams, Padding, Patch, PatchImager, PatchLayer, PatchScratch, Source, TransmittedLight, Zernike,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// An object on the slide: transmittances, optional phase delays, and position.
struct Object {
    transmittance: Vec<f32>,
    phase: Vec<f32>,
    width: usize,
    at_px: [i64; 2],
    depth_um: f64,
}

impl Object {
    /// Returns a complete tile of absorbance.
    fn tile(absorbance: &[f64], depth_um: f64) -> Self {
        let transmittance = absorbance.iter().map(|a| libm::exp10(-a) as f32).collect();
        Self { transmittance, phase: Vec::new(), width: SIDE, at_px: [0, 0], depth_um }
    }
}

fn imager(params: &MicroscopeParams) -> PatchImager {
    PatchImager::new(&Microscope::new(params).unwrap())
}

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

fn factor(imager: &PatchImager, object: &Object, focus: &Focus) -> Factor {
    let (mut patch, mut factor) = (Patch::default(), Factor::default());
    imager.load(&object.transmittance, &object.phase, object.width, &mut patch);
    imager.expose(&mut patch, focus, &mut PatchScratch::default(), &mut factor);
    factor
}

/// Returns a square image.
fn render(imager: &PatchImager, objects: &[Object], side_px: usize, focus: impl Fn(f64) -> Focus) -> Vec<f64> {
    let mut light = TransmittedLight::new(imager.microscope(), side_px, side_px);
    for object in objects {
        light.multiply(&factor(imager, object, &focus(object.depth_um)), object.at_px);
    }
    let mut out = vec![0.0; side_px * side_px];
    light.image_into(&mut out);
    double(&out)
}

fn sample_image(imager: &PatchImager, objects: &[Object], side_px: usize) -> Vec<f64> {
    render(imager, objects, side_px, |depth| imager.focus(depth, 0.0).unwrap())
}

/// Returns textured cells, leukocytes, bacilli and specks at random positions and depths.
fn scene(seed: u64, side_px: i64) -> Vec<Object> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut uniform = |low: f64, high: f64| low + (high - low) * f64::from(rng.next_u32()) / 4_294_967_296.0;
    let kinds = [
        (3, 80, 0.08, 0.9, 1.0),
        (3, 32, 0.4, 0.9, 1.0),
        (3, 40, 0.4, 0.9, 4.0),
        (40, 20, 0.15, 0.25, 4.0),
        (10, 6, 0.5, 0.9, 4.0),
    ];
    let mut objects = Vec::new();
    for (count, width_px, absorbance, ratio, range) in kinds {
        for _ in 0..count {
            let width = 2 * width_px;
            let centre = width as f64 / 2.0;
            let angle = uniform(0.0, core::f64::consts::PI);
            let (c, s) = (libm::cos(angle), libm::sin(angle));
            let clumps: Vec<[f64; 3]> =
                (0..12).map(|_| [uniform(-centre, centre), uniform(-centre, centre), uniform(1.0, 4.0)]).collect();
            let sample = |k: usize| {
                let [x, y] = [k % width, k / width].map(|v| v as f64 + 0.5 - centre);
                let (p, q) = (c * x + s * y, (c * y - s * x) / ratio);
                let inside = ((centre - 1.0 - (p * p + q * q).sqrt()) * ratio + 0.5).clamp(0.0, 1.0);
                let clump = |[u, v, r]: &[f64; 3]| libm::exp(-((x - u) * (x - u) + (y - v) * (y - v)) / (2.0 * r * r));
                libm::exp10(-absorbance * inside * (1.0 + 0.6 * clumps.iter().map(clump).sum::<f64>())) as f32
            };
            let place = |v: f64| v as i64 - width_px as i64 / 2;
            objects.push(Object {
                transmittance: (0..width * width).map(sample).collect(),
                phase: Vec::new(),
                width,
                at_px: [place(uniform(0.0, side_px as f64)), place(uniform(0.0, side_px as f64))],
                depth_um: uniform(-range, range),
            });
        }
    }
    objects
}

#[test]
fn one_patch_matches_the_complete_image() {
    let disk = soft_disk(3.0, 0.5, 0.12);
    let coma = Zernike { coma: [0.05, 0.02], ..Zernike::default() };
    for (zernike, phase) in [(Zernike::default(), 0.0), (Zernike::default(), 0.4), (coma, 0.3)] {
        let params = MicroscopeParams { condenser_na: 0.6, bandwidth_um: 0.0, zernike, ..MicroscopeParams::default() };
        let imager = imager(&params);
        let phase: Vec<f32> = if phase == 0.0 { Vec::new() } else { disk.iter().map(|a| (phase * a) as f32).collect() };
        for depth in [0.0, 1.5, 3.0] {
            let whole = BrightFieldParams {
                width: SIDE,
                height: SIDE,
                padding: Padding::Clear { px: 128 },
                depths_um: vec![depth],
                ..BrightFieldParams::default()
            };
            let whole = BrightField::new(imager.microscope(), &whole).unwrap();
            let mut specimen = whole.specimen();
            let object = Object { phase: phase.clone(), ..Object::tile(&disk, depth) };
            whole.set_transmittance(&mut specimen, 0, &object.transmittance);
            if !phase.is_empty() {
                whole.set_phase(&mut specimen, 0, &phase);
            }
            let expected = double(&whole.image(&mut specimen, 0));
            let error = worst(&sample_image(&imager, &[object], SIDE / 2), &expected);
            // Rounding errors of two grids of different sizes. With asymmetric aberrations, the coarser table causes
            // faint echoes.
            let bound = if zernike == coma { 5e-4 } else { 2e-5 };
            assert!(error < bound, "{depth}: {error}");
        }
    }
}

#[test]
fn many_patches_match_the_complete_image() {
    let imager = imager(&MicroscopeParams::default());
    let depths: Vec<f64> = (-4..=4).map(f64::from).collect();
    let side = 256;
    let mut objects = scene(0x5CE7E, side);
    for object in &mut objects {
        object.depth_um = object.depth_um.round();
    }
    // Touching objects in one slab are imaged as one object: one of each pair is left out.
    let mut kept: Vec<Object> = Vec::new();
    for object in objects {
        let apart = |other: &Object| {
            let centre = |t: &Object, k: usize| t.at_px[k] as f64 + t.width as f64 / 4.0;
            let [dx, dy] = [0, 1].map(|k| centre(&object, k) - centre(other, k));
            let reach = (object.width + other.width) as f64 / 4.0 + 12.0;
            other.depth_um != object.depth_um || dx * dx + dy * dy > reach * reach
        };
        if kept.iter().all(apart) {
            kept.push(object);
        }
    }
    assert!(kept.len() > 25, "{}", kept.len());
    let margin = 64;
    let wide = 2 * (side as usize + 2 * margin);
    let params =
        BrightFieldParams { width: wide, height: wide, depths_um: depths.clone(), ..BrightFieldParams::default() };
    let whole = BrightField::new(imager.microscope(), &params).unwrap();
    let mut specimen = whole.specimen();
    for (k, depth) in depths.iter().enumerate() {
        let mut slab = vec![1.0; wide * wide];
        for object in kept.iter().filter(|t| t.depth_um == *depth) {
            for (i, t) in object.transmittance.iter().enumerate() {
                let [x, y] = [i % object.width, i / object.width];
                let place = |at: i64, v: usize| (2 * (at + margin as i64)) as usize + v;
                slab[place(object.at_px[1], y) * wide + place(object.at_px[0], x)] *= t;
            }
        }
        whole.set_transmittance(&mut specimen, k, &slab);
    }
    let all = double(&whole.image(&mut specimen, 0));
    let (row, side) = (wide / 2, side as usize);
    let expected: Vec<f64> = (0..side * side).map(|i| all[(i / side + margin) * row + i % side + margin]).collect();
    let error = relative(&sample_image(&imager, &kept, side), &expected);
    assert!(error < 1e-3, "{error}");
}

#[test]
fn light_beyond_margins_is_below_a_thousandth_of_the_contrast() {
    let disc = |width: usize, absorbance: f64| {
        let sample = |k: usize| {
            let [x, y] = [k % width, k / width].map(|v| v as f64 + 0.5 - width as f64 / 2.0);
            let inside = (width as f64 / 2.0 - (x * x + y * y).sqrt()).clamp(0.0, 1.0);
            libm::exp10(-absorbance * inside) as f32
        };
        (width, (0..width * width).map(sample).collect::<Vec<f32>>())
    };
    let mut errors_beyond = Vec::new();
    for (condenser_na, cover_error_um) in [(0.3, 0.0), (0.41, 0.0), (0.6, 0.0), (0.9, 0.0), (0.5, 10.0)] {
        let imager = imager(&MicroscopeParams { condenser_na, cover_error_um, ..MicroscopeParams::default() });
        for (width, transmittance) in [disc(12, 0.6), disc(64, 0.5), disc(160, 0.1)] {
            for depth_um in [0.0, -0.6, -1.3, 2.5, -5.0, -8.0] {
                let focus = imager.focus(depth_um, 0.0).unwrap();
                let object =
                    Object { transmittance: transmittance.clone(), phase: Vec::new(), width, at_px: [0, 0], depth_um };
                let found = factor(&imager, &object, &focus);
                // The same with an additional margin of empty slide.
                let more = 2 * 96;
                let wide = width + 2 * more;
                let mut padded = vec![1.0; wide * wide];
                for (k, t) in transmittance.iter().enumerate() {
                    padded[(k / width + more) * wide + k % width + more] = *t;
                }
                let all = factor(&imager, &Object { transmittance: padded, width: wide, ..object }, &focus);
                let offset = more / 2;
                let height = found.values.len() / found.width;
                let inside = |v: usize, len: usize| (offset..offset + len).contains(&v);
                let contrast = all.values.iter().map(|v| 1.0 - v).fold(0.0, f32::max);
                let cut = all
                    .values
                    .iter()
                    .enumerate()
                    .filter(|(k, _)| !inside(k % all.width, found.width) || !inside(k / all.width, height));
                let outside = cut.map(|(_, v)| (1.0 - v).abs()).fold(0.0, f32::max) / contrast;
                let wrapped = found.values.iter().enumerate().map(|(k, v)| {
                    (v - all.values[(k / found.width + offset) * all.width + k % found.width + offset]).abs()
                });
                let wrapped = wrapped.fold(0.0, f32::max) / contrast;
                assert!(outside < 1.5e-3 && wrapped < 1.5e-3, "{condenser_na} {width} {depth_um}: {outside} {wrapped}");
                errors_beyond.push(outside.max(wrapped));
            }
        }
    }
    errors_beyond.sort_by(f32::total_cmp);
    assert!(errors_beyond[errors_beyond.len() / 2] < 2.5e-4, "{}", errors_beyond[errors_beyond.len() / 2]);
}

#[test]
fn factors_do_not_depend_on_earlier_exposures() {
    let imager = imager(&MicroscopeParams::default());
    let objects = scene(3, 64);
    let focuses = [0.0, 0.7, -1.5, 3.0, 9.0, 0.2].map(|z| imager.focus(z, 0.5).unwrap());
    assert!(focuses.iter().any(|f| f.margin_px() != focuses[0].margin_px()));
    let (mut patch, mut scratch, mut out) = (Patch::default(), PatchScratch::default(), Factor::default());
    for object in [&objects[0], &objects[20], &objects[4]] {
        imager.load(&object.transmittance, &object.phase, object.width, &mut patch);
        for focus in &focuses {
            imager.expose(&mut patch, focus, &mut scratch, &mut out);
            assert_eq!(out, factor(&imager, object, focus));
            let side = object.width / 2 + 2 * focus.margin_px();
            assert_eq!((out.width, out.values.len()), (side, side * side));
        }
    }
}

#[test]
fn layers_of_an_object_match_one_layer() {
    // A smooth disc with a small sharp one in it: 1 sample per pixel for the first, 2 for the second.
    let imager = imager(&MicroscopeParams { condenser_na: 0.6, ..MicroscopeParams::default() });
    let smooth = |x: f64, y: f64| 0.15 / (1.0 + libm::exp((libm::hypot(x - 64.0, y - 64.0) - 40.0) / 5.0));
    let small = |x: f64, y: f64| 0.4 * (9.0 - libm::hypot(x - 70.0, y - 58.0)).clamp(0.0, 1.0);
    let image = |width: usize, at: [f64; 2], absorbance: &dyn Fn(f64, f64) -> f64| -> Vec<f32> {
        let sample = |i: usize| absorbance(at[0] + (i % width) as f64, at[1] + (i / width) as f64);
        (0..width * width).map(|i| libm::exp10(-sample(i)) as f32).collect()
    };
    let fine = image(128, [0.0, 0.0], &|x, y| smooth(x, y) + small(x, y));
    // Samples are at the centres of pixels, and the second layer begins at pixel (28, 22).
    let coarse = image(64, [0.0, 0.0], &|x, y| smooth(2.0 * x + 0.5, 2.0 * y + 0.5));
    let behind = image(32, [56.0, 44.0], &smooth);
    let both = image(32, [56.0, 44.0], &|x, y| smooth(x, y) + small(x, y));
    let layers = [
        PatchLayer { transmittance: &coarse, width: 64, samples_per_pixel: 1, ..PatchLayer::default() },
        PatchLayer {
            transmittance: &both,
            behind: &behind,
            width: 32,
            samples_per_pixel: 2,
            at_px: [28, 22],
            ..PatchLayer::default()
        },
    ];
    let (mut patch, mut scratch) = (Patch::default(), PatchScratch::default());
    let (mut whole, mut layered) = (Factor::default(), Factor::default());
    let depths = [0.0, 0.7, 1.3, -1.6, 3.0, 8.0];
    let mut all = Vec::new();
    for depth in depths {
        let focus = imager.focus(depth, 0.0).unwrap();
        imager.load(&fine, &[], 128, &mut patch);
        imager.expose(&mut patch, &focus, &mut scratch, &mut whole);
        imager.load_layers([64, 64], &layers, &mut patch);
        imager.expose(&mut patch, &focus, &mut scratch, &mut layered);
        assert_eq!(layered.width, whole.width);
        let error = relative(&double(&layered.values), &double(&whole.values));
        assert!(error < 2e-3, "{depth}: {error}");
        all.push(layered.clone());
    }
    // A loaded patch gives the same factors in any order.
    for (depth, expected) in depths.iter().zip(&all).rev().chain(depths.iter().zip(&all)) {
        imager.expose(&mut patch, &imager.focus(*depth, 0.0).unwrap(), &mut scratch, &mut layered);
        assert!(layered == *expected, "{depth}");
    }
}

#[test]
fn a_smooth_layer_with_a_steep_fold_matches_a_fine_layer() {
    // A narrow ridge on a disc: 1 or 2 samples per pixel. Without correction, the error would be 0.008.
    let imager = imager(&MicroscopeParams { condenser_na: 0.6, ..MicroscopeParams::default() });
    let absorbance = |x: f64, y: f64| {
        let disc = 0.1 / (1.0 + libm::exp((libm::hypot(x - 64.0, y - 64.0) - 40.0) / 4.0));
        let across = (0.8 * (x - 60.0) - 0.6 * (y - 66.0)) / 2.5;
        disc * (1.0 + 5.0 * libm::exp(-across * across))
    };
    let light = |x: f64, y: f64| libm::exp10(-absorbance(x, y));
    let fine: Vec<f32> = (0..128 * 128).map(|i| light(f64::from(i % 128), f64::from(i / 128)) as f32).collect();
    let mean = |i: i32| {
        let (x, y) = (f64::from(2 * (i % 64)), f64::from(2 * (i / 64)));
        ((light(x, y) + light(x + 1.0, y) + light(x, y + 1.0) + light(x + 1.0, y + 1.0)) / 4.0) as f32
    };
    let coarse: Vec<f32> = (0..64 * 64).map(mean).collect();
    let layer = PatchLayer { transmittance: &coarse, width: 64, samples_per_pixel: 1, ..PatchLayer::default() };
    let (mut patch, mut scratch) = (Patch::default(), PatchScratch::default());
    let (mut expected, mut found) = (Factor::default(), Factor::default());
    for depth in [0.0, -0.7, 1.5, 4.0] {
        let focus = imager.focus(depth, 0.0).unwrap();
        imager.load(&fine, &[], 128, &mut patch);
        imager.expose(&mut patch, &focus, &mut scratch, &mut expected);
        imager.load_layers([64, 64], &[layer], &mut patch);
        imager.expose(&mut patch, &focus, &mut scratch, &mut found);
        let worst = found.values.iter().zip(&expected.values).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 5e-3, "{depth}: {worst}");
    }
}

#[test]
#[should_panic(expected = "within the patch")]
fn layers_outside_the_patch_panic() {
    let layer = PatchLayer {
        transmittance: &[1.0; 16],
        width: 4,
        samples_per_pixel: 2,
        at_px: [1, 0],
        ..PatchLayer::default()
    };
    imager(&MicroscopeParams::default()).load_layers([2, 2], &[layer], &mut Patch::default());
}

#[test]
fn overlapping_objects_at_two_depths_are_within_2_percent_of_abbe() {
    let disk: Vec<f64> = shifted(&soft_disk(3.0, 0.5, 0.12), -10, 6).iter().map(|a| 0.6 * a).collect();
    let Some(asym) = array("ref_asym_absorbance") else { return };
    let asym = shifted(&asym, 8, -4);
    for condenser_na in [0.41, 0.6] {
        let params = sampled(condenser_na);
        let source = Source::Lattice { stride: 2 };
        let abbe = AbbeParams { width: SIDE, height: SIDE, source };
        let abbe = Abbe::new(&Microscope::new(&params).unwrap(), &abbe).unwrap();
        for depths in [[2.0, -3.0], [0.0, 3.0], [0.0, 1.0], [-1.0, 4.0], [3.0, 4.0]] {
            let layers: [Layer; 2] = [absorbing(depths[0], &disk), absorbing(depths[1], &asym)];
            let reference = abbe.image(&layers, 0.0).unwrap();
            let objects = [Object::tile(&disk, depths[0]), Object::tile(&asym, depths[1])];
            let error = relative(&sample_image(&imager(&params), &objects, SIDE), &reference);
            assert!(error < 0.02, "{condenser_na} {depths:?}: {error}");
        }
    }
}

#[test]
fn objects_at_one_depth_need_one_patch() {
    // Two patches are accurate for objects 1 µm apart, or for a small object on a far larger one. Objects whose edges
    // meet need one patch.
    let params = sampled(0.6);
    let imager = imager(&params);
    let source = Source::Lattice { stride: 2 };
    let abbe = AbbeParams { width: SIDE, height: SIDE, source };
    let abbe = Abbe::new(&Microscope::new(&params).unwrap(), &abbe).unwrap();
    let disc = |x, y, radius, absorbance| shifted(&soft_disk(radius, absorbance, 0.12), x, y);
    let touching = [disc(-8, 0, 1.0, 0.4), disc(8, 0, 1.0, 0.4)];
    let apart = [disc(-12, 0, 1.0, 0.4), disc(12, 0, 1.0, 0.4)];
    let on_top = [disc(0, 0, 6.0, 0.1), disc(3, 4, 0.5, 0.4)];
    for (pair, [apart_at_2, joint_at_2]) in
        [(&touching, [0.05, 0.012]), (&apart, [0.016, 0.016]), (&on_top, [0.005, 0.005])]
    {
        let sum: Vec<f64> = pair[0].iter().zip(&pair[1]).map(|(a, b)| a + b).collect();
        for (depth, scale) in [(0.0, 0.4), (2.0, 1.0)] {
            let reference = abbe.image(&[absorbing(depth, &sum)], 0.0).unwrap();
            let separate = sample_image(&imager, &[Object::tile(&pair[0], depth), Object::tile(&pair[1], depth)], SIDE);
            let joint = sample_image(&imager, &[Object::tile(&sum, depth)], SIDE);
            let errors = [relative(&separate, &reference), relative(&joint, &reference)];
            assert!(errors[0] < apart_at_2 * scale && errors[1] < joint_at_2 * scale, "{depth}: {errors:?}");
        }
    }
}

#[test]
fn depth_rounding_error_is_visible_to_a_sixteenth_of_a_um() {
    let imager = imager(&MicroscopeParams::default());
    for seed in 0..2 {
        let objects = scene(seed, 256);
        let exact = sample_image(&imager, &objects, 256);
        let rounded = |step: f64| {
            let focus = |depth: f64| imager.focus((depth / step).round() * step, 0.0).unwrap();
            relative(&render(&imager, &objects, 256, focus), &exact)
        };
        let errors = [1.0, 0.5, 0.25, 0.0625].map(rounded);
        assert!(errors[3] < 0.003, "{errors:?}");
        assert!((0.02..0.05).contains(&errors[0]) && errors[1] > 0.01 && errors[2] > 0.005, "{errors:?}");
    }
}

#[test]
fn refocused_images_match_the_defocused_object() {
    let Some(asym) = array("ref_asym_absorbance") else { return };
    for (condenser_na, bound) in [(0.41, 0.01), (0.9, 0.01)] {
        let imager = imager(&MicroscopeParams { condenser_na, ..MicroscopeParams::default() });
        let truth = |depth: f64| sample_image(&imager, &[Object::tile(&asym, depth)], SIDE / 2);
        let taken = single(&enlarged(&truth(0.0), SIDE / 2));
        for depth in [0.0, 0.5, 1.0, 2.0, 4.0, -3.0] {
            let object = || Object { transmittance: taken.clone(), ..Object::tile(&asym, depth) };
            let again = render(&imager, &[object()], SIDE / 2, |z| imager.refocus(&imager.focus(z, 0.0).unwrap()));
            let blurred_twice = sample_image(&imager, &[object()], SIDE / 2);
            let error = |image: &[f64]| relative(image, &truth(depth));
            assert!(error(&again) < bound, "{condenser_na} {depth}: {}", error(&again));
            assert!(error(&again) < error(&blurred_twice), "{condenser_na} {depth}");
        }
    }
    // Also with asymmetric aberrations.
    let zernike = Zernike { coma: [0.06, 0.0], ..Zernike::default() };
    let imager =
        imager(&MicroscopeParams { condenser_na: 0.6, bandwidth_um: 0.0, zernike, ..MicroscopeParams::default() });
    let truth = |depth: f64| sample_image(&imager, &[Object::tile(&asym, depth)], SIDE / 2);
    let taken = single(&enlarged(&truth(0.0), SIDE / 2));
    for depth in [0.0, 2.0] {
        let object = Object { transmittance: taken.clone(), ..Object::tile(&asym, depth) };
        let again = render(&imager, &[object], SIDE / 2, |z| imager.refocus(&imager.focus(z, 0.0).unwrap()));
        assert!(relative(&again, &truth(depth)) < 0.012, "{depth}: {}", relative(&again, &truth(depth)));
    }
}

/// Upsamples by two with Catmull–Rom cubics.
fn enlarged(image: &[f64], width: usize) -> Vec<f64> {
    // A sample is a quarter of a pixel from the centre of its pixel.
    const WEIGHTS: [f64; 4] = [-0.023_437_5, 0.226_562_5, 0.867_187_5, -0.070_312_5];
    let at = |v: i64| v.clamp(0, width as i64 - 1) as usize;
    let taps = |sample: usize| {
        let pixel = (sample / 2) as i64;
        let mirrored = sample % 2 == 1;
        (0..4).map(move |k| (at(if mirrored { pixel + 2 - k } else { pixel - 2 + k }), WEIGHTS[k as usize]))
    };
    let sample = |i: usize| {
        let (x, y) = (i % (2 * width), i / (2 * width));
        taps(y).map(|(y, v)| taps(x).map(|(x, u)| u * v * image[y * width + x]).sum::<f64>()).sum()
    };
    (0..4 * image.len()).map(sample).collect()
}

#[test]
fn clipped_values_are_counted_and_empty_patches_have_unit_intensity() {
    let imager = imager(&MicroscopeParams { condenser_na: 0.6, ..MicroscopeParams::default() });
    let deep = Object::tile(&soft_disk(3.0, 3.0, 0.12), 3.0);
    let found = factor(&imager, &deep, &imager.focus(3.0, 0.0).unwrap());
    assert!(found.clipped > 20);
    assert_eq!(found.values.iter().filter(|v| **v == MIN_TRANSMITTANCE).count(), found.clipped);
    let empty = Object { phase: vec![0.0; SIDE * SIDE], ..Object::tile(&[0.0; SIDE * SIDE], 0.0) };
    for depth in [0.0, 6.0] {
        let found = factor(&imager, &empty, &imager.focus(depth, 0.0).unwrap());
        assert!(found.clipped == 0 && found.values.iter().all(|v| *v == 1.0));
    }
}

#[test]
fn stray_light_brightens_dark_regions() {
    let params = MicroscopeParams { stray_light: 0.1, ..MicroscopeParams::default() };
    let microscope = Microscope::new(&params).unwrap();
    let glaring = PatchImager::new(&microscope);
    let objects = scene(9, 96);
    let clean = imager(&MicroscopeParams::default());
    let (lit, dark) = (sample_image(&glaring, &objects, 96), sample_image(&clean, &objects, 96));
    assert!(lit.iter().zip(&dark).all(|(l, d)| (l - (0.1 + 0.9 * d)).abs() < 1e-6));
}

#[test]
fn margins_depend_on_defocus_only() {
    let imager = imager(&MicroscopeParams::default());
    let focus = |depth, stage| imager.focus(depth, stage).unwrap();
    let mut margins: Vec<usize> = (0..40).map(|z| focus(0.5 * f64::from(z), 0.0).margin_px()).collect();
    assert!(margins.windows(2).all(|pair| pair[0] <= pair[1]));
    margins.dedup();
    assert!(margins[0] == 10 && margins.len() <= 10, "{margins:?}");
    assert_eq!(focus(2.0, 0.0).margin_px(), focus(-2.0, 0.0).margin_px());
    assert!((focus(-1.0, -1.0).defocus_um() - (1.0 - 1.515)).abs() < 1e-12);
}

#[test]
fn light_outside_the_image_is_ignored() {
    let imager = imager(&MicroscopeParams::default());
    let objects = scene(5, 128);
    let all = sample_image(&imager, &objects, 128);
    let mut moved = objects;
    for object in &mut moved {
        object.at_px = object.at_px.map(|v| v - 40);
    }
    let part = sample_image(&imager, &moved, 64);
    assert!((0..64 * 64).all(|i| part[i] == all[(i / 64 + 40) * 128 + i % 64 + 40]));
    let mut light = TransmittedLight::new(imager.microscope(), 64, 64);
    let speck = factor(&imager, &moved[55], &imager.focus(0.0, 0.0).unwrap());
    for far in [[-1000, 3], [3, 1 << 40], [64 + 12, 0]] {
        light.multiply(&speck, far);
    }
    light.multiply(&Factor::default(), [0, 0]);
    let mut out = vec![0.0; 64 * 64];
    light.image_into(&mut out);
    assert_eq!(out, vec![1.0; 64 * 64]);
    light.multiply(&speck, [30, 30]);
    light.clear();
    light.image_into(&mut out);
    assert_eq!(out, vec![1.0; 64 * 64]);
    light.multiply(&speck, [30, 30]);
    light.image_into(&mut out);
    let mut swapped = Vec::new();
    light.swap_image(&mut swapped);
    assert_eq!(out, swapped);
    assert!(out.iter().any(|light| *light < 1.0));
    TransmittedLight::new(imager.microscope(), 0, 0).image_into(&mut []);
}

#[test]
fn invalid_depths_are_rejected_by_name() {
    let imager = imager(&MicroscopeParams::default());
    let named = |result: Result<Focus, Error>| result.unwrap_err().to_string();
    assert!(named(imager.focus(f64::NAN, 0.0)).starts_with("depth_um is NaN"));
    assert!(named(imager.focus(0.0, 1e9)).starts_with("stage_um is 1000000000"));
}

#[test]
#[should_panic(expected = "belongs to another imager")]
fn patches_of_another_imager_panic() {
    let [a, b] =
        [0.4, 0.6].map(|condenser_na| imager(&MicroscopeParams { condenser_na, ..MicroscopeParams::default() }));
    factor(&a, &Object::tile(&[0.0; SIDE * SIDE], 0.0), &b.focus(0.0, 0.0).unwrap());
}

#[test]
#[should_panic(expected = "multiple of the oversampling")]
fn incomplete_pixels_panic() {
    imager(&MicroscopeParams::default()).load(&[1.0; 15], &[], 5, &mut Patch::default());
}

#[test]
fn imagers_can_be_shared_between_threads() {
    fn shared<T: Send + Sync>(_: &T) {}
    let imager = imager(&MicroscopeParams::default());
    shared(&imager);
    let objects = scene(11, 96);
    let one = |object: &Object| factor(&imager, object, &imager.focus(object.depth_um, 0.25).unwrap());
    let alone: Vec<Factor> = objects.iter().map(one).collect();
    let together: Vec<Factor> = std::thread::scope(|scope| {
        let threads: Vec<_> = objects.iter().map(|object| scope.spawn(move || one(object))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert!(alone == together);
}

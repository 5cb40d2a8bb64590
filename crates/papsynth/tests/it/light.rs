//! Optics and stain in images of the engine, tested against physical laws and against slower reference models.

#![expect(clippy::cast_possible_truncation, reason = "a small program with small numbers")]

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{
    Border, Colour, Debris, Distribution, DyeAmounts, Gaussians, Illumination, Imaging, Layout, LightSection,
    Microscope, Mixing, Monochrome, Number, Optics, Preset, Recipe,
};
use papsynth::recipe::{Rendition, Restore};
use papsynth::scene::{Body, ObjectKind};
use papsynth::truth::Part;
use papsynth::{Engine, Error, Frame, Inputs};

/// Returns a recipe for a small field with uniform illumination and negligible noise.
fn small() -> Recipe {
    let mut recipe = Preset::Lbc.recipe();
    recipe.field.width_px = 160.0.into();
    recipe.field.height_px = 128.0.into();
    recipe.layout = Layout::Uniform {};
    recipe.slide.spacing_um = 2.0.into();
    for mix in recipe.cells.values_mut() {
        mix.count = 2.0.into();
    }
    recipe.background.illumination = Illumination::Border(Border { exponent: 0.0.into() });
    recipe.background.texture = 0.0.into();
    recipe.camera.bits = 16.0.into();
    recipe
}

/// Returns a recipe for an empty field.
fn empty() -> Recipe {
    let mut recipe = small();
    recipe.cells.clear();
    recipe.debris = Debris::none();
    recipe
}

fn set(recipe: &mut Recipe, change: impl FnOnce(Fields<'_>)) {
    let Optics::BrightField(Microscope {
        condenser_na,
        stray_light,
        stray_light_um,
        extra_blur_um,
        imaging,
        mount_index,
        ..
    }) = &mut recipe.optics
    else {
        panic!("the default is bright field")
    };
    change(Fields { condenser_na, stray_light, stray_light_um, extra_blur_um, imaging, mount_index });
}

struct Fields<'a> {
    condenser_na: &'a mut Number,
    stray_light: &'a mut Number,
    stray_light_um: &'a mut Number,
    extra_blur_um: &'a mut Number,
    imaging: &'a mut Imaging,
    mount_index: &'a mut Number,
}

fn engine(recipe: &Recipe) -> Engine {
    Engine::new(recipe, &Model::builtin(), &Inputs::default()).unwrap()
}

fn frame(recipe: &Recipe, index: u64) -> Frame {
    engine(recipe).frame(Key { seed: 11, index }).unwrap()
}

fn light(recipe: &Recipe) -> Vec<f32> {
    frame(recipe, 0).planes.swap_remove(0).noise_free
}

/// Returns ‖a − b‖ / ‖white − b‖: the error relative to the contrast.
fn error(a: &[f32], b: &[f32]) -> f64 {
    let white = f64::from(b.iter().copied().fold(0.0, f32::max));
    let square = |x: f64| x * x;
    let off: f64 = a.iter().zip(b).map(|(a, b)| square(f64::from(a - b))).sum();
    let contrast: f64 = b.iter().map(|b| square(white - f64::from(*b))).sum();
    (off / contrast).sqrt()
}

fn colour(recipe: &mut Recipe, mixing: Mixing, rendition: Rendition) {
    recipe.light = LightSection::Colour(Colour { lamp_k: 3200.0.into(), mixing, chromatic_um: 0.3.into(), rendition });
}

#[test]
fn an_empty_slide_has_the_background_level_with_any_optics() {
    let mut recipe = empty();
    recipe.background.level = 0.8.into();
    let mut gaussian = recipe.clone();
    gaussian.optics = Optics::gaussian();
    let mut rgb = recipe.clone();
    colour(&mut rgb, Mixing::Spectral, Rendition::Raw);
    for (name, recipe) in [("bright field", &recipe), ("gaussian", &gaussian), ("colour", &rgb)] {
        let light = light(recipe);
        assert!(light.iter().all(|v| (v / 65_535.0 - 0.8).abs() < 1e-4), "{name}: {:?}", &light[..3]);
    }
    set(&mut recipe, |optics| *optics.stray_light = 0.2.into());
    assert!(
        light(&recipe).iter().all(|v| (v / 65_535.0 - 0.8).abs() < 1e-4),
        "stray light does not change the empty field"
    );
    set(&mut recipe, |optics| *optics.stray_light_um = 5.0.into());
    assert!(light(&recipe).iter().all(|v| (v / 65_535.0 - 0.8).abs() < 1e-4), "nor does local stray light");
}

#[test]
fn local_stray_light_is_weaker_near_objects_than_even_stray_light() {
    let mut recipe = small();
    let with = |fraction: f64, um: f64, recipe: &mut Recipe| {
        set(recipe, |optics| (*optics.stray_light, *optics.stray_light_um) = (fraction.into(), um.into()));
        light(recipe)
    };
    let [none, even, local] = [(0.0, 0.0), (0.2, 0.0), (0.2, 5.0)].map(|(s, um)| with(s, um, &mut recipe));
    // Nothing becomes brighter than with even stray light, and cells and their surroundings become darker.
    let darker = |a: &[f32], b: &[f32]| a.iter().zip(b).filter(|(a, b)| **a < *b - 65.0).count();
    assert_eq!(darker(&even, &local), 0);
    assert!(darker(&local, &even) > even.len() / 20 && darker(&none, &local) > 0 && darker(&local, &none) > 0);
    // The light is the same in the mean, but for what spreads beyond the border.
    let mean = |light: &[f32]| light.iter().map(|v| f64::from(*v)).sum::<f64>() / light.len() as f64;
    assert!((mean(&local) / mean(&none) - 1.0).abs() < 1e-3, "{} {}", mean(&local), mean(&none));
}

#[test]
fn a_broad_band_converts_the_light_behind_all_objects() {
    let mut recipe = small();
    recipe.background.level = 0.8.into();
    set(&mut recipe, |optics| (*optics.stray_light, *optics.extra_blur_um) = (0.0.into(), 0.0.into()));
    let mut at = |variation: f64| {
        let absorption_variation = variation.into();
        recipe.light = LightSection::Monochrome(Monochrome { absorption_variation, ..Monochrome::default() });
        light(&recipe)
    };
    let (variance, empty) = (0.49, 0.8 * 65_535.0);
    let [narrow, broad] = [0.0, 0.7].map(&mut at);
    let mut overlaps = 0;
    for (narrow, broad) in narrow.iter().zip(&broad).map(|(a, b)| (f64::from(*a) / empty, f64::from(*b) / empty)) {
        let absorbance = (-libm::log(narrow)).max(0.0);
        overlaps += usize::from(absorbance > 2.0);
        let expected = if absorbance > 0.0 { libm::pow(1.0 + variance * absorbance, -1.0 / variance) } else { narrow };
        assert!((broad - expected).abs() < 1e-3, "{narrow}: {broad} {expected}");
    }
    assert!(overlaps > 100, "{overlaps}");
}

#[test]
fn the_product_model_approximates_the_abbe_model_and_gaussians_do_not() {
    let mut recipe = small();
    recipe.debris.bacilli.clusters = 3.0.into();
    // Soft edges look the same with any optics.
    recipe.nucleus.edge_um = 0.0.into();
    recipe.cytoplasm.rim_um = 0.0.into();
    // Fine detail does not. Where it is strongest, it has 1.5 times its mean strength.
    recipe.cytoplasm.texture = 1.5.into();
    recipe.focus.centre_um = 1.5.into();
    let product = light(&recipe);
    set(&mut recipe, |optics| *optics.imaging = Imaging::Abbe);
    let abbe = light(&recipe);
    let off = error(&product, &abbe);
    assert!(off < 0.02, "{off}");
    for (sigma_z, min) in [(0.25, 0.02), (1.0, 0.08)] {
        // In the paper's model, stage position equals depth; this is the same focus in the mountant.
        recipe.focus.centre_um = (1.5 * 1.515).into();
        recipe.optics = Optics::Gaussian(Gaussians { sigma_xy_um: 0.175.into(), sigma_z_um_per_um: sigma_z.into() });
        let off = error(&light(&recipe), &abbe);
        assert!(off > min, "{sigma_z}: {off}");
    }
}

#[test]
fn adding_planes_never_changes_a_plane() {
    for rgb in [false, true] {
        let mut recipe = small();
        if rgb {
            colour(&mut recipe, Mixing::Spectral, Rendition::Raw);
        }
        let alone = frame(&recipe, 0);
        recipe.focus.planes = 5.0.into();
        recipe.focus.step_um = 3.0.into();
        let stack = frame(&recipe, 0);
        assert_eq!(stack.planes[2].noise_free, alone.planes[0].noise_free, "the centre plane is the single plane");
        assert_eq!(stack.planes[2].grey, alone.planes[0].grey, "the noise is the same");
        assert_ne!(stack.planes[1].grey, stack.planes[2].grey);
        recipe.focus.planes = 9.0.into();
        let more = frame(&recipe, 0);
        for (few, many) in stack.planes.iter().zip(&more.planes[2..7]) {
            assert_eq!(few.noise_free, many.noise_free);
            assert_eq!(few.grey, many.grey);
        }
    }
}

#[test]
fn the_focus_moves_by_the_stage_travel_times_the_mountant_index() {
    let mut recipe = small();
    recipe.focus.planes = 21.0.into();
    recipe.focus.step_um = 0.4.into();
    recipe.slide.depth_um = 0.0.into();
    recipe.slide.stacking_um = 0.0.into();
    recipe.debris = empty().debris;
    recipe.cytoplasm.phase_rad = 0.0.into();
    let engine = engine(&recipe);
    let mut scene = engine.scene(Key { seed: 11, index: 0 }).unwrap();
    for object in &mut scene.objects {
        object.depth_um = 3.03;
    }
    let width = scene.view.width;
    let mut roughness = Vec::new();
    let finished = engine
        .image::<Error>(scene, papsynth::Threads::One, |plane| {
            let rows = plane.noise_free.chunks_exact(width).flat_map(|row| row.windows(2));
            roughness.push(rows.map(|w| f64::from(w[1] - w[0]) * f64::from(w[1] - w[0])).sum::<f64>());
            Ok(())
        })
        .unwrap();
    let sharpest = (0..21).max_by(|a, b| roughness[*a].total_cmp(&roughness[*b])).unwrap();
    // 3.03 µm of mountant are 2 µm of stage travel for paraxial rays, five steps above the centre, and less for other
    // rays.
    assert!((14..=15).contains(&sharpest), "{roughness:?}");
    assert!(finished.truth.objects.iter().all(|object| object.defocus_um[15].abs() < 1e-9));
}

#[test]
fn a_refracting_speck_changes_contrast_through_focus() {
    let mut recipe = empty();
    recipe.debris.speckles.count = 1.0.into();
    recipe.debris.speckles.absorbance = 0.0.into();
    recipe.debris.speckles.phase_rad = 0.4.into();
    recipe.debris.speckles.dilations = 3.0.into();
    recipe.focus.planes = 3.0.into();
    recipe.focus.step_um = 2.0.into();
    recipe.background.level = 0.6.into();
    set(&mut recipe, |optics| *optics.stray_light = 0.0.into());
    let engine = engine(&recipe);
    let mut scene = engine.scene(Key { seed: 11, index: 0 }).unwrap();
    (scene.objects[0].depth_um, scene.objects[0].centre_um) = (0.0, [20.0, 16.0]);
    let mut contrasts = Vec::new();
    let width = scene.view.width;
    let image = |plane: &papsynth::Plane| {
        let white = plane.noise_free[0];
        contrasts.push(plane.noise_free[64 * width + 80] / white - 1.0);
        Ok(())
    };
    engine.image::<Error>(scene, papsynth::Threads::One, image).unwrap();
    assert!(contrasts[0] * contrasts[2] < 0.0 && contrasts[0].abs() > 0.03, "{contrasts:?}");
    assert!((contrasts[0] + contrasts[2]).abs() < 0.3 * contrasts[0].abs(), "{contrasts:?}");
    assert!(contrasts[1].abs() < 0.01, "it is invisible in focus: {contrasts:?}");
}

#[test]
fn clipped_pixels_of_a_black_object_are_counted() {
    let mut recipe = empty();
    recipe.debris.speckles.count = 1.0.into();
    recipe.debris.speckles.absorbance = 3.0.into();
    recipe.debris.speckles.dilations = 14.0.into();
    recipe.debris.speckles.phase_rad = 0.0.into();
    recipe.focus.centre_um = 1.5.into();
    let frame = frame(&recipe, 0);
    assert!(frame.planes[0].clipped_px > 0);
    assert!(frame.planes[0].noise_free.iter().all(|v| *v > 0.0 && v.is_finite()));
    assert_eq!(self::frame(&small(), 0).planes[0].clipped_px, 0, "cells are not dark enough to be clipped");
}

#[test]
fn colour_matches_the_sum_of_sixteen_wavelengths() {
    let mut recipe = small();
    recipe.debris = empty().debris;
    colour(&mut recipe, Mixing::PerWavelength, Rendition::Raw);
    let reference = light(&recipe);
    for (mixing, min, max) in [(Mixing::Spectral, 0.0, 0.005), (Mixing::ThreeVectors, 0.01, 0.2)] {
        colour(&mut recipe, mixing, Rendition::Raw);
        let off = error(&light(&recipe), &reference);
        assert!((min..max).contains(&off), "{mixing:?}: {off}");
    }
}

#[test]
fn black_objects_stay_black_in_colour() {
    let mut recipe = small();
    recipe.stain.nucleus.haematein = 100.0;
    recipe.debris.leukocytes.clusters = 6.0.into();
    colour(&mut recipe, Mixing::Spectral, Rendition::Raw);
    let light = light(&recipe);
    let background = f64::from(light.iter().copied().fold(0.0, f32::max));
    let saturated_colours = light.chunks_exact(3).filter(|pixel| {
        let [low, high] = [pixel.iter().copied().fold(f32::MAX, f32::min), pixel.iter().copied().fold(0.0, f32::max)];
        f64::from(high - low) > 0.8 * background
    });
    assert_eq!(saturated_colours.count(), 0);
}

#[test]
fn per_wavelength_colour_is_the_weighted_sum_of_monochrome_images() {
    // One monochrome image for each wavelength node of lamp and sensor.
    let mut recipe = small();
    recipe.debris = empty().debris;
    recipe.light = LightSection::Colour(Colour {
        lamp_k: 3200.0.into(),
        mixing: Mixing::PerWavelength,
        chromatic_um: 0.0.into(),
        rendition: Rendition::Raw,
    });
    let colours = light(&recipe);
    let sensor = dye_spectra::Colour::new(&dye_spectra::ColourParams::default()).unwrap();
    let mut sums = vec![0.0_f64; colours.len()];
    for node in 0..16 {
        let nodes = sensor.channels().each_ref().map(|channel| channel.nodes[node]);
        recipe.light = LightSection::Monochrome(Monochrome {
            wavelength_um: nodes[0].wavelength_um.into(),
            bandwidth_um: 0.0.into(),
            ..Monochrome::default()
        });
        let grey = light(&recipe);
        for (pixel, value) in sums.chunks_exact_mut(3).zip(&grey) {
            pixel.iter_mut().zip(&nodes).for_each(|(sum, node)| *sum += node.weight * f64::from(*value));
        }
    }
    let sums: Vec<f32> = sums.iter().map(|v| *v as f32).collect();
    assert!(error(&colours, &sums) < 1e-4, "{}", error(&colours, &sums));
}

#[test]
fn cytoplasm_takes_the_tint_of_its_dyes() {
    let mut recipe = empty();
    let mut mix = small().cells["intermediate"].clone();
    mix.count = 1.0.into();
    recipe.stain.cell_balance = 0.0.into();
    colour(&mut recipe, Mixing::Spectral, Rendition::Display);
    for (tint, bright, dark) in [("cyanophilic", 2, 0), ("eosinophilic", 0, 1), ("orangeophilic", 0, 2)] {
        let weight = |name: &str| if name == tint { Number::Fixed(1.0) } else { Number::Fixed(0.0) };
        mix.tints.cyanophilic = weight("cyanophilic");
        mix.tints.eosinophilic = weight("eosinophilic");
        mix.tints.orangeophilic = weight("orangeophilic");
        recipe.cells = [("intermediate".to_owned(), mix.clone())].into();
        let frame = frame(&recipe, 0);
        let cell = frame.finished.truth.objects.iter().find(|o| o.part == Part::Cytoplasm).unwrap();
        assert_eq!(cell.tint_name(), tint);
        let width = frame.finished.scene.view.width;
        let mut sums = [0.0_f64; 3];
        for run in cell.amodal.runs() {
            for x in run.x0..run.x1 {
                let pixel = &frame.planes[0].noise_free[(run.y as usize * width + x as usize) * 3..][..3];
                sums.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += f64::from(*value));
            }
        }
        assert!(sums[bright] > 1.05 * sums[dark], "{tint}: {sums:?}");
    }
}

#[test]
fn fields_of_one_slide_have_the_same_stain() {
    let mut recipe = small();
    recipe.slide.fields_per_slide = 4;
    recipe.stain.field_balance = 0.0.into();
    recipe.stain.slide_balance = 0.5.into();
    let engine = engine(&recipe);
    let scene = |index| engine.scene(Key { seed: 3, index }).unwrap();
    let (a, b, c) = (scene(0), scene(3), scene(4));
    assert_eq!((a.slide, b.slide, c.slide), (0, 0, 1));
    assert_eq!(a.dyes, b.dyes);
    assert_ne!(a.dyes, c.dyes);
}

#[test]
fn a_grey_stain_is_the_same_at_every_wavelength() {
    let mut recipe = small();
    recipe.optics = Optics::gaussian();
    let grey = DyeAmounts::grey();
    recipe.stain.cyanophilic = grey;
    recipe.stain.eosinophilic = grey;
    recipe.stain.orangeophilic = grey;
    recipe.stain.nucleus = grey;
    recipe.stain.bacillus = grey;
    recipe.stain.speckle = grey;
    recipe.debris = Preset::Paper2015.recipe().debris;
    recipe.stain.slide_balance = 0.0.into();
    recipe.stain.field_balance = 0.0.into();
    recipe.stain.cell_balance = 0.0.into();
    let mut at = |wavelength_um: f64| {
        recipe.light = LightSection::Monochrome(Monochrome {
            wavelength_um: wavelength_um.into(),
            bandwidth_um: 0.01.into(),
            ..Monochrome::default()
        });
        light(&recipe)
    };
    assert_eq!(at(0.45), at(0.65));
}

#[test]
fn nuclei_stand_out_most_near_the_papers_filter() {
    let mut recipe = empty();
    let mut mix = small().cells["intermediate"].clone();
    mix.count = 1.0.into();
    recipe.cells = [("intermediate".to_owned(), mix)].into();
    let mut contrast = |wavelength_um: f64| {
        recipe.light = LightSection::Monochrome(Monochrome {
            wavelength_um: wavelength_um.into(),
            bandwidth_um: 0.0.into(),
            ..Monochrome::default()
        });
        let frame = frame(&recipe, 0);
        let objects = &frame.finished.truth.objects;
        objects.iter().find(|o| o.part == Part::Nucleus).unwrap().detectability[0]
    };
    let [blue, filter, red] = [0.48, 0.57, 0.66].map(&mut contrast);
    assert!(filter > blue && filter > red, "{blue} {filter} {red}");
}

#[test]
fn extra_blur_and_a_wider_condenser_reduce_contrast() {
    let roughness = |recipe: &Recipe| {
        let light = light(recipe);
        // Differences along rows of 160 px.
        let steps = light.chunks_exact(160).flat_map(|row| row.windows(2));
        steps.map(|w| f64::from(w[1] - w[0]) * f64::from(w[1] - w[0])).sum::<f64>()
    };
    let recipe = small();
    let mut softer = recipe.clone();
    set(&mut softer, |optics| *optics.extra_blur_um = 0.4.into());
    assert!(roughness(&softer) < 0.8 * roughness(&recipe));
    // Out of focus, the cone of the condenser determines the blur.
    let mut out = recipe;
    out.focus.centre_um = 6.0.into();
    let mut wide = out.clone();
    set(&mut wide, |optics| *optics.condenser_na = 0.9.into());
    let [found, narrow] = [&wide, &out].map(&roughness);
    assert!(found < 0.8 * narrow, "{found} {narrow}");
}

#[test]
fn invalid_apertures_are_reported_with_their_field() {
    let problems = |change: &dyn Fn(&mut Recipe)| {
        let mut recipe = small();
        change(&mut recipe);
        Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap_err().to_string()
    };
    let na = |value: f64| {
        move |recipe: &mut Recipe| {
            if let Optics::BrightField(Microscope { na, .. }) = &mut recipe.optics {
                *na = value.into();
            }
        }
    };
    let text = problems(&na(1.2));
    assert!(text.contains("optics.na: 1.2 is above `optics.immersion_index` = 1; expected at most 1"), "{text}");
    let text = problems(&|recipe| set(recipe, |optics| *optics.condenser_na = 1.55.into()));
    assert!(text.contains("optics.condenser_na") && text.contains("less than 1.515"), "{text}");
    let text = problems(&|recipe| {
        recipe.light = LightSection::Monochrome(Monochrome {
            wavelength_um: 0.0.into(),
            bandwidth_um: 0.01.into(),
            ..Monochrome::default()
        });
    });
    assert!(text.contains("light.wavelength_um: 0 is out of range: expected 0.4 to 0.7"), "{text}");
    let text = problems(&|recipe| {
        recipe.optics = Optics::gaussian();
        colour(recipe, Mixing::Spectral, Rendition::Raw);
    });
    assert!(text.contains("light.kind") && text.contains("bright-field"), "{text}");
    let text = problems(&|recipe| set(recipe, |optics| *optics.mount_index = 0.9.into()));
    assert!(text.contains("optics.mount_index"), "{text}");
    // A condenser wider than the objective is accepted with a note.
    let mut recipe = small();
    assert!(recipe.notes().is_empty());
    set(&mut recipe, |optics| *optics.condenser_na = 1.2.into());
    assert!(recipe.problems().is_empty());
    assert!(recipe.notes()[0].to_string().contains("37 % of the light"), "{:?}", recipe.notes());
    let text = problems(&|recipe| recipe.field.magnification = 0.5.into());
    assert!(text.contains("field.magnification: 0.5 gives a pixel size outside 0.05 to 4 µm"), "{text}");
}

#[test]
fn pixel_size_follows_from_magnification_and_sensor() {
    let mut recipe = empty();
    recipe.field.magnification = (40.0 * 0.645).into();
    let pixel = |recipe: &Recipe| engine(recipe).scene(Key { seed: 1, index: 0 }).unwrap().view.pixel_um;
    assert!((pixel(&recipe) - 0.25).abs() < 1e-12);
    recipe.camera.binning_px = 2.0.into();
    assert!((pixel(&recipe) - 0.5).abs() < 1e-12);
}

#[test]
fn specks_of_both_forms_have_the_specified_size() {
    let mut recipe = empty();
    recipe.debris.speckles.count = 30.0.into();
    recipe.debris.speckles.dilations =
        Number::Drawn { distribution: Distribution::Choice(vec![2.0]), min: f64::NEG_INFINITY, max: f64::INFINITY };
    for form in [papsynth::recipe::SpeckForm::Round, papsynth::recipe::SpeckForm::Dilated] {
        recipe.debris.speckles.form = form;
        let frame = frame(&recipe, 0);
        let specks = frame.finished.truth.objects.iter().filter(|o| o.kind == ObjectKind::Speckle && !o.truncated);
        let inside: Vec<_> = specks.collect();
        assert!(inside.len() >= 15, "{form:?}: {} specks", inside.len());
        for speck in inside {
            // A capsule of radius 2.5 px and length 1 px, or two adjacent diamonds of 13 px.
            let expected = match form {
                papsynth::recipe::SpeckForm::Round => 24.6,
                papsynth::recipe::SpeckForm::Dilated => 18.0,
            };
            assert!((speck.area_um2 * 16.0 - expected).abs() < 0.1 * expected, "{form:?}: {}", speck.area_um2 * 16.0);
        }
        assert!(
            frame
                .finished
                .scene
                .objects
                .iter()
                .all(|o| matches!(o.body, Body::Speckle(speckle) if speckle.dilations == 2))
        );
    }
}

#[test]
fn nuclei_from_images_are_not_blurred_twice() {
    let mut model = Model::builtin();
    let class = model.classes.get_mut("intermediate").unwrap();
    // An imaged donor with fine stripes.
    let width = 48;
    let stripes = |i: usize| 300 + if i % width % 4 < 2 { 60 } else { 0 };
    class.nucleus.donors = vec![papsynth::model::Donor {
        pixel_um: 0.25,
        width,
        absorbance_milli: (0..width * width).map(stripes).collect(),
    }];
    let mut recipe = small();
    recipe.debris = empty().debris;
    recipe.cells.retain(|class, _| class == "intermediate");
    recipe.nucleus.pyknotic = 0.0.into();
    recipe.slide.depth_um = 0.0.into();
    recipe.slide.stacking_um = 0.0.into();
    let mut contrast = |restore: Restore| {
        recipe.nucleus.restore = restore;
        let engine = Engine::new(&recipe, &model, &Inputs::default()).unwrap();
        let frame = engine.frame(Key { seed: 11, index: 0 }).unwrap();
        let nuclei = frame.finished.truth.objects.iter().filter(|o| o.part == Part::Nucleus);
        let nucleus = nuclei.max_by_key(|nucleus| nucleus.amodal.area()).unwrap();
        let width = frame.finished.scene.view.width;
        let light = |at: usize| f64::from(frame.planes[0].noise_free[at]);
        let runs = nucleus.amodal.runs().iter();
        let inside =
            runs.flat_map(|run| (run.x0 + 3..run.x1.max(6) - 3).map(move |x| run.y as usize * width + x as usize));
        let steps: Vec<f64> = inside.map(|at| (light(at + 1) - light(at)) / light(at)).collect();
        (steps.iter().map(|step| step * step).sum::<f64>() / steps.len() as f64).sqrt()
    };
    let (off, before, after) =
        (contrast(Restore::Off), contrast(Restore::BeforeDetection), contrast(Restore::AfterDetection));
    assert!(before > 1.05 * off, "{off} {before}");
    assert!((before - after).abs() < 1e-3 * before, "{before} {after}");
}

//! `papsynth calibrate` on images with known blur and noise.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]

#[allow(dead_code, reason = "each test uses a part")]
use crate::support;
use std::fs;
use std::path::PathBuf;

use crate::support::{Bench, Outcome};
use ccd_noise::{Camera, CameraParams, ReadNoise};
use optics_psf::{Border, BrightField, BrightFieldParams, Gaussian, Microscope, MicroscopeParams, Padding, Scratch};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use tiff::encoder::{TiffEncoder, colortype};
use toml::Table;

/// Side of the images, pixels of 0.25 µm.
pub(crate) const SIDE: usize = 128;

fn uniform(rng: &mut Xoshiro256PlusPlus, low: f64, high: f64) -> f64 {
    low + (high - low) * f64::from(rng.next_u32()) / 4_294_967_296.0
}

/// A row-major image of the values of `at`.
fn image(side: usize, at: impl Fn(f64, f64) -> f64) -> Vec<f32> {
    (0..side * side).map(|i| at((i % side) as f64, (i / side) as f64) as f32).collect()
}

/// Absorbance of a nucleus, an ellipse with a soft border and clumps of chromatin; lengths in µm.
pub(crate) fn nucleus(seed: u64) -> impl Fn(f64, f64) -> f64 {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let clumps: Vec<[f64; 3]> = (0..40)
        .map(|_| {
            let (r, turn) = (uniform(&mut rng, 0.0, 1.0).sqrt() * 3.3, uniform(&mut rng, 0.0, core::f64::consts::TAU));
            [r * libm::cos(turn), 0.85 * r * libm::sin(turn), uniform(&mut rng, -0.5, 0.8)]
        })
        .collect();
    move |x, y| {
        let (u, v) = (x / 4.2, y / 3.5);
        let d = (1.0 - (u * u + v * v).sqrt()) * 3.8;
        let inside = 0.5 * (1.0 + libm::erf(d / 0.25));
        let at = |[cx, cy, h]: &[f64; 3]| h * libm::exp(-((x - cx) * (x - cx) + (y - cy) * (y - cy)) / 0.18);
        0.35 * inside * (0.9 + 0.5 * clumps.iter().map(at).sum::<f64>()).max(0.05)
    }
}

/// A focus stack of an object. `object` takes µm from the centre.
pub(crate) fn bright_field(condenser_na: f64, stages_um: &[f64], object: impl Fn(f64, f64) -> f64) -> Vec<Vec<f32>> {
    let microscope = Microscope::new(&MicroscopeParams { condenser_na, ..MicroscopeParams::default() }).unwrap();
    let samples = 2 * SIDE;
    let params = BrightFieldParams {
        width: samples,
        height: samples,
        padding: Padding::Periodic,
        depths_um: vec![0.0],
        stages_um: stages_um.to_vec(),
    };
    let field = BrightField::new(&microscope, &params).unwrap();
    let mut specimen = field.specimen();
    let um = |v: f64| (v - SIDE as f64) * 0.125;
    field.set_absorbance(&mut specimen, 0, &image(samples, |x, y| object(um(x), um(y))));
    (0..stages_um.len()).map(|plane| field.image(&mut specimen, plane)).collect()
}

fn blurred(image: &[f32], width: usize, sigma_px: f64) -> Vec<f32> {
    let mut out = image.to_vec();
    let gaussian = Gaussian::new(sigma_px).unwrap();
    gaussian.blur_into(image, width, Border::Replicate, &mut out, &mut Scratch::new());
    out
}

fn write_pages(path: PathBuf, planes: &[Vec<f32>], width: usize) {
    let mut encoder = TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
    for plane in planes {
        let (width, height) = (width as u32, (plane.len() / width) as u32);
        encoder.write_image::<colortype::Gray32Float>(width, height, plane).unwrap();
    }
}

fn write_grey16(path: PathBuf, grey: &[u16], width: usize) {
    let mut encoder = TiffEncoder::new(fs::File::create(path).unwrap()).unwrap();
    encoder.write_image::<colortype::Gray16>(width as u32, (grey.len() / width) as u32, grey).unwrap();
}

/// Three nuclei in focus in different planes, with a Gaussian blur of 0.6 px per plane of defocus.
fn three_nuclei(planes: usize) -> Vec<Vec<f32>> {
    let nuclei = [(40.0, 44.0, 8), (150.0, 60.0, 9), (90.0, 150.0, 10)];
    let focused: Vec<(Vec<f32>, usize)> = nuclei
        .map(|(cx, cy, plane)| {
            let nucleus = nucleus(plane as u64);
            let light = |x: f64, y: f64| 200.0 * libm::exp10(-nucleus(0.25 * (x - cx), 0.25 * (y - cy)));
            (image(192, light), plane)
        })
        .to_vec();
    (0..planes)
        .map(|k| {
            let mut light = vec![200.0_f32; 192 * 192];
            for (nucleus, plane) in &focused {
                let nucleus = blurred(nucleus, 192, 0.6 * k.abs_diff(*plane) as f64);
                light.iter_mut().zip(nucleus).for_each(|(sum, value)| *sum += value - 200.0);
            }
            light
        })
        .collect()
}

fn toml(bench: &Bench, name: &str, section: &str) -> Table {
    let table: Table = toml::from_str(&fs::read_to_string(bench.path(name)).unwrap()).unwrap();
    table[section].as_table().unwrap().clone()
}

fn number(table: &Table, key: &str) -> f64 {
    let value = &table[key];
    value.as_float().or(value.as_integer().map(|v| v as f64)).unwrap()
}

fn json(bench: &Bench, name: &str) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(bench.path(name)).unwrap()).unwrap()
}

/// Checks that a run has exit code 2, prints these words, and writes no file.
fn rejected(bench: &Bench, words: &str, named: &[&str]) {
    let Outcome { code, err, out } = bench.run(&format!("calibrate {words}"));
    assert_eq!(code, 2, "{words}\n{out}{err}");
    for named in named {
        assert!(err.contains(named), "{words}: expected {named:?} in\n{err}");
    }
    assert!(!bench.path("calibration").exists(), "{words}");
}

#[test]
fn a_stack_in_micrometres_gives_fig_10_and_the_condenser() {
    let bench = Bench::new("calibrate-condenser");
    let stages: Vec<f64> = (-5..=4).map(|i| 0.8 * f64::from(i)).collect();
    write_pages(bench.path("stack.tif"), &bright_field(0.41, &stages, nucleus(3)), SIDE);
    let run = bench.good("calibrate --stack stack.tif --step-um 0.8 --pixel-um 0.25");
    assert!(run.out.contains("in focus in plane 5") && run.out.contains("condenser NA"), "{}", run.out);
    let optics = toml(&bench, "calibration/optics.toml", "optics");
    assert_eq!(optics["kind"].as_str(), Some("bright-field"));
    assert!((number(&optics, "condenser_na") - 0.41).abs() < 0.02, "{optics}");
    assert_eq!(number(&toml(&bench, "calibration/optics.toml", "light"), "wavelength_um"), 0.57);
    let known = [("na", 0.95), ("mount_index", 1.515), ("immersion_index", 1.0)];
    for (key, value) in known.into_iter().chain([("extra_blur_um", 0.0), ("stray_light", 0.0)]) {
        assert_eq!(number(&optics, key), value, "{key}");
    }
    // The default aperture gives the 0.25 µm per µm of the paper.
    let gaussian = toml(&bench, "calibration/optics-gaussian.toml", "optics");
    assert_eq!(gaussian["kind"].as_str(), Some("gaussian"));
    assert!((number(&gaussian, "sigma_z_um_per_um") - 0.25).abs() < 0.02, "{gaussian}");
    let focus = &json(&bench, "calibration/calibration.json")["focus"];
    let (error, bound) = (&focus["condenser"]["error"], &focus["condenser"]["bound"]);
    let error = error.as_f64().unwrap();
    assert!((0.004..0.02).contains(&error) && bound == "inside", "{error} {bound}");
    assert!((number(&optics, "condenser_na") - 0.41).abs() < 3.0 * error, "{optics} {error}");
    assert!(focus["asymmetry"].as_f64().unwrap() < 0.02, "{focus}");
    let svg = fs::read_to_string(bench.path("calibration/focus.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.trim_end().ends_with("</svg>") && svg.contains("<text"), "{svg}");
    assert!(svg.contains("µm per µm"));

    // A larger aperture has more blur; the same command replaces its output.
    write_pages(bench.path("stack.tif"), &bright_field(0.6, &stages, nucleus(3)), SIDE);
    bench.good("calibrate --stack stack.tif --step-um 0.8 --pixel-um 0.25 --window 44,44,40,40");
    let optics = toml(&bench, "calibration/optics.toml", "optics");
    assert!((number(&optics, "condenser_na") - 0.6).abs() < 0.03, "{optics}");
}

#[test]
fn a_folder_of_planes_gives_the_blur_per_plane() {
    let bench = Bench::new("calibrate-planes");
    fs::create_dir(bench.path("planes")).unwrap();
    for (k, plane) in three_nuclei(19).iter().enumerate() {
        // Alphabetical order would put plane 10 before plane 2.
        bench.grey_png(&format!("planes/z{k}.png"), 192, 192, |x, y| plane[(y * 192 + x) as usize].round() as u8);
    }
    let run = bench.good("calibrate --stack planes --out here");
    assert!(run.out.contains("give --pixel-um and --step-um") && !run.out.contains("condenser"), "{}", run.out);
    let names: Vec<String> = bench.files("here").into_keys().collect();
    assert_eq!(names, ["calibration.json", "focus.svg"]);
    let focus = &json(&bench, "here/calibration.json")["focus"];
    let mut focused: Vec<u64> =
        focus["nuclei"].as_array().unwrap().iter().map(|n| n["focused"].as_u64().unwrap()).collect();
    focused.sort_unstable();
    assert_eq!(focused, [8, 9, 10]);
    for side in ["before", "after"] {
        let side = &focus[side];
        assert!((side["slope_px"].as_f64().unwrap() - 0.6).abs() < 0.015, "{side}");
        assert!((side["proportional_px"].as_f64().unwrap() - 0.6).abs() < 0.015, "{side}");
        assert!(side["r_squared"].as_f64().unwrap() > 0.999, "{side}");
    }
    // The files one by one, and only one of the lengths.
    let files: String = (0..19).rev().map(|k| format!(" planes/z{k}.png")).collect();
    let again = bench.good(&format!("calibrate --out there --step-um 0.5 --stack{files}"));
    assert!(again.out.contains("1.2") && again.out.contains("px per um of travel"), "{}", again.out);
    assert!(again.out.contains("give --pixel-um\n"), "{}", again.out);
    assert_eq!(json(&bench, "there/calibration.json")["focus"]["nuclei"], focus["nuclei"]);
}

#[test]
fn edges_are_found_and_measured() {
    let bench = Bench::new("calibrate-edge");
    // An oblique edge with a disk and noise.
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xED6E);
    let noise: Vec<f64> = (0..SIDE * SIDE).map(|_| (0..12).map(|_| uniform(&mut rng, -0.5, 0.5)).sum()).collect();
    let drawn = image(SIDE, |x, y| {
        let d = 0.8 * (x - 50.3) + 0.6 * (y - 60.1);
        let r = ((x - 100.0) * (x - 100.0) + (y - 90.0) * (y - 90.0)).sqrt() - 9.0;
        let disk = 50.0 * 0.5 * libm::erfc(r / (0.6 * 2_f64.sqrt()));
        80.0 + 120.0 * 0.5 * libm::erfc(-d / (0.9 * 2_f64.sqrt())) - disk + noise[y as usize * SIDE + x as usize]
    });
    bench.grey_png("edge.png", SIDE as u32, SIDE as u32, |x, y| drawn[y as usize * SIDE + x as usize].round() as u8);
    for line in ["", "--line 35,48,65,72 ", "--line 62,44,38,76 "] {
        let run = bench.good(&format!("calibrate --edge edge.png {line}--pixel-um 0.2"));
        let found = json(&bench, "calibration/calibration.json")["edge"].clone();
        let (sigma, error) = (found["sigma_px"].as_f64().unwrap(), found["error_px"].as_f64().unwrap());
        assert!((sigma - 0.9).abs() < 0.03 && error > 0.001 && error < 0.03, "{line}: {found}");
        assert!((found["normal"][0].as_f64().unwrap() - 0.8).abs() < 0.02, "{line}: {found}");
        let gaussian = toml(&bench, "calibration/optics-gaussian.toml", "optics");
        assert!((number(&gaussian, "sigma_xy_um") - 0.18).abs() < 0.006, "{gaussian}");
        // Values that are not measured are those of the paper.
        assert_eq!(number(&gaussian, "sigma_z_um_per_um"), 0.25);
        assert!(run.out.contains("sigma_xy") && bench.path("calibration/edge.svg").exists());
    }
}

#[test]
fn extra_blur_is_separated_from_diffraction() {
    let bench = Bench::new("calibrate-extra");
    let half = |x: f64, y: f64| 0.15 * libm::erfc(-(0.8 * x + 0.6 * y) / (0.03 * 2_f64.sqrt()));
    let sharp = &bright_field(0.41, &[0.0], half)[0];
    for (extra_px, least, most) in [(0.0, 0.0, 0.04), (0.8, 0.19, 0.21)] {
        let seen = if extra_px > 0.0 { blurred(sharp, SIDE, extra_px) } else { sharp.clone() };
        write_pages(bench.path("edge.tif"), &[seen], SIDE);
        bench.good("calibrate --edge edge.tif --line 52,64,76,64 --pixel-um 0.25");
        let optics = toml(&bench, "calibration/optics.toml", "optics");
        let extra = number(&optics, "extra_blur_um");
        assert!((least..=most).contains(&extra), "{extra_px} px: {extra}");
        assert_eq!(number(&optics, "condenser_na"), 0.41);
    }
}

/// Frames of one light, `SIDE` x `SIDE` pixels.
fn expose(camera: &Camera, folder: PathBuf, names: &[&str], electrons: f32, rng: &mut Xoshiro256PlusPlus) {
    fs::create_dir_all(&folder).unwrap();
    for name in names {
        let mut grey = vec![0; SIDE * SIDE];
        camera.expose_into(&vec![electrons; SIDE * SIDE], SIDE, &mut grey, rng);
        write_grey16(folder.join(name), &grey, SIDE);
    }
}

/// A camera of 12 bits with all properties that photon transfer measures.
fn camera() -> CameraParams {
    CameraParams {
        bit_depth: 12,
        gain_dn_per_e: 0.25,
        full_well_e: 18_000.0,
        offset_dn: 100.0,
        read_noise: ReadNoise::Same { e: 9.0 },
        prnu: 0.01,
        dsnu_e: 5.0,
        ..CameraParams::default()
    }
}

const PAIR: [&str; 2] = ["1.tif", "2.tif"];
const MANY: [&str; 8] = ["1.tif", "2.tif", "3.tif", "4.tif", "5.tif", "6.tif", "7.tif", "8.tif"];

#[test]
fn flats_give_the_camera() {
    let bench = Bench::new("calibrate-flat");
    let (camera, mut rng) = (Camera::new(&camera()).unwrap(), Xoshiro256PlusPlus::seed_from_u64(0xF1A7));
    expose(&camera, bench.path("flats/Dark"), &MANY, 0.0, &mut rng);
    for (ms, electrons) in [(5, 1000.0), (10, 2000.0), (20, 4000.0), (60, 12_000.0), (100, 20_000.0)] {
        expose(&camera, bench.path(&format!("flats/{ms}ms")), &PAIR, electrons, &mut rng);
    }
    expose(&camera, bench.path("flats/40ms"), &MANY, 8000.0, &mut rng);
    let run = bench.good("calibrate --flat flats --bits 12");
    let found = json(&bench, "calibration/calibration.json")["camera"].clone();
    let is = |key: &str, expected: f64, within: f64| {
        let value = found[key].as_f64().unwrap();
        assert!((value - expected).abs() < within, "{key}: {value}, not {expected} within {within}");
    };
    // A variance of n pixels has a standard error of √(2 ∕ n): 0.8 % here for pairs; bounds are at least three times
    // larger.
    is("gain_dn_per_e", 0.25, 0.005);
    is("offset_dn", 100.0, 0.05);
    is("dark_noise_e", 9.0, 0.3);
    is("dsnu_e", 5.0, 0.3);
    is("prnu", 0.01, 0.0005);
    is("full_scale_e", 3995.0 / 0.25, 320.0);
    assert_eq!(found["saturation"]["reached"], true, "{found}");
    let preset = toml(&bench, "calibration/camera.toml", "camera");
    assert_eq!((number(&preset, "bits"), preset["photon_noise"].as_str()), (12.0, Some("exact")));
    for (key, expected, within) in [
        ("full_well_e", 15_980.0, 320.0),
        ("read_noise_e", 9.0, 0.3),
        ("offset_dn", 100.0, 0.05),
        ("prnu", 0.01, 0.001),
    ] {
        assert!((number(&preset, key) - expected).abs() < within, "{preset}");
    }
    let rows: Vec<&str> = run.out.lines().filter(|line| line.contains("flats/")).collect();
    assert_eq!(rows.len(), 7, "{}", run.out);
    assert!(rows[0].contains("Dark") && rows[6].contains("100ms"), "{}", run.out);
    assert!(fs::read_to_string(bench.path("calibration/photon-transfer.svg")).unwrap().contains("Photon transfer"));

    // Pairs of files, and dark frames in another folder.
    for (k, electrons) in [1000.0, 4000.0, 8000.0].into_iter().enumerate() {
        let names = [format!("{k}a.tif"), format!("{k}b.tif")];
        expose(&camera, bench.path("pairs"), &names.each_ref().map(String::as_str), electrons, &mut rng);
    }
    bench.good("calibrate --flat pairs --dark flats/Dark --bits 12 --out pairs-out");
    let gain = json(&bench, "pairs-out/calibration.json")["camera"]["gain_dn_per_e"].as_f64().unwrap();
    assert!((gain - 0.25).abs() < 0.006, "{gain}");
}

#[test]
fn invalid_flats_are_rejected() {
    let bench = Bench::new("calibrate-bad-flat");
    let (camera, mut rng) = (Camera::new(&camera()).unwrap(), Xoshiro256PlusPlus::seed_from_u64(0xBAD));
    let mut frames = |folder: &str, names: &[&str], electrons: f32| {
        expose(&camera, bench.path(folder), names, electrons, &mut rng);
    };
    frames("darks", &PAIR, 0.0);
    frames("white", &PAIR, 60_000.0);
    frames("white", &["3.tif", "4.tif"], 90_000.0);
    rejected(&bench, "--flat white --dark darks --bits 12", &["--flat white", "levels of flats are saturated", "4095"]);
    frames("sizes/5ms", &PAIR, 4000.0);
    fs::create_dir(bench.path("sizes/10ms")).unwrap();
    for name in PAIR {
        write_grey16(bench.path("sizes/10ms").join(name), &[900; 64 * 32], 64);
    }
    rejected(
        &bench,
        "--flat sizes --dark darks --bits 12",
        &["10ms", "found 64 x 32 pixels, expected 128 x 128", "same size"],
    );
    rejected(&bench, "--flat sizes --bits 12", &["--flat sizes: no dark frames", "--dark"]);
    fs::remove_dir_all(bench.path("sizes/10ms")).unwrap();
    rejected(&bench, "--flat sizes --dark darks", &["bit depth of the camera is unknown", "--bits"]);
    rejected(&bench, "--flat sizes --dark darks --bits 8", &["--bits 8: ", "grey level"]);
    rejected(&bench, "--flat sizes --dark darks --bits 17", &["expected an integer from 8 to 16"]);
    rejected(&bench, "--flat sizes --dark no-such --bits 12", &["no-such", "no such folder"]);
    rejected(&bench, "--flat no-such --dark darks --bits 12", &["no-such"]);
    frames("alike/1", &PAIR, 8.0);
    rejected(
        &bench,
        "--flat alike --dark darks --bits 12",
        &["alike: the brightest light level is", "1 % of full scale"],
    );
    frames("odd", &["1.tif", "2.tif", "3.tif"], 4000.0);
    rejected(&bench, "--flat odd --dark darks --bits 12", &["3 files; expected an even number"]);
    frames("single/5ms", &["1.tif"], 4000.0);
    rejected(&bench, "--flat single --dark darks --bits 12", &["5ms: 1 frame; expected 2 or more"]);
    frames("both/5ms", &PAIR, 4000.0);
    frames("both/dark", &PAIR, 0.0);
    rejected(&bench, "--flat both --dark darks --bits 12", &["--dark", "already holds dark frames"]);
    let cut = Camera::new(&CameraParams { offset_dn: 0.0, ..self::camera() }).unwrap();
    expose(&cut, bench.path("cut"), &PAIR, 0.0, &mut rng);
    rejected(&bench, "--flat sizes --dark cut --bits 12", &["cut", "raise the offset"]);
    fs::create_dir_all(bench.path("tiny/dark")).unwrap();
    for name in PAIR {
        write_grey16(bench.path("tiny/dark").join(name), &[100; 12 * 12], 12);
        write_grey16(bench.path("tiny").join(name), &[900; 12 * 12], 12);
    }
    rejected(&bench, "--flat tiny --bits 12", &["12 x 12 pixels", "more than 15 in each direction"]);
}

#[test]
fn invalid_stacks_and_edges_are_rejected() {
    let bench = Bench::new("calibrate-bad");
    let planes = three_nuclei(19);
    let write = |name: &str, planes: &[Vec<f32>]| write_pages(bench.path(name), planes, 192);
    write("stack.tif", &planes);
    write("end.tif", &planes[10..]);
    write("two.tif", &planes[..2]);
    write("flat.tif", &vec![vec![5.0; 192 * 192]; 4]);
    let one = "18,26,44,38";
    rejected(&bench, "", &["--stack", "--edge", "--flat"]);
    rejected(&bench, "--stack end.tif", &["--stack end.tif: window ", "first or last plane", "both sides of focus"]);
    rejected(&bench, &format!("--stack end.tif --window {one}"), &["window 18,26,44,38", "first or last plane"]);
    rejected(&bench, "--stack two.tif", &["--stack two.tif: planes: found 2, expected 3 or more"]);
    rejected(&bench, "--stack flat.tif", &["no nucleus found", "--window"]);
    rejected(&bench, "--stack flat.tif --window 0,0,20,20", &["holds no detail"]);
    rejected(&bench, "--stack stack.tif --window 180,0,20,20", &["inside the image of 192 x 192", "--window X,Y,W,H"]);
    rejected(&bench, "--stack stack.tif --window 1,1,4,4", &["at least 8 pixels"]);
    rejected(&bench, "--stack stack.tif --window 1,1,9", &["expected X,Y,W,H"]);
    rejected(&bench, "--stack stack.tif --window 1,1,9,99999999999", &["up to 1048576"]);
    for bad in ["0", "101", "nan", "x"] {
        rejected(&bench, &format!("--stack stack.tif --step-um {bad}"), &["--step-um", "more than 0 and at most 100"]);
    }
    rejected(&bench, "--stack stack.tif --pixel-um 9", &["--pixel-um", "0.05 to 4"]);
    rejected(&bench, "--stack stack.tif --na 1.2", &["--na 1.2", "at most immersion-index"]);
    rejected(&bench, "--stack stack.tif --wavelength-um 570", &["--wavelength-um 570", "0.1 to 10"]);
    rejected(&bench, "--stack stack.tif --mount-index nan", &["--mount-index NaN", "1 to 3"]);
    rejected(&bench, "--stack no-such.tif", &["no-such.tif: there is no such file"]);
    rejected(&bench, "--stack .", &["plane"]);
    rejected(&bench, "--step-um 1 --edge stack.tif", &["--stack"]);
    rejected(&bench, "--edge stack.tif", &["--edge stack.tif: 19 images; expected 1"]);
    write("one.tif", &planes[9..10]);
    rejected(&bench, "--edge one.tif --line 0,0,4,0", &["line 0,0,4,0", "192 x 192", "at least 8 pixels long"]);
    rejected(&bench, "--edge one.tif --line 180,10,220,10", &["extends beyond the"]);
    rejected(&bench, "--edge one.tif --line 1,2,3", &["expected X0,Y0,X1,Y1"]);
    rejected(&bench, "--edge one.tif --line 1,2,3,inf", &["expected X0,Y0,X1,Y1"]);
    write("even.tif", &[vec![5.0; 192 * 192]]);
    rejected(&bench, "--edge even.tif", &["no straight edge found", "--line"]);
    rejected(&bench, "--edge even.tif --line 50,50,80,50", &["holds no edge"]);
    fs::write(bench.path("text.tif"), "no image").unwrap();
    rejected(&bench, "--edge text.tif", &["text.tif: is not a PNG, JPEG or TIFF"]);
}

#[test]
fn a_folder_holds_one_microscope_and_other_files_are_not_replaced() {
    let bench = Bench::new("calibrate-out");
    let edge = image(64, |x, _| 100.0 + 60.0 * libm::erf((x - 31.7) / (0.8 * 2_f64.sqrt())));
    write_pages(bench.path("edge.tif"), &[edge], 64);
    write_pages(bench.path("stack.tif"), &three_nuclei(19), 192);
    bench.good("calibrate --stack stack.tif --step-um 0.5 --pixel-um 0.25 --window 18,26,44,38 --na 0.75 --out out");
    let first = toml(&bench, "out/optics.toml", "optics");
    // The second run keeps the measurements of the first.
    bench.good("calibrate --edge edge.tif --pixel-um 0.25 --na 0.75 --out out");
    let both = toml(&bench, "out/optics.toml", "optics");
    assert_eq!(first["condenser_na"], both["condenser_na"]);
    assert!(number(&both, "extra_blur_um") > 0.1, "{both}");
    let gaussian = toml(&bench, "out/optics-gaussian.toml", "optics");
    assert!((number(&gaussian, "sigma_xy_um") - 0.2).abs() < 0.01, "{gaussian}");
    assert!((number(&gaussian, "sigma_z_um_per_um") - 0.3).abs() < 0.01, "{gaussian}");
    let before = bench.files("out");
    // The same command writes the same bytes.
    bench.good("calibrate --edge edge.tif --pixel-um 0.25 --na 0.75 --out out");
    assert_eq!(bench.files("out"), before);
    // Another microscope, another file with one of the names, and a file instead of the folder.
    let rejected = |words: &str, named: &str| {
        let run = bench.run(&format!("calibrate --edge edge.tif {words}"));
        assert_eq!(run.code, 2, "{}{}", run.out, run.err);
        assert!(run.err.contains(named), "{named}: {}", run.err);
    };
    rejected("--pixel-um 0.25 --out out", "measured with --na 0.75; this command has --na 0.95");
    assert_eq!(bench.files("out"), before);
    fs::create_dir(bench.path("mine")).unwrap();
    fs::write(bench.path("mine/optics.toml"), "[optics]\n").unwrap();
    rejected("--out mine", "the file exists and is not a recipe of papsynth calibrate");
    fs::write(bench.path("mine/optics.toml"), "").unwrap();
    fs::write(bench.path("mine/calibration.json"), "{\n  \"calibration\": 1,\n  \"more\": 2\n}").unwrap();
    rejected("--out mine", "not a calibration of papsynth");
    fs::write(bench.path("mine/calibration.json"), "{\n  \"calibration\": 7\n}").unwrap();
    rejected("--out mine", "version 7; expected version 1");
    assert_eq!(bench.files("mine").len(), 2);
    rejected("--out edge.tif", "expected a folder");
    let full = bench.run("calibrate --edge edge.tif --out /proc/papsynth");
    assert!(full.code == 2 || full.code == 74, "{}", full.err);
}

/// The sections are recipes with default values for all other fields.
#[test]
fn sections_are_recipes() {
    let bench = Bench::new("calibrate-recipe");
    let edge = image(64, |x, _| 100.0 + 60.0 * libm::erf((x - 31.7) / (0.8 * 2_f64.sqrt())));
    write_pages(bench.path("edge.tif"), &[edge], 64);
    let (camera, mut rng) = (Camera::new(&camera()).unwrap(), Xoshiro256PlusPlus::seed_from_u64(0xF1A7));
    expose(&camera, bench.path("flats/dark"), &PAIR, 0.0, &mut rng);
    expose(&camera, bench.path("flats/1"), &PAIR, 4000.0, &mut rng);
    bench.good("calibrate --edge edge.tif --pixel-um 0.25 --flat flats --bits 12");
    for name in ["optics", "optics-gaussian", "camera"] {
        bench.good(&format!("preview calibration/{name}.toml --out {name}.png {}", support::TINY));
    }
    let both = "--with calibration/optics-gaussian.toml --with calibration/camera.toml";
    bench.good(&format!("preview --preset sparse {both} --out both.png {}", support::TINY));
    assert!(bench.run("preview --with edge.tif --out none.png").err.contains("edge.tif"));
}

/// A folder of real images. Without `PAPSYNTH_REFERENCE`, tests are skipped, except on CI.
fn reference(folder: &str) -> Option<PathBuf> {
    let Some(root) = std::env::var_os("PAPSYNTH_REFERENCE") else {
        assert!(std::env::var("CI").as_deref() != Ok("true"), "PAPSYNTH_REFERENCE is not set");
        eprintln!("skipped: PAPSYNTH_REFERENCE is not set");
        return None;
    };
    Some(PathBuf::from(root).join(folder))
}

#[test]
fn the_real_stack_is_linear_and_symmetric() {
    let Some(folder) = reference("focus_stack") else { return };
    let bench = Bench::new("calibrate-real");
    let files: String = (0..20).map(|k| format!(" {}", folder.join(format!("plane{k:02}.png")).display())).collect();
    bench.good(&format!("calibrate --stack{files}"));
    let focus = &json(&bench, "calibration/calibration.json")["focus"];
    assert!(focus["nuclei"].as_array().unwrap().len() >= 15);
    let value = |side: &str, key: &str| focus[side][key].as_f64().unwrap();
    for side in ["before", "after"] {
        assert!((value(side, "slope_px") - 0.53).abs() < 0.05, "{side}: {}", focus[side]);
        assert!((value(side, "proportional_px") - 0.53).abs() < 0.05, "{side}: {}", focus[side]);
        assert!(value(side, "r_squared") > 0.99, "{side}: {}", focus[side]);
    }
    assert!((value("before", "slope_px") - value("after", "slope_px")).abs() < 0.05, "{focus}");
    // Masks are not planes.
    let run = bench.run(&format!("calibrate --stack {} --out folder", folder.display()));
    assert_eq!(run.code, 2, "{}", run.out);
    assert!(run.err.contains("no masks"), "{}", run.err);
}

//! Small synthetic frames, and temporary folders.
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the numbers are small")]
#![allow(dead_code, reason = "each test uses its part")]

use std::fs;
use std::path::{Path, PathBuf};

use papsynth::key::Key;
use papsynth::recipe::{Binning, Mixing, PhotonNoise, Recipe, Rendition, Restore, Subsampling};
use papsynth::scene::{
    ObjectKind, Restoration, Scene, SceneBackground, SceneCamera, SceneDyes, SceneIllumination, SceneLight,
    SceneOptics, Tint, View,
};
use papsynth::truth::{Group, Mask, ObjectTruth, Part, Run, Trait, Truth, visible_masks};
use papsynth::{Finished, Frame, Plane};

pub(crate) const WIDTH: usize = 70;
pub(crate) const HEIGHT: usize = 50;
pub(crate) const SEED: u64 = 11;

/// A temporary folder of one test.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    pub(crate) fn new(name: &str) -> Self {
        let path = |n: u32| std::env::temp_dir().join(format!("papsynth-dataset-{}-{name}-{n}", std::process::id()));
        // Concurrent tests may use the same name.
        Self((0..).map(path).find(|path| fs::create_dir(path).is_ok()).unwrap())
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    pub(crate) fn join(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Returns path and content of every file in a folder, sorted by path.
pub(crate) fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    collect(folder, "", &mut found);
    found.sort();
    found
}

fn collect(folder: &Path, prefix: &str, found: &mut Vec<(String, Vec<u8>)>) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries {
        let path = entry.unwrap().path();
        let name = format!("{prefix}{}", path.file_name().unwrap().to_string_lossy());
        if path.is_dir() {
            collect(&path, &format!("{name}/"), found);
        } else {
            found.push((name, fs::read(&path).unwrap()));
        }
    }
}

/// Returns the recipe with the classes of the frames.
pub(crate) fn recipe() -> Recipe {
    Recipe::default()
}

pub(crate) fn class() -> String {
    recipe().cells.keys().next().unwrap().clone()
}

pub(crate) fn scene(index: u64, planes: usize, bits: u32) -> Scene {
    Scene {
        key: Key { seed: SEED, index },
        slide: index / 16,
        condition: None,
        fusion: None,
        view: View { width: WIDTH, height: HEIGHT, pixel_um: 0.25 },
        planes_um: (0..planes).map(|z| 0.8 * z as f64 - 0.8).collect(),
        background: SceneBackground {
            level: 0.9,
            illumination: SceneIllumination::Border { exponent: 0.02 },
            texture: 0.01,
            texture_um: 60.0,
        },
        light: SceneLight::Monochrome { wavelength_um: 0.57, bandwidth_um: 0.01, absorption_variation: 0.0 },
        optics: SceneOptics::Gaussian { sigma_xy_um: 0.225, sigma_z_um_per_um: 0.25 },
        restoration: Restoration { restore: Restore::Off, feather_um: 1.0 },
        dyes: SceneDyes { nucleus: [0.0; 5], bacillus: [0.0; 5], speckle: [0.0; 5] },
        camera: SceneCamera {
            bits,
            full_well_e: 17_600.0,
            read_noise_e: 8.0,
            read_noise_rms_e: 0.0,
            offset_dn: 0.0,
            glare_subtracted: 0.0,
            sensor_dust: 0.0,
            photon_noise: PhotonNoise::Exact,
            prnu: 0.0,
            dsnu_e: 0.0,
            serial: 1,
            exposure_s: 0.02,
            dark_current_e_per_s: 0.0,
            dark_reference_c: 25.0,
            temperature_c: 25.0,
            dark_doubling_c: 8.0,
            blooming: 0.0,
            blooming_vertical: 0.95,
            binning_px: 1,
            binning: Binning::Charge,
            jpeg_quality: 0,
            jpeg_subsampling: Subsampling::S420,
        },
        frame: None,
        attempts: 1,
        cells: std::collections::BTreeMap::new(),
        objects: Vec::new(),
    }
}

fn disc(x: f32, y: f32, radius: f32) -> Mask {
    let tile: Vec<f32> = (0..WIDTH * HEIGHT)
        .map(|i| {
            let (dx, dy) = ((i % WIDTH) as f32 - x, (i / WIDTH) as f32 - y);
            if dx * dx + dy * dy <= radius * radius { 1.0 } else { 0.0 }
        })
        .collect();
    Mask::from_tile(&tile, WIDTH, [0, 0], WIDTH, HEIGHT, |v| v > 0.5)
}

fn object(
    id: u32,
    part: Part,
    kind: ObjectKind,
    class: &str,
    depth_um: f64,
    planes: &[f64],
    amodal: Mask,
) -> ObjectTruth {
    ObjectTruth {
        id,
        part,
        kind,
        class: class.to_owned(),
        bethesda: if kind == ObjectKind::Cell { "NILM".to_owned() } else { String::new() },
        traits: [Trait::Flap, Trait::Pyknotic].into_iter().collect(),
        cluster: 1,
        centre_um: [3.25, 7.5],
        depth_um,
        mean_absorbance: 0.3,
        tint: (part == Part::Cytoplasm).then_some(Tint::Cyanophilic),
        rotation_deg: 12.5,
        area_um2: amodal.area() as f64 / 16.0,
        truncated: amodal.bounds().is_some_and(|b| b.x == 0),
        visible: Mask::default(),
        amodal,
        defocus_um: planes.iter().map(|z| z - depth_um).collect(),
        detectability: planes.iter().map(|z| 10.0 / (1.0 + (z - depth_um).abs())).collect(),
    }
}

/// Returns a frame with two overlapping cells and two pieces of debris. `first_id` is the id of the first cell.
pub(crate) fn frame(index: u64, planes: usize, bits: u32, first_id: u32) -> Frame {
    frame_of(scene(index, planes, bits), first_id)
}

/// Returns the same frame in colour.
pub(crate) fn colour_frame(index: u64, planes: usize, bits: u32) -> Frame {
    let light =
        SceneLight::Colour { lamp_k: 3200.0, mixing: Mixing::Spectral, chromatic_um: 0.3, rendition: Rendition::Srgb };
    frame_of(Scene { light, ..scene(index, planes, bits) }, 1)
}

fn frame_of(scene: Scene, first_id: u32) -> Frame {
    let (index, planes, bits, channels) = (scene.key.index, scene.planes_um.len(), scene.camera.bits, scene.channels());
    let (class, z) = (class(), &scene.planes_um);
    let shift = (index % 7) as f32;
    let near = first_id + 1;
    let mut objects = vec![
        object(first_id, Part::Cytoplasm, ObjectKind::Cell, &class, -0.5, z, disc(18.0 + shift, 22.0, 17.0)),
        object(first_id, Part::Nucleus, ObjectKind::Cell, &class, -0.5, z, disc(18.0 + shift, 22.0, 5.0)),
        object(near, Part::Cytoplasm, ObjectKind::Cell, &class, 0.5, z, disc(40.0, 24.0, 16.0)),
        object(near, Part::Nucleus, ObjectKind::Cell, &class, 0.5, z, disc(42.0, 24.0, 4.0)),
        object(near + 1, Part::Whole, ObjectKind::Leukocyte, "leukocyte", 0.0, z, disc(0.0, 45.0, 6.0)),
        object(near + 2, Part::Whole, ObjectKind::Speckle, "speckle", 1.0, z, disc(60.0, 6.0, 0.5)),
    ];
    let of_part = |objects: &[ObjectTruth], part: Part| -> Vec<usize> {
        (0..objects.len()).filter(|&i| objects[i].part == part).collect()
    };
    for part in [Part::Cytoplasm, Part::Nucleus, Part::Whole] {
        let members = of_part(&objects, part);
        let stack: Vec<_> = members.iter().map(|&i| (objects[i].id, objects[i].depth_um, &objects[i].amodal)).collect();
        let fronts = visible_masks(&stack, WIDTH, HEIGHT);
        for (i, front) in members.into_iter().zip(fronts) {
            objects[i].visible = front;
        }
    }
    let truth = Truth { width: WIDTH, height: HEIGHT, objects };
    let labels = Group::ALL.map(|group| truth.labels(group));
    let white = u16::try_from((1_u32 << bits) - 1).unwrap();
    let all_in_focus: Vec<f32> = (0..WIDTH * HEIGHT * channels)
        .map(|i| {
            let ids = labels.iter().filter(|l| l.ids[i / channels] > 0).count() as f32;
            f32::from(white) * (0.9 - 0.25 * ids - 0.05 * (i % channels) as f32)
        })
        .collect();
    let planes = (0..planes)
        .map(|z| {
            let noise_free: Vec<f32> = all_in_focus.iter().map(|v| v * (1.0 - 0.05 * z as f32)).collect();
            let mut state = index.wrapping_mul(31) + z as u64 + 1;
            let grey = noise_free.iter().map(|v| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let noise = (state >> 40) as f32 / (1 << 24) as f32 - 0.5;
                (v + noise * 0.05 * f32::from(white)).clamp(0.0, f32::from(white)) as u16
            });
            let (grey, stage_um) = (grey.collect(), scene.planes_um[z]);
            // Plane z has z saturated pixels.
            let run = Run { y: 0, x0: 3, x1: 3 + z as u32 };
            let saturated = Mask::from_runs(if z > 0 { vec![run] } else { Vec::new() });
            Plane { index: z, stage_um, channels, grey, noise_free, saturated, clipped_px: 0 }
        })
        .collect();
    Frame { planes, finished: Finished { scene, truth, all_in_focus } }
}

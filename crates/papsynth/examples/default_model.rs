//! Writes the built-in model, from reference images and published tables.
//!
//! ```sh
//! cargo run --release -p papsynth --example default_model -- REFERENCE crates/papsynth/model/default.json
//! ```
//!
//! Outlines and chromatin are learned from `REFERENCE/outlines` and `REFERENCE/nuclei` (statistics only). Sizes are
//! those of the Herlev table (log-normal, Jantzen et al. 2005); absorbances were measured on monochrome fields of
//! liquid-based cytology and on the authors' nuclei.

#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::print_stdout,
    reason = "a small program with small numbers"
)]

use std::collections::BTreeMap;
use std::path::Path;

use papsynth::learn::{Donors, LearnParams, Material, NucleusImage, Point, learn};
use papsynth::model::{
    CellClass, ChromatinStatistics, CytoplasmStatistics, LogNormal, MODEL_VERSION, Model, Normal, NucleusStatistics,
    OutlineForm, Shapes,
};

/// Thickness from rim to centre in ten steps, relative to the median of a cell: measured on isolated cells.
const RIM_TO_CENTRE: [f64; 10] = [0.61, 0.87, 0.96, 1.04, 1.08, 1.14, 1.22, 1.23, 1.31, 1.31];

/// Number (from 1) of the outline that is two connected cells.
const TWO_CELLS: usize = 21;

/// Pixel size of the reference images, µm.
const PIXEL_UM: f64 = 0.25;

/// Published values of a class.
struct Published {
    name: &'static str,
    bethesda: &'static str,
    /// Cell diameter, µm: mean and sd of the natural logarithm.
    cell: [f64; 2],
    /// Nucleus area, µm²: mean and sd of the natural logarithm.
    nucleus: [f64; 2],
    /// Correlation of their logarithms.
    correlation: f64,
    /// Distance of the nucleus from the centre of the cell, fraction of the radius: mean and sd.
    off_centre: [f64; 2],
    /// Absorbance of the cytoplasm: median, sd of the logarithm.
    cytoplasm: [f64; 2],
    /// Folder of the nuclei and file of their outlines.
    nuclei: [&'static str; 2],
}

const CLASSES: [Published; 3] = [
    Published {
        name: "intermediate",
        bethesda: "NILM",
        cell: [3.857, 0.182],
        nucleus: [3.928, 0.25],
        correlation: 0.34,
        off_centre: [0.172, 0.091],
        cytoplasm: [0.125, 0.40],
        nuclei: ["nuclei/normal", "outlines/nucleus.csv"],
    },
    Published {
        name: "superficial",
        bethesda: "NILM",
        cell: [3.991, 0.20],
        nucleus: [3.33, 0.28],
        correlation: 0.30,
        off_centre: [0.170, 0.096],
        cytoplasm: [0.105, 0.44],
        nuclei: ["nuclei/normal", "outlines/nucleus.csv"],
    },
    Published {
        name: "high-grade",
        bethesda: "HSIL",
        cell: [3.116, 0.236],
        nucleus: [4.75, 0.28],
        correlation: 0.76,
        off_centre: [0.20, 0.12],
        cytoplasm: [0.15, 0.35],
        nuclei: ["nuclei/high_grade", "outlines/nucleus_high_grade.csv"],
    },
];

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (Some(reference), Some(out)) = (arguments.next(), arguments.next()) else {
        eprintln!("usage: default_model REFERENCE OUT.json");
        std::process::exit(2);
    };
    let reference = Path::new(&reference);
    let mut cells = outlines(&reference.join("outlines/cytoplasm.csv"));
    cells.remove(TWO_CELLS - 1);
    let mut model =
        Model { version: MODEL_VERSION, provenance: Vec::new(), classes: BTreeMap::new(), cytoplasm_texture: None };
    for published in &CLASSES {
        let nuclei = nuclei(&reference.join(published.nuclei[0]));
        let nucleus_outlines = outlines(&reference.join(published.nuclei[1]));
        model.classes.insert(published.name.to_owned(), blank(published));
        let material = Material { nuclei: &nuclei, nucleus_outlines: &nucleus_outlines, cytoplasm_outlines: &cells };
        let params = LearnParams {
            class: published.name.to_owned(),
            like: published.name.to_owned(),
            bethesda: published.bethesda.to_owned(),
            pixel_um: PIXEL_UM,
            source: "library of the PAPSYNTH authors (Malm, Brun, Bengtsson 2015); sizes: Herlev table".to_owned(),
            donors: Donors::NumbersOnly,
        };
        model = learn(&model, &material, &params).unwrap_or_else(|e| panic!("{e}"));
        let class = model.classes.get_mut(published.name).expect("just learned");
        let known = blank(published);
        class.cytoplasm.radius_um = known.cytoplasm.radius_um;
        class.nucleus.radius_um = known.nucleus.radius_um;
        if published.name == "superficial" {
            // Small, condensed nuclei: darker and with less texture than those of intermediate cells.
            class.nucleus.absorbance = Normal { mean: 0.40, sd: 0.10 };
            class.nucleus.chromatin.sd = Normal { mean: 0.055, sd: 0.018 };
        }
        let chromatin = &class.nucleus.chromatin;
        println!(
            "{}: nuclei A {:?}, sd {:?}, skewness {}, nu {}, length {} um, profile {:?}",
            published.name,
            class.nucleus.absorbance,
            chromatin.sd,
            chromatin.skewness,
            chromatin.nu,
            chromatin.length_um,
            chromatin.rim_to_centre
        );
    }
    let text = model.to_json();
    std::fs::write(&out, &text).unwrap_or_else(|e| panic!("{out}: {e}"));
    println!("{out}: {} bytes", text.len());
}

/// Returns a class with published values only, before learning.
fn blank(published: &Published) -> CellClass {
    let empty = fsd_shape::ShapeStatistics {
        harmonics: 1,
        outlines: 0,
        ln_radius_mean: 0.0,
        ln_radius_sd: 0.0,
        mean: vec![0.0, 0.0, 1.0, 0.0],
        components: Vec::new(),
        residual: fsd_shape::Residual::Descriptors,
        residual_sd: vec![0.0; 4],
        roughness_sd: 0.0,
        local_roughness: 0.0,
    };
    let shapes = Shapes { correlated: empty.clone(), independent: empty };
    let round = |v: f64| (v * 1e4).round() / 1e4;
    CellClass {
        bethesda: published.bethesda.to_owned(),
        cytoplasm: CytoplasmStatistics {
            radius_um: LogNormal { median: round(libm::exp(published.cell[0]) / 2.0), log_sd: published.cell[1] },
            absorbance: LogNormal { median: published.cytoplasm[0], log_sd: published.cytoplasm[1] },
            rim_to_centre: RIM_TO_CENTRE.to_vec(),
            form: OutlineForm::default(),
            pliability: 1.0,
            halo: None,
            shapes: shapes.clone(),
        },
        nucleus: NucleusStatistics {
            radius_um: LogNormal {
                median: round((libm::exp(published.nucleus[0]) / core::f64::consts::PI).sqrt()),
                log_sd: published.nucleus[1] / 2.0,
            },
            size_correlation: published.correlation,
            form: OutlineForm::default(),
            nucleoli: 0.0,
            polarity: 0.0,
            off_centre: Normal { mean: published.off_centre[0], sd: published.off_centre[1] },
            absorbance: Normal { mean: 0.33, sd: 0.09 },
            chromatin: ChromatinStatistics {
                nu: 1.0,
                length_um: 0.5,
                sd: Normal { mean: 0.074, sd: 0.02 },
                skewness: 0.4,
                rim_to_centre: vec![1.0],
            },
            shapes,
            donors: Vec::new(),
        },
    }
}

/// Reads the outlines of a CSV file with the columns outline, k, x_px, y_px.
fn outlines(path: &Path) -> Vec<Vec<Point>> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut outlines: BTreeMap<u32, Vec<Point>> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let fields: Vec<f64> = line.split(',').map(|f| f.trim().parse().unwrap_or(f64::NAN)).collect();
        outlines.entry(fields[0] as u32).or_default().push([fields[2], fields[3]]);
    }
    outlines.into_values().collect()
}

/// Reads the nuclei of a folder with `images` and `masks`.
fn nuclei(folder: &Path) -> Vec<NucleusImage> {
    let mut names: Vec<_> = std::fs::read_dir(folder.join("images"))
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .filter_map(|entry| Some(entry.ok()?.file_name()))
        .collect();
    names.sort();
    let open =
        |path: std::path::PathBuf| image::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).to_luma8();
    names
        .iter()
        .map(|name| {
            let (image, mask) = (open(folder.join("images").join(name)), open(folder.join("masks").join(name)));
            NucleusImage {
                name: name.to_string_lossy().into_owned(),
                light: image.iter().map(|v| f32::from(*v)).collect(),
                mask: mask.iter().map(|v| if *v > 0 { 1.0 } else { 0.0 }).collect(),
                width: image.width() as usize,
            }
        })
        .collect()
}

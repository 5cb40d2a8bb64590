//! Reference arrays of the repository. The packaged crate does not contain them.

#![allow(dead_code, reason = "each test uses a part of the module")]
#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small grids and single precision images")]

use std::path::PathBuf;

use optics_psf::{Layer, Microscope, MicroscopeParams};

pub(crate) const SIDE: usize = 128;

/// Returns the path of a fixture, or `None` with a message if the repository's fixtures are missing.
pub(crate) fn fixture(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/optics").join(name);
    if path.exists() {
        return Some(path);
    }
    assert!(std::env::var("CI").as_deref() != Ok("true"), "{} is missing", path.display());
    eprintln!("skipped: {} is not part of the packaged crate", path.display());
    None
}

/// Reads an array of little-endian doubles.
pub(crate) fn array(name: &str) -> Option<Vec<f64>> {
    let bytes = std::fs::read(fixture(&format!("{name}.f64"))?).expect("the array can be read");
    Some(bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect())
}

/// Returns the paper's microscope at 0.57 µm with another condenser aperture; samples are 0.125 µm apart.
pub(crate) fn microscope(condenser_na: f64) -> Microscope {
    Microscope::new(&MicroscopeParams { condenser_na, bandwidth_um: 0.0, ..MicroscopeParams::default() }).unwrap()
}

/// Returns a layer of absorbance given in double precision.
pub(crate) fn absorbing(depth_um: f64, absorbance: &[f64]) -> Layer {
    Layer::new(depth_um, absorbance.iter().map(|a| [libm::exp10(-0.5 * a), 0.0]).collect()).unwrap()
}

/// Returns the difference of two images relative to the contrast of the reference: ‖I − R‖ / ‖1 − R‖.
pub(crate) fn relative(image: &[f64], reference: &[f64]) -> f64 {
    let square = |differences: &mut dyn Iterator<Item = f64>| differences.map(|d| d * d).sum::<f64>();
    let error = square(&mut image.iter().zip(reference).map(|(a, b)| a - b));
    (error / square(&mut reference.iter().map(|r| 1.0 - r))).sqrt()
}

pub(crate) fn worst(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

pub(crate) fn single(values: &[f64]) -> Vec<f32> {
    values.iter().map(|v| *v as f32).collect()
}

pub(crate) fn double(values: &[f32]) -> Vec<f64> {
    values.iter().map(|v| f64::from(*v)).collect()
}

/// Shifts an image right and down on the periodic grid.
pub(crate) fn shifted(image: &[f64], right: i32, down: i32) -> Vec<f64> {
    let side = SIDE as i32;
    let source = |x: i32, y: i32| ((y - down).rem_euclid(side) * side + (x - right).rem_euclid(side)) as usize;
    (0..side).flat_map(|y| (0..side).map(move |x| image[source(x, y)])).collect()
}

/// Returns a disc whose edge profile is a normal distribution function.
pub(crate) fn soft_disk(radius_um: f64, height: f64, edge_um: f64) -> Vec<f64> {
    let at = |i: usize| {
        let [x, y] = [i % SIDE, i / SIDE].map(|v| (v as f64 - SIDE as f64 / 2.0) * 0.125);
        height * 0.5 * (1.0 - libm::erf(((x * x + y * y).sqrt() - radius_um) / (2_f64.sqrt() * edge_um)))
    };
    (0..SIDE * SIDE).map(at).collect()
}

/// Returns absorbance and phase delay of the reference arrays of refracting objects.
pub(crate) fn phase_object() -> (Vec<f64>, Vec<f64>) {
    (soft_disk(3.0, 0.1, 0.12), soft_disk(3.0, 0.3, 0.25))
}

/// Returns the discrete spectrum for kx and ky from −`reach` to `reach`.
pub(crate) fn coefficients(image: &[f64], reach: i32) -> Vec<[f64; 2]> {
    let wave: Vec<[f64; 2]> = (0..SIDE)
        .map(|i| {
            let turn = core::f64::consts::TAU * i as f64 / SIDE as f64;
            [libm::cos(turn), -libm::sin(turn)]
        })
        .collect();
    let at = |k: i32, x: usize| wave[(k * x as i32).rem_euclid(SIDE as i32) as usize];
    let rows: Vec<Vec<[f64; 2]>> = image
        .chunks_exact(SIDE)
        .map(|row| {
            let sum = |k| {
                row.iter().enumerate().fold([0.0; 2], |s, (x, v)| {
                    let [c, w] = at(k, x);
                    [s[0] + v * c, s[1] + v * w]
                })
            };
            (-reach..=reach).map(sum).collect()
        })
        .collect();
    let columns = (-reach..=reach).flat_map(|ky| (0..=2 * reach as usize).map(move |kx| (ky, kx)));
    columns
        .map(|(ky, kx)| {
            rows.iter().enumerate().fold([0.0; 2], |s, (y, row)| {
                let ([c, w], [a, b]) = (at(ky, y), row[kx]);
                [s[0] + a * c - b * w, s[1] + a * w + b * c]
            })
        })
        .collect()
}

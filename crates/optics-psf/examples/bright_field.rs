//! Draws the image of the crate documentation: a nucleus through focus by Abbe's integration, by the default model and
//! by the paper's model, and the halo of a speck. Optional argument: the output path.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small 8-bit image")]

use image::GrayImage;
use optics_psf::{
    Abbe, AbbeParams, Border, BrightField, BrightFieldParams, DepthOfFocus, FocusParams, Gaussian, Layer, Microscope,
    MicroscopeParams, Padding, Source,
};

/// Size of the object in samples 0.125 µm apart.
const SIDE: usize = 192;

/// Size of a panel in pixels.
const PANEL: usize = SIDE / 2;

const DEPTHS_UM: [f64; 4] = [0.0, 1.0, 2.0, 4.0];
const SPECK_UM: [f64; 4] = [3.0, 1.0, -1.0, -3.0];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/bright_field.png".to_owned());
    let microscope = Microscope::new(&MicroscopeParams { condenser_na: 0.6, ..MicroscopeParams::default() })?;
    let nucleus = nucleus();
    let mut image = GrayImage::new(4 * PANEL as u32, 4 * PANEL as u32);
    for (column, depth) in DEPTHS_UM.into_iter().enumerate() {
        let abbe = AbbeParams { width: SIDE, height: SIDE, source: Source::Vogel { points: 256 } };
        let exact = Abbe::new(&microscope, &abbe)?.image(&[Layer::from_absorbance(depth, &nucleus, &[])?], 0.0)?;
        draw(&mut image, column, 0, &pixels(&exact.iter().map(|v| *v as f32).collect::<Vec<_>>()));
        draw(
            &mut image,
            column,
            1,
            &bright_field(&microscope, depth, |field, specimen| {
                field.set_absorbance(specimen, 0, &nucleus);
            })?,
        );
        // A pixel of the paper is two samples; Eqs. 14 and 11.
        let sigma = 2.0 * DepthOfFocus::new(&FocusParams::paper())?.sigma_px(depth);
        let blurred = Gaussian::new(sigma)?.blur(&nucleus, SIDE, Border::Zero);
        draw(&mut image, column, 2, &pixels(&blurred.iter().map(|a| libm::exp10f(-a)).collect::<Vec<_>>()));
    }
    let speck: Vec<f32> = (0..SIDE * SIDE).map(|i| 0.5 * disc(i, [0.0, 0.0], 1.2)).collect();
    for (column, depth) in SPECK_UM.into_iter().enumerate() {
        draw(
            &mut image,
            column,
            3,
            &bright_field(&microscope, depth, |field, specimen| {
                field.set_absorbance(specimen, 0, &speck.iter().map(|v| 0.1 * v).collect::<Vec<_>>());
                field.set_phase(specimen, 0, &speck);
            })?,
        );
    }
    image.save(path)?;
    Ok(())
}

fn bright_field(
    microscope: &Microscope,
    depth: f64,
    fill: impl Fn(&BrightField, &mut optics_psf::Specimen),
) -> Result<Vec<f32>, optics_psf::Error> {
    let params = BrightFieldParams {
        width: SIDE,
        height: SIDE,
        padding: Padding::Periodic,
        depths_um: vec![depth],
        ..BrightFieldParams::default()
    };
    let field = BrightField::new(microscope, &params)?;
    let mut specimen = field.specimen();
    fill(&field, &mut specimen);
    Ok(field.image(&mut specimen, 0))
}

/// Returns 1 inside a disc around a point in µm, 0 outside, with an edge one sample wide.
fn disc(i: usize, [x, y]: [f32; 2], radius_um: f32) -> f32 {
    let at = |v: usize| (v as f32 - SIDE as f32 / 2.0) * 0.125;
    let (dx, dy) = (at(i % SIDE) - x, at(i / SIDE) - y);
    ((radius_um - (dx * dx + dy * dy).sqrt()) / 0.125 + 0.5).clamp(0.0, 1.0)
}

/// Returns the absorbance of a nucleus of 8.4 µm with chromatin clumps on a spiral and a pale patch.
fn nucleus() -> Vec<f32> {
    let clump = |k: usize| {
        let (angle, r) = (2.4 * k as f32, 0.75 * (k as f32).sqrt());
        ([r * libm::cosf(angle), r * libm::sinf(angle)], 0.22 + 0.05 * (k % 5) as f32)
    };
    let sample = |i: usize| {
        let clumps: f32 = (0..24).map(clump).map(|(centre, radius)| disc(i, centre, radius)).sum();
        let rim = disc(i, [0.0; 2], 4.2) - disc(i, [0.0; 2], 3.9);
        disc(i, [0.0; 2], 4.2) * (0.25 + 0.2 * clumps + 0.15 * rim)
    };
    (0..SIDE * SIDE).map(sample).collect()
}

/// Returns means over 2 x 2 samples.
fn pixels(samples: &[f32]) -> Vec<f32> {
    let mean = |i: usize| {
        let at = |dx, dy| samples[(i / PANEL * 2 + dy) * SIDE + i % PANEL * 2 + dx];
        0.25 * (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1))
    };
    (0..PANEL * PANEL).map(mean).collect()
}

/// Draws the centre of a panel, enlarged; the speck in the last row is enlarged more.
fn draw(image: &mut GrayImage, column: usize, row: usize, panel: &[f32]) {
    let zoom = if row < 3 { 2 } else { 4 };
    let first = (PANEL - PANEL / zoom) / 2;
    for i in 0..PANEL * PANEL {
        let (x, y) = (i % PANEL, i / PANEL);
        let light = panel[(first + y / zoom) * PANEL + first + x / zoom];
        let at = ((row * PANEL + y) * 4 + column) * PANEL + x;
        image.as_mut()[at] = (light * 200.0 + 0.5).clamp(0.0, 255.0) as u8;
    }
}

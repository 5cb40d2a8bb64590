//! Writes the image of the README: `cargo run --release --example background [path]`.
//!
//! Above: fractal noise of 1, 3 and 5 octaves. Below: the paper's background and the default one. Each panel is
//! stretched to its extremes; the backgrounds vary by only a few per cent of their level.

use image::GrayImage;
use perlin_bg::{Background, BackgroundParams, Fractal, FractalParams, Window, stretch_to_unit};

const GAP: usize = 4;
const NOISE: [usize; 2] = [160, 120];
const FIELD: [usize; 2] = [242, 182];
const IMAGE: [usize; 2] = [3 * NOISE[0] + 2 * GAP, NOISE[1] + GAP + FIELD[1]];
const KEY: u64 = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/perlin-bg.png".into());
    let mut image = vec![1.0; IMAGE[0] * IMAGE[1]];

    for (column, octaves) in [1, 3, 5].into_iter().enumerate() {
        let params = FractalParams { octaves, ..FractalParams::default() };
        let mut panel = vec![0.0; NOISE[0] * NOISE[1]];
        let window = Window::with_cell_px(40.0);
        Fractal::new(&params, KEY)?.add_into(&mut panel, NOISE[0], &window, 1.0);
        paste(&mut image, panel, NOISE[0], [column * (NOISE[0] + GAP), 0]);
    }

    let backgrounds = [BackgroundParams::paper(), BackgroundParams::default()];
    for (column, mut params) in backgrounds.into_iter().enumerate() {
        // The field is about a sixth of a camera frame, and its cells are scaled accordingly.
        params.texture.cell_px /= 6.0;
        let background = Background::new(&params, FIELD[0], FIELD[1], KEY)?;
        let mut panel = vec![0.0; FIELD[0] * FIELD[1]];
        background.transmitted_into(&mut panel, FIELD[0], [0, 0]);
        let corner = [column * (FIELD[0] + GAP), NOISE[1] + GAP];
        paste(&mut image, panel, FIELD[0], corner);
    }

    let [width, height] = [u32::try_from(IMAGE[0])?, u32::try_from(IMAGE[1])?];
    let bytes = image.into_iter().map(grey).collect();
    GrayImage::from_raw(width, height, bytes).ok_or("the image size differs from its buffer")?.save(path)?;
    Ok(())
}

fn paste(image: &mut [f32], mut panel: Vec<f32>, width: usize, corner: [usize; 2]) {
    stretch_to_unit(&mut panel);
    for (row, line) in panel.chunks(width).enumerate() {
        let start = (corner[1] + row) * IMAGE[0] + corner[0];
        image[start..start + width].copy_from_slice(line);
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "values are in 0..=1")]
fn grey(value: f32) -> u8 {
    (value * 255.0).round() as u8
}

//! Writes the picture of the README: `cargo run --release --example background [path]`.
//!
//! Above: fractal noise of 1, 3 and 5 octaves. Below: the paper's background and ours. Every panel is stretched to its
//! own extremes; the backgrounds vary by some percent of their level only.

use image::GrayImage;
use perlin_bg::{Background, BackgroundParams, Fractal, FractalParams, Window, stretch_to_unit};

const GAP: usize = 4;
const NOISE: [usize; 2] = [160, 120];
const FIELD: [usize; 2] = [242, 182];
const PICTURE: [usize; 2] = [3 * NOISE[0] + 2 * GAP, NOISE[1] + GAP + FIELD[1]];
const KEY: u64 = 8;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/perlin-bg.png".into());
    let mut picture = vec![1.0; PICTURE[0] * PICTURE[1]];

    for (column, octaves) in [1, 3, 5].into_iter().enumerate() {
        let params = FractalParams { octaves, ..FractalParams::default() };
        let mut panel = vec![0.0; NOISE[0] * NOISE[1]];
        let window = Window::with_cell_px(40.0);
        Fractal::new(&params, KEY)?.add_into(&mut panel, NOISE[0], &window, 1.0);
        paste(&mut picture, panel, NOISE[0], [column * (NOISE[0] + GAP), 0]);
    }

    let backgrounds = [BackgroundParams::paper(), BackgroundParams::default()];
    for (column, mut params) in backgrounds.into_iter().enumerate() {
        // The field is about a sixth of a camera's, and so are the cells.
        params.scatter.cell_px /= 6.0;
        let background = Background::new(&params, FIELD[0], FIELD[1], KEY)?;
        let mut panel = vec![0.0; FIELD[0] * FIELD[1]];
        background.transmitted_into(&mut panel, FIELD[0], [0, 0]);
        let corner = [column * (FIELD[0] + GAP), NOISE[1] + GAP];
        paste(&mut picture, panel, FIELD[0], corner);
    }

    let [width, height] = [u32::try_from(PICTURE[0])?, u32::try_from(PICTURE[1])?];
    let bytes = picture.into_iter().map(grey).collect();
    GrayImage::from_raw(width, height, bytes).ok_or("the picture has the size of its buffer")?.save(path)?;
    Ok(())
}

fn paste(picture: &mut [f32], mut panel: Vec<f32>, width: usize, corner: [usize; 2]) {
    stretch_to_unit(&mut panel);
    for (row, line) in panel.chunks(width).enumerate() {
        let start = (corner[1] + row) * PICTURE[0] + corner[0];
        picture[start..start + width].copy_from_slice(line);
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "values lie in 0..=1")]
fn grey(value: f32) -> u8 {
    (value * 255.0).round() as u8
}

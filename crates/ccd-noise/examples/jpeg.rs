//! Writes a grey and a colour frame before and after JPEG compression at several qualities, for
//! `tests/external_jpeg.py`. Optional argument: the output folder.

use std::error::Error;
use std::fs;
use std::path::Path;

use ccd_noise::{Camera, CameraParams, Jpeg, JpegParams, Subsampling};
use image::{GrayImage, RgbImage};

/// Not a multiple of 8 or 16, so that the last blocks need padding.
const WIDTH: u32 = 301;
const HEIGHT: u32 = 203;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "target/jpeg".to_owned());
    let folder = Path::new(&folder);
    fs::create_dir_all(folder)?;
    let grey = GrayImage::from_raw(WIDTH, HEIGHT, frame(1)?).ok_or("the frame has an unexpected size")?;
    let channels = [frame(1)?, frame(2)?, frame(3)?];
    let rgb = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let i = (y * WIDTH + x) as usize;
        image::Rgb([channels[0][i], channels[1][i], channels[2][i]])
    });
    grey.save(folder.join("grey.png"))?;
    rgb.save(folder.join("rgb.png"))?;
    for quality in [10, 50, 75, 90, 95, 100] {
        for (subsampling, name) in [(Subsampling::S444, 444), (Subsampling::S422, 422), (Subsampling::S420, 420)] {
            let jpeg = Jpeg::new(&JpegParams { quality, subsampling, ..JpegParams::default() })?;
            let (mut grey, mut rgb) = (grey.clone(), rgb.clone());
            if subsampling == Subsampling::S444 {
                jpeg.grey(&mut grey, WIDTH as usize);
                grey.save(folder.join(format!("grey_{quality}.png")))?;
            }
            jpeg.rgb(&mut rgb, WIDTH as usize);
            rgb.save(folder.join(format!("rgb_{quality}_{name}.png")))?;
        }
    }
    Ok(())
}

/// Returns a frame of spots of different sizes on an uneven background, with noise.
#[expect(clippy::cast_possible_truncation, reason = "8 bits")]
fn frame(channel: u16) -> Result<Vec<u8>, ccd_noise::Error> {
    let camera = Camera::new(&CameraParams::default())?;
    let light: Vec<f32> = (0..WIDTH * HEIGHT)
        .map(|i| {
            let [x, y] = [i % WIDTH, i / WIDTH].map(|v| v as f32 + 3.0 * f32::from(channel));
            let [u, v] = [x % 60.0 - 30.0, y % 60.0 - 30.0];
            let spot = u * u + v * v < x + 30.0 * f32::from(channel);
            (if spot { 5e3 } else { 14e3 }) * (1.0 - 1e-6 * (x * x + y * y))
        })
        .collect();
    let mut frame = vec![0; light.len()];
    camera.expose_window(&light, WIDTH as usize, [0, 0], channel.into(), &mut frame);
    Ok(frame.into_iter().map(|dn| dn as u8).collect())
}

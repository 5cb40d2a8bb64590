//! Draws the figure of the README, like Fig. 5 of the paper: three sources, and two nuclei synthesised from them, by
//! the paper's method and by the default. The only argument is the path of the image.

use image::{GrayImage, Luma};
use quilt_texture::{QuiltParams, Quilter, Rng, Source};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

/// Size of sources and target, px; magnification and gap of the figure.
const SIDE: usize = 44;
const ZOOM: usize = 3;
const GAP: usize = 8;

/// Grey levels: mean and standard deviation of a nucleus, and the background.
const MEAN: f32 = 110.0;
const DEVIATION: f32 = 17.0;
const PAPER: u8 = 225;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/nucleus.png".into());
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);

    let shapes = [(20.0, 17.0), (17.0, 20.0), (19.0, 19.0)].map(|(a, b)| ellipse(a, b));
    let images: Vec<_> = shapes.iter().map(|shape| chromatin(shape, &mut rng)).collect();
    let sources = images
        .iter()
        .zip(&shapes)
        .map(|(image, shape)| Source::new(image, shape, SIDE))
        .collect::<Result<Vec<_>, _>>()?;
    let sources: Vec<&Source> = sources.iter().collect();
    let target = ellipse(21.0, 18.0);

    let mut panels: Vec<_> = images.into_iter().zip(shapes).collect();
    for params in [QuiltParams::paper(), QuiltParams::default()] {
        let texture = Quilter::new(&sources, &params)?.synthesise(&target, SIDE, &mut rng);
        panels.push((texture.pixels, target.clone()));
    }

    let step = SIDE * ZOOM + GAP;
    let size = [panels.len() * step - GAP, SIDE * ZOOM].map(u32::try_from);
    let [width, height] = [size[0]?, size[1]?];
    let mut figure = GrayImage::from_pixel(width, height, Luma([PAPER]));
    for (x, y, pixel) in figure.enumerate_pixels_mut() {
        let (panel, x) = (x as usize / step, x as usize % step / ZOOM);
        let (pixels, mask) = &panels[panel];
        let i = y as usize / ZOOM * SIDE + x;
        if x < SIDE && mask[i] > 0.0 {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let grey = pixels[i].clamp(0.0, 255.0) as u8;
            pixel.0 = [grey];
        }
    }
    figure.save(path)?;
    Ok(())
}

fn ellipse(a: f32, b: f32) -> Vec<f32> {
    let offset = |i: usize| i as f32 + 0.5 - SIDE as f32 / 2.0;
    let inside = |i: usize| {
        let (x, y) = (offset(i % SIDE) / a, offset(i / SIDE) / b);
        x * x + y * y < 1.0
    };
    (0..SIDE * SIDE).map(|i| if inside(i) { 1.0 } else { 0.0 }).collect()
}

/// Returns white noise smoothed over 3 x 3 px minus the same smoothed over 7 x 7 px, normalised under the mask: clumps
/// of about the size of chromatin clumps.
fn chromatin(mask: &[f32], rng: &mut impl Rng) -> Vec<f32> {
    let noise: Vec<f32> = (0..SIDE * SIDE).map(|_| (rng.next_u32() >> 8) as f32).collect();
    let smooth = |radius: usize, image: &[f32]| -> Vec<f32> {
        let side = 2 * radius + 1;
        let wrapped = |i: usize, k: usize| {
            let y = (i / SIDE + k / side + SIDE - radius) % SIDE;
            let x = (i % SIDE + k % side + SIDE - radius) % SIDE;
            image[y * SIDE + x]
        };
        let mean = |i| (0..side * side).map(|k| wrapped(i, k)).sum::<f32>() / (side * side) as f32;
        (0..image.len()).map(mean).collect()
    };
    let (fine, coarse) = (smooth(1, &noise), smooth(3, &noise));
    let mut image: Vec<f32> = fine.iter().zip(&coarse).map(|(f, c)| f - 0.6 * c).collect();
    let count: f32 = mask.iter().sum();
    let mean = image.iter().zip(mask).map(|(v, m)| v * m).sum::<f32>() / count;
    image.iter_mut().for_each(|v| *v -= mean);
    let variance = image.iter().zip(mask).map(|(v, m)| v * v * m).sum::<f32>() / count;
    let scale = DEVIATION / variance.sqrt();
    image.iter().map(|v| MEAN + scale * v).collect()
}

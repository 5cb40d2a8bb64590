//! Draws the image of the README: above, four textures that this program draws; below, images synthesized from their
//! statistics. Optional argument: the output path.

#![expect(clippy::cast_possible_truncation, reason = "images are single precision")]

use image::GrayImage;
use portable_numerics::random::{below, between, direction, normal, uniform};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use steerable_texture::{Statistics, SynthesisParams, Synthesizer};

/// Side of a texture, px.
const SIDE: usize = 256;

/// Side of the part that is shown, px.
const SHOWN: usize = 200;

const GAP: usize = 4;

type Generator = Xoshiro256PlusPlus;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/textures.png".into());
    let mut rng = Generator::seed_from_u64(2);
    let synthesizer = Synthesizer::new(SIDE, SIDE, &SynthesisParams::default())?;
    let originals = [network(&mut rng), granules(&mut rng), fibres(&mut rng), flecks(&mut rng)];
    let stride = SHOWN + GAP;
    let [width, height] = [4 * stride - GAP, 2 * stride - GAP].map(|side| u32::try_from(side).unwrap_or(0));
    let mut output = GrayImage::from_pixel(width, height, image::Luma([255]));
    for (column, original) in originals.iter().enumerate() {
        let statistics = Statistics::measure(original, SIDE, None, &SynthesisParams::default().texture)?;
        let synthesized = synthesizer.synthesize(&statistics, &mut rng)?;
        for (row, texture) in [original, &synthesized].into_iter().enumerate() {
            for (x, y) in (0..SHOWN).flat_map(|y| (0..SHOWN).map(move |x| (x, y))) {
                // The range of the original is that of the grey levels; larger values are darker.
                let v = f64::from(texture[y * SIDE + x]);
                let part = (v - statistics.min) / (statistics.max - statistics.min);
                #[expect(clippy::cast_sign_loss, reason = "clamped")]
                let grey = (245.0 - 235.0 * part).clamp(0.0, 255.0) as u8;
                output.put_pixel(
                    u32::try_from(column * stride + x)?,
                    u32::try_from(row * stride + y)?,
                    image::Luma([grey]),
                );
            }
        }
    }
    output.save(path)?;
    Ok(())
}

/// Calls `draw` with each pixel and its distance to a centre, periodic.
fn around(image: &mut [f32], [x, y]: [f64; 2], reach: f64, mut draw: impl FnMut(&mut f32, f64, f64)) {
    let side = SIDE as isize;
    let [left, top, reach] = [x, y, reach + 1.0].map(|v| v as isize);
    for j in top - reach..=top + reach {
        for i in left - reach..=left + reach {
            let place = j.rem_euclid(side) * side + i.rem_euclid(side);
            draw(&mut image[place.unsigned_abs()], i as f64 - x, j as f64 - y);
        }
    }
}

fn point(rng: &mut Generator) -> [f64; 2] {
    [0, 1].map(|_| between(0.0, SIDE as f64, rng))
}

/// Thin walls between the cells of a Voronoi diagram.
fn network(rng: &mut Generator) -> Vec<f32> {
    let mut sites: Vec<[f64; 2]> = Vec::new();
    while sites.len() < 330 {
        let site = point(rng);
        if sites.iter().all(|other| squared_distance(site, *other) > 81.0) {
            sites.push(site);
        }
    }
    let wall = |i: usize| {
        let here = [(i % SIDE) as f64, (i / SIDE) as f64];
        let mut nearest = [f64::INFINITY; 2];
        for distance in sites.iter().map(|site| squared_distance(here, *site).sqrt()) {
            if distance < nearest[0] {
                nearest = [distance, nearest[0]];
            } else if distance < nearest[1] {
                nearest[1] = distance;
            }
        }
        let across = 0.5 * (nearest[1] - nearest[0]);
        libm::exp(-0.5 * across * across / 1.2) as f32
    };
    (0..SIDE * SIDE).map(wall).collect()
}

fn squared_distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = |i: usize| {
        let d = (a[i] - b[i]).abs();
        d.min(SIDE as f64 - d)
    };
    along(0) * along(0) + along(1) * along(1)
}

/// Round granules of several sizes.
fn granules(rng: &mut Generator) -> Vec<f32> {
    let mut image = vec![0.0; SIDE * SIDE];
    for _ in 0..800 {
        let radius = [1.2, 1.6, 2.4, 4.0][below(4, rng)];
        let strength = between(0.5, 1.0, rng);
        around(&mut image, point(rng), 2.0 * radius, |pixel, x, y| {
            let distance = (x * x + y * y).sqrt() / radius;
            *pixel = pixel.max((strength * libm::exp(-0.7 * distance * distance * distance)) as f32);
        });
    }
    image
}

/// Fibres near two directions, which add up where they cross.
fn fibres(rng: &mut Generator) -> Vec<f32> {
    let mut image = vec![0.0; SIDE * SIDE];
    for fibre in 0..420 {
        let mut angle = if fibre % 2 == 0 { 0.5 } else { 1.9 } + 0.15 * normal(rng);
        let [mut x, mut y] = point(rng);
        let strength = between(0.1, 0.35, rng);
        for step in 0..70 {
            angle += 0.03 * normal(rng);
            let (sin, cos) = libm::sincos(angle);
            (x, y) = ((x + cos).rem_euclid(SIDE as f64), (y + sin).rem_euclid(SIDE as f64));
            // Both ends are thin.
            let here = strength * libm::sin(core::f64::consts::PI * (f64::from(step) + 0.5) / 70.0);
            around(&mut image, [x, y], 4.0, |pixel, dx, dy| {
                *pixel += (here * libm::exp(-(dx * dx + dy * dy) / 2.5)) as f32;
            });
        }
    }
    image
}

/// Elongated flecks with a tail of strong values, on a weak grain.
fn flecks(rng: &mut Generator) -> Vec<f32> {
    let mut image: Vec<f32> = (0..SIDE * SIDE).map(|_| (0.06 * normal(rng)) as f32).collect();
    for _ in 0..1500 {
        let (sin, cos) = libm::sincos(0.15 * direction(rng));
        let length = between(1.0, 3.5, rng);
        let strength = -0.3 * libm::log(1.0 - 0.95 * uniform(rng));
        around(&mut image, point(rng), 9.0, |pixel, x, y| {
            let [along, across] = [(x * cos + y * sin) / length, (y * cos - x * sin) / 1.1];
            *pixel += (strength * libm::exp(-0.5 * (along * along + across * across))) as f32;
        });
    }
    image
}

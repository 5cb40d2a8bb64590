//! Made-up periodic textures, 128 x 128.

#![expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small images in single precision")]

use portable_numerics::random::{between, normal};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

pub(crate) const SIDE: usize = 128;

pub(crate) fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

fn image(value: impl Fn(f64, f64) -> f64) -> Vec<f32> {
    (0..SIDE * SIDE).map(|i| value((i % SIDE) as f64, (i / SIDE) as f64) as f32).collect()
}

/// Returns the distance of two positions, periodic.
fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    let along = |i: usize| {
        let d = (a[i] - b[i]).abs();
        d.min(SIDE as f64 - d)
    };
    (along(0) * along(0) + along(1) * along(1)).sqrt()
}

fn points(count: usize, seed: u64) -> Vec<[f64; 2]> {
    let mut rng = rng(seed);
    (0..count).map(|_| [0, 1].map(|_| between(0.0, SIDE as f64, &mut rng))).collect()
}

pub(crate) fn spots() -> Vec<f32> {
    let points = points(150, 1);
    let strength = |at| points.iter().map(|&point| distance(point, at)).map(|d| libm::exp(-d * d / 6.0)).sum();
    image(|x, y| strength([x, y]))
}

pub(crate) fn stripes() -> Vec<f32> {
    let mut rng = rng(2);
    let shifts: Vec<f64> = (0..SIDE / 4).map(|_| 0.6 * normal(&mut rng)).collect();
    image(|x, y| {
        let row = y / 4.0;
        let [above, below] = [0, 1].map(|i| shifts[(row as usize + i) % shifts.len()]);
        let shift = above + (below - above) * (row - row.floor());
        libm::sin(core::f64::consts::TAU * (x + y) / 8.0 + shift)
    })
}

pub(crate) fn walls() -> Vec<f32> {
    let points = points(80, 3);
    image(|x, y| {
        let mut distances: Vec<_> = points.iter().map(|&point| distance(point, [x, y])).collect();
        distances.sort_by(f64::total_cmp);
        let across = distances[1] - distances[0];
        libm::exp(-across * across / 8.0)
    })
}

/// Gaussian noise with a maximum of its spectrum at a period of some 8 px.
pub(crate) fn noise(seed: u64) -> Vec<f32> {
    let mut rng = rng(seed);
    let white: Vec<f64> = (0..SIDE * SIDE).map(|_| normal(&mut rng)).collect();
    let kernel: Vec<(usize, usize, f64)> = (0..13 * 13)
        .map(|i| {
            let (x, y) = (i % 13, i / 13);
            let r2 = (x as f64 - 6.0) * (x as f64 - 6.0) + (y as f64 - 6.0) * (y as f64 - 6.0);
            (x, y, (1.0 - r2 / 8.0) * libm::exp(-r2 / 8.0))
        })
        .collect();
    image(|x, y| {
        let at = |dx: usize, dy: usize| white[(y as usize + dy) % SIDE * SIDE + (x as usize + dx) % SIDE];
        kernel.iter().map(|&(dx, dy, weight)| weight * at(dx, dy)).sum()
    })
}

pub(crate) fn skewed() -> Vec<f32> {
    noise(5).into_iter().map(|v| libm::expf(0.3 * v)).collect()
}

//! Local stray light: how much darker the empty slide is beside objects.

use papsynth_judge::number::{single, whole};

use crate::noise::blur;

/// Side of the blocks whose mean is measured, µm.
const BLOCK_UM: f64 = 1.3;

/// Maximum absorbed fraction of a block of empty slide.
const EMPTY: f32 = 0.05;

/// Distance of empty slide from objects, blocks.
const APART: usize = 2;

/// Standard deviations of the Gaussians by which light that objects absorb is spread, µm, and their weights: the kernel
/// of the stray light of EDF presets.
const SPREAD_UM: [(f64, f32); 3] = [(5.0, 0.5), (10.0, 0.25), (20.0, 0.25)];

/// Minimum number of blocks of empty slide.
const LEAST: usize = 400;

/// Returns the absorbed fraction of the empty slide relative to that of the objects around, spread by a kernel: about
/// the fraction of the light that is local stray light. NaN for too little empty slide.
///
/// It is the slope of a linear regression; the others of its variables are a quadratic surface.
pub(crate) fn halo(grey: &[f32], width: usize, empty: f64, pixel_um: f64) -> f64 {
    let side = whole(BLOCK_UM / pixel_um).max(1);
    let (columns, rows) = (width / side, grey.len() / width / side);
    if columns < 2 * APART + 1 || rows < 2 * APART + 1 {
        return f64::NAN;
    }
    let per_pixel = single(1.0 / (empty * (side * side) as f64));
    let mut absorbed = vec![1.0_f32; columns * rows];
    for (lines, blocks) in grey.chunks(side * width).zip(absorbed.chunks_exact_mut(columns)) {
        for line in lines.chunks_exact(width) {
            for (block, part) in blocks.iter_mut().zip(line.chunks_exact(side)) {
                *block -= per_pixel * part.iter().sum::<f32>();
            }
        }
    }
    let objects: Vec<f32> = absorbed.iter().map(|value| if *value > EMPTY { *value } else { 0.0 }).collect();
    let mut around = vec![0.0_f32; objects.len()];
    for (um, weight) in SPREAD_UM {
        let blurred = blur(&objects, columns, um / (side as f64 * pixel_um));
        around.iter_mut().zip(blurred).for_each(|(sum, value)| *sum += weight * value);
    }
    let is_empty = |x: usize, y: usize| {
        (y - APART..=y + APART)
            .all(|y| objects[y * columns + x - APART..=y * columns + x + APART].iter().all(|o| *o == 0.0))
    };
    let mut places = Vec::new();
    for y in APART..rows - APART {
        for x in (APART..columns - APART).filter(|x| is_empty(*x, y)) {
            let [u, v] = [x as f64 / columns as f64 - 0.5, y as f64 / rows as f64 - 0.5];
            let at = y * columns + x;
            places.push(([f64::from(around[at]), 1.0, u, v, u * u, u * v, v * v], f64::from(absorbed[at])));
        }
    }
    if places.len() < LEAST {
        return f64::NAN;
    }
    let of_blocks = nalgebra::DMatrix::from_fn(places.len(), 7, |i, j| places[i].0[j]);
    let values = nalgebra::DVector::from_iterator(places.len(), places.iter().map(|place| place.1));
    let solved = of_blocks.tr_mul(&of_blocks).cholesky().map(|c| c.solve(&of_blocks.tr_mul(&values)));
    solved.map_or(f64::NAN, |slopes| slopes[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fraction_of_local_stray_light_is_measured_and_even_stray_light_is_not() {
        const PIXEL_UM: f64 = 0.33;
        let (width, height) = (480, 400);
        // Discs, under light that falls off towards the borders.
        let transmitted = |p: usize| {
            let at = [(p % width) as f64, (p / width) as f64];
            let inside =
                |c: [f64; 2], r: f64| (at[0] - c[0]) * (at[0] - c[0]) + (at[1] - c[1]) * (at[1] - c[1]) < r * r;
            if inside([130.0, 140.0], 70.0) || inside([330.0, 260.0], 60.0) { 0.6 } else { 1.0 }
        };
        let light = |p: usize| {
            let [u, v] = [(p % width) as f64 / 480.0 - 0.5, (p / width) as f64 / 400.0 - 0.5];
            200.0 * (1.0 - 0.05 * u * u - 0.03 * v * v)
        };
        let clear: Vec<f32> = (0..width * height).map(|p| single(transmitted(p))).collect();
        let mut spread = vec![0.0_f32; clear.len()];
        for (um, weight) in SPREAD_UM {
            spread.iter_mut().zip(blur(&clear, width, um / PIXEL_UM)).for_each(|(s, value)| *s += weight * value);
        }
        for fraction in [0.0_f32, 0.1, 0.3] {
            let image = |stray: &dyn Fn(usize) -> f32| -> Vec<f32> {
                let one = |p: usize| single(light(p)) * ((1.0 - fraction) * clear[p] + fraction * stray(p));
                (0..clear.len()).map(one).collect()
            };
            let local = halo(&image(&|p| spread[p]), width, 200.0, PIXEL_UM);
            let expected = f64::from(fraction);
            assert!((local - expected).abs() < 0.01 + 0.12 * expected, "{fraction}: {local}");
            let even = halo(&image(&|_| 1.0), width, 200.0, PIXEL_UM);
            assert!(even.abs() < 0.01, "{fraction}: {even}");
        }
        assert!(halo(&[200.0; 400], 20, 200.0, PIXEL_UM).is_nan());
    }
}

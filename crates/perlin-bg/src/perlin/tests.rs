use super::*;
use crate::Window;
use portable_numerics::random::between;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const SEED: u64 = 0x0070_6572_6c69_6e00;

fn quintic() -> Perlin {
    Perlin::new(&PerlinParams::default(), SEED).unwrap()
}

fn with_fade(fade: Fade, key: u64) -> Perlin {
    let params = PerlinParams { fade, ..PerlinParams::default() };
    Perlin::new(&params, key).unwrap()
}

fn sampled(noise: &Perlin, side: usize, cell_px: f64) -> Vec<f32> {
    let mut image = vec![0.0; side * side];
    // Half a pixel off the lattice, so that samples are equidistant in a cell.
    let window = Window { origin: [0.5 / cell_px; 2], ..Window::with_cell_px(cell_px) };
    noise.add_into(&mut image, side, &window, 1.0);
    image
}

fn variance(image: &[f32]) -> f64 {
    let count = image.len() as f64;
    let mean = image.iter().map(|&v| f64::from(v)).sum::<f64>() / count;
    let squares = image.iter().map(|&v| (f64::from(v) - mean) * (f64::from(v) - mean));
    squares.sum::<f64>() / count
}

fn positions(count: usize, range: f64) -> Vec<[f64; 2]> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(SEED);
    let mut draw = || between(-range, range, &mut rng);
    (0..count).map(|_| [draw(), draw()]).collect()
}

#[test]
fn noise_is_zero_on_the_lattice() {
    for fade in [Fade::Cubic, Fade::Quintic] {
        let noise = with_fade(fade, 3);
        for i in -20..20 {
            for j in [-1_000_000_007i64, -1, 0, 1, 5, 1 << 50] {
                assert_eq!(noise.at(f64::from(i), j as f64), 0.0);
            }
        }
    }
}

#[test]
fn noise_stays_within_its_bound_and_approaches_it() {
    for fade in [Fade::Cubic, Fade::Quintic] {
        let noise = with_fade(fade, SEED);
        let largest = sampled(&noise, 2048, 8.0).iter().fold(0.0f32, |largest, v| largest.max(v.abs()));
        assert!(f64::from(largest) <= Perlin::BOUND, "{largest}");
        assert!(largest > 0.68, "{largest}");
    }
}

#[test]
fn noise_matches_the_textbook() {
    // Perlin 1985 in double precision: four ramps, blended along x, then along y.
    let oracle = |noise: &Perlin, x: f64, y: f64| {
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i, y - j);
        let fade = |t: f64| match noise.fade {
            Fade::Cubic => t * t * (3.0 - 2.0 * t),
            Fade::Quintic => t * t * t * (10.0 - 15.0 * t + 6.0 * t * t),
        };
        let ramp = |di: f64, dj: f64| {
            let [gx, gy] = noise.gradient([i + di, j + dj].map(|line| noise.profile(line).cell));
            f64::from(gx) * (u - di) + f64::from(gy) * (v - dj)
        };
        let lerp = |t: f64, a: f64, b: f64| (1.0 - t) * a + t * b;
        let upper = lerp(fade(u), ramp(0.0, 0.0), ramp(1.0, 0.0));
        let lower = lerp(fade(u), ramp(0.0, 1.0), ramp(1.0, 1.0));
        lerp(fade(v), upper, lower)
    };
    for fade in [Fade::Cubic, Fade::Quintic] {
        let noise = with_fade(fade, 11);
        // Also far from the origin.
        for corner in [0.0, (1i64 << 36) as f64] {
            for [x, y] in positions(10_000, 500.0).into_iter().map(|p| p.map(|at| corner + at)) {
                let error = f64::from(noise.at(x, y)) - oracle(&noise, x, y);
                assert!(error.abs() < 2e-6, "{x} {y}: {error}");
            }
        }
    }
}

#[test]
fn rows_match_points_bit_for_bit() {
    let noise = quintic();
    for (cell_px, origin) in [(64.0, [0.0, 0.0]), (7.3, [-4.2, 1e6]), (0.4, [3.1, -2.7]), (-5.0, [0.0, 0.25])] {
        let window = Window { origin, ..Window::with_cell_px(cell_px) };
        let (width, height) = (101, 67);
        for (before, amplitude) in [(0.0, 1.0), (2.0, 0.5)] {
            let mut image = vec![before; width * height];
            noise.add_into(&mut image, width, &window, amplitude);
            for (i, &value) in image.iter().enumerate() {
                let point = noise.at(window.x(i % width), window.y(i / width));
                assert_eq!(value.to_bits(), (before + amplitude * point).to_bits());
            }
        }
    }
}

#[test]
fn tiles_match_the_complete_image() {
    let noise = quintic();
    let plane = Window { origin: [0.123, -9.7], ..Window::with_cell_px(13.7) };
    // A tile on a slide of 10^10 pixels, beyond the precision of f32 coordinates.
    for corner in [[0, 0], [-70, 12_345], [10_000_000_000, 9_999_999_999]] {
        let (width, height) = (96, 60);
        let mut whole = vec![0.0; width * height];
        noise.add_into(&mut whole, width, &plane.tile(corner), 1.0);
        for (x0, y0, w, h) in [(0, 0, 96, 7), (31, 17, 33, 43), (95, 59, 1, 1)] {
            let mut tile = vec![0.0; w * h];
            let first = [corner[0] + x0 as i64, corner[1] + y0 as i64];
            noise.add_into(&mut tile, w, &plane.tile(first), 1.0);
            for (row, line) in tile.chunks(w).enumerate() {
                let start = (y0 + row) * width + x0;
                assert_eq!(line, &whole[start..start + w]);
            }
        }
    }
}

#[test]
fn variance_matches_unit_gradients() {
    // 256 x 256 cells with a correlation length of about one cell: the standard error of the variance is about 0.6 %.
    for (fade, expected) in [(Fade::Cubic, 0.0444), (Fade::Quintic, 0.0462)] {
        let found = variance(&sampled(&with_fade(fade, SEED), 2048, 8.0));
        assert!((found / expected - 1.0).abs() < 0.03, "{fade:?}: {found}");
    }
}

#[test]
fn gradients_are_isotropic_and_independent() {
    // Fade curve and these moments determine the spectrum: it is the same for any three or more equidistant directions.
    const SIDE: i64 = 200;
    for gradients in [3, 8, 256] {
        let params = PerlinParams { gradients, ..PerlinParams::default() };
        let [noise, other] = [1, 2].map(|key| Perlin::new(&params, key).unwrap());
        let mean = |of: &dyn Fn(i64, i64) -> f32| {
            let sums = (0..SIDE).map(|j| (0..SIDE).map(|i| f64::from(of(i - 50, j - 90))).sum::<f64>());
            sums.sum::<f64>() / (SIDE * SIDE) as f64
        };
        // Standard errors of means of 40 000 values: 0.0035 of gradients, 0.0018 of products within a gradient, 0.0025
        // of two gradients. The bounds are four standard errors.
        for axis in [0, 1] {
            let square = mean(&|i, j| noise.gradient([i, j])[axis] * noise.gradient([i, j])[axis]);
            assert!((square - 0.5).abs() < 0.0072, "{gradients}: {square}");
            let level = mean(&|i, j| noise.gradient([i, j])[axis]);
            assert!(level.abs() < 0.0142, "{gradients}: {level}");
        }
        for (first, second) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let products: [&dyn Fn(i64, i64) -> [f32; 2]; 5] = [
                &|i, j| other.gradient([i, j]),
                &|i, j| noise.gradient([i + 1, j]),
                &|i, j| noise.gradient([i, j + 1]),
                &|i, j| noise.gradient([i + 1, j - 1]),
                &|i, j| noise.gradient([i + 1, j + 1]),
            ];
            for (place, neighbour) in products.into_iter().enumerate() {
                let product = mean(&|i, j| noise.gradient([i, j])[first] * neighbour(i, j)[second]);
                assert!(product.abs() < 0.01, "{gradients} {place}: {product}");
            }
        }
        let mixed = mean(&|i, j| noise.gradient([i, j])[0] * noise.gradient([i, j])[1]);
        assert!(mixed.abs() < 0.0072, "{gradients}: {mixed}");
    }
}

#[test]
fn bits_are_pinned() {
    // A change of these bits changes every image generated from a seed.
    let noise = quintic();
    let bits = [[0.5, 0.5], [-3.25, 17.75], [1e9 + 0.125, -1e9 - 0.375]].map(|[x, y]| noise.at(x, y).to_bits());
    assert_eq!(bits, [3_202_643_538, 1_051_042_590, 973_699_328]);
}

#[test]
fn out_of_range_values_are_rejected_by_field() {
    for gradients in [0, 1, 2, (1 << 16) + 1, usize::MAX] {
        let params = PerlinParams { gradients, ..PerlinParams::default() };
        let message = Perlin::new(&params, 0).unwrap_err().to_string();
        assert!(message.contains("gradients") && message.contains("between 3 and 65536"), "{message}");
    }
}

#[test]
fn non_finite_positions_give_nan() {
    let noise = quintic();
    assert!(noise.at(f64::NAN, 0.0).is_nan());
    assert!(noise.at(0.0, f64::INFINITY).is_nan());
    // Beyond 2^53 every position is a lattice point.
    assert_eq!(noise.at(1e300, -1e300), 0.0);
}

#[test]
#[should_panic(expected = "20 pixels are not a multiple of the width, 7")]
fn incomplete_rows_panic() {
    quintic().add_into(&mut [0.0; 20], 7, &Window::default(), 1.0);
}

use super::*;
use crate::Window;
use core::f64::consts::TAU;
use noise::{NoiseFn, Perlin as Rival};
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
    // Half a pixel off the lattice, so that samples lie evenly in a cell.
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
fn zero_on_the_lattice() {
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
fn stays_within_its_bound_and_comes_near_it() {
    for fade in [Fade::Cubic, Fade::Quintic] {
        let noise = with_fade(fade, SEED);
        let largest = sampled(&noise, 2048, 8.0).iter().fold(0.0f32, |largest, v| largest.max(v.abs()));
        assert!(f64::from(largest) <= Perlin::BOUND, "{largest}");
        assert!(largest > 0.68, "{largest}");
    }
}

#[test]
fn agrees_with_the_textbook() {
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
        for [x, y] in positions(10_000, 500.0) {
            let error = f64::from(noise.at(x, y)) - oracle(&noise, x, y);
            assert!(error.abs() < 2e-6, "{x} {y}: {error}");
        }
    }
}

#[test]
fn a_row_has_the_bits_of_its_points() {
    let noise = quintic();
    for (cell_px, origin) in [(64.0, [0.0, 0.0]), (7.3, [-4.2, 1e6]), (0.4, [3.1, -2.7]), (-5.0, [0.0, 0.25])] {
        let window = Window { origin, ..Window::with_cell_px(cell_px) };
        let (width, height) = (101, 67);
        let mut image = vec![0.0; width * height];
        noise.add_into(&mut image, width, &window, 1.0);
        for (i, &value) in image.iter().enumerate() {
            let point = noise.at(window.x(i % width), window.y(i / width));
            assert_eq!(value.to_bits(), (0.0 + point).to_bits());
        }
    }
}

#[test]
fn amplitude_scales_and_adds() {
    let noise = quintic();
    let window = Window::with_cell_px(9.0);
    let mut image = vec![2.0; 40 * 30];
    noise.add_into(&mut image, 40, &window, 0.5);
    for (i, &value) in image.iter().enumerate() {
        assert_eq!(value, 2.0 + 0.5 * noise.at(window.x(i % 40), window.y(i / 40)));
    }
}

#[test]
fn tiles_agree_with_the_whole() {
    let noise = quintic();
    let plane = Window { origin: [0.123, -9.7], ..Window::with_cell_px(13.7) };
    // Far away on a slide of 10^10 pixels, where a tile of f32 coordinates would have lost its place.
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
fn large_coordinates_keep_their_precision() {
    let noise = quintic();
    let base = (1i64 << 40) as f64;
    let step = 1.0 / 1024.0;
    let mut last = noise.at(base, base + 0.5);
    for i in 1..2048 {
        let next = noise.at(base + step * f64::from(i), base + 0.5);
        // The slope of noise with unit gradients stays below 3.
        assert!((next - last).abs() < 3.0 / 1024.0);
        last = next;
    }
}

#[test]
fn variance_is_that_of_unit_gradients() {
    // 256 x 256 cells of correlation about one cell: standard error of the variance about 0.6 %.
    for (fade, expected) in [(Fade::Cubic, 0.0444), (Fade::Quintic, 0.0462)] {
        let found = variance(&sampled(&with_fade(fade, SEED), 2048, 8.0));
        assert!((found / expected - 1.0).abs() < 0.03, "{fade:?}: {found}");
    }
}

#[test]
fn variance_agrees_with_another_implementation() {
    // The crate `noise` returns twice the noise of unit gradients, so as to fill -1..1.
    let rival = Rival::new(5);
    let theirs: Vec<f32> = (0..1024 * 1024)
        .map(|i| {
            let at = [i % 1024, i / 1024].map(|p| (f64::from(p) + 0.5) / 8.0);
            single(rival.get(at) / 2.0)
        })
        .collect();
    let ours = sampled(&quintic(), 1024, 8.0);
    // 128 x 128 cells each: standard error of the ratio about 1.7 %; bound 4 standard errors.
    let ratio = variance(&ours) / variance(&theirs);
    assert!((ratio - 1.0).abs() < 0.07, "{ratio}");
}

#[test]
fn quintic_bends_smoothly_across_lattice_lines_and_cubic_does_not() {
    let jump = |noise: &Perlin| {
        let h = 1.0 / 128.0;
        let second = |x: f64, y: f64| {
            let [a, b, c] = [x - h, x, x + h].map(|x| f64::from(noise.at(x, y)));
            (a - 2.0 * b + c) / (h * h)
        };
        let crossings = (0..500).map(|i| (f64::from(i % 25), f64::from(i) * 0.317 + 0.11));
        // Second derivatives just left and right of a line, each extrapolated to it.
        let jumps = crossings.map(|(x, y)| {
            let left = 2.0 * second(x - h, y) - second(x - 2.0 * h, y);
            let right = 2.0 * second(x + h, y) - second(x + 2.0 * h, y);
            (right - left).abs()
        });
        jumps.fold(0.0, f64::max)
    };
    let (smooth, broken) = (jump(&with_fade(Fade::Quintic, 2)), jump(&with_fade(Fade::Cubic, 2)));
    assert!(smooth < 0.3, "{smooth}");
    assert!(broken > 6.0, "{broken}");
}

/// Power spectrum under a Hann window, averaged over keys; `side` x `side`, frequency zero first.
fn spectrum(params: &PerlinParams, side: usize, cell_px: f64, keys: u64) -> Vec<f64> {
    let angle = |k: usize| TAU * k as f64 / side as f64;
    let table: Vec<[f64; 2]> = (0..side).map(|k| [libm::cos(angle(k)), libm::sin(angle(k))]).collect();
    // A DFT of each row by its definition, the result transposed: twice makes the two dimensions.
    let transform = |input: &[[f64; 2]]| {
        let mut output = vec![[0.0; 2]; side * side];
        for (row, line) in input.chunks(side).enumerate() {
            for k in 0..side {
                let mut sum = [0.0; 2];
                for (n, z) in line.iter().enumerate() {
                    let [c, s] = table[k * n % side];
                    sum[0] += z[0] * c + z[1] * s;
                    sum[1] += z[1] * c - z[0] * s;
                }
                output[k * side + row] = sum;
            }
        }
        output
    };
    let mut power = vec![0.0; side * side];
    for key in 0..keys {
        let image = sampled(&Perlin::new(params, SEED ^ key).unwrap(), side, cell_px);
        let hann = |k: usize| 0.5 - 0.5 * libm::cos(angle(k));
        let windowed: Vec<[f64; 2]> =
            image.iter().enumerate().map(|(i, &v)| [f64::from(v) * hann(i % side) * hann(i / side), 0.0]).collect();
        for (p, z) in power.iter_mut().zip(transform(&transform(&windowed))) {
            *p += z[0] * z[0] + z[1] * z[1];
        }
    }
    power
}

/// Magnitudes of the two frequencies of an entry of the spectrum, in cycles a cell.
fn frequencies(entry: usize, side: usize, cell_px: f64) -> [f64; 2] {
    [entry % side, entry / side].map(|bin| bin.min(side - bin) as f64 * cell_px / side as f64)
}

/// Power within 22.5° of the axes over power within 22.5° of the diagonals.
fn axis_over_diagonal(power: &[f64], side: usize, cell_px: f64) -> f64 {
    let (mut axis, mut diagonal) = (0.0, 0.0);
    for (i, p) in power.iter().enumerate() {
        let [fx, fy] = frequencies(i, side, cell_px);
        // Below 0.1 cycles a cell the window's own shape is seen; tan 22.5° parts the sectors.
        if fx.max(fy) < 0.1 {
            continue;
        }
        if fx.min(fy) < 0.414_2 * fx.max(fy) {
            axis += p;
        } else {
            diagonal += p;
        }
    }
    axis / diagonal
}

#[test]
fn spectrum_peaks_below_half_a_cycle_a_cell() {
    let (side, cell_px) = (128, 4.0);
    let power = spectrum(&PerlinParams::default(), side, cell_px, 12);
    let mut rings = vec![(0.0, 0.0); side];
    for (i, p) in power.iter().enumerate() {
        let [fx, fy] = frequencies(i, side, cell_px);
        // Rings of 0.05 cycles a cell.
        let ring = (1..side).take_while(|&ring| (fx * fx + fy * fy).sqrt() >= ring as f64 * 0.05).count();
        rings[ring].0 += p;
        rings[ring].1 += 1.0;
    }
    let density = |ring: usize| rings[ring].0 / f64::max(rings[ring].1, 1.0);
    let peak = (0..side).max_by(|&a, &b| density(a).total_cmp(&density(b))).unwrap();
    let peak = (peak as f64 + 0.5) * 0.05;
    assert!((peak - 0.45).abs() <= 0.08, "{peak}");
}

#[test]
fn power_is_nearly_even_over_directions_whatever_the_number_of_gradients() {
    // The spectrum depends on the gradients' second moments alone, which any three even directions share.
    for gradients in [3, 8, 256] {
        let params = PerlinParams { gradients, ..PerlinParams::default() };
        let ratio = axis_over_diagonal(&spectrum(&params, 128, 4.0, 12), 128, 4.0);
        // Expectation 1.13 (average over 40 keys of another program); standard error over 12 keys 0.02.
        assert!((ratio - 1.13).abs() < 0.08, "{gradients}: {ratio}");
    }
}

#[test]
fn a_key_is_a_field() {
    let [a, b, again] = [1, 2, 1].map(|key| sampled(&with_fade(Fade::Quintic, key), 256, 8.0));
    assert_eq!(a, again);
    let product = a.iter().zip(&b).map(|(&x, &y)| f64::from(x * y)).sum::<f64>();
    let correlation = product / (a.len() as f64 * (variance(&a) * variance(&b)).sqrt());
    // 32 x 32 independent cells: standard error about 1/32; bound 4 standard errors.
    assert!(correlation.abs() < 0.125, "{correlation}");
}

#[test]
fn bits_are_the_same_everywhere() {
    // Recorded once; a change here changes every image made from a seed.
    let noise = quintic();
    let bits = [[0.5, 0.5], [-3.25, 17.75], [1e9 + 0.125, -1e9 - 0.375]].map(|[x, y]| noise.at(x, y).to_bits());
    assert_eq!(bits, [3_202_643_538, 1_051_042_590, 973_699_328]);
}

#[test]
fn parameters_out_of_range_are_named() {
    for gradients in [0, 1, 2, (1 << 16) + 1, usize::MAX] {
        let params = PerlinParams { gradients, ..PerlinParams::default() };
        let message = Perlin::new(&params, 0).unwrap_err().to_string();
        assert!(message.contains("gradients") && message.contains("between 3 and 65536"), "{message}");
    }
}

#[test]
fn positions_that_are_not_finite_give_nan() {
    let noise = quintic();
    assert!(noise.at(f64::NAN, 0.0).is_nan());
    assert!(noise.at(0.0, f64::INFINITY).is_nan());
    // Beyond 2^53 every position is a lattice point.
    assert_eq!(noise.at(1e300, -1e300), 0.0);
}

#[test]
#[should_panic(expected = "width 7 must divide the image's 20 pixels")]
fn a_width_that_does_not_divide_panics() {
    quintic().add_into(&mut [0.0; 20], 7, &Window::default(), 1.0);
}

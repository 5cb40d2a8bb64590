use super::*;
use crate::{Fade, Window};

const KEY: u64 = 42;

fn fractal(octaves: usize, persistence: f64) -> Fractal {
    let params = FractalParams { octaves, persistence, ..FractalParams::default() };
    Fractal::new(&params, KEY).unwrap()
}

#[test]
fn one_octave_equals_perlin() {
    let perlin = Perlin::new(&PerlinParams::default(), KEY).unwrap();
    let noise = fractal(1, 0.5);
    for i in 0..500 {
        let (x, y) = (f64::from(i) * 0.37 - 50.0, f64::from(i) * 0.91 + 3.0);
        assert_eq!(noise.at(x, y), perlin.at(x, y));
    }
    assert_eq!(noise.amplitude_bound(), Perlin::BOUND);
}

#[test]
fn images_match_points_bit_for_bit() {
    let noise = fractal(5, 0.6);
    let window = Window { origin: [-3.3, 8.8], ..Window::with_cell_px(37.0) };
    let (width, height) = (83, 59);
    let (mut image, mut unit) = (vec![0.0; width * height], vec![9.0; width * height]);
    noise.add_into(&mut image, width, &window, 1.0);
    noise.unit_into(&mut unit, width, &window);
    for i in 0..image.len() {
        let (x, y) = (window.x(i % width), window.y(i / width));
        assert_eq!(image[i], noise.at(x, y));
        assert_eq!(unit[i], noise.unit_at(x, y));
        assert!((0.0..=1.0).contains(&unit[i]));
    }
}

#[test]
fn bound_is_the_sum_of_amplitudes() {
    for (octaves, persistence, sum) in [(3, 0.5, 1.75), (2, 1.0, 2.0)] {
        let noise = fractal(octaves, persistence);
        assert!((noise.amplitude_bound() / Perlin::BOUND - sum).abs() < 1e-12);
        let window = Window::with_cell_px(16.0);
        let mut image = vec![0.0; 512 * 512];
        noise.add_into(&mut image, 512, &window, 1.0);
        assert!(image.iter().all(|&v| f64::from(v.abs()) <= noise.amplitude_bound()));
    }
}

#[test]
fn spectrum_falls_with_persistence() {
    // Structure function E|n(x + d) - n(x)|² of noise with power f^-(2H+2): it grows as d^2H within its octaves.
    let growth = |persistence: f64| {
        let noise = fractal(10, persistence);
        let mean_square = |distance: f64| {
            let squares = (0..40_000u32).map(|i| {
                let (x, y) = (f64::from(i) * 1.618_034, f64::from(i) * 0.754_878);
                let step = f64::from(noise.at(x + distance, y)) - f64::from(noise.at(x, y));
                step * step
            });
            squares.sum::<f64>() / 40_000.0
        };
        // Fitted over three of the ten octaves.
        libm::log2(mean_square(1.0 / 8.0) / mean_square(1.0 / 64.0)) / 3.0
    };
    for (persistence, twice_hurst) in [(0.75, 0.830), (0.85, 0.469)] {
        let found = growth(persistence);
        assert!((found - twice_hurst).abs() < 0.1, "{persistence}: {found}");
    }
}

#[test]
fn every_option_changes_the_noise() {
    let base = FractalParams::default();
    let reference = Fractal::new(&base, KEY).unwrap();
    let variants = [
        FractalParams { octaves: 3, ..base.clone() },
        FractalParams { persistence: 0.4, ..base.clone() },
        FractalParams { lacunarity: 1.9, ..base.clone() },
        FractalParams { base: PerlinParams { fade: Fade::Cubic, ..PerlinParams::default() }, ..base.clone() },
        FractalParams { base: PerlinParams { gradients: 8, ..PerlinParams::default() }, ..base },
    ];
    for params in variants {
        let noise = Fractal::new(&params, KEY).unwrap();
        assert_ne!(noise.at(0.3, 0.7), reference.at(0.3, 0.7), "{params:?}");
    }
}

#[test]
fn out_of_range_values_are_rejected_by_field() {
    let base = FractalParams::default();
    let cases = [
        ("octaves", FractalParams { octaves: 0, ..base.clone() }),
        ("octaves", FractalParams { octaves: 33, ..base.clone() }),
        ("persistence", FractalParams { persistence: f64::NAN, ..base.clone() }),
        ("persistence", FractalParams { persistence: 0.0, ..base.clone() }),
        ("persistence", FractalParams { persistence: -0.5, ..base.clone() }),
        ("lacunarity", FractalParams { lacunarity: f64::INFINITY, ..base.clone() }),
        ("lacunarity", FractalParams { lacunarity: 0.5, ..base.clone() }),
        ("gradients", FractalParams { base: PerlinParams { gradients: 1, ..PerlinParams::default() }, ..base }),
    ];
    for (field, params) in cases {
        let message = Fractal::new(&params, KEY).unwrap_err().to_string();
        assert!(message.starts_with(field), "{message}");
    }
}

//! Statistical properties of fields, for every spectrum.

use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use rustfft::{FftPlanner, num_complex::Complex64};
use spectral_field::{FieldParams, Padding, SpectralField, Spectrum};

const SEED: u64 = 0xf1e1d;

const GAUSSIAN: Spectrum = Spectrum::Gaussian { sigma_px: 2.0 };

fn rng() -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(SEED)
}

fn matern(nu: f64, length_px: f64) -> Spectrum {
    Spectrum::Matern { nu, length_px }
}

fn periodic(width: usize, height: usize, spectrum: Spectrum) -> SpectralField {
    SpectralField::new(&FieldParams { width, height, spectrum, padding: Padding::Periodic }).unwrap()
}

/// Returns the mean over pixels of field(x) · field(x + lag), periodic.
fn product(field: &[f32], width: usize, [dx, dy]: [usize; 2]) -> f64 {
    let height = field.len() / width;
    let mut sum = 0.0;
    for y in 0..height {
        for x in 0..width {
            let there = (y + dy) % height * width + (x + dx) % width;
            sum += f64::from(field[y * width + x]) * f64::from(field[there]);
        }
    }
    sum / field.len() as f64
}

/// Returns mean and standard error of one number per draw.
fn statistics(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

#[test]
fn mean_is_zero_and_variance_one() {
    for (spectrum, padding) in [
        (matern(1.0, 3.0), Padding::Decorrelated),
        (GAUSSIAN, Padding::Margin { px: 9 }),
        (Spectrum::BROWNIAN, Padding::Periodic),
        (Spectrum::BROWNIAN, Padding::Decorrelated),
    ] {
        let field = SpectralField::new(&FieldParams { width: 96, height: 64, spectrum, padding }).unwrap();
        let mut rng = rng();
        let draws: Vec<_> = (0..2000).map(|_| field.draw(&mut rng)).collect();
        let squares: Vec<_> = draws.iter().map(|f| product(f, 96, [0, 0])).collect();
        let (variance, error) = statistics(&squares);
        assert!((variance - 1.0).abs() < 4.0 * error.min(0.005), "{spectrum:?}: {variance}");
        let means: Vec<_> =
            draws.iter().map(|f| f.iter().map(|&v| f64::from(v)).sum::<f64>() / f.len() as f64).collect();
        let (mean, error) = statistics(&means);
        assert!(mean.abs() < 4.0 * error + 1e-6, "{spectrum:?}: {mean} ± {error}");
    }
}

#[test]
fn autocorrelation_matches_the_analytic_one() {
    for spectrum in [matern(0.5, 2.0), matern(1.0, 4.0), matern(2.3, 1.5), matern(0.2, 3.0), GAUSSIAN] {
        let field = periodic(128, 96, spectrum);
        for lag in [[0.0_f64, 0.0], [1.0, 0.0], [0.0, 2.0], [3.0, 3.0], [0.0, 7.0], [12.0, 5.0]] {
            let distance = (lag[0] * lag[0] + lag[1] * lag[1]).sqrt();
            let analytic = spectrum.autocorrelation(distance).unwrap();
            let planned = field.autocorrelation(lag);
            // The error of omitted alias orders; the periodic tail is smaller.
            assert!((planned - analytic).abs() < 2e-3, "{spectrum:?} {lag:?}: {planned}, {analytic}");
        }
    }
}

#[test]
fn drawn_fields_have_the_expected_autocorrelation() {
    for (width, height) in [(48, 30), (45, 31)] {
        for spectrum in [matern(0.5, 2.0), Spectrum::BROWNIAN] {
            let field = periodic(width, height, spectrum);
            let mut rng = rng();
            let draws: Vec<_> = (0..1500).map(|_| field.draw(&mut rng)).collect();
            for lag in [[0, 0], [1, 0], [0, 1], [2, 3], [7, 2], [width / 2, height / 2]] {
                let products: Vec<_> = draws.iter().map(|f| product(f, width, lag)).collect();
                let (mean, error) = statistics(&products);
                let planned = field.autocorrelation(lag.map(|l| l as f64));
                let z = (mean - planned) / error;
                assert!(z.abs() < 4.0, "{width} x {height} {spectrum:?} {lag:?}: {z} standard errors");
            }
        }
    }
}

#[test]
fn both_diagonals_are_equally_likely() {
    // A sign error in the packing of rows would favour one diagonal.
    let field = periodic(32, 32, matern(1.0, 3.0));
    let mut rng = rng();
    let difference: Vec<_> =
        (0..1500).map(|_| field.draw(&mut rng)).map(|f| product(&f, 32, [3, 3]) - product(&f, 32, [3, 29])).collect();
    let (mean, error) = statistics(&difference);
    assert!(mean.abs() < 4.0 * error, "{mean} ± {error}");
}

#[test]
fn fields_are_gaussian() {
    let field = periodic(64, 64, matern(1.0, 2.0));
    let mut rng = rng();
    let moments: Vec<_> = (0..600)
        .map(|_| field.draw(&mut rng))
        .map(|f| {
            f.iter()
                .map(|&v| f64::from(v))
                .fold([0.0; 2], |[third, fourth], v| [third + v * v * v / 4096.0, fourth + v * v * v * v / 4096.0])
        })
        .collect();
    for (order, expected) in [(0, 0.0), (1, 3.0)] {
        let (mean, error) = statistics(&moments.iter().map(|m| m[order]).collect::<Vec<_>>());
        assert!((mean - expected).abs() < 4.0 * error, "{mean} ± {error}");
    }
}

#[test]
fn brownian_power_falls_with_the_square_of_frequency() {
    const SIDE: usize = 256;
    for exponent in [2.0, 3.5] {
        let field = periodic(SIDE, SIDE, Spectrum::PowerLaw { exponent });
        let transform = FftPlanner::new().plan_fft_forward(SIDE);
        let mut rng = rng();
        // Power along kx at ky = 0: the transform of the column sums.
        let mut power = [0.0; SIDE];
        for _ in 0..200 {
            let draw = field.draw(&mut rng);
            let mut sums = vec![Complex64::default(); SIDE];
            for row in draw.chunks(SIDE) {
                for (sum, &v) in sums.iter_mut().zip(row) {
                    sum.re += f64::from(v);
                }
            }
            transform.process(&mut sums);
            for (p, z) in power.iter_mut().zip(&sums) {
                *p += z.norm_sqr();
            }
        }
        let points: Vec<_> = (2..SIDE / 2).map(|k| (libm::log(k as f64), libm::log(power[k]))).collect();
        let n = points.len() as f64;
        let mean = points.iter().fold([0.0; 2], |m, p| [m[0] + p.0 / n, m[1] + p.1 / n]);
        let slope = points.iter().map(|p| (p.0 - mean[0]) * (p.1 - mean[1])).sum::<f64>()
            / points.iter().map(|p| (p.0 - mean[0]) * (p.0 - mean[0])).sum::<f64>();
        assert!((slope + exponent).abs() < 0.1, "{slope}");
    }
}

#[test]
fn periodic_fields_tile_but_padded_fields_do_not() {
    const SIDE: usize = 120;
    let spectrum = Spectrum::Gaussian { sigma_px: 6.0 };
    let seam = |padding| {
        let field = SpectralField::new(&FieldParams { width: SIDE, height: SIDE, spectrum, padding }).unwrap();
        let mut rng = rng();
        let products: Vec<_> = (0..300)
            .map(|_| field.draw(&mut rng))
            .map(|f| {
                let rows = f.chunks(SIDE).map(|row| f64::from(row[0]) * f64::from(row[SIDE - 1]));
                rows.sum::<f64>() / SIDE as f64
            })
            .collect();
        statistics(&products)
    };
    let (tiled, error) = seam(Padding::Periodic);
    let neighbour = spectrum.autocorrelation(1.0).unwrap();
    assert!((tiled - neighbour).abs() < 4.0 * error, "{tiled} ± {error}");
    for padding in [Padding::Decorrelated, Padding::Margin { px: 40 }] {
        let (apart, error) = seam(padding);
        assert!(apart.abs() < 0.01 + 4.0 * error, "{padding:?}: {apart} ± {error}");
    }
}

#[test]
fn draw_into_matches_draw_bit_for_bit() {
    for (width, height) in [(1, 1), (1, 9), (9, 1), (2, 3), (37, 29), (64, 17)] {
        for padding in [Padding::Periodic, Padding::Margin { px: 3 }] {
            let field =
                SpectralField::new(&FieldParams { width, height, spectrum: matern(1.0, 2.0), padding }).unwrap();
            let drawn = field.draw(&mut rng());
            let mut filled = vec![f32::NAN; width * height];
            field.draw_into(&mut filled, &mut rng());
            assert_eq!(drawn, filled);
            assert!(drawn.iter().all(|v| v.is_finite()));
        }
    }
}

#[test]
fn bits_are_pinned() {
    let mut sums = Vec::new();
    for spectrum in [Spectrum::BROWNIAN, matern(1.0, 4.0), GAUSSIAN] {
        let params = FieldParams { width: 75, height: 53, spectrum, ..FieldParams::default() };
        let field = SpectralField::new(&params).unwrap().draw(&mut rng());
        // Fowler–Noll–Vo hash.
        sums.push(field.iter().fold(0xcbf2_9ce4_8422_2325, |hash: u64, v| {
            (hash ^ u64::from(v.to_bits())).wrapping_mul(0x0100_0000_01b3)
        }));
    }
    assert_eq!(sums, [0xe424_4f2d_1aba_29cc, 0x2ec6_03b2_95f1_ddcc, 0x7127_0790_64a2_c28a], "{sums:#x?}");
}

#[test]
#[should_panic(expected = "8 x 4 elements")]
fn wrong_length_panics() {
    periodic(8, 4, GAUSSIAN).draw_into(&mut [0.0; 31], &mut rng());
}

/// Subtracts a least-squares fit of all monomials x^i y^j up to third degree.
fn detrend(values: &mut [f64], at: &[[f64; 2]]) {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for (i, j) in (0..4).flat_map(|i| (0..4 - i).map(move |j| (i, j))) {
        let power = |v: f64, p: usize| (0..p).fold(1.0, |m, _| m * v);
        let mut term: Vec<_> = at.iter().map(|p| power(p[0], i) * power(p[1], j)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // Gram–Schmidt, twice for accuracy.
        for _ in 0..2 {
            for earlier in &basis {
                let along = dot(earlier, &term);
                term.iter_mut().zip(earlier).for_each(|(t, e)| *t -= along * e);
            }
        }
        let norm = dot(&term, &term).sqrt();
        term.iter_mut().for_each(|t| *t /= norm);
        let along = dot(&term, values);
        values.iter_mut().zip(&term).for_each(|(v, t)| *v -= along * t);
        basis.push(term);
    }
}

/// Compares the detrended autocorrelation of 100 normal nuclei, at 1 to 6 px of 0.25 µm, with a Matérn field of ν = 1,
/// l = 0.5 µm. The field has a grid of 0.125 µm, is averaged to pixels and cut to a disc of the nuclei's mean diameter,
/// 7.96 µm, without optics.
#[test]
fn matern_field_matches_chromatin() {
    const MEASURED: [f64; 6] = [0.715, 0.373, 0.137, -0.013, -0.082, -0.104];
    const SIDE: usize = 40;
    const RADIUS: f64 = 15.9;
    let field = periodic(2 * SIDE, 2 * SIDE, matern(1.0, 4.0));
    let offset = |i: usize| (i as f64 + 0.5 - SIDE as f64 / 2.0) / RADIUS;
    let inside: Vec<usize> = (0..SIDE * SIDE)
        .filter(|i| {
            let (x, y) = (offset(i % SIDE), offset(i / SIDE));
            x * x + y * y < 1.0
        })
        .collect();
    let at: Vec<_> = inside.iter().map(|i| [offset(i % SIDE), offset(i / SIDE)]).collect();
    let mut rng = rng();
    let mut sums = [0.0; 7];
    for _ in 0..300 {
        let draw = field.draw(&mut rng);
        let pixel = |i: usize| {
            let corner = i / SIDE * 4 * SIDE + i % SIDE * 2;
            [0, 1, 2 * SIDE, 2 * SIDE + 1].map(|d| f64::from(draw[corner + d])).iter().sum::<f64>()
        };
        let mut values: Vec<_> = inside.iter().map(|&i| pixel(i)).collect();
        detrend(&mut values, &at);
        let mut image = vec![f64::NAN; SIDE * SIDE];
        inside.iter().zip(&values).for_each(|(&i, &v)| image[i] = v);
        let mut lags = [0.0; 7];
        for (lag, sum) in lags.iter_mut().enumerate() {
            let pairs: Vec<f64> = inside
                .iter()
                .flat_map(|&i| [(i, i + lag), (i, i + lag * SIDE)])
                .filter(|&(_, j)| j < SIDE * SIDE)
                .map(|(i, j)| image[i] * image[j])
                .filter(|p| p.is_finite())
                .collect();
            *sum = pairs.iter().sum::<f64>() / pairs.len() as f64;
        }
        sums.iter_mut().zip(lags).for_each(|(s, l)| *s += l / lags[0] / 300.0);
    }
    let squares: f64 = MEASURED.iter().zip(&sums[1..]).map(|(m, s)| (m - s) * (m - s)).sum();
    let rmse = (squares / 6.0).sqrt();
    assert!(rmse < 0.02, "{sums:?}: {rmse}");
}

//! Benchmarks of images, relative to the real FFT pairs they need, and of further planes.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use optics_psf::{Abbe, AbbeParams, BrightField, BrightFieldParams, Layer, Microscope, MicroscopeParams, Padding};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex32;

const SIDE: usize = 512;
const SLABS: [f64; 8] = [-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0];

fn microscope() -> Microscope {
    Microscope::new(&MicroscopeParams::default()).expect("the defaults are valid")
}

/// Returns the absorbance of discs that cover a third of a slab.
fn slab(k: usize) -> Vec<f32> {
    let pixel = |i: usize| {
        let (x, y) = ((i % SIDE + 37 * k) % 128, (i / SIDE + 53 * k) % 128);
        let (dx, dy) = (x as f32 - 64.0, y as f32 - 64.0);
        if dx * dx + dy * dy < 1600.0 { 0.2 } else { 0.0 }
    };
    (0..SIDE * SIDE).map(pixel).collect()
}

fn field(depths_um: &[f64], stages_um: &[f64]) -> BrightField {
    let params = BrightFieldParams {
        width: SIDE,
        height: SIDE,
        padding: Padding::Periodic,
        depths_um: depths_um.to_vec(),
        stages_um: stages_um.to_vec(),
    };
    BrightField::new(&microscope(), &params).expect("the parameters are valid")
}

/// A real FFT and its inverse on the grid of the object: the unit of comparison.
fn fft_pair(c: &mut Criterion) {
    let mut planner = RealFftPlanner::<f32>::new();
    let (forward, inverse) = (planner.plan_fft_forward(SIDE), planner.plan_fft_inverse(SIDE));
    let mut complex = rustfft::FftPlanner::<f32>::new();
    let (down, up) = (complex.plan_fft_forward(SIDE), complex.plan_fft_inverse(SIDE));
    let image = slab(0);
    let half = SIDE / 2 + 1;
    let mut rows = image.clone();
    let mut spectrum = vec![Complex32::default(); half * SIDE];
    let mut columns = spectrum.clone();
    let mut group = c.benchmark_group("reference");
    group.throughput(Throughput::Elements((SIDE * SIDE) as u64));
    group.bench_function("real FFT pair", |b| {
        b.iter(|| {
            rows.copy_from_slice(&image);
            for (row, out) in rows.chunks_exact_mut(SIDE).zip(spectrum.chunks_exact_mut(half)) {
                forward.process(row, out).expect("the lengths fit");
            }
            transpose(&spectrum, half, &mut columns);
            down.process(&mut columns);
            up.process(&mut columns);
            transpose(&columns, SIDE, &mut spectrum);
            for (row, input) in rows.chunks_exact_mut(SIDE).zip(spectrum.chunks_exact_mut(half)) {
                input[0].im = 0.0;
                input[half - 1].im = 0.0;
                inverse.process(input, row).expect("the lengths fit");
            }
        });
    });
}

fn transpose(from: &[Complex32], width: usize, to: &mut [Complex32]) {
    const TILE: usize = 16;
    let height = from.len() / width;
    for top in (0..height).step_by(TILE) {
        for left in (0..width).step_by(TILE) {
            for x in left..(left + TILE).min(width) {
                for y in top..(top + TILE).min(height) {
                    to[x * height + y] = from[y * width + x];
                }
            }
        }
    }
}

fn image(c: &mut Criterion) {
    let mut group = c.benchmark_group("image");
    group.throughput(Throughput::Elements((SIDE * SIDE) as u64));
    let absorbance: Vec<Vec<f32>> = (0..SLABS.len()).map(slab).collect();
    let mut bench = |name: &str, slabs: &[usize]| {
        let depths: Vec<f64> = slabs.iter().map(|&k| SLABS[k]).collect();
        let field = field(&depths, &[0.0]);
        let mut specimen = field.specimen();
        let mut out = vec![0.0; field.image_size().into_iter().product()];
        group.bench_function(name, |b| {
            b.iter(|| {
                for (i, &k) in slabs.iter().enumerate() {
                    field.set_absorbance(&mut specimen, i, &absorbance[k]);
                }
                field.image_into(&mut specimen, 0, &mut out)
            });
        });
        group.bench_function(format!("{name}, a further plane"), |b| {
            b.iter(|| field.image_into(&mut specimen, 0, &mut out));
        });
    };
    bench("one slab in focus", &[4]);
    bench("one slab at 2 um", &[6]);
    bench("one slab at 4 um", &[0]);
    bench("eight slabs", &[0, 1, 2, 3, 4, 5, 6, 7]);
}

fn stack(c: &mut Criterion) {
    let stages: Vec<f64> = (-10..=10).map(|i| 0.3 * f64::from(i)).collect();
    let field = field(&SLABS, &stages);
    let mut specimen = field.specimen();
    let mut out = vec![0.0; field.image_size().into_iter().product()];
    let absorbance: Vec<Vec<f32>> = (0..SLABS.len()).map(slab).collect();
    let mut group = c.benchmark_group("stack");
    group.sample_size(10);
    group.bench_function("21 planes of eight slabs", |b| {
        b.iter(|| {
            for (k, absorbance) in absorbance.iter().enumerate() {
                field.set_absorbance(&mut specimen, k, absorbance);
            }
            (0..stages.len()).map(|plane| field.image_into(&mut specimen, plane, &mut out)).sum::<usize>()
        });
    });
    group.finish();
    c.bench_function("transfer function at 3 um", |b| b.iter(|| microscope().transfer(3.0, 0.0)));
}

fn abbe(c: &mut Criterion) {
    let abbe = Abbe::new(&microscope(), &AbbeParams::default()).expect("the defaults are valid");
    let layers = [Layer::from_absorbance(2.0, &slab(0), &[]).expect("a finite depth")];
    let mut group = c.benchmark_group("abbe");
    group.sample_size(10);
    group.bench_function("one layer, 64 points", |b| b.iter(|| abbe.image(&layers, 0.0)));
}

criterion_group!(benches, fft_pair, image, stack, abbe);
criterion_main!(benches);

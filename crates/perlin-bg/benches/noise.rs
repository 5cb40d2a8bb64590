//! Benchmarks of a field of 1376 x 1038 pixels: one octave, four octaves, a background and its logarithm.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use perlin_bg::{Background, BackgroundParams, Fractal, FractalParams, Perlin, PerlinParams, Window};
use std::hint::black_box;

const WIDTH: usize = 1376;
const HEIGHT: usize = 1038;
const KEY: u64 = 7;

fn bench(c: &mut Criterion) {
    let mut image = vec![0.0f32; WIDTH * HEIGHT];
    let mut group = c.benchmark_group("1376x1038");
    group.throughput(Throughput::Elements((WIDTH * HEIGHT) as u64));

    let perlin = Perlin::new(&PerlinParams::default(), KEY).unwrap();
    for cell_px in [4.0, 16.0, 64.0, 220.0] {
        let window = Window::with_cell_px(cell_px);
        group.bench_function(format!("one octave, cell {cell_px} px"), |b| {
            b.iter(|| perlin.add_into(black_box(&mut image), WIDTH, &window, 1e-3));
        });
    }
    let fractal = Fractal::new(&FractalParams::default(), KEY).unwrap();
    group.bench_function("four octaves, cell 220 px", |b| {
        let window = Window::with_cell_px(220.0);
        b.iter(|| fractal.add_into(black_box(&mut image), WIDTH, &window, 1e-3));
    });

    let background = Background::new(&BackgroundParams::default(), WIDTH, HEIGHT, KEY).unwrap();
    group.bench_function("background, transmitted", |b| {
        b.iter(|| background.transmitted_into(black_box(&mut image), WIDTH, [0, 0]));
    });
    group.bench_function("background, log10", |b| {
        b.iter(|| background.log10_into(black_box(&mut image), WIDTH, [0, 0]));
    });
    group.bench_function("the paper's background, log10, including set-up", |b| {
        let params = BackgroundParams::paper();
        b.iter(|| {
            Background::new(&params, WIDTH, HEIGHT, KEY).unwrap().log10_into(black_box(&mut image), WIDTH, [0, 0]);
        });
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);

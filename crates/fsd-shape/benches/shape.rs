//! Outlines per second: tracing, resampling, descriptors, self-intersections, draws, fits.

#[path = "../examples/support/mod.rs"]
mod support;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fsd_shape::{Descriptors, ShapeModel, ShapeModelParams, resample, self_intersects, trace};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

fn shapes(c: &mut Criterion) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(0xBE9C);
    let cells = support::polygons(70, 100.0, &support::CELL, &mut rng);
    let nuclei = support::polygons(70, 16.0, &support::NUCLEUS, &mut rng);
    let cytoplasm = ShapeModel::fit(&cells, &ShapeModelParams::default()).expect("polygons are valid");
    let nucleus = ShapeModel::fit(&nuclei, &ShapeModelParams { harmonics: 8, ..ShapeModelParams::default() })
        .expect("polygons are valid");

    let mut group = c.benchmark_group("outlines");
    group.throughput(Throughput::Elements(1));
    group.bench_function("draw, 40 harmonics", |b| b.iter(|| cytoplasm.draw(black_box(100.0), &mut rng)));
    group.bench_function("draw, 8 harmonics", |b| b.iter(|| nucleus.draw(black_box(16.0), &mut rng)));
    let outline = resample(&cells[0], 420);
    let descriptors = Descriptors::from_outline(&outline).expect("polygons are valid");
    let smooth = descriptors.truncated(40);
    group.bench_function("descriptors of 420 points", |b| b.iter(|| Descriptors::from_outline(black_box(&outline))));
    group.bench_function("420 points of 40 harmonics", |b| b.iter(|| black_box(&smooth).outline(420)));
    group.bench_function("resample 420 points", |b| b.iter(|| resample(black_box(&cells[0]), 420)));
    let points = smooth.outline(640);
    group.bench_function("crossings of 640 points", |b| b.iter(|| self_intersects(black_box(&points))));
    group.bench_function("fit 70 outlines", |b| {
        b.iter(|| ShapeModel::fit(black_box(&cells), &ShapeModelParams::default()));
    });
    group.finish();

    let width = 1024;
    let mask: Vec<f32> = (0..width * width)
        .map(|i| {
            let (x, y) = ((i % width) as f32 - 500.0, (i / width) as f32 - 520.0);
            if x * x + y * y < 1e5 { 1.0 } else { 0.0 }
        })
        .collect();
    let mut group = c.benchmark_group("mask");
    group.throughput(Throughput::Elements(mask.len() as u64));
    group.bench_function("trace 1024 x 1024", |b| b.iter(|| trace(black_box(&mask), width, 0.5)));
    group.finish();
}

criterion_group!(benches, shapes);
criterion_main!(benches);

//! Benchmarks of a plan, a measurement and a synthesis, by the side of the image.

#![expect(clippy::cast_possible_truncation, reason = "images are single precision")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use portable_numerics::random::normal;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use steerable_texture::{Analyzer, Pyramid, PyramidParams, SynthesisParams, Synthesizer, TextureParams};

const SIDES: [usize; 2] = [256, 512];

/// Returns white noise.
fn image(side: usize) -> Vec<f32> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    (0..side * side).map(|_| normal(&mut rng) as f32).collect()
}

fn decompose(c: &mut Criterion) {
    let mut group = c.benchmark_group("decompose and reconstruct");
    for side in SIDES {
        let pyramid = Pyramid::new(side, side, &PyramidParams::default()).expect("valid parameters");
        let image = image(side);
        group.throughput(Throughput::Elements((side * side) as u64));
        group.bench_function(side.to_string(), |b| {
            b.iter(|| pyramid.reconstruct(&pyramid.decompose(black_box(&image))));
        });
    }
}

fn measure(c: &mut Criterion) {
    let mut group = c.benchmark_group("measure");
    group.sample_size(10);
    for side in SIDES {
        let analyzer = Analyzer::new(side, side, &TextureParams::default()).expect("valid parameters");
        let image = image(side);
        group.throughput(Throughput::Elements((side * side) as u64));
        group.bench_function(side.to_string(), |b| b.iter(|| analyzer.measure(black_box(&image), None)));
    }
}

fn synthesize(c: &mut Criterion) {
    let mut group = c.benchmark_group("synthesize, 25 iterations");
    group.sample_size(10);
    for side in SIDES {
        let synthesizer = Synthesizer::new(side, side, &SynthesisParams::default()).expect("valid parameters");
        let analyzer = Analyzer::new(side, side, &TextureParams::default()).expect("valid parameters");
        let statistics = analyzer.measure(&image(side), None).expect("a valid image");
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
        group.throughput(Throughput::Elements((side * side) as u64));
        group.bench_function(side.to_string(), |b| {
            b.iter(|| synthesizer.synthesize(black_box(&statistics), &mut rng));
        });
    }
}

fn plan(c: &mut Criterion) {
    let mut group = c.benchmark_group("plan of a synthesis");
    group.sample_size(10);
    for side in SIDES {
        group.bench_function(side.to_string(), |b| {
            b.iter(|| Synthesizer::new(side, side, black_box(&SynthesisParams::default())));
        });
    }
}

criterion_group!(benches, decompose, measure, synthesize, plan);
criterion_main!(benches);

//! Time to measure a field, and to compare two sets of fields.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use papsynth_judge::{Detail, Field, Judge, JudgeParams, Measurer, MeasurerParams, NucleiFrom};

#[path = "../tests/support/mod.rs"]
mod support;

use support::Toy;

fn measurer(detail: Detail) -> Measurer {
    Measurer::new(&MeasurerParams { nuclei_from: NucleiFrom::Search, detail, ..MeasurerParams::default() })
        .expect("defaults are in range")
}

/// Measures a field of 1280 x 960 pixels with 29 nuclei on one thread.
fn measure(c: &mut Criterion) {
    let image = Toy { width: 1280, height: 960, cells: 29, ..Toy::default() }.image(1);
    let mut group = c.benchmark_group("measure 1280x960");
    group.sample_size(10).throughput(Throughput::Elements(1));
    for (name, detail) in [("statistics", Detail::Statistics), ("everything", Detail::Everything)] {
        let measurer = measurer(detail);
        group.bench_function(name, |b| b.iter(|| measurer.measure(black_box(&image))));
    }
    group.finish();
}

/// Compares 12 with 12 measured fields on all threads.
fn compare(c: &mut Criterion) {
    let toy = Toy { width: 640, height: 480, cells: 12, ..Toy::default() };
    let measurer = measurer(Detail::Everything);
    let fields = |seed: u64| -> Vec<Field> {
        toy.images(12, seed).iter().map(|p| measurer.measure(p).expect("toy fields are images")).collect()
    };
    let (real, synthetic) = (fields(1), fields(100));
    let mut group = c.benchmark_group("compare 12 with 12");
    group.sample_size(10).throughput(Throughput::Elements(24));
    for (name, params) in [("quick", JudgeParams::quick()), ("default", JudgeParams::default())] {
        let judge = Judge::new(&params).expect("defaults are in range");
        group.bench_function(name, |b| {
            b.iter_batched(|| (), |()| judge.compare(&real, &synthetic), BatchSize::PerIteration)
        });
    }
    group.finish();
}

criterion_group!(benches, measure, compare);
criterion_main!(benches);

//! Benchmarks of a draw and of a plan of a 200 x 200 field, by spectrum and padding.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use spectral_field::{FieldParams, Padding, SpectralField, Spectrum};

const SIDE: usize = 200;

fn draw(c: &mut Criterion) {
    let matern = Spectrum::Matern { nu: 1.0, length_px: 4.0 };
    let gaussian = Spectrum::Gaussian { sigma_px: 7.0 };
    let margin = Padding::Margin { px: 16 };
    let cases = [
        ("brownian/periodic", Spectrum::BROWNIAN, Padding::Periodic),
        ("brownian/margin 16", Spectrum::BROWNIAN, margin),
        ("brownian/decorrelated", Spectrum::BROWNIAN, Padding::Decorrelated),
        ("matern/decorrelated", matern, Padding::Decorrelated),
        ("gaussian/decorrelated", gaussian, Padding::Decorrelated),
    ];
    let mut group = c.benchmark_group("draw 200 x 200");
    group.throughput(Throughput::Elements((SIDE * SIDE) as u64));
    for (case, spectrum, padding) in cases {
        let field = SpectralField::new(&FieldParams { width: SIDE, height: SIDE, spectrum, padding })
            .expect("valid parameters");
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut out = vec![0.0; SIDE * SIDE];
        group.bench_function(case, |b| {
            b.iter(|| field.draw_into(black_box(&mut out), &mut rng));
        });
    }
}

fn plan(c: &mut Criterion) {
    let mut group = c.benchmark_group("plan 200 x 200");
    for (name, spectrum) in [
        ("brownian", Spectrum::BROWNIAN),
        ("matern 1", Spectrum::Matern { nu: 1.0, length_px: 4.0 }),
        ("matern 0.8", Spectrum::Matern { nu: 0.8, length_px: 4.0 }),
        ("gaussian", Spectrum::Gaussian { sigma_px: 7.0 }),
    ] {
        let params = FieldParams { width: SIDE, height: SIDE, spectrum, ..FieldParams::default() };
        group.bench_function(name, |b| b.iter(|| SpectralField::new(black_box(&params))));
    }
}

criterion_group!(benches, draw, plan);
criterion_main!(benches);

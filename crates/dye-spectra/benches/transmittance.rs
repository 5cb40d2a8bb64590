//! Benchmarks of the light of stained pixels: summed over wavelengths, as three vectors, and as a curve.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use dye_spectra::{Colour, ColourParams, DYES, Dye, Mixing, amounts};

/// Pixels of a tile of 256 x 256.
const PIXELS: usize = 256 * 256;

fn sums(c: &mut Criterion) {
    let plane: Vec<f32> = (0..PIXELS).map(|i| 0.05 + (i % 997) as f32 * 5e-4).collect();
    let mut out = [const { Vec::new() }; 3].map(|_: Vec<f32>| vec![0.0; PIXELS]);
    let mut group = c.benchmark_group("sum");
    group.throughput(Throughput::Elements(PIXELS as u64));
    for (name, mixing) in [("16 wavelengths", Mixing::Spectral), ("three vectors", Mixing::ThreeVectors)] {
        let colour = Colour::new(&ColourParams { mixing, ..ColourParams::default() }).expect("valid parameters");
        for dyes in 0..=DYES {
            let empty = vec![0.0; PIXELS];
            let planes: [&[f32]; DYES] = std::array::from_fn(|d| if d < dyes { &plane[..] } else { &empty });
            group.bench_function(BenchmarkId::new(name, format!("{dyes} dyes")), |b| {
                b.iter(|| colour.transmittance_into(planes, out.each_mut().map(|plane| &mut plane[..])));
            });
        }
    }
}

fn curve(c: &mut Criterion) {
    let plane: Vec<f32> = (0..PIXELS).map(|i| 0.05 + (i % 997) as f32 * 5e-4).collect();
    let mut out = [const { Vec::new() }; 3].map(|_: Vec<f32>| vec![0.0; PIXELS]);
    let colour = Colour::new(&ColourParams::default()).expect("valid parameters");
    let curve = colour.curve(&amounts([(Dye::LightGreen, 0.8), (Dye::EosinY, 0.2)])).expect("a valid mixture");
    let mut group = c.benchmark_group("curve");
    group.throughput(Throughput::Elements(PIXELS as u64));
    group.bench_function("two dyes", |b| {
        b.iter(|| curve.transmittance_into(&plane, out.each_mut().map(|plane| &mut plane[..])));
    });
}

criterion_group!(benches, sums, curve);
criterion_main!(benches);

//! Benchmarks of blurs of a camera frame and of an object's tile, by width.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use optics_psf::{Border, Gaussian, Method, Scratch};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

fn noise(len: usize) -> Vec<f32> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    (0..len).map(|_| (rng.next_u32() >> 8) as f32 / 16_777_216.0).collect()
}

fn frame(c: &mut Criterion) {
    let (width, height) = (1376, 1038);
    let image = noise(width * height);
    let (mut dst, mut scratch) = (image.clone(), Scratch::new());
    let mut group = c.benchmark_group("frame");
    group.throughput(Throughput::Elements(image.len() as u64));
    for method in [Method::Direct, Method::Decimated] {
        for sigma in [0.9, 3.6, 20.0] {
            if method == Method::Decimated && sigma < 3.5 {
                continue;
            }
            let gaussian = Gaussian::truncated(sigma, method, 1e-7).expect("a finite width");
            group.bench_function(BenchmarkId::new(format!("{method:?}"), sigma), |b| {
                b.iter(|| gaussian.blur_into(&image, width, Border::Reflect, &mut dst, &mut scratch));
            });
        }
    }
}

fn tile(c: &mut Criterion) {
    let (width, height) = (160, 140);
    let tile = noise(width * height);
    let mut scratch = Scratch::new();
    let mut group = c.benchmark_group("tile");
    group.throughput(Throughput::Elements(tile.len() as u64));
    for sigma in [1.0, 2.0, 4.0, 8.0] {
        let gaussian = Gaussian::new(sigma).expect("a finite width");
        let (mut dst, _) = gaussian.blur_expanded(&tile, width);
        group.bench_function(BenchmarkId::from_parameter(sigma), |b| {
            b.iter(|| gaussian.blur_expanded_into(&tile, width, &mut dst, &mut scratch));
        });
    }
}

criterion_group!(benches, frame, tile);
criterion_main!(benches);

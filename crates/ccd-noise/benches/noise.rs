//! How long does the noise of a camera frame take: its deviates alone, and the whole exposure?

use ccd_noise::{Camera, CameraParams, NoiseField, PhotonNoise};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

const WIDTH: usize = 1376;
const PIXELS: usize = WIDTH * 1038;

fn deviates(c: &mut Criterion) {
    let field = NoiseField::new(1);
    let mut out = vec![0.0; PIXELS];
    let mut group = c.benchmark_group("deviates");
    group.throughput(Throughput::Elements(PIXELS as u64));
    group.bench_function("normal", |b| b.iter(|| field.normal_into(WIDTH, [0, 0], &mut out)));
    for mean in [0.1, 1.0, 10.0, 30.0, 200.0, 2e3, 17_850.0] {
        let means = vec![mean; PIXELS];
        group.bench_function(BenchmarkId::new("poisson", mean), |b| {
            b.iter(|| field.poisson_into(&means, WIDTH, [0, 0], &mut out));
        });
    }
}

fn frame(c: &mut Criterion) {
    // A field of cells: 14 000 electrons in the background, 8 000 in the objects.
    let object = |i: usize| (i % WIDTH / 50 + i / WIDTH / 50).is_multiple_of(2);
    let electrons: Vec<f32> = (0..PIXELS).map(|i| if object(i) { 8e3 } else { 14e3 }).collect();
    let mut out = vec![0; PIXELS];
    let mut group = c.benchmark_group("frame");
    group.throughput(Throughput::Elements(PIXELS as u64));
    for (name, photon_noise) in [
        ("exact", PhotonNoise::Exact),
        ("one normal", PhotonNoise::NormalAbove { mean_e: 200.0 }),
        ("read noise alone", PhotonNoise::Off),
    ] {
        let params = CameraParams { photon_noise, ..CameraParams::default() };
        let camera = Camera::new(&params).expect("valid parameters");
        group.bench_function(name, |b| {
            b.iter(|| camera.expose_window(&electrons, WIDTH, [0, 0], 1, &mut out));
        });
    }
}

criterion_group!(benches, deviates, frame);
criterion_main!(benches);

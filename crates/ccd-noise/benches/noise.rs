//! Benchmarks of noise deviates, of the exposure of a frame with different camera models, and of JPEG compression.

use ccd_noise::{Blooming, Camera, CameraParams, Jpeg, JpegParams, NoiseField, PhotonNoise, ReadNoise, Subsampling};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

const WIDTH: usize = 1376;
const PIXELS: usize = WIDTH * 1038;

/// Mean electrons of a field of cells: 14 000 in the background, 8 000 in the objects.
fn scene() -> Vec<f32> {
    let object = |i: usize| (i % WIDTH / 50 + i / WIDTH / 50).is_multiple_of(2);
    (0..PIXELS).map(|i| if object(i) { 8e3 } else { 14e3 }).collect()
}

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
    let electrons = scene();
    let mut out = vec![0; PIXELS];
    let mut group = c.benchmark_group("frame");
    group.throughput(Throughput::Elements(PIXELS as u64));
    let even = CameraParams::default();
    let uneven = CameraParams { prnu: 0.007, dsnu_e: 2.0, ..even.clone() };
    let per_pixel = ReadNoise::PerPixel { median_e: 5.0, rms_e: 8.0 };
    for (name, params) in [
        ("exact", even.clone()),
        ("one normal", CameraParams { photon_noise: PhotonNoise::NormalAbove { mean_e: 200.0 }, ..even.clone() }),
        ("read noise only", CameraParams { photon_noise: PhotonNoise::Off, ..even.clone() }),
        ("exact, PRNU and DSNU", uneven.clone()),
        ("exact, PRNU and DSNU, read noise per pixel", CameraParams { read_noise: per_pixel, ..uneven }),
    ] {
        let camera = Camera::new(&params).expect("valid parameters");
        group.bench_function(name, |b| {
            b.iter(|| camera.expose_window(&electrons, WIDTH, [0, 0], 1, &mut out));
        });
    }
    let mut runs = Vec::new();
    let camera = Camera::new(&even).expect("valid parameters");
    group.bench_function("exact, with saturated runs", |b| {
        b.iter(|| {
            runs.clear();
            camera.expose_window_marking(&electrons, WIDTH, [0, 0], 1, &mut out, &mut runs)
        });
    });
    let blooming = Blooming::On { vertical: 0.95, anti_blooming: 0.0 };
    let camera = Camera::new(&CameraParams { blooming, full_well_e: 13_000.0, ..even }).expect("valid parameters");
    group.bench_function("exact, half of the pixels blooming", |b| {
        b.iter(|| {
            runs.clear();
            camera.expose_frame(&electrons, WIDTH, 1, &mut out, &mut runs)
        });
    });
}

fn jpeg(c: &mut Criterion) {
    let camera = Camera::new(&CameraParams::default()).expect("valid parameters");
    let mut frame = vec![0; PIXELS];
    camera.expose_window(&scene(), WIDTH, [0, 0], 1, &mut frame);
    let grey: Vec<u8> = frame.iter().map(|&dn| u8::try_from(dn).unwrap_or(u8::MAX)).collect();
    let rgb: Vec<u8> = grey.iter().flat_map(|v| [*v, v / 2, 255 - v]).collect();
    let mut group = c.benchmark_group("jpeg");
    group.throughput(Throughput::Elements(PIXELS as u64));
    let jpeg = Jpeg::new(&JpegParams::default()).expect("valid parameters");
    let mut image = grey.clone();
    group.bench_function("grey", |b| {
        b.iter(|| {
            image.copy_from_slice(&grey);
            jpeg.grey(&mut image, WIDTH);
        });
    });
    for subsampling in [Subsampling::S444, Subsampling::S420] {
        let jpeg = Jpeg::new(&JpegParams { subsampling, ..JpegParams::default() }).expect("valid parameters");
        let mut image = rgb.clone();
        group.bench_function(BenchmarkId::new("rgb", format!("{subsampling:?}")), |b| {
            b.iter(|| {
                image.copy_from_slice(&rgb);
                jpeg.rgb(&mut image, WIDTH);
            });
        });
    }
}

criterion_group!(benches, deviates, frame, jpeg);
criterion_main!(benches);

//! Time of a cytoskeleton, and of its stages.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::hint::black_box;
use voronoi_cytoskeleton::{Diagram, LineParams, Point, Skeleton, SkeletonParams, Torus, Window, draw_into};

const SIDE: usize = 200;
const SEED: u64 = 7;

/// Returns a wavy outline of 420 points, 200 pixels wide.
fn outline() -> Vec<Point> {
    (0..420)
        .map(|k| {
            let angle = core::f64::consts::TAU * f64::from(k) / 420.0;
            let radius = 88.0 + 8.0 * libm::cos(3.0 * angle) + 3.0 * libm::sin(7.0 * angle);
            [100.0 + radius * libm::cos(angle), 100.0 + radius * libm::sin(angle)]
        })
        .collect()
}

fn bench(c: &mut Criterion) {
    let outline = outline();
    let window = Window::around(&outline).unwrap();
    let params = SkeletonParams::default();
    let skeleton = Skeleton::new(&params).unwrap();
    let line = LineParams::default();
    let rng = || Xoshiro256PlusPlus::seed_from_u64(SEED);
    let diagram = skeleton.diagram(&window, &mut rng()).unwrap();
    let paths = skeleton.grow(&outline, &mut rng()).unwrap();
    let mut image = vec![0.0; SIDE * SIDE];

    let mut group = c.benchmark_group("cell of 200 px, 300 sites");
    group.throughput(Throughput::Elements(params.sites as u64));
    group.bench_function("skeleton, grown and drawn", |b| {
        b.iter(|| {
            image.fill(0.0);
            let paths = skeleton.grow(black_box(&outline), &mut rng()).unwrap();
            draw_into(&mut image, SIDE, &paths, &line).unwrap();
        });
    });
    group.bench_function("skeleton, grown", |b| {
        b.iter(|| skeleton.grow(black_box(&outline), &mut rng()).unwrap());
    });
    let torus = Torus::new(4 * params.sites, params.lloyd_passes, &mut rng()).unwrap();
    group.bench_function("skeleton, grown from a torus", |b| {
        let mut rng = rng();
        b.iter(|| skeleton.grow_from(&torus, black_box(&outline), &mut rng).unwrap());
    });
    group.bench_function("diagram", |b| {
        b.iter(|| Diagram::new(black_box(diagram.sites()), &window).unwrap());
    });
    group.bench_function("paths on a cone", |b| {
        let cone = |[x, y]: Point| 90.0 - ((x - 100.0) * (x - 100.0) + (y - 100.0) * (y - 100.0)).sqrt();
        b.iter(|| skeleton.paths(black_box(&diagram), cone, &mut rng()));
    });
    group.bench_function("drawing", |b| {
        b.iter(|| draw_into(&mut image, SIDE, black_box(&paths), &line).unwrap());
    });
    group.finish();

    let params = SkeletonParams { sites: 10_000, ..SkeletonParams::default() };
    let skeleton = Skeleton::new(&params).unwrap();
    let mut group = c.benchmark_group("10000 sites");
    group.throughput(Throughput::Elements(params.sites as u64));
    group.bench_function("diagram and two Lloyd passes", |b| {
        b.iter(|| skeleton.diagram(&window, &mut rng()).unwrap());
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);

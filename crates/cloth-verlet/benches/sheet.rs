//! Time of one sheet, alone and in a batch of sixteen, of folding, and of the thickness image.

use cloth_verlet::{Cloth, ClothParams, Crease, FoldKind, PixelGrid, Point};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::hint::black_box;

const LANES: u8 = 16;

/// A closed curve about 200 pixels across.
fn outline(waves: f64) -> Vec<Point> {
    (0..200)
        .map(|k| std::f64::consts::TAU * f64::from(k) / 200.0)
        .map(|angle| (100.0 * (1.0 + 0.1 * libm::cos(waves * angle)), angle))
        .map(|(r, angle)| [r * libm::cos(angle), r * libm::sin(angle)])
        .collect()
}

fn crumple(c: &mut Criterion) {
    let outlines: Vec<Vec<Point>> = (0..LANES).map(|k| outline(f64::from(2 + k % 5))).collect();
    let outlines: Vec<&[Point]> = outlines.iter().map(Vec::as_slice).collect();
    let rngs: Vec<_> = (0..LANES).map(|k| Xoshiro256PlusPlus::seed_from_u64(u64::from(k))).collect();
    for (name, params) in [("paper", ClothParams::paper()), ("default", ClothParams::default())] {
        let cloth = Cloth::new(&params).expect("presets are valid");
        let mut group = c.benchmark_group(format!("crumple, {name}"));
        group.sample_size(20);
        group.throughput(Throughput::Elements(1));
        group.bench_function("alone", |b| b.iter(|| cloth.crumple(outlines[0], &mut rngs[0].clone())));
        group.throughput(Throughput::Elements(u64::from(LANES)));
        group.bench_function("sixteen", |b| b.iter(|| cloth.crumple_many(&outlines, &mut rngs.clone())));
        group.finish();
    }
}

fn thickness(c: &mut Criterion) {
    let cloth = Cloth::new(&ClothParams::default()).expect("presets are valid");
    let flat = cloth.crumple(&outline(3.0), &mut Xoshiro256PlusPlus::seed_from_u64(1)).expect("an outline");
    let crease = Crease::straight([30.0, 10.0], 1.0, 4.0, FoldKind::Flap);
    let mut folded = flat.clone();
    folded.fold(&crease).expect("a crease");
    let grid = PixelGrid { origin: [-110.0, -110.0], pixel_size: 1.0 };
    let mut image = vec![0.0_f32; 220 * 220];
    let mut group = c.benchmark_group("thickness, 220 x 220 pixels");
    group.throughput(Throughput::Elements(220 * 220));
    for (name, sheet) in [("crumpled", &flat), ("folded", &folded)] {
        group.bench_function(name, |b| {
            b.iter(|| sheet.thickness_into(black_box(&mut image), 220, &grid, |r| 1.5 - r * r))
        });
    }
    group.finish();
    c.bench_function("fold", |b| {
        b.iter_batched(|| flat.clone(), |mut sheet| sheet.fold(&crease), criterion::BatchSize::SmallInput)
    });
}

criterion_group!(benches, crumple, thickness);
criterion_main!(benches);

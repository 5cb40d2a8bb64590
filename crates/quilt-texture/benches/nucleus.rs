//! Time of a nucleus of 40 x 40 px from three sources of that size, and of the scan and the Fourier transforms for
//! larger sources.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use quilt_texture::{Acceptance, CentreBias, QuiltParams, Quilter, Rng, Seam, Search, Source};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

const SIDE: usize = 40;

fn disc(side: usize) -> Vec<f32> {
    let offset = |i: usize| (2 * i + 1) as f32 / side as f32 - 1.0;
    let inside = |i: usize| offset(i % side) * offset(i % side) + offset(i / side) * offset(i / side) < 1.0;
    (0..side * side).map(|i| if inside(i) { 1.0 } else { 0.0 }).collect()
}

/// Returns white noise, averaged over 3 x 3 px, with a standard deviation of about 17.
fn texture(side: usize, rng: &mut Xoshiro256PlusPlus) -> Vec<f32> {
    let noise: Vec<f32> = (0..side * side).map(|_| (rng.next_u32() >> 16) as f32 / 370.0).collect();
    let at = |x: usize, y: usize| noise[y % side * side + x % side];
    let mean = |i: usize| {
        let (x, y) = (i % side, i / side);
        (0..9).map(|k| at(x + k % 3, y + k / 3)).sum::<f32>() / 9.0
    };
    (0..side * side).map(mean).collect()
}

fn nucleus(c: &mut Criterion) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let mask = disc(SIDE);
    let sources: Vec<Source> =
        (0..3).map(|_| Source::new(&texture(SIDE, &mut rng), &mask, SIDE).expect("a disc")).collect();
    let sources: Vec<&Source> = sources.iter().collect();
    let seven_by_two = QuiltParams { patch_px: 7, overlap_px: 2, ..QuiltParams::default() };
    let cases = [
        ("default", QuiltParams::default()),
        ("paper", QuiltParams::paper()),
        (
            "paper, four fifths of the distance",
            QuiltParams { acceptance: Acceptance::Threshold { d_max: 12.0, max_tries: 1000 }, ..QuiltParams::paper() },
        ),
        ("patch 7, overlap 2", seven_by_two.clone()),
        (
            "patch 7, overlap 2, no bias, sharp cut",
            QuiltParams { centre_bias: CentreBias::Off, seam: Seam::MinCut { feather_px: 0 }, ..seven_by_two },
        ),
    ];
    let mut group = c.benchmark_group("nucleus");
    group.throughput(Throughput::Elements((SIDE * SIDE) as u64));
    for (name, params) in &cases {
        group.bench_function(*name, |b| {
            b.iter(|| {
                let quilter = Quilter::new(black_box(&sources), params).expect("valid parameters");
                quilter.synthesise(black_box(&mask), SIDE, &mut rng)
            });
        });
    }
    group.bench_function("Quilter::new alone", |b| {
        b.iter(|| Quilter::new(black_box(&sources), &cases[0].1));
    });
    group.finish();
}

fn search(c: &mut Criterion) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
    let mut group = c.benchmark_group("one source");
    group.sample_size(10);
    for (side, patch_px) in [(128, 16), (256, 32), (256, 64)] {
        let source = Source::new(&texture(side, &mut rng), &vec![1.0; side * side], side).expect("a square");
        let target = vec![1.0; side * side];
        for search in [Search::Direct, Search::Fft, Search::Auto] {
            let params = QuiltParams {
                patch_px,
                overlap_px: patch_px / 4,
                search,
                acceptance: Acceptance::Near { factor: 1.1, floor: 0.02 },
                ..QuiltParams::default()
            };
            let quilter = Quilter::new(&[&source], &params).expect("valid parameters");
            let id = BenchmarkId::new(format!("{search:?}"), format!("side {side}, patch {patch_px}"));
            group.bench_function(id, |b| b.iter(|| quilter.synthesise(black_box(&target), side, &mut rng)));
        }
    }
    group.finish();
}

criterion_group!(benches, nucleus, search);
criterion_main!(benches);

//! A shard of a whole slide, full of the default contents: made, and written with labels, pyramids and tables. One thread.

use std::fs;
use std::hint::black_box;
use std::sync::atomic::AtomicBool;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use papsynth::model::Model;
use papsynth::recipe::Preset;
use papsynth::{Engine, Inputs, Threads};
use papsynth_dataset::slide::{SlideInfo, SlideRun, SlideSet};
use papsynth_dataset::{Check, Task};

const SIDE_PX: u32 = 2048;

fn shard(c: &mut Criterion) {
    let mut recipe = Preset::Lbc.recipe();
    (recipe.scan.width_px, recipe.scan.height_px) = (SIDE_PX, SIDE_PX);
    recipe.scan.deposit.radius_um = 60_000.0.into();
    let model = Model::builtin();
    let engine = Engine::new(&recipe, &model, &Inputs::default()).expect("the default recipe");
    let folder = std::env::temp_dir().join(format!("papsynth-bench-{}-slide", std::process::id()));
    let mut group = c.benchmark_group("slide");
    group.sample_size(10).throughput(Throughput::Elements(u64::from(SIDE_PX) * u64::from(SIDE_PX)));
    group.bench_function("rendered", |b| {
        b.iter(|| {
            let slide = engine.slide(1, 0).expect("a slide");
            black_box(slide.picture([0, 0], [SIDE_PX; 2], Threads::One).expect("a picture"))
        });
    });
    group.bench_function("written", |b| {
        b.iter(|| {
            let _ = fs::remove_dir_all(&folder);
            let slide = engine.slide(1, 0).expect("a slide");
            let info = SlideInfo { recipe: &recipe, model: &model, seed: 1, shard_px: SIDE_PX, objects_parquet: false };
            let set = SlideSet::create_or_resume(&folder, &slide, &info).expect("a folder");
            let stop = AtomicBool::new(false);
            let run = SlideRun { task: Task::ALL, threads: Threads::One, check: Check::Sizes, stop: &stop };
            set.generate(&slide, &run, &|_| ()).expect("a shard")
        });
    });
    group.finish();
    let _ = fs::remove_dir_all(&folder);
}

criterion_group!(benches, shard);
criterion_main!(benches);

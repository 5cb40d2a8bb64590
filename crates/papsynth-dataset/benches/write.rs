//! Writing of a frame of 1376 x 1038 pixels with ground truth, and encoding of a mask.

use std::fs;
use std::path::PathBuf;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::Preset;
use papsynth::{Engine, Frame, Inputs};
use papsynth_dataset::{Dataset, DatasetInfo, Layout, rle};

const SEED: u64 = 1;

/// A folder that is removed at the end.
struct Scratch(PathBuf);

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn write(dataset: &Dataset, frame: &Frame) {
    let mut writer = dataset.shard_writer(frame.finished.scene.key.index).unwrap();
    writer.begin(&frame.finished.scene).unwrap();
    frame.planes.iter().for_each(|plane| writer.write_plane(plane).unwrap());
    writer.end(&frame.finished).unwrap();
    writer.commit().unwrap();
}

fn bench(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("write");
    for planes in [1, 5] {
        let mut recipe = Preset::Lbc.recipe();
        recipe.focus.planes = f64::from(planes).into();
        let model = Model::builtin();
        let engine = Engine::new(&recipe, &model, &Inputs::default()).unwrap();
        let frame = engine.frame(Key { seed: SEED, index: 0 }).unwrap();
        let pixels = frame.finished.scene.view.width * frame.finished.scene.view.height;
        let scratch = Scratch(std::env::temp_dir().join(format!("papsynth-bench-{}-{planes}", std::process::id())));
        let info = DatasetInfo { recipe: &recipe, model: &model, seed: SEED, map: None, layout: &Layout::default() };
        let dataset = Dataset::create_or_resume(&scratch.0, &info).unwrap();
        group.throughput(Throughput::Elements((pixels * frame.planes.len()) as u64));
        group.bench_function(format!("{planes} planes"), |b| b.iter(|| write(&dataset, &frame)));
        if planes == 1 {
            let view = frame.finished.scene.view;
            let masks: Vec<_> = frame.finished.truth.objects.iter().map(|o| &o.amodal).collect();
            group.throughput(Throughput::Elements(masks.iter().map(|m| m.area()).sum()));
            group.bench_function("all masks as RLE", |b| {
                b.iter(|| masks.iter().map(|mask| rle::encode(mask, view.width, view.height).len()).sum::<usize>());
            });
        }
    }
    group.finish();
}

criterion_group! { name = benches; config = Criterion::default().sample_size(20); targets = bench }
criterion_main!(benches);

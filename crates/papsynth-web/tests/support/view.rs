//! Small data sets and viewer requests for tests.

use std::path::Path;

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::Recipe;
use papsynth::{Engine, Frame, Inputs};
use papsynth_dataset::{Dataset, DatasetInfo, Format, Layout};
use papsynth_web::{Reply, Request, Site, Viewer};
use serde_json::Value;

pub(crate) const SEED: u64 = 5;

/// The default recipe with few cells and fields larger than a tile.
pub(crate) fn recipe(settings: &str) -> Recipe {
    let mut recipe: Recipe = toml::from_str(&format!("[field]\nwidth_px = 300\nheight_px = 270\n{settings}")).unwrap();
    recipe.cells.values_mut().for_each(|mix| mix.count = 1.0.into());
    recipe
}

/// Writes a data set and returns its frames.
pub(crate) fn write(path: &Path, recipe: &Recipe, formats: &[Format], frames: u64) -> Vec<Frame> {
    let model = Model::builtin();
    let engine = Engine::new(recipe, &model, &Inputs::default()).unwrap();
    let mut layout = Layout::new(formats.iter().copied());
    layout.frames_per_shard = layout.frames_per_shard.min(2);
    let info = DatasetInfo { recipe, model: &model, seed: SEED, map: None, layout: &layout };
    let dataset = Dataset::create_or_resume(path, &info).unwrap();
    let frames: Vec<Frame> = (0..frames).map(|index| engine.frame(Key { seed: SEED, index }).unwrap()).collect();
    let each = layout.frames_per_shard;
    for (shard, frames) in (0..).zip(frames.chunks(usize::try_from(each).unwrap())) {
        let mut writer = dataset.shard_writer(shard).unwrap();
        for frame in frames {
            writer.begin(&frame.finished.scene).unwrap();
            frame.planes.iter().for_each(|plane| writer.write_plane(plane).unwrap());
            writer.end(&frame.finished).unwrap();
        }
        writer.commit().unwrap();
    }
    dataset.finish().unwrap();
    frames
}

pub(crate) fn get(view: &mut Viewer, target: &str) -> Reply {
    view.reply(&Request { method: "GET", target, ..Request::default() })
}

pub(crate) fn json(view: &mut Viewer, target: &str) -> Value {
    let reply = get(view, target);
    assert_eq!(reply.status, 200, "{target}: {}", String::from_utf8_lossy(&reply.body));
    serde_json::from_slice(&reply.body).unwrap()
}

/// An assembled 8-bit image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pixels {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) channels: usize,
    pub(crate) bytes: Vec<u8>,
}

impl Pixels {
    pub(crate) fn decode(bytes: &[u8]) -> Self {
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut bytes).unwrap();
        assert_eq!(info.bit_depth, png::BitDepth::Eight);
        let channels = info.color_type.samples();
        Self { width: info.width as usize, height: info.height as usize, channels, bytes }
    }

    pub(crate) fn at(&self, x: usize, y: usize) -> &[u8] {
        &self.bytes[(y * self.width + x) * self.channels..][..self.channels]
    }
}

/// Assembles all tiles of a level; `layer` is the path before the level.
pub(crate) fn assembled(view: &mut Viewer, image: &Value, layer: &str, level: usize) -> Pixels {
    let number = |name: &str| usize::try_from(image[name].as_u64().unwrap()).unwrap();
    let [width, height] = ["width", "height"].map(|side| number(side).div_ceil(1 << level));
    let side = number("tile");
    let mut whole: Option<Pixels> = None;
    for row in 0..height.div_ceil(side) {
        for column in 0..width.div_ceil(side) {
            let target = format!("/{layer}/{level}/{row}-{column}.png");
            let reply = get(view, &target);
            assert_eq!((reply.status, reply.content_type), (200, "image/png"), "{target}");
            let tile = Pixels::decode(&reply.body);
            let channels = tile.channels;
            let whole = whole.get_or_insert_with(|| Pixels {
                width,
                height,
                channels,
                bytes: vec![0; width * height * channels],
            });
            for y in 0..tile.height {
                let start = ((row * side + y) * width + column * side) * channels;
                let line = tile.width * channels;
                whole.bytes[start..start + line].copy_from_slice(&tile.bytes[y * line..][..line]);
            }
        }
    }
    whole.unwrap()
}

/// Halves an image: a direct implementation.
pub(crate) fn half(image: &Pixels) -> Pixels {
    let (width, height, channels) = (image.width.div_ceil(2), image.height.div_ceil(2), image.channels);
    let mut bytes = Vec::new();
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let [right, lower] = [(2 * x + 1).min(image.width - 1), (2 * y + 1).min(image.height - 1)];
        let four = [[2 * x, 2 * y], [right, 2 * y], [2 * x, lower], [right, lower]];
        for channel in 0..channels {
            let sum: u32 = four.iter().map(|&[x, y]| u32::from(image.at(x, y)[channel])).sum();
            bytes.push(u8::try_from((sum + 2) / 4).unwrap());
        }
    }
    Pixels { width, height, channels, bytes }
}

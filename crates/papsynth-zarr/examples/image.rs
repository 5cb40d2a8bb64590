//! Writes a small image with labels into a folder: `cargo run -p papsynth-zarr --example image -- FOLDER`.

#![allow(clippy::cast_possible_truncation, reason = "the numbers are small")]

use std::error::Error;
use std::fs;
use std::path::PathBuf;

use papsynth_zarr::{
    Channel, Coordinates, DataType, Image, Labels, Pyramid, PyramidShape, Sample, Tiling, halved, halved_labels,
    shard_bytes,
};
use serde_json::{Map, json};

/// Width and height.
const SIDE: usize = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).ok_or("usage: image FOLDER")?);
    let tiling = Tiling { chunk: 128, shard: 256, planes: 1 };
    let shape =
        PyramidShape { kind: DataType::U8, channels: None, planes: None, height: SIDE, width: SIDE, tiling, levels: 4 };
    let labels_form = PyramidShape { kind: DataType::U16, ..shape };
    let squared_distance = |i: usize| (i % SIDE).abs_diff(SIDE / 2).pow(2) + (i / SIDE).abs_diff(SIDE / 2).pow(2);
    let pixels: Vec<u8> = (0..SIDE * SIDE).map(|i| (255 - squared_distance(i) * 200 / (SIDE * SIDE)) as u8).collect();
    let ids: Vec<u16> = (0..SIDE * SIDE).map(|i| if squared_distance(i) < 90_000 { 7 } else { 0 }).collect();

    let disc = Map::from_iter([("what".to_owned(), json!("disc"))]);
    let image = Image {
        name: "disc".to_owned(),
        pyramid: Pyramid::new(&shape)?,
        coordinates: Coordinates { pixel_um: 0.25, step_um: 1.0, first_um: 0.0 },
        channels: vec![Channel {
            label: "grey".to_owned(),
            color: [255; 3],
            range: [0.0, 255.0],
            window: [0.0, 255.0],
        }],
        plane: 0,
        labels: vec![Labels {
            name: "discs".to_owned(),
            pyramid: Pyramid::new(&labels_form)?,
            colors: vec![(7, [0, 158, 115, 255])],
            properties: vec![(7, disc)],
        }],
        attributes: Map::new(),
    };
    for (path, bytes) in image.documents()? {
        write(&folder.join(path), &bytes)?;
    }
    levels(&folder, &image.pyramid, pixels, halved)?;
    levels(&folder.join(image.labels[0].folder()), &image.labels[0].pyramid, ids, halved_labels)
}

/// Writes all shards of all levels.
fn levels<T: Sample>(
    folder: &std::path::Path,
    pyramid: &Pyramid,
    mut values: Vec<T>,
    halve: fn(&[T], usize) -> Vec<T>,
) -> Result<(), Box<dyn Error>> {
    for (number, array) in pyramid.levels().iter().enumerate() {
        let width = array.shape()[3];
        for shard in array.shards() {
            let block = array.block(shard)?;
            let rows = values.chunks_exact(width).skip(block.rows.start).take(block.rows.len());
            let part: Vec<T> = rows.flat_map(|row| row[block.columns.clone()].iter().copied()).collect();
            write(&folder.join(number.to_string()).join(array.file(shard)), &shard_bytes(array, shard, &part)?)?;
        }
        values = halve(&values, width);
    }
    Ok(())
}

fn write(path: &std::path::Path, bytes: &[u8]) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(path.parent().ok_or("the path has no folder")?)?;
    Ok(fs::write(path, bytes)?)
}

//! Shards are read back by this crate and by zarrs; damage is found.

#![allow(clippy::cast_possible_truncation, reason = "the numbers are small")]

use std::io::Cursor;
use std::sync::Arc;

use papsynth_zarr::{
    Array, Channel, Coordinates, DataType, Error, Image, Pyramid, PyramidShape, Sample, Shard, ShardEncoder,
    ShardReader, Tiling, halved, shard_bytes,
};
use proptest::prelude::*;
use zarrs::array::{Array as Theirs, ArraySubset, Element, ElementOwned};
use zarrs::storage::store::MemoryStore;
use zarrs::storage::{Bytes, StoreKey, WritableStorageTraits};

/// Deterministic noise.
fn noise(number: usize) -> u32 {
    let mut state = (number as u64).wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    state ^= state >> 29;
    (state.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 33) as u32
}

/// The values of an array; each seventh and the first quarter are 0.
fn values<T: Sample>(array: &Array, from: impl Fn(u32) -> T) -> Vec<T> {
    let count: usize = array.shape().iter().product();
    (0..count).map(|i| if i % 7 == 0 || i < count / 4 { T::default() } else { from(noise(i)) }).collect()
}

/// The values of a shard.
fn block_of<T: Sample>(array: &Array, all: &[T], shard: Shard) -> Vec<T> {
    let [channels, planes, rows, columns] = array.shape();
    let block = array.block(shard).unwrap();
    let mut found = Vec::new();
    for channel in 0..channels {
        for plane in block.planes.clone() {
            for row in block.rows.clone() {
                let line = ((channel * planes + plane) * rows + row) * columns;
                found.extend(&all[line + block.columns.start..line + block.columns.end]);
            }
        }
    }
    found
}

fn array(shape: &PyramidShape) -> Array {
    Pyramid::new(shape).unwrap().levels()[0].clone()
}

/// Writes all shards of an array and reads them with zarrs.
fn read_by_zarrs<T: Sample + Element + ElementOwned>(array: &Array, all: &[T]) -> Vec<T> {
    let store = Arc::new(MemoryStore::new());
    let put = |path: &str, bytes: Vec<u8>| {
        store.set(&StoreKey::new(path).unwrap(), Bytes::from(bytes)).unwrap();
    };
    put("0/zarr.json", array.document().to_string().into_bytes());
    for shard in array.shards() {
        let bytes = shard_bytes(array, shard, &block_of(array, all, shard)).unwrap();
        put(&format!("0/{}", array.file(shard)), bytes);
    }
    let theirs = Theirs::open(store, "/0").unwrap();
    let whole = ArraySubset::new_with_shape(theirs.shape().to_vec());
    theirs.retrieve_array_subset::<Vec<T>>(&whole).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn shards_are_read_back_by_this_crate_and_by_zarrs(
        [width, height, chunk] in [1_usize..70, 1_usize..70, 1_usize..20],
        doublings in 0_u32..3,
        channels in prop::option::of(1_usize..4),
        planes in prop::option::of(1_usize..5),
        shard_planes in 1_usize..4,
        kind in 0..4,
    ) {
        let tiling = Tiling { chunk, shard: chunk << doublings, planes: shard_planes };
        let shape = |kind| PyramidShape { kind, channels, planes, height, width, tiling, levels: 1 };
        match kind {
            0 => agree(&array(&shape(DataType::U8)), |v| v as u8)?,
            1 => agree(&array(&shape(DataType::U16)), |v| v as u16)?,
            2 => agree(&array(&shape(DataType::U32)), |v| v)?,
            _ => agree(&array(&shape(DataType::F32)), |v| v as f32 / 7.0)?,
        }
    }
}

fn agree<T: Sample + Element + ElementOwned + std::fmt::Debug>(
    array: &Array,
    from: impl Fn(u32) -> T,
) -> Result<(), TestCaseError> {
    let all = values(array, from);
    prop_assert_eq!(&read_by_zarrs(array, &all), &all);
    let [channels, _, _, columns] = array.shape();
    for shard in array.shards() {
        let due = block_of(array, &all, shard);
        let bytes = shard_bytes(array, shard, &due).unwrap();
        let mut reader = ShardReader::open(array, shard, Cursor::new(&bytes)).unwrap();
        let block = reader.block().clone();
        let mut found = Vec::new();
        for channel in 0..channels {
            for plane in block.planes.clone() {
                found.extend(reader.plane::<T>(channel, plane).unwrap());
            }
        }
        prop_assert_eq!(&found, &due);
        // A region in the centre of the last plane.
        let part = |range: &std::ops::Range<usize>| range.start + range.len() / 3..range.end - range.len() / 4;
        let (rows, wide) = (part(&block.rows), part(&block.columns));
        let plane = block.planes.end - 1;
        let region = reader.region::<T>(channels - 1, plane, rows.clone(), wide.clone()).unwrap();
        let [_, planes, height, _] = array.shape();
        let at = |y: usize, x: usize| all[(((channels - 1) * planes + plane) * height + y) * columns + x];
        let due: Vec<T> = rows.flat_map(|y| wide.clone().map(move |x| (y, x))).map(|(y, x)| at(y, x)).collect();
        prop_assert_eq!(region, due);
    }
    Ok(())
}

/// Three channels and two planes in several chunks.
fn small() -> Array {
    let tiling = Tiling { chunk: 8, shard: 32, planes: 2 };
    array(&PyramidShape {
        kind: DataType::U16,
        channels: Some(3),
        planes: Some(2),
        height: 20,
        width: 29,
        tiling,
        levels: 1,
    })
}

#[test]
fn planes_are_written_in_any_order_and_all_are_required() {
    let (array, shard) = (small(), Shard::default());
    let all = values(&array, |v| v as u16);
    let pixels = array.block(shard).unwrap().pixels();
    let mut encoder = ShardEncoder::new(&array, shard).unwrap();
    let mut bytes = Vec::new();
    for (plane, channel) in [(1, 2), (0, 0), (1, 0), (0, 2), (0, 1), (1, 1)] {
        bytes.extend(encoder.plane(channel, plane, &all[(channel * 2 + plane) * pixels..][..pixels]).unwrap());
    }
    assert!(encoder.plane(1, 1, &all[..pixels]).unwrap_err().to_string().contains("already written"));
    bytes.extend(encoder.end().unwrap());
    let mut reader = ShardReader::open(&array, shard, Cursor::new(&bytes)).unwrap();
    assert_eq!(reader.plane::<u16>(2, 1).unwrap(), all[5 * pixels..]);
    // Equal values give equal bytes.
    assert_eq!(shard_bytes(&array, shard, &all).unwrap(), shard_bytes(&array, shard, &all).unwrap());
    let mut encoder = ShardEncoder::new(&array, shard).unwrap();
    assert!(encoder.plane(0, 0, &[0_u8; 580]).unwrap_err().to_string().contains("uint8 to an array of uint16"));
    assert!(encoder.plane(0, 0, &[0_u16; 579]).unwrap_err().to_string().contains("579 values"));
    assert!(encoder.plane(3, 0, &[0_u16; 580]).is_err() && encoder.plane(0, 2, &[0_u16; 580]).is_err());
    assert!(encoder.end().unwrap_err().to_string().contains("channel 0 of plane 0 is missing"));
    assert!(shard_bytes(&array, shard, &all[1..]).is_err());
    assert!(ShardEncoder::new(&array, Shard { z: 1, y: 0, x: 0 }).is_err());
    assert!(reader.plane::<u8>(0, 0).is_err() && reader.plane::<u16>(3, 0).is_err());
    assert!(reader.region::<u16>(0, 0, 0..21, 0..1).is_err());
}

/// Reads all planes of a shard.
fn read_all(array: &Array, bytes: &[u8]) -> Result<Vec<u16>, Error> {
    let mut reader = ShardReader::open(array, Shard::default(), Cursor::new(bytes))?;
    let mut found = Vec::new();
    for (channel, plane) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
        found.extend(reader.plane::<u16>(channel, plane)?);
    }
    Ok(found)
}

#[test]
fn zeros_are_written_and_flipped_bits_and_missing_bytes_are_found() {
    let array = small();
    let all = values(&array, |v| v as u16);
    let bytes = shard_bytes(&array, Shard::default(), &all).unwrap();
    assert_eq!(read_all(&array, &bytes).unwrap(), all);
    for bit in (0..bytes.len() * 8).step_by(37) {
        let mut changed = bytes.clone();
        changed[bit / 8] ^= 1 << (bit % 8);
        // A few header bits of zstd have no effect; the values must not change.
        match read_all(&array, &changed) {
            Ok(found) => assert!(found == all, "bit {bit}"),
            Err(error) => assert!(matches!(error, Error::Damaged { .. }), "bit {bit}: {error}"),
        }
    }
    for length in (0..bytes.len()).step_by(11) {
        assert!(matches!(read_all(&array, &bytes[..length]), Err(Error::Damaged { .. })), "{length} bytes");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(matches!(read_all(&array, &longer), Err(Error::Damaged { .. })));
    // The index of an array of zeros has all chunks.
    let zeros = shard_bytes(&array, Shard::default(), &vec![0_u16; all.len()]).unwrap();
    assert_eq!(read_all(&array, &zeros).unwrap(), vec![0; all.len()]);
}

/// Changes the index of a shard and its checksum.
fn with_index(bytes: &[u8], change: impl FnOnce(&mut Vec<u64>)) -> Vec<u8> {
    // Three channels x two planes x 4 x 4 chunks.
    let data = bytes.len() - 3 * 2 * 16 * 16 - 4;
    let index = &bytes[data..bytes.len() - 4];
    let mut numbers: Vec<u64> = index.chunks(8).map(|b| u64::from_le_bytes(b.try_into().unwrap())).collect();
    change(&mut numbers);
    let index: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    let checksum = !index.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0x82F6_3B78 } else { crc >> 1 })
    });
    [&bytes[..data], &index, &checksum.to_le_bytes()].concat()
}

#[test]
fn wrong_indices_and_oversized_chunks_are_refused() {
    let array = small();
    let bytes = shard_bytes(&array, Shard::default(), &values(&array, |v| v as u16)).unwrap();
    assert!(read_all(&array, &with_index(&bytes, |_| ())).is_ok());
    let says = |bytes: Vec<u8>, what: &str| {
        let error = read_all(&array, &bytes).map(|_| ()).unwrap_err();
        assert!(matches!(error, Error::Damaged { .. }) && error.to_string().contains(what), "{error}");
    };
    says(with_index(&bytes, |index| index[..2].fill(u64::MAX)), "chunk 0 is missing");
    says(with_index(&bytes, |index| index[0] = u64::MAX - 1), "the index gives bytes ");
    says(with_index(&bytes, |index| index[1] = 1 << 60), "the index gives bytes ");
    says(with_index(&bytes, |index| index[1] -= 1), "do not belong to a chunk");
    // A chunk that overlaps the next.
    says(with_index(&bytes, |index| index[1] += 1), "more bytes than the file");
    // 29 columns have four chunks; 20 rows have three.
    says(with_index(&bytes, |index| index[24..26].fill(0)), "chunk 12 is outside");
    // A chunk that decompresses to 4 MiB, and one with a size of 2⁶⁰ bytes in its header.
    let first = {
        let mut size = 0;
        with_index(&bytes, |index| size = index[1]);
        usize::try_from(size).unwrap()
    };
    let bomb = zstd::bulk::compress(&vec![0; 1 << 22], 19).unwrap();
    let mut header = zstd::bulk::compress(&[0; 128], 3).unwrap();
    header[4] = 0xE0;
    header.splice(5..6, (1_u64 << 60).to_le_bytes());
    for chunk in [bomb, header] {
        assert!(chunk.len() < 300, "{}", chunk.len());
        let enlarged = [&chunk, &bytes[first..]].concat();
        let [grown, was] = [chunk.len() as u64, first as u64];
        let changed = with_index(&enlarged, |index| {
            index[1] = grown;
            for entry in index.chunks_mut(2).skip(1).filter(|entry| entry[0] != u64::MAX) {
                entry[0] = entry[0] + grown - was;
            }
        });
        says(changed, "chunk 0");
    }
}

proptest! {
    /// Random chunks and index entries with a valid checksum give values or an error.
    #[test]
    fn random_bytes_do_not_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        entries in prop::collection::vec((any::<prop::sample::Index>(), any::<u64>()), 0..4),
        near in any::<bool>(),
    ) {
        let array = small();
        let mut bytes = shard_bytes(&array, Shard::default(), &values(&array, |v| v as u16)).unwrap();
        let data = bytes.len() - 3 * 2 * 16 * 16 - 4;
        for (at, byte) in changes {
            bytes[at.index(data)] = byte;
        }
        let bytes = with_index(&bytes, |index| {
            for (at, number) in entries {
                let at = at.index(index.len());
                index[at] = if near { index[at].wrapping_add(number % 3).wrapping_sub(1) } else { number };
            }
        });
        match read_all(&array, &bytes) {
            Ok(found) => prop_assert_eq!(found.len(), 3 * 2 * 20 * 29),
            Err(error) => prop_assert!(matches!(error, Error::Damaged { .. }), "{}", error),
        }
    }
}

#[test]
fn a_pyramid_can_be_written_shard_by_shard() {
    let tiling = Tiling { chunk: 8, shard: 16, planes: 1 };
    let shape =
        PyramidShape { kind: DataType::U8, channels: None, planes: None, height: 83, width: 101, tiling, levels: 5 };
    let pyramid = Pyramid::new(&shape).unwrap();
    let levels = pyramid.levels();
    let all = values(&levels[0], |v| v as u8);
    let mut files: Vec<std::collections::BTreeMap<Shard, Vec<u8>>> = vec![Default::default(); levels.len()];
    for shard in levels[0].shards() {
        let mut values = block_of(&levels[0], &all, shard);
        for (level, array) in levels.iter().enumerate().take(pyramid.with_shard()) {
            files[level].insert(shard, shard_bytes(array, shard, &values).unwrap());
            values = halved(&values, array.block(shard).unwrap().columns.len());
        }
    }
    for level in pyramid.with_shard()..levels.len() {
        for shard in levels[level].shards() {
            let block = levels[level].block(shard).unwrap();
            let below = &levels[level - 1];
            let [_, _, height, width] = below.shape();
            let [rows, columns] =
                [(&block.rows, height), (&block.columns, width)].map(|(r, end)| r.start * 2..(r.end * 2).min(end));
            let mut values = Vec::new();
            for row in rows {
                let mut column = columns.start;
                while column < columns.end {
                    let from = below.shard_of(0, row, column);
                    let mut reader = ShardReader::open(below, from, Cursor::new(&files[level - 1][&from])).unwrap();
                    let end = reader.block().columns.end.min(columns.end);
                    values.extend(reader.region::<u8>(0, 0, row..row + 1, column..end).unwrap());
                    column = end;
                }
            }
            let half = halved(&values, columns.len());
            files[level].insert(shard, shard_bytes(&levels[level], shard, &half).unwrap());
        }
    }
    // The levels equal the complete image, halved at once.
    let (mut whole, mut width) = (all, shape.width);
    for (level, array) in levels.iter().enumerate() {
        for shard in array.shards() {
            let mut reader = ShardReader::open(array, shard, Cursor::new(&files[level][&shard])).unwrap();
            assert_eq!(reader.plane::<u8>(0, 0).unwrap(), block_of(array, &whole, shard), "level {level}, {shard:?}");
        }
        (whole, width) = (halved(&whole, width), width.div_ceil(2));
    }
}

#[test]
fn zarrs_reads_the_documents() {
    let channel =
        |label: &str| Channel { label: label.to_owned(), color: [255; 3], range: [0.0, 255.0], window: [0.0, 255.0] };
    let tiling = Tiling { chunk: 16, shard: 64, planes: 1 };
    let shape =
        PyramidShape { kind: DataType::U8, channels: Some(3), planes: None, height: 50, width: 60, tiling, levels: 2 };
    let image = Image {
        name: "one".to_owned(),
        pyramid: Pyramid::new(&shape).unwrap(),
        coordinates: Coordinates { pixel_um: 0.25, step_um: 1.0, first_um: 0.0 },
        channels: ["red", "green", "blue"].map(channel).to_vec(),
        plane: 0,
        labels: Vec::new(),
        attributes: serde_json::Map::new(),
    };
    let store = Arc::new(MemoryStore::new());
    for (path, bytes) in image.documents().unwrap() {
        store.set(&StoreKey::new(path).unwrap(), Bytes::from(bytes)).unwrap();
    }
    let group = zarrs::group::Group::open(store.clone(), "/").unwrap();
    assert_eq!(group.attributes()["ome"]["multiscales"][0]["datasets"][1]["path"], "1");
    for (level, shape) in [("/0", [3, 50, 60]), ("/1", [3, 25, 30])] {
        let array = Theirs::open(store.clone(), level).unwrap();
        assert_eq!(array.shape(), shape);
        let names: Vec<Option<String>> = array.dimension_names().clone().unwrap();
        assert_eq!(names, ["c", "y", "x"].map(|name| Some(name.to_owned())));
    }
}

//! Forged files with correct hashes.

use std::fs;

use papsynth_dataset::{Fix, ShardRecord};
use sha2::{Digest, Sha256};

use super::{fill, is_found, look, make};
use crate::support::{Scratch, contents};

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Changes a record, and updates its hash and the manifest.
fn forge_record(scratch: &Scratch, shard: u64, change: impl FnOnce(&mut ShardRecord)) {
    let name = format!("shards/{shard:06}.json");
    let mut record = ShardRecord::from_json(&fs::read(scratch.join(&name)).unwrap()).unwrap();
    change(&mut record);
    record.sha256 = String::new();
    record.sha256 = sha256(&serde_json::to_vec(&record).unwrap());
    let text = serde_json::to_vec_pretty(&record).unwrap();
    fs::write(scratch.join(&name), &text).unwrap();
    let entry = |path: &str, bytes: usize, sha: &str| {
        format!("{{\"path\":\"{path}\",\"bytes\":{bytes},\"sha256\":\"{sha}\",\"shard\":{shard}}}")
    };
    let mut entries: Vec<String> =
        record.files.iter().map(|file| entry(&file.path, file.bytes as usize, &file.sha256)).collect();
    entries.push(entry(&name, text.len(), &sha256(&text)));
    // The entries of a shard are consecutive lines.
    let manifest = fs::read_to_string(scratch.join("manifest.json")).unwrap();
    let (head, list) = manifest.split_once("\"files\":[\n").unwrap();
    let lines: Vec<&str> = list.trim_end().trim_end_matches("]}").split(",\n").collect();
    let is_own = |line: &&&str| line.ends_with(&format!("\"shard\":{shard}}}"));
    let first = lines.iter().position(|line| is_own(&line)).unwrap();
    let others = |range: &[&str]| range.iter().filter(|l| !is_own(l)).map(|&l| l.to_owned()).collect::<Vec<_>>();
    let all = [others(&lines[..first]), entries, others(&lines[first..])].concat().join(",\n");
    fs::write(scratch.join("manifest.json"), format!("{head}\"files\":[\n{all}]}}\n")).unwrap();
}

/// Changes a file of a shard and updates all hashes.
fn forge(scratch: &Scratch, shard: u64, name: &str, bytes: &[u8]) {
    fs::write(scratch.join(name), bytes).unwrap();
    forge_record(scratch, shard, |record| {
        let file = record.files.iter_mut().find(|file| file.path == name).unwrap();
        (file.bytes, file.sha256) = (bytes.len() as u64, sha256(bytes));
    });
}

/// Restores the original files.
fn restore(scratch: &Scratch, files: &[(String, Vec<u8>)]) {
    files.iter().for_each(|(name, bytes)| fs::write(scratch.join(name), bytes).unwrap());
}

fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect(from);
    [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
}

/// Returns a tar file with changed entries.
fn tar_with(bytes: &[u8], change: impl FnOnce(&mut Vec<(String, Vec<u8>)>)) -> Vec<u8> {
    let mut archive = tar::Archive::new(bytes);
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for entry in archive.entries().unwrap() {
        let mut entry = entry.unwrap();
        let name = entry.path().unwrap().to_string_lossy().into_owned();
        let mut content = Vec::new();
        std::io::Read::read_to_end(&mut entry, &mut content).unwrap();
        files.push((name, content));
    }
    change(&mut files);
    let mut builder = tar::Builder::new(Vec::new());
    for (name, content) in files {
        let mut header = tar::Header::new_ustar();
        header.set_size(content.len() as u64);
        header.set_mode(0o644);
        header.set_mtime(0);
        builder.append_data(&mut header, name, content.as_slice()).unwrap();
    }
    builder.into_inner().unwrap()
}

/// Returns OME-Zarr shards of other labels, planes or frames, and changed metadata; each file is valid.
#[cfg(feature = "zarr")]
fn forged_zarr(files: &[(String, Vec<u8>)]) -> Vec<(&str, Vec<u8>)> {
    let [stack, image] = ["ome-zarr/000000.ome.zarr", "ome-zarr/000001.ome.zarr"];
    let file = |group: &str, name: &str| {
        let name = format!("{group}/{name}");
        let (name, bytes) = files.iter().find(|(found, _)| *found == name).expect(&name);
        (name.as_str(), bytes.as_slice())
    };
    let mut forgeries = Vec::new();
    for name in ["0/c/0/0/0", "labels/cytoplasm-1/0/c/0/0"] {
        let (name, bytes) = file(stack, name);
        forgeries.extend([50, 75, 95].map(|percent| (name, bytes[..bytes.len() * percent / 100].to_vec())));
        forgeries.push((name, Vec::new()));
    }
    for (to, from) in [
        ("labels/cytoplasm-0/0/c/0/0", "labels/cytoplasm-1/0/c/0/0"),
        ("labels/nucleus-0/0/c/0/0", "labels/debris-0/0/c/0/0"),
        ("labels/nucleus-0/zarr.json", "labels/debris-0/zarr.json"),
        ("labels/zarr.json", "zarr.json"),
        ("0/zarr.json", "labels/debris-0/0/zarr.json"),
    ] {
        forgeries.push((file(image, to).0, file(image, from).1.to_vec()));
    }
    forgeries.push((file(image, "labels/cytoplasm-0/0/c/0/0").0, file(stack, "labels/cytoplasm-0/0/c/0/0").1.to_vec()));
    for (name, from, to) in [
        ("zarr.json", "micrometer", "nanometer"),
        ("zarr.json", "\"end\": 255.0", "\"end\": 155.0"),
        ("0/zarr.json", "uint8", "uint16"),
        ("labels/cytoplasm-0/zarr.json", "NILM", "HSIL"),
        ("labels/nucleus-0/zarr.json", "\"parent\": 1", "\"parent\": 2"),
        ("labels/zarr.json", "\"debris-0\"", "\"debris-1\""),
    ] {
        let (name, bytes) = file(stack, name);
        forgeries.push((name, replaced(bytes, from, to)));
    }
    // Swapped planes.
    let (name, bytes) = file(stack, "0/c/0/0/0");
    let [index, checksum] = [bytes.len() - 36, bytes.len() - 4];
    let entries = [&bytes[index + 16..checksum], &bytes[index..index + 16]].concat();
    let crc = !entries.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0x82F6_3B78 } else { crc >> 1 })
    });
    forgeries.push((name, [&bytes[..index], &entries, &crc.to_le_bytes()].concat()));
    forgeries
}

#[test]
fn inconsistent_files_with_correct_hashes_are_found() {
    let scratch = make("forged");
    let files = contents(scratch.path());
    let of = |name: &str| files.iter().find(|(n, _)| n == name).unwrap().1.as_slice();
    let coco = "shards/000000.coco.json";
    // Forging alone is not found.
    forge(&scratch, 0, coco, &[of(coco), b"\n"].concat());
    let report = look(scratch.path());
    assert!(report.root.is_some(), "{report:?}");
    restore(&scratch, &files);

    let mut forgeries: Vec<(&str, Vec<u8>)> = Vec::new();
    let stacks = ["images/000000.ome.tif", "ome-tiff/000000.ome.tif"];
    let tiffs = ["ome-tiff/000000.cytoplasm.ome.tif", "noise-free/000000.tif", "labels/nucleus/000000.tif"];
    for (name, percent) in stacks.into_iter().chain(tiffs).flat_map(|name| [50, 75, 95].map(|p| (name, p))) {
        forgeries.push((name, of(name)[..of(name).len() * percent / 100].to_vec()));
    }
    for name in stacks {
        forgeries.push((name, replaced(of(name), " SizeZ=\"2\"", " SizeZ=\"9\"")));
        forgeries.push((name, replaced(of(name), " PhysicalSizeX=\"0.25\"", " PhysicalSizeX=\"0.52\"")));
    }
    // Floating-point labels, and labels of another group, policy or frame.
    forgeries.push(("labels/nucleus/000001.tif", of("noise-free/000001.tif").to_vec()));
    forgeries.push(("labels/nucleus/000001.tif", of("labels/cytoplasm/000001.tif").to_vec()));
    forgeries.push(("labels/semantic/000000.png", of("labels/semantic/000001.png").to_vec()));
    forgeries.push(("labels/layers/000000.tif", of("labels/layers/000001.tif").to_vec()));
    forgeries.push(("ome-tiff/000001.nucleus.ome.tif", of("ome-tiff/000001.debris.ome.tif").to_vec()));
    forgeries.push(("cellpose/nucleus/000001_masks.tif", of("cellpose/nucleus/000000_masks.tif").to_vec()));
    forgeries.push(("stardist/cytoplasm/masks/000001.tif", of("stardist/nucleus/masks/000001.tif").to_vec()));
    // Images that differ from those in other formats.
    forgeries.push(("cellpose/nucleus/000001.tif", of("cellpose/nucleus/000000.tif").to_vec()));
    forgeries.push(("qupath/000001.ome.tif", of("qupath/000000.ome.tif").to_vec()));
    // Outlines and tables.
    let yolo = files.iter().find(|(name, _)| name.ends_with("000001.txt")).unwrap();
    forgeries.push((&yolo.0, yolo.1.split_inclusive(|&b| b == b'\n').skip(1).flatten().copied().collect()));
    forgeries.push(("qupath/000000.geojson", replaced(of("qupath/000000.geojson"), "\"cell\"", "\"annotation\"")));
    forgeries.push(("objects/000000.csv", replaced(of("objects/000000.csv"), "NILM", "HSIL")));
    forgeries.push((coco, replaced(of(coco), "\"iscrowd\":0", "\"iscrowd\":1")));
    forgeries.push((coco, replaced(of(coco), "\"semantic_class\":\"nucleus\"", "\"semantic_class\":\"shred\"")));
    // COCO: a truncated mask; wrong boxes, areas, visible masks, parents and categories.
    let text = String::from_utf8(of(coco).to_vec()).unwrap();
    let first = |key: &str, until: char| {
        let at = text.find(&format!("\"{key}\":")).unwrap() + key.len() + 3;
        (at, at + text[at..].find(until).unwrap())
    };
    let (from, to) = first("counts", '}');
    forgeries.push((coco, [&text[..to - 3], &text[to - 1..]].concat().into_bytes()));
    let counts = &text[from..to];
    for (key, until, value) in [
        ("area", ',', "7"),
        ("bbox", ']', "[1,2,3,4"),
        ("visible_area", ',', "7"),
        ("category_id", ',', "9"),
        ("image_id", ',', "1"),
        ("object_id", ',', "77"),
        ("depth_um", ',', "9.5"),
        ("width", ',', "71"),
        ("file_name", ',', "\"images/000001.png\""),
    ] {
        let (from, to) = first(key, until);
        forgeries.push((coco, [&text[..from], value, &text[to..]].concat().into_bytes()));
    }
    // The complete mask as the visible mask: it overlaps a nearer cell.
    let (from, to) = first("visible", '}');
    let (area, _) = first("area", ',');
    let area = text[area..].split(',').next().unwrap();
    let visible = text[from..to].replace(text[from..to].split("\"counts\":").nth(1).unwrap(), counts);
    let forged = [&text[..from], &visible, &text[to..]].concat();
    let at = forged.find("\"visible_area\":").unwrap() + 15;
    let end = at + forged[at..].find(',').unwrap();
    forgeries.push((coco, [&forged[..at], area, &forged[end..]].concat().into_bytes()));
    // Tar files.
    let tar = "webdataset/000000.tar";
    forgeries.push((tar, of(tar)[..of(tar).len() / 2].to_vec()));
    forgeries.push((tar, tar_with(of(tar), |files| drop(files.pop()))));
    forgeries.push((tar, tar_with(of(tar), |files| files.push(("000009.png".to_owned(), Vec::new())))));
    forgeries.push((tar, tar_with(of(tar), |files| files.swap(1, 2))));
    forgeries.push((tar, tar_with(of(tar), |files| files[3].1 = files[4].1.clone())));
    forgeries.push((tar, tar_with(of(tar), |files| files[0].1 = replaced(&files[0].1, "\"area\":", "\"area\":1"))));
    forgeries.push((
        tar,
        tar_with(of(tar), |files| {
            let image = files.iter().find(|(name, _)| name == "000000.all-in-focus.png").unwrap().1.clone();
            files.iter_mut().find(|(name, _)| name == "000001.png").unwrap().1 = image;
        }),
    ));
    #[cfg(feature = "zarr")]
    forgeries.extend(forged_zarr(&files));
    for (number, (name, bytes)) in forgeries.iter().enumerate() {
        forge(&scratch, 0, name, bytes);
        let report = look(scratch.path());
        assert!(report.root.is_none(), "forgery {number} in {name}");
        // Of two different files the first is reported.
        assert!(report.findings.iter().all(|finding| finding.fix == Fix::Generate), "{report:?}");
        restore(&scratch, &files);
    }
    assert!(look(scratch.path()).root.is_some());
}

#[test]
fn forged_records_are_found() {
    let scratch = make("records");
    let files = contents(scratch.path());
    let forgeries: [fn(&mut ShardRecord); 8] = [
        |record| record.frames[0].planes_um.push(9.0),
        |record| record.frames[0].planes_um[1] = 9.0,
        |record| record.frames[1].pixel_um = 0.5,
        |record| record.frames[1].width = 71,
        |record| record.frames[1].occluded_px.values_mut().for_each(|px| *px += 1),
        |record| record.frames[1].objects.values_mut().for_each(|count| *count += 1),
        |record| record.frames[0].saturated_px[1] = 0,
        |record| drop(record.frames.pop()),
    ];
    for (number, change) in forgeries.into_iter().enumerate() {
        forge_record(&scratch, 0, change);
        assert!(look(scratch.path()).root.is_none(), "forgery {number}");
        restore(&scratch, &files);
    }
    // Removes each file of a shard and its entries in all lists.
    for (name, _) in files.iter().filter(|(name, _)| name.contains('/') && !name.ends_with("data.yaml")) {
        if ["shards/000000.json", "shards/000001.json"].contains(&name.as_str()) {
            continue;
        }
        let record =
            |shard| ShardRecord::from_json(&fs::read(scratch.join(&format!("shards/{shard:06}.json"))).unwrap());
        let shard = u64::from(record(1).unwrap().files.iter().any(|file| file.path == *name));
        forge_record(&scratch, shard, |record| record.files.retain(|file| file.path != *name));
        fs::remove_file(scratch.join(name)).unwrap();
        let report = look(scratch.path());
        assert!(is_found(&report, name), "{name}: {report:?}");
        restore(&scratch, &files);
    }
    assert!(look(scratch.path()).root.is_some());
}

/// Changes or removes a merged file, and updates the list of files.
fn forge_merged(scratch: &Scratch, name: &str, bytes: Option<&[u8]>) {
    let manifest = fs::read_to_string(scratch.join("manifest.json")).unwrap();
    let (head, list) = manifest.split_once("\"files\":[\n").unwrap();
    let own = format!("{{\"path\":\"{name}\",");
    let entry = |bytes: &[u8]| format!("{own}\"bytes\":{},\"sha256\":\"{}\"}}", bytes.len(), sha256(bytes));
    let lines = list.trim_end().trim_end_matches("]}").split(",\n");
    let lines = lines.filter_map(|line| match line.starts_with(&own) {
        true => bytes.map(entry),
        false => Some(line.to_owned()),
    });
    let list = lines.collect::<Vec<_>>().join(",\n");
    assert!(bytes.is_none() || list.contains(&own), "{name} is listed");
    fs::write(scratch.join("manifest.json"), format!("{head}\"files\":[\n{list}]}}\n")).unwrap();
    match bytes {
        Some(bytes) => fs::write(scratch.join(name), bytes).unwrap(),
        None => fs::remove_file(scratch.join(name)).unwrap(),
    }
}

#[test]
fn merged_files_are_compared_with_the_shards() {
    for frames_per_shard in [1, 2] {
        let scratch = Scratch::new(&format!("merged-{frames_per_shard}"));
        fill(scratch.path(), frames_per_shard);
        let files = contents(scratch.path());
        let whole = look(scratch.path());
        assert!(whole.root.is_some(), "{whole:?}");
        let text =
            String::from_utf8(files.iter().find(|(name, _)| name == "manifest.json").unwrap().1.clone()).unwrap();
        let of_no_shard = text.lines().skip(1).filter(|line| !line.contains("\"shard\":"));
        let merged: Vec<&str> = of_no_shard.map(|line| line.split('"').nth(3).unwrap()).collect();
        let by_frame =
            ["coco.json", "objects.csv"].into_iter().chain(cfg!(feature = "parquet").then_some("objects.parquet"));
        let always = ["README.md", "contact-sheet.png", "croissant.json", "model.json", "recipe.toml", "splits.csv"];
        assert!(always.iter().all(|name| merged.contains(name)), "{merged:?}");
        assert!(by_frame.clone().all(|name| merged.contains(&name) == (frames_per_shard == 1)), "{merged:?}");
        let of = |name: &str| files.iter().find(|(n, _)| n == name).unwrap().1.as_slice();
        let mut forgeries: Vec<(&str, Option<Vec<u8>>)> = Vec::new();
        for &name in &merged {
            forgeries.push((name, None));
            forgeries.push((name, Some([of(name), b"\n"].concat())));
        }
        // Valid files with changed content.
        let change = |name, from: &str, to: &str| (name, Some(replaced(of(name), from, to)));
        forgeries.push(change("splits.csv", "train", "test"));
        forgeries.push(change("README.md", "| frames | 3 |", "| frames | 4 |"));
        forgeries.push(change("README.md", "cc0-1.0", "mit"));
        forgeries.push(change("croissant.json", "sc:Integer", "sc:Text"));
        forgeries.push(change("recipe.toml", "pixel_um", "pixel_um = 0.5 #"));
        if frames_per_shard == 1 {
            forgeries.push(change("coco.json", "\"area\":", "\"area\":1"));
            forgeries.push(change("coco.json", "intermediate nucleus", "superficial nucleus"));
            forgeries.push(change("coco.json", "\"id\":1", "\"id\":2"));
            forgeries.push(change("objects.csv", "NILM", "HSIL"));
        }
        for (name, bytes) in forgeries {
            forge_merged(&scratch, name, bytes.as_deref());
            let report = look(scratch.path());
            assert!(is_found(&report, name), "{name}: {report:?}");
            assert!(report.findings.iter().all(|finding| finding.fix == Fix::Generate), "{report:?}");
            // The next run repairs the file.
            fill(scratch.path(), frames_per_shard);
            assert_eq!(contents(scratch.path()), files, "{name}");
        }
        assert_eq!(look(scratch.path()), whole);
    }
}

#[test]
fn categories_are_those_of_the_recipe_everywhere() {
    let scratch = make("categories");
    let files = contents(scratch.path());
    // In the document of a shard, in a category without objects.
    let coco = "shards/000000.coco.json";
    let text = files.iter().find(|(name, _)| name == coco).unwrap();
    for (from, to) in [("\"mucus\"", "\"nucleus\""), ("\"debris\"", "\"nucleus\""), ("synthetic", "real")] {
        forge(&scratch, 0, coco, &replaced(&text.1, from, to));
        assert!(is_found(&look(scratch.path()), coco), "{from}");
        restore(&scratch, &files);
    }
    // In every document and in the head of the manifest, with an updated hash.
    for shard in 0..2 {
        let coco = format!("shards/{shard:06}.coco.json");
        let text = fs::read(scratch.join(&coco)).unwrap();
        forge(&scratch, shard, &coco, &replaced(&text, "\"mucus\"", "\"sulcum\""));
    }
    let manifest = fs::read_to_string(scratch.join("manifest.json")).unwrap();
    let (head, list) = manifest.split_once(",\"files\":").unwrap();
    let seal = "\"head_sha256\":\"";
    let (head, _) = head.split_once(seal).unwrap();
    let head = format!("{}{seal}", head.replace("\"mucus\"", "\"sulcum\""));
    let hash = sha256(format!("{head}\"}}").as_bytes());
    fs::write(scratch.join("manifest.json"), format!("{head}{hash}\",\"files\":{list}")).unwrap();
    let report = look(scratch.path());
    assert!(is_found(&report, "manifest.json"), "{report:?}");
    assert!(report.findings[0].message.contains("categories"), "{report:?}");
}

#[test]
#[cfg(not(feature = "parquet"))]
fn tables_without_a_record_are_missing_also_in_builds_without_parquet() {
    let scratch = make("no-parquet");
    for shard in 0..2 {
        forge_record(&scratch, shard, |record| record.layout.objects_parquet = true);
    }
    let manifest = fs::read_to_string(scratch.join("manifest.json")).unwrap();
    let (head, list) = manifest.split_once(",\"files\":").unwrap();
    let (seal, flatten) = ("\"head_sha256\":\"", "\"flatten\":\"top\"");
    let (head, _) = head.split_once(seal).unwrap();
    assert!(head.contains(flatten));
    let head = format!("{}{seal}", head.replace(flatten, &format!("{flatten},\"objects_parquet\":true")));
    let hash = sha256(format!("{head}\"}}").as_bytes());
    fs::write(scratch.join("manifest.json"), format!("{head}{hash}\",\"files\":{list}")).unwrap();
    let report = papsynth_dataset::verify(scratch.path(), None).unwrap();
    assert!((0..2).all(|shard| is_found(&report, &format!("objects/{shard:06}.parquet"))), "{report:?}");
}

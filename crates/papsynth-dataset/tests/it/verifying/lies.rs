//! What somebody plants who mends every hash.

use std::fs;

use papsynth_dataset::{Mend, ShardRecord};
use sha2::{Digest, Sha256};

use super::{fill, is_found, look, make};
use crate::support::{Scratch, contents};

fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Changes a record and mends its own hash and the manifest, so that no hash tells.
fn lie_in_record(scratch: &Scratch, shard: u64, change: impl FnOnce(&mut ShardRecord)) {
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
    // The entries of a shard stand together, a line each.
    let manifest = fs::read_to_string(scratch.join("manifest.json")).unwrap();
    let (head, list) = manifest.split_once("\"files\":[\n").unwrap();
    let lines: Vec<&str> = list.trim_end().trim_end_matches("]}").split(",\n").collect();
    let is_own = |line: &&&str| line.ends_with(&format!("\"shard\":{shard}}}"));
    let first = lines.iter().position(|line| is_own(&line)).unwrap();
    let others = |range: &[&str]| range.iter().filter(|l| !is_own(l)).map(|&l| l.to_owned()).collect::<Vec<_>>();
    let all = [others(&lines[..first]), entries, others(&lines[first..])].concat().join(",\n");
    fs::write(scratch.join("manifest.json"), format!("{head}\"files\":[\n{all}]}}\n")).unwrap();
}

/// Changes a file of a shard and mends every hash.
fn lie(scratch: &Scratch, shard: u64, name: &str, bytes: &[u8]) {
    fs::write(scratch.join(name), bytes).unwrap();
    lie_in_record(scratch, shard, |record| {
        let file = record.files.iter_mut().find(|file| file.path == name).unwrap();
        (file.bytes, file.sha256) = (bytes.len() as u64, sha256(bytes));
    });
}

/// Puts back what was there.
fn restore(scratch: &Scratch, files: &[(String, Vec<u8>)]) {
    files.iter().for_each(|(name, bytes)| fs::write(scratch.join(name), bytes).unwrap());
}

fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect(from);
    [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
}

/// The files of a tar file, of which some are changed.
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

/// Shards of other labels, planes or frames, and documents that say something else; each is a file as whole as the right one.
#[cfg(feature = "zarr")]
fn lies_of_zarr(files: &[(String, Vec<u8>)]) -> Vec<(&str, Vec<u8>)> {
    let [stack, image] = ["ome-zarr/000000.ome.zarr", "ome-zarr/000001.ome.zarr"];
    let file = |group: &str, name: &str| {
        let name = format!("{group}/{name}");
        let (name, bytes) = files.iter().find(|(found, _)| *found == name).expect(&name);
        (name.as_str(), bytes.as_slice())
    };
    let mut lies = Vec::new();
    for name in ["0/c/0/0/0", "labels/cytoplasm-1/0/c/0/0"] {
        let (name, bytes) = file(stack, name);
        lies.extend([50, 75, 95].map(|percent| (name, bytes[..bytes.len() * percent / 100].to_vec())));
        lies.push((name, Vec::new()));
    }
    for (to, from) in [
        ("labels/cytoplasm-0/0/c/0/0", "labels/cytoplasm-1/0/c/0/0"),
        ("labels/nucleus-0/0/c/0/0", "labels/debris-0/0/c/0/0"),
        ("labels/nucleus-0/zarr.json", "labels/debris-0/zarr.json"),
        ("labels/zarr.json", "zarr.json"),
        ("0/zarr.json", "labels/debris-0/0/zarr.json"),
    ] {
        lies.push((file(image, to).0, file(image, from).1.to_vec()));
    }
    lies.push((file(image, "labels/cytoplasm-0/0/c/0/0").0, file(stack, "labels/cytoplasm-0/0/c/0/0").1.to_vec()));
    for (name, from, to) in [
        ("zarr.json", "micrometer", "nanometer"),
        ("zarr.json", "\"end\": 255.0", "\"end\": 155.0"),
        ("0/zarr.json", "uint8", "uint16"),
        ("labels/cytoplasm-0/zarr.json", "NILM", "HSIL"),
        ("labels/nucleus-0/zarr.json", "\"parent\": 1", "\"parent\": 2"),
        ("labels/zarr.json", "\"debris-0\"", "\"debris-1\""),
    ] {
        let (name, bytes) = file(stack, name);
        lies.push((name, replaced(bytes, from, to)));
    }
    // The planes in another order.
    let (name, bytes) = file(stack, "0/c/0/0/0");
    let [index, checksum] = [bytes.len() - 36, bytes.len() - 4];
    let entries = [&bytes[index + 16..checksum], &bytes[index..index + 16]].concat();
    let crc = !entries.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0x82F6_3B78 } else { crc >> 1 })
    });
    lies.push((name, [&bytes[..index], &entries, &crc.to_le_bytes()].concat()));
    lies
}

/// What readers overlook, planted by somebody who mends every hash.
#[test]
fn what_does_not_fit_together_is_found_although_every_hash_is_right() {
    let scratch = make("lies");
    let files = contents(scratch.path());
    let of = |name: &str| files.iter().find(|(n, _)| n == name).unwrap().1.as_slice();
    let coco = "shards/000000.coco.json";
    // The mending itself is not what is found.
    lie(&scratch, 0, coco, &[of(coco), b"\n"].concat());
    let verdict = look(scratch.path());
    assert!(verdict.root.is_some(), "{verdict:?}");
    restore(&scratch, &files);

    let mut lies: Vec<(&str, Vec<u8>)> = Vec::new();
    let stacks = ["images/000000.ome.tif", "ome-tiff/000000.ome.tif"];
    let tiffs = ["ome-tiff/000000.cytoplasm.ome.tif", "noise-free/000000.tif", "labels/nucleus/000000.tif"];
    for (name, percent) in stacks.into_iter().chain(tiffs).flat_map(|name| [50, 75, 95].map(|p| (name, p))) {
        lies.push((name, of(name)[..of(name).len() * percent / 100].to_vec()));
    }
    for name in stacks {
        lies.push((name, replaced(of(name), " SizeZ=\"2\"", " SizeZ=\"9\"")));
        lies.push((name, replaced(of(name), " PhysicalSizeX=\"0.25\"", " PhysicalSizeX=\"0.52\"")));
    }
    // Floating-point labels, and labels of another group, policy or frame.
    lies.push(("labels/nucleus/000001.tif", of("noise-free/000001.tif").to_vec()));
    lies.push(("labels/nucleus/000001.tif", of("labels/cytoplasm/000001.tif").to_vec()));
    lies.push(("labels/layers/000000.tif", of("labels/layers/000001.tif").to_vec()));
    lies.push(("ome-tiff/000001.nucleus.ome.tif", of("ome-tiff/000001.debris.ome.tif").to_vec()));
    lies.push(("cellpose/nucleus/000001_masks.tif", of("cellpose/nucleus/000000_masks.tif").to_vec()));
    lies.push(("stardist/cytoplasm/masks/000001.tif", of("stardist/nucleus/masks/000001.tif").to_vec()));
    // Another image than in the other formats.
    lies.push(("cellpose/nucleus/000001.tif", of("cellpose/nucleus/000000.tif").to_vec()));
    lies.push(("qupath/000001.ome.tif", of("qupath/000000.ome.tif").to_vec()));
    // Outlines and tables.
    let yolo = files.iter().find(|(name, _)| name.ends_with("000001.txt")).unwrap();
    lies.push((&yolo.0, yolo.1.split_inclusive(|&b| b == b'\n').skip(1).flatten().copied().collect()));
    lies.push(("qupath/000000.geojson", replaced(of("qupath/000000.geojson"), "\"cell\"", "\"annotation\"")));
    lies.push(("objects/000000.csv", replaced(of("objects/000000.csv"), "NILM", "HSIL")));
    // COCO: a mask that is cut, and wrong boxes, areas, fronts, parents and categories.
    let text = String::from_utf8(of(coco).to_vec()).unwrap();
    let first = |key: &str, until: char| {
        let at = text.find(&format!("\"{key}\":")).unwrap() + key.len() + 3;
        (at, at + text[at..].find(until).unwrap())
    };
    let (from, to) = first("counts", '}');
    lies.push((coco, [&text[..to - 3], &text[to - 1..]].concat().into_bytes()));
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
        lies.push((coco, [&text[..from], value, &text[to..]].concat().into_bytes()));
    }
    // The complete mask as what lies in front, with its area: it overlaps the cell that is nearer.
    let (from, to) = first("visible", '}');
    let (area, _) = first("area", ',');
    let area = text[area..].split(',').next().unwrap();
    let front = text[from..to].replace(text[from..to].split("\"counts\":").nth(1).unwrap(), counts);
    let lied = [&text[..from], &front, &text[to..]].concat();
    let at = lied.find("\"visible_area\":").unwrap() + 15;
    let end = at + lied[at..].find(',').unwrap();
    lies.push((coco, [&lied[..at], area, &lied[end..]].concat().into_bytes()));
    // Tar files.
    let tar = "webdataset/000000.tar";
    lies.push((tar, of(tar)[..of(tar).len() / 2].to_vec()));
    lies.push((tar, tar_with(of(tar), |files| drop(files.pop()))));
    lies.push((tar, tar_with(of(tar), |files| files.push(("000009.png".to_owned(), Vec::new())))));
    lies.push((tar, tar_with(of(tar), |files| files.swap(1, 2))));
    lies.push((tar, tar_with(of(tar), |files| files[3].1 = files[4].1.clone())));
    lies.push((tar, tar_with(of(tar), |files| files[0].1 = replaced(&files[0].1, "\"area\":", "\"area\":1"))));
    lies.push((
        tar,
        tar_with(of(tar), |files| {
            let image = files.iter().find(|(name, _)| name == "000000.all-in-focus.png").unwrap().1.clone();
            files.iter_mut().find(|(name, _)| name == "000001.png").unwrap().1 = image;
        }),
    ));
    #[cfg(feature = "zarr")]
    lies.extend(lies_of_zarr(&files));
    for (number, (name, bytes)) in lies.iter().enumerate() {
        lie(&scratch, 0, name, bytes);
        let verdict = look(scratch.path());
        assert!(verdict.root.is_none(), "lie {number} in {name}");
        // Two files that differ are both suspect; the first is named.
        assert!(verdict.findings.iter().all(|finding| finding.mend == Mend::Generate), "{verdict:?}");
        restore(&scratch, &files);
    }
    assert!(look(scratch.path()).root.is_some());
}

#[test]
fn a_record_that_lies_is_found() {
    let scratch = make("records");
    let files = contents(scratch.path());
    let lies: [fn(&mut ShardRecord); 8] = [
        |record| record.frames[0].planes_um.push(9.0),
        |record| record.frames[0].planes_um[1] = 9.0,
        |record| record.frames[1].pixel_um = 0.5,
        |record| record.frames[1].width = 71,
        |record| record.frames[1].occluded_px.values_mut().for_each(|px| *px += 1),
        |record| record.frames[1].objects.values_mut().for_each(|count| *count += 1),
        |record| record.frames[0].saturated_px[1] = 0,
        |record| drop(record.frames.pop()),
    ];
    for (number, change) in lies.into_iter().enumerate() {
        lie_in_record(&scratch, 0, change);
        assert!(look(scratch.path()).root.is_none(), "lie {number}");
        restore(&scratch, &files);
    }
    // Each file of a shard is taken away, and out of every list.
    for (name, _) in files.iter().filter(|(name, _)| name.contains('/') && !name.ends_with("data.yaml")) {
        if ["shards/000000.json", "shards/000001.json"].contains(&name.as_str()) {
            continue;
        }
        let record =
            |shard| ShardRecord::from_json(&fs::read(scratch.join(&format!("shards/{shard:06}.json"))).unwrap());
        let shard = u64::from(record(1).unwrap().files.iter().any(|file| file.path == *name));
        lie_in_record(&scratch, shard, |record| record.files.retain(|file| file.path != *name));
        fs::remove_file(scratch.join(name)).unwrap();
        let verdict = look(scratch.path());
        assert!(is_found(&verdict, name), "{name}: {verdict:?}");
        restore(&scratch, &files);
    }
    assert!(look(scratch.path()).root.is_some());
}

/// Changes a file that is no shard's, or takes it away, and mends the list of files.
fn lie_in_merged(scratch: &Scratch, name: &str, bytes: Option<&[u8]>) {
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
fn what_is_merged_is_made_again_and_compared() {
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
        let mut lies: Vec<(&str, Option<Vec<u8>>)> = Vec::new();
        for &name in &merged {
            lies.push((name, None));
            lies.push((name, Some([of(name), b"\n"].concat())));
        }
        // Lies that a reader would believe.
        let lie = |name, from: &str, to: &str| (name, Some(replaced(of(name), from, to)));
        lies.push(lie("splits.csv", "train", "test"));
        lies.push(lie("README.md", "| frames | 3 |", "| frames | 4 |"));
        lies.push(lie("README.md", "cc0-1.0", "mit"));
        lies.push(lie("croissant.json", "sc:Integer", "sc:Text"));
        lies.push(lie("recipe.toml", "pixel_um", "pixel_um = 0.5 #"));
        if frames_per_shard == 1 {
            lies.push(lie("coco.json", "\"area\":", "\"area\":1"));
            lies.push(lie("coco.json", "intermediate nucleus", "superficial nucleus"));
            lies.push(lie("coco.json", "\"id\":1", "\"id\":2"));
            lies.push(lie("objects.csv", "NILM", "HSIL"));
        }
        for (name, bytes) in lies {
            lie_in_merged(&scratch, name, bytes.as_deref());
            let verdict = look(scratch.path());
            assert!(is_found(&verdict, name), "{name}: {verdict:?}");
            assert!(verdict.findings.iter().all(|finding| finding.mend == Mend::Generate), "{verdict:?}");
            // What makes it again mends it.
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
    // In the document of a shard: of a category that nothing is of, so that no object tells.
    let coco = "shards/000000.coco.json";
    let text = files.iter().find(|(name, _)| name == coco).unwrap();
    for (from, to) in [("\"mucus\"", "\"nucleus\""), ("\"debris\"", "\"nucleus\""), ("synthetic", "real")] {
        lie(&scratch, 0, coco, &replaced(&text.1, from, to));
        assert!(is_found(&look(scratch.path()), coco), "{from}");
        restore(&scratch, &files);
    }
    // In every document and the head of the manifest, whose own hash is mended.
    for shard in 0..2 {
        let coco = format!("shards/{shard:06}.coco.json");
        let text = fs::read(scratch.join(&coco)).unwrap();
        lie(&scratch, shard, &coco, &replaced(&text, "\"mucus\"", "\"sulcum\""));
    }
    let manifest = fs::read_to_string(scratch.join("manifest.json")).unwrap();
    let (head, list) = manifest.split_once(",\"files\":").unwrap();
    let seal = "\"head_sha256\":\"";
    let (head, _) = head.split_once(seal).unwrap();
    let head = format!("{}{seal}", head.replace("\"mucus\"", "\"sulcum\""));
    let hash = sha256(format!("{head}\"}}").as_bytes());
    fs::write(scratch.join("manifest.json"), format!("{head}{hash}\",\"files\":{list}")).unwrap();
    let verdict = look(scratch.path());
    assert!(is_found(&verdict, "manifest.json"), "{verdict:?}");
    assert!(verdict.findings[0].message.contains("categories"), "{verdict:?}");
}

#[test]
#[cfg(not(feature = "parquet"))]
fn tables_that_no_record_lists_are_missing_although_this_build_writes_none() {
    let scratch = make("no-parquet");
    for shard in 0..2 {
        lie_in_record(&scratch, shard, |record| record.layout.objects_parquet = true);
    }
    let manifest = fs::read_to_string(scratch.join("manifest.json")).unwrap();
    let (head, list) = manifest.split_once(",\"files\":").unwrap();
    let (seal, flatten) = ("\"head_sha256\":\"", "\"flatten\":\"top\"");
    let (head, _) = head.split_once(seal).unwrap();
    assert!(head.contains(flatten));
    let head = format!("{}{seal}", head.replace(flatten, &format!("{flatten},\"objects_parquet\":true")));
    let hash = sha256(format!("{head}\"}}").as_bytes());
    fs::write(scratch.join("manifest.json"), format!("{head}{hash}\",\"files\":{list}")).unwrap();
    let verdict = papsynth_dataset::verify(scratch.path(), None).unwrap();
    assert!((0..2).all(|shard| is_found(&verdict, &format!("objects/{shard:06}.parquet"))), "{verdict:?}");
}

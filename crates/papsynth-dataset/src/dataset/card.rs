//! The description of a data set: a card in Markdown, and Croissant metadata.

use std::fmt::Write;

use serde_json::{Value, json};

use super::set::{Dataset, Summary};
use crate::files::FileRecord;
use crate::formats::{Extra, Format, names};

/// Licence of the images: <https://spdx.org/licenses/CC0-1.0.html>.
const LICENCE: &str = "https://creativecommons.org/publicdomain/zero/1.0/";

const ABOUT: &str = "Synthetic bright-field microscope images of cervical smears with exact ground truth: complete (amodal) and visible masks \
                     of every cell, nucleus and piece of debris, with class, position, depth and absorbance.";

/// Returns the card in Markdown, with the YAML header of Hugging Face. `writer` is the program that wrote the data set.
pub(super) fn card(dataset: &Dataset, writer: &str, summary: &Summary) -> String {
    let identity = &dataset.identity;
    let formats = &dataset.layout.formats;
    let mut text = format!(
        "---\nlicense: cc0-1.0\ntask_categories:\n- image-segmentation\n- object-detection\ntags:\n- synthetic\n- cytology\n- \
         microscopy\n---\n\n# Synthetic cervical smears\n\n{ABOUT}\n\n## Provenance\n\n\
         | | |\n|---|---|\n| program | {writer} |\n| recipe | `recipe.toml`, SHA-256 `{}` |\n| model | `model.json`, SHA-256 \
         `{}` |\n| seed | {} |\n| stream version | {} |\n| frames | {} |\n\nThe same recipe, model, seed and stream version give \
         the same pixels, labels and tables:\n\n```sh\npapsynth generate recipe.toml --model model.json --seed {} \
         --frames N --out again\n```\n",
        identity.recipe_sha256,
        identity.model_sha256,
        identity.seed,
        identity.stream_version,
        summary.frames,
        identity.seed,
    );
    text.push_str("\n## Files\n\n| | |\n|---|---|\n");
    let mut row = |what: &str, about: &str| {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| `{what}` | {about} |");
    };
    for format in formats {
        if *format != Format::Folder {
            row(format.name(), format.about());
            continue;
        }
        let layout = &dataset.layout;
        let has = |extras: &[Extra]| extras.iter().any(|extra| layout.has_extra(*extra));
        let folders = [
            ("images/", true),
            ("preview/", has(&[Extra::Preview])),
            ("labels/", has(&[Extra::Labels, Extra::Layers, Extra::Semantic])),
            ("noise-free/", has(&[Extra::NoiseFree])),
        ];
        let folders: Vec<&str> = folders.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect();
        let about = match layout.without.is_empty() {
            true => format.about().to_owned(),
            false => format!("{}; {}", format.about(), layout.left_out()),
        };
        row(&folders.join(", "), &about);
    }
    row("shards/*.coco.json", "COCO with amodal and visible masks and all properties of every object");
    row("objects/*.csv", "the properties of every object as a table, without masks");
    if dataset.layout.objects_parquet {
        row("objects/*.parquet", "the same table with types, and with amodal and visible masks as COCO run lengths");
    }
    if dataset.layout.scenes {
        row("scenes/", "the scene of each frame as JSON; `papsynth render --scene` renders it");
    }
    row(
        "splits.csv",
        "train, val and test splits, by field and by slide (fields of a slide have the same stain and light)",
    );
    row("manifest.json, shards/*.json", "size and SHA-256 of every file; `papsynth verify` checks them");
    if formats.iter().any(|format| format.is_flat()) {
        let lost: u64 = summary.occluded_px.values().sum();
        let policy = dataset.layout.flatten.name();
        let _ = writeln!(
            text,
            "\nFormats with one label a pixel use the policy `{policy}` where objects overlap; they omit {lost} occluded mask \
             pixels ({}).",
            summary.occluded_px.iter().map(|(group, px)| format!("{group} {px}")).collect::<Vec<_>>().join(", ")
        );
    }
    if !summary.empty_splits.is_empty() {
        let empty = summary.empty_splits.join(" and ");
        let _ = writeln!(
            text,
            "\nNo slide is in the split {empty}: the data set has too few slides for splits by slide. Generate more frames, set fewer \
             fields per slide in the recipe, or use the splits by field in `splits.csv`."
        );
    }
    text.push_str("\n## Objects\n\n| category | objects |\n|---|---|\n");
    for (category, count) in &summary.objects {
        let _ = writeln!(text, "| {category} | {count} |");
    }
    text.push_str(
        "\n## Limits\n\nNo image shows a patient. Shapes and textures are drawn from statistics of real cells; properties without \
         measurements are plausible assumptions. Classes are defined by their morphology in the recipe, not by a diagnosis. \
         Results on these images do not apply to patients until they are repeated on real images.\n\n## Licence\n\nThese images are in the public domain (CC0 1.0), unless their publisher states \
         another licence.\n",
    );
    text
}

/// Returns the metadata in Croissant 1.0: <https://docs.mlcommons.org/croissant/docs/croissant-spec.html>.
pub(super) fn croissant(dataset: &Dataset, files: &[FileRecord]) -> Value {
    let object = |file: &FileRecord| {
        let encoding = match file.path.rsplit('.').next() {
            Some("csv") => "text/csv",
            Some("json") => "application/json",
            Some("tar") => "application/x-tar",
            Some("parquet") => PARQUET,
            _ => "application/octet-stream",
        };
        json!({
            "@type": "cr:FileObject", "@id": file.path, "name": file.path, "contentUrl": file.path,
            "contentSize": format!("{} B", file.bytes), "encodingFormat": encoding, "sha256": file.sha256,
        })
    };
    // One file set for each format with many frames in a file.
    let format_sets = dataset.layout.formats.iter().filter_map(|format| {
        let (includes, encoding) = match format {
            Format::Webdataset => ("webdataset/*.tar", "application/x-tar"),
            Format::Huggingface => ("huggingface/data/*.parquet", PARQUET),
            _ => return None,
        };
        Some((format.name(), includes, encoding, format.about()))
    });
    let table_sets = [
        (TABLES, "objects/*.csv", "text/csv", "tables of objects, one for each shard"),
        (PARQUET_TABLES, "objects/*.parquet", PARQUET, "tables of objects with masks, one for each shard"),
    ];
    let table_sets = table_sets.into_iter().filter(|(set, ..)| *set == TABLES || dataset.layout.objects_parquet);
    let file_set = |(name, includes, encoding, about): (&str, &str, &str, &str)| {
        json!({
            "@type": "cr:FileSet", "@id": name, "name": name, "description": about, "encodingFormat": encoding, "includes": includes,
        })
    };
    let distribution: Vec<Value> =
        files.iter().map(object).chain(format_sets.chain(table_sets).map(file_set)).collect();
    let has = |name: &str| files.iter().any(|file| file.path == name);
    let field = |set: &str, (source, id): (&str, &str), (name, kind, about): &(&str, &str, &str)| {
        json!({
            "@type": "cr:Field", "@id": format!("{set}/{name}"), "name": name, "description": about, "dataType": kind,
            "source": { source: { "@id": id }, "extract": { "column": name } },
        })
    };
    let mut sets = Vec::new();
    // If shards have many frames, objects are only in the tables of the shards.
    let objects = if has(names::TABLE) { ("fileObject", names::TABLE) } else { ("fileSet", TABLES) };
    for (set, source, about, fields) in [
        ("objects", objects, "Every object and part of a cell.", OBJECTS),
        ("splits", ("fileObject", names::SPLITS), "Split of each frame.", SPLITS),
        ("frames", ("fileSet", Format::Huggingface.name()), "Size and slide of each frame.", FRAMES),
    ] {
        let (kind, name) = source;
        let is_there = match kind {
            "fileObject" => has(name),
            _ => name == TABLES || dataset.layout.has(Format::Huggingface),
        };
        if is_there {
            let fields: Vec<Value> = fields.iter().map(|f| field(set, source, f)).collect();
            sets.push(json!({
                "@type": "cr:RecordSet", "@id": set, "name": set, "description": about, "field": fields,
            }));
        }
    }
    json!({
        "@context": context(),
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": "papsynth",
        "description": ABOUT,
        "license": LICENCE,
        "url": format!("urn:sha256:{}:{}:{}", dataset.identity.recipe_sha256, dataset.identity.model_sha256, dataset.identity.seed),
        "version": format!("{}.0.0", dataset.identity.stream_version),
        "citeAs": "Malm P, Brun A, Bengtsson E. Simulation of bright-field microscopy images depicting pap-smear specimen. \
                   Cytometry A 87 (2015) 212-226. doi:10.1002/cyto.a.22624",
        "distribution": distribution,
        "recordSet": sets,
    })
}

const PARQUET: &str = "application/x-parquet";

const TABLES: &str = "objects-csv";
const PARQUET_TABLES: &str = "objects-parquet";

const FRAMES: &[(&str, &str, &str)] = &[
    ("index", "sc:Integer", "index of the frame"),
    ("slide", "sc:Integer", "number of its slide"),
    ("width", "sc:Integer", "columns"),
    ("height", "sc:Integer", "rows"),
    ("pixel_um", "sc:Float", "size of a pixel in micrometres"),
    ("bits", "sc:Integer", "bits of a grey level"),
];

const OBJECTS: &[(&str, &str, &str)] = &[
    ("image", "sc:Integer", "index of the frame"),
    ("id", "sc:Integer", "id in the frame; nucleus and cytoplasm of a cell share it"),
    ("part", "sc:Text", "cytoplasm, nucleus or whole"),
    ("kind", "sc:Text", "kind of the object"),
    ("class", "sc:Text", "class of the cell, else the kind"),
    ("bethesda", "sc:Text", "Bethesda category of the class"),
    ("depth_um", "sc:Float", "depth in micrometres, positive towards the objective"),
    ("mean_absorbance", "sc:Float", "mean decadic absorbance"),
    ("area_um2", "sc:Float", "area of the complete object in square micrometres"),
    ("area_px", "sc:Integer", "pixels of the complete mask"),
];

const SPLITS: &[(&str, &str, &str)] = &[
    ("image", "sc:Integer", "index of the frame"),
    ("slide", "sc:Integer", "number of its slide"),
    ("by_field", "sc:Text", "split of the frame by field"),
    ("by_slide", "sc:Text", "split of the frame by slide"),
];

/// Returns the JSON-LD context of the standard.
fn context() -> Value {
    json!({
        "@language": "en", "@vocab": "https://schema.org/", "citeAs": "cr:citeAs", "column": "cr:column",
        "conformsTo": "dct:conformsTo", "cr": "http://mlcommons.org/croissant/", "rai": "http://mlcommons.org/croissant/RAI/",
        "data": { "@id": "cr:data", "@type": "@json" }, "dataType": { "@id": "cr:dataType", "@type": "@vocab" },
        "dct": "http://purl.org/dc/terms/", "examples": { "@id": "cr:examples", "@type": "@json" }, "equivalentProperty": "cr:equivalentProperty",
        "extract": "cr:extract",
        "field": "cr:field", "fileProperty": "cr:fileProperty", "fileObject": "cr:fileObject", "fileSet": "cr:fileSet",
        "format": "cr:format", "includes": "cr:includes", "isLiveDataset": "cr:isLiveDataset", "jsonPath": "cr:jsonPath",
        "key": "cr:key", "md5": "cr:md5", "parentField": "cr:parentField", "path": "cr:path", "recordSet": "cr:recordSet",
        "references": "cr:references", "regex": "cr:regex", "repeated": "cr:repeated", "replace": "cr:replace",
        "samplingRate": "cr:samplingRate", "sc": "https://schema.org/", "separator": "cr:separator", "source": "cr:source", "subField": "cr:subField",
        "transform": "cr:transform",
    })
}

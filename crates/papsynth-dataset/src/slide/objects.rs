//! What is known of the objects of a shard: a table with their masks, and their outlines as GeoJSON.

use papsynth::truth::{Mask, ObjectTruth, Part, Run};
use serde_json::{Value, json};

use crate::coco::category_name;
use crate::formats::qupath;
use crate::rle;

/// The columns. A mask stands in its box alone: the run lengths are those of an image of the box's size.
type Column = (&'static str, fn(&ObjectTruth) -> String);

const COLUMNS: [Column; 22] = [
    ("id", |o| o.id.to_string()),
    ("part", |o| crate::table::part(o.part).to_owned()),
    ("kind", |o| o.kind.name().to_owned()),
    ("class", |o| o.class.clone()),
    ("bethesda", |o| o.bethesda.clone()),
    ("traits", |o| o.traits.clone()),
    ("cluster", |o| o.cluster.to_string()),
    ("centre_x_um", |o| o.centre_um[0].to_string()),
    ("centre_y_um", |o| o.centre_um[1].to_string()),
    ("depth_um", |o| o.depth_um.to_string()),
    ("rotation_deg", |o| o.rotation_deg.to_string()),
    ("stain", |o| o.stain.to_string()),
    ("tint", |o| o.tint.to_owned()),
    ("area_um2", |o| o.area_um2.to_string()),
    ("area_px", |o| o.amodal.area().to_string()),
    ("truncated", |o| o.truncated.to_string()),
    ("bbox_x_px", |o| side(o, |b| b.x)),
    ("bbox_y_px", |o| side(o, |b| b.y)),
    ("bbox_width_px", |o| side(o, |b| b.width)),
    ("bbox_height_px", |o| side(o, |b| b.height)),
    ("defocus_um", |o| o.defocus_um.iter().map(f64::to_string).collect::<Vec<_>>().join(";")),
    ("rle", |o| run_lengths(&o.amodal)),
];

fn side(object: &ObjectTruth, side: fn(papsynth::truth::Bounds) -> u32) -> String {
    object.amodal.bounds().map_or_else(String::new, |b| side(b).to_string())
}

/// The mask in its box, as COCO writes it.
fn run_lengths(mask: &Mask) -> String {
    let Some(bounds) = mask.bounds() else { return String::new() };
    let moved = |run: &Run| Run { y: run.y - bounds.y, x0: run.x0 - bounds.x, x1: run.x1 - bounds.x };
    let within = Mask::from_runs(mask.runs().iter().map(moved).collect());
    rle::encode(&within, bounds.width as usize, bounds.height as usize)
}

/// The table of a shard.
pub(super) fn table(objects: &[ObjectTruth]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(COLUMNS.map(|(name, _)| name))?;
    for object in objects {
        writer.write_record(COLUMNS.map(|(_, print)| print(object)))?;
    }
    writer.into_inner().map_err(|e| e.into_error().into())
}

/// The outlines of a shard, in pixels of the slide: a cell is a feature with its nucleus within.
pub(super) fn collection(objects: &[ObjectTruth], seed: u64, slide: u64) -> Value {
    let find = |id: u32, part: Part| objects.iter().find(|o| o.id == id && o.part == part);
    let features: Vec<Value> = objects
        .iter()
        .filter(|object| object.part != Part::Nucleus || find(object.id, Part::Cytoplasm).is_none())
        .map(|object| {
            let nucleus = find(object.id, Part::Nucleus).filter(|_| object.part == Part::Cytoplasm);
            let mut feature = json!({
                "type": "Feature",
                "id": qupath::uuid_of(&format!("papsynth slide {seed} {slide} {} {:?}", object.id, object.part)),
                "geometry": qupath::shape(&object.amodal),
                "properties": {
                    "objectType": if object.part == Part::Cytoplasm { "cell" } else { "detection" },
                    "name": object.id.to_string(),
                    "classification": { "name": match object.part {
                        Part::Cytoplasm => object.class.clone(),
                        part => category_name(&object.class, part),
                    } },
                    "measurements": { "Area µm^2": object.area_um2, "Depth µm": object.depth_um, "Stain": object.stain },
                },
            });
            if let (Some(nucleus), Some(feature)) = (nucleus, feature.as_object_mut()) {
                feature.insert("nucleusGeometry".to_owned(), qupath::shape(&nucleus.amodal));
            }
            feature
        })
        .collect();
    json!({ "type": "FeatureCollection", "features": features })
}

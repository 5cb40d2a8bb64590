//! What is known of the objects of a shard: a table with their masks, and their outlines as GeoJSON.

use papsynth::truth::{Bounds, Mask, ObjectTruth, Part, Run};
use serde_json::{Value, json};

use crate::coco::category_name;
use crate::formats::qupath;
use crate::rle;
use crate::table::{Cell, Sort, part, text};

/// What a column is called, and what stands in it.
type Column = (&'static str, Sort, fn(&ObjectTruth) -> Cell);

/// The columns. A mask stands in its box alone: the run lengths are those of an image of the box's size.
const COLUMNS: [Column; 22] = [
    ("id", Sort::Id, |o| Cell::Id(o.id)),
    ("part", Sort::Text, |o| text(part(o.part))),
    ("kind", Sort::Text, |o| text(o.kind.name())),
    ("class", Sort::Text, |o| text(&o.class)),
    ("bethesda", Sort::Text, |o| text(&o.bethesda)),
    ("traits", Sort::Text, |o| text(&o.traits.to_string())),
    ("cluster", Sort::Id, |o| Cell::Id(o.cluster)),
    ("centre_x_um", Sort::Number, |o| Cell::Number(o.centre_um[0])),
    ("centre_y_um", Sort::Number, |o| Cell::Number(o.centre_um[1])),
    ("depth_um", Sort::Number, |o| Cell::Number(o.depth_um)),
    ("rotation_deg", Sort::Number, |o| Cell::Number(o.rotation_deg)),
    ("stain", Sort::Number, |o| Cell::Number(o.stain)),
    ("tint", Sort::Text, |o| text(o.tint_name())),
    ("area_um2", Sort::Number, |o| Cell::Number(o.area_um2)),
    ("area_px", Sort::Whole, |o| Cell::Whole(o.amodal.area())),
    ("truncated", Sort::Flag, |o| Cell::Flag(o.truncated)),
    ("bbox_x_px", Sort::WholeOrNone, |o| side(o, |b| b.x)),
    ("bbox_y_px", Sort::WholeOrNone, |o| side(o, |b| b.y)),
    ("bbox_width_px", Sort::WholeOrNone, |o| side(o, |b| b.width)),
    ("bbox_height_px", Sort::WholeOrNone, |o| side(o, |b| b.height)),
    ("defocus_um", Sort::Numbers, |o| Cell::Numbers(o.defocus_um.clone())),
    ("rle", Sort::Text, |o| Cell::Text(run_lengths(&o.amodal))),
];

fn side(object: &ObjectTruth, side: fn(Bounds) -> u32) -> Cell {
    object.amodal.bounds().map_or(Cell::Nothing, |b| Cell::Whole(side(b).into()))
}

/// The mask in its box, as COCO writes it.
fn run_lengths(mask: &Mask) -> String {
    let Some(bounds) = mask.bounds() else { return String::new() };
    let moved = |run: &Run| Run { y: run.y - bounds.y, x0: run.x0 - bounds.x, x1: run.x1 - bounds.x };
    let within = Mask::from_runs(mask.runs().iter().map(moved).collect());
    rle::encode(&within, bounds.width as usize, bounds.height as usize)
}

/// Names and sorts of the columns.
pub(super) fn columns() -> [(&'static str, Sort); COLUMNS.len()] {
    COLUMNS.map(|(name, sort, _)| (name, sort))
}

/// What stands in the columns of an object's row.
pub(super) fn cells(object: &ObjectTruth) -> impl Iterator<Item = Cell> {
    COLUMNS.into_iter().map(move |(_, _, cell)| cell(object))
}

/// The table of a shard.
pub(super) fn table(objects: &[ObjectTruth]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(COLUMNS.map(|(name, _, _)| name))?;
    for object in objects {
        writer.write_record(cells(object).map(|cell| cell.print()))?;
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

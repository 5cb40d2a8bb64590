//! The table of objects.

use papsynth::truth::{Bounds, ObjectTruth, Part, Truth};

/// An object, or a part of a cell, of an image.
struct Entry<'a> {
    image: u64,
    object: &'a ObjectTruth,
}

/// What a column is called, and what stands in it.
type Column = (&'static str, fn(&Entry) -> String);

/// The columns: what each is called and what stands in it. A number is printed with as few digits as read back to
/// it; lists have one value a plane, separated by semicolons.
const COLUMNS: [Column; 28] = [
    ("image", |e| e.image.to_string()),
    ("id", |e| e.object.id.to_string()),
    ("part", |e| part(e.object.part).to_owned()),
    ("kind", |e| e.object.kind.name().to_owned()),
    ("class", |e| e.object.class.clone()),
    ("bethesda", |e| e.object.bethesda.clone()),
    ("traits", |e| e.object.traits.clone()),
    ("cluster", |e| e.object.cluster.to_string()),
    ("centre_x_um", |e| e.object.centre_um[0].to_string()),
    ("centre_y_um", |e| e.object.centre_um[1].to_string()),
    ("depth_um", |e| e.object.depth_um.to_string()),
    ("rotation_deg", |e| e.object.rotation_deg.to_string()),
    ("stain", |e| e.object.stain.to_string()),
    ("tint", |e| e.object.tint.to_owned()),
    ("area_um2", |e| e.object.area_um2.to_string()),
    ("area_px", |e| e.object.amodal.area().to_string()),
    ("front_area_px", |e| e.object.front.area().to_string()),
    ("bbox_x_px", |e| bounds(e, |b| b.x)),
    ("bbox_y_px", |e| bounds(e, |b| b.y)),
    ("bbox_width_px", |e| bounds(e, |b| b.width)),
    ("bbox_height_px", |e| bounds(e, |b| b.height)),
    ("centroid_x_px", |e| centroid(e, 0)),
    ("centroid_y_px", |e| centroid(e, 1)),
    ("truncated", |e| e.object.truncated.to_string()),
    ("best_plane", |e| best(e).map_or_else(String::new, |plane| plane.to_string())),
    ("best_detectability", |e| best(e).map_or_else(String::new, |plane| e.object.detectability[plane].to_string())),
    ("defocus_um", |e| list(&e.object.defocus_um)),
    ("detectability", |e| list(&e.object.detectability)),
];

/// The rows of one frame, if wanted below a header, which stands even if there is no object.
pub(crate) fn table(truth: &Truth, image: u64, header: bool) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    if header {
        writer.write_record(COLUMNS.map(|(name, _)| name))?;
    }
    for object in &truth.objects {
        let entry = Entry { image, object };
        writer.write_record(COLUMNS.map(|(_, print)| print(&entry)))?;
    }
    writer.into_inner().map_err(|e| e.into_error().into())
}

pub(crate) fn part(part: Part) -> &'static str {
    match part {
        Part::Cytoplasm => "cytoplasm",
        Part::Nucleus => "nucleus",
        Part::Whole => "whole",
    }
}

fn bounds(entry: &Entry, side: fn(Bounds) -> u32) -> String {
    entry.object.amodal.bounds().map_or_else(String::new, |b| side(b).to_string())
}

fn centroid(entry: &Entry, axis: usize) -> String {
    entry.object.amodal.centroid().map_or_else(String::new, |c| c[axis].to_string())
}

/// The plane in which an object is easiest to detect; of equal ones the first.
fn best(entry: &Entry) -> Option<usize> {
    let detectability = &entry.object.detectability;
    (0..detectability.len()).reduce(|best, i| if detectability[i] > detectability[best] { i } else { best })
}

fn list(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(";")
}

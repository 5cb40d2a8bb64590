//! OME-XML: what the pages of a TIFF are.

use papsynth::truth::Group;

use crate::layout::numbered;
use crate::record::Geometry;

/// The µ of µm, as XML that is ASCII: readers of TIFF expect no other.
const MICROMETRE: &str = "&#181;m";

/// The description of a frame, one page a plane in the order of the geometry.
pub(crate) fn description(geometry: &Geometry) -> String {
    let planes = &geometry.planes_um;
    let step = match planes.as_slice() {
        [first, second, ..] => {
            format!(" PhysicalSizeZ=\"{}\" PhysicalSizeZUnit=\"{MICROMETRE}\"", (second - first).abs())
        }
        _ => String::new(),
    };
    let positions: String = planes
        .iter()
        .enumerate()
        .map(|(z, um)| {
            format!("<Plane TheZ=\"{z}\" TheC=\"0\" TheT=\"0\" PositionZ=\"{um}\" PositionZUnit=\"{MICROMETRE}\"/>")
        })
        .collect();
    image(geometry, &numbered(geometry.key.index), planes.len(), &step, &positions)
}

/// The description of a frame's picture alone.
pub(crate) fn of_picture(geometry: &Geometry) -> String {
    image(geometry, &numbered(geometry.key.index), 1, "", "")
}

fn image(geometry: &Geometry, name: &str, planes: usize, step: &str, positions: &str) -> String {
    let (bits, channels) = (geometry.bits, geometry.channels);
    let kind = if bits <= 8 { "uint8" } else { "uint16" };
    // The samples of a pixel lie side by side.
    let (order, interleaved) = if channels == 1 { ("XYZCT", "") } else { ("XYCZT", " Interleaved=\"true\"") };
    document(
        geometry,
        name,
        &format!(
            "DimensionOrder=\"{order}\"{interleaved} Type=\"{kind}\" SignificantBits=\"{bits}\" SizeZ=\"{planes}\" \
             SizeC=\"{channels}\" SizeT=\"1\"{step}"
        ),
        &format!(
            "<Channel ID=\"Channel:0:0\" SamplesPerPixel=\"{channels}\"/>\
             <TiffData IFD=\"0\" PlaneCount=\"{planes}\"/>{positions}"
        ),
    )
}

/// The description of layers of labels: each is a channel.
pub(crate) fn of_labels(geometry: &Geometry, group: Group, layers: usize, kind: &str) -> String {
    let channels: String = (0..layers)
        .map(|layer| {
            format!("<Channel ID=\"Channel:0:{layer}\" Name=\"{} {layer}\" SamplesPerPixel=\"1\"/>", group.name())
        })
        .collect();
    document(
        geometry,
        &format!("{} {}", numbered(geometry.key.index), group.name()),
        &format!("DimensionOrder=\"XYCZT\" Type=\"{kind}\" SizeZ=\"1\" SizeC=\"{layers}\" SizeT=\"1\""),
        &format!("{channels}<TiffData IFD=\"0\" PlaneCount=\"{layers}\"/>"),
    )
}

fn document(geometry: &Geometry, name: &str, attributes: &str, content: &str) -> String {
    let view = geometry.view;
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\
         <OME xmlns=\"http://www.openmicroscopy.org/Schemas/OME/2016-06\" \
         xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"http://www.openmicroscopy.org/Schemas/OME/2016-06 \
         http://www.openmicroscopy.org/Schemas/OME/2016-06/ome.xsd\" Creator=\"papsynth\">\
         <Image ID=\"Image:0\" Name=\"{name}\"><Pixels ID=\"Pixels:0\" SizeX=\"{width}\" SizeY=\"{height}\" \
         PhysicalSizeX=\"{pixel}\" PhysicalSizeXUnit=\"{MICROMETRE}\" \
         PhysicalSizeY=\"{pixel}\" PhysicalSizeYUnit=\"{MICROMETRE}\" {attributes}>{content}</Pixels></Image></OME>",
        width = view.width,
        height = view.height,
        pixel = view.pixel_um,
    )
}

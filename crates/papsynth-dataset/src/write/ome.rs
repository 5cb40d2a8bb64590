//! OME-XML: what the pages of a TIFF are.

use crate::layout::frame_name;
use crate::record::Geometry;

/// The µ of µm, as XML that is ASCII: readers of TIFF expect no other.
const MICROMETRE: &str = "&#181;m";

/// The description of a focus stack, one page a plane in the order of the geometry.
pub(crate) fn description(geometry: &Geometry) -> String {
    let Geometry { view, bits, channels, planes_um: planes, .. } = geometry;
    let bits = *bits;
    let kind = if bits <= 8 { "uint8" } else { "uint16" };
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
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\
         <OME xmlns=\"http://www.openmicroscopy.org/Schemas/OME/2016-06\" \
         xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"http://www.openmicroscopy.org/Schemas/OME/2016-06 \
         http://www.openmicroscopy.org/Schemas/OME/2016-06/ome.xsd\" Creator=\"papsynth\">\
         <Image ID=\"Image:0\" Name=\"{name}\">\
         <Pixels ID=\"Pixels:0\" DimensionOrder=\"{order}\"{interleaved} Type=\"{kind}\" SignificantBits=\"{bits}\" \
         SizeX=\"{width}\" SizeY=\"{height}\" SizeZ=\"{count}\" SizeC=\"{channels}\" SizeT=\"1\" \
         PhysicalSizeX=\"{pixel}\" PhysicalSizeXUnit=\"{MICROMETRE}\" \
         PhysicalSizeY=\"{pixel}\" PhysicalSizeYUnit=\"{MICROMETRE}\"{step}>\
         <Channel ID=\"Channel:0:0\" SamplesPerPixel=\"{channels}\"/>\
         <TiffData IFD=\"0\" PlaneCount=\"{count}\"/>\
         {positions}</Pixels></Image></OME>",
        name = frame_name(geometry.key.index),
        // The samples of a pixel lie side by side.
        order = if *channels == 1 { "XYZCT" } else { "XYCZT" },
        interleaved = if *channels == 1 { "" } else { " Interleaved=\"true\"" },
        width = view.width,
        height = view.height,
        count = planes.len(),
        pixel = view.pixel_um,
    )
}

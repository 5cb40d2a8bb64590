//! Frames and labels as TIFF, and OME-XML that says what its pages are.

use std::io::{self, Cursor};

use papsynth::truth::Group;

use super::names::numbered;
use crate::truth::Geometry;
use crate::write::{Page, PageWriter, Pixels, compressed, fits_16_bits, is_large, label_pages};

/// The µ of µm, as XML that is ASCII: readers of TIFF expect no other.
const MICROMETRE: &str = "&#181;m";

/// The description of a frame, one page a plane in the order of the geometry.
pub(super) fn description(geometry: &Geometry) -> String {
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
pub(super) fn of_picture(geometry: &Geometry) -> String {
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
pub(super) fn of_labels(geometry: &Geometry, group: Group, layers: &[Vec<u32>]) -> String {
    let kind = if layers.iter().all(|layer| fits_16_bits(layer)) { "uint16" } else { "uint32" };
    let layers = layers.len();
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

/// A page of a frame.
pub(super) fn page<'a>(geometry: &Geometry, text: Option<&'a str>) -> Page<'a> {
    Page { width: geometry.view.width, channels: geometry.channels, pixel_um: geometry.view.pixel_um, text }
}

/// Levels of a camera in as many bits as files have for them.
pub(super) enum Levels<'a> {
    U8(Vec<u8>),
    U16(&'a [u16]),
}

impl<'a> Levels<'a> {
    pub(super) fn new(levels: &'a [u16], geometry: &Geometry) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "levels of at most 8 bits")]
        let narrow = |&level: &u16| level as u8;
        if geometry.bits <= 8 { Self::U8(levels.iter().map(narrow).collect()) } else { Self::U16(levels) }
    }

    pub(super) fn pixels(&self) -> Pixels<'_> {
        match self {
            Self::U8(levels) => Pixels::U8(levels),
            Self::U16(levels) => Pixels::U16(levels),
        }
    }
}

/// The picture of a frame.
pub(super) fn picture_tiff(picture: &[u16], geometry: &Geometry, text: Option<&str>) -> io::Result<Vec<u8>> {
    compressed(&[Levels::new(picture, geometry).pixels()], &page(geometry, text))
}

/// The same as OME-TIFF, a pyramid if it is large.
pub(super) fn ome_picture(picture: &[u16], geometry: &Geometry) -> io::Result<Vec<u8>> {
    let text = of_picture(geometry);
    if !is_large(geometry.view.width, geometry.view.height) {
        return picture_tiff(picture, geometry, Some(&text));
    }
    let mut out = Cursor::new(Vec::new());
    let levels = Levels::new(picture, geometry);
    PageWriter::new(&mut out, 3 * picture.len() as u64)?
        .write_pyramid(levels.pixels(), &page(geometry, Some(&text)))?;
    Ok(out.into_inner())
}

/// Layers of labels as channels of an OME-TIFF.
pub(super) fn ome_labels(layers: &[Vec<u32>], group: Group, geometry: &Geometry) -> io::Result<Vec<u8>> {
    let text = of_labels(geometry, group, layers);
    label_pages(layers, &Page { channels: 1, ..page(geometry, Some(&text)) })
}

//! Images and labels as TIFF with OME-XML; and `ome-tiff`: an OME-TIFF for the image of each frame, and one for each
//! group of labels in layers without overlap.

use std::io;

use papsynth::Plane;
use papsynth::truth::Group;

use super::depth::Depth;
use super::names::numbered;
use super::sink::{Field, Files, Sink};
use super::written::{Written, is_described};
use crate::error::Error;
use crate::truth::{FrameSummary, LabelRuns, layers};
use crate::write::{Page, Pages, Pixels, compressed, is_large, label_pages, pyramid};

/// `µm` as ASCII XML, because TIFF descriptions are ASCII.
const MICROMETRE: &str = "&#181;m";

/// Returns the OME-XML of a frame with one page per plane, in the order of `planes_um`.
pub(super) fn description(frame: &FrameSummary) -> String {
    let planes = &frame.planes_um;
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
    image(frame, &numbered(frame.index), planes.len(), &step, &positions)
}

/// Returns the OME-XML of an image of one plane.
pub(super) fn image_description(frame: &FrameSummary) -> String {
    image(frame, &numbered(frame.index), 1, "", "")
}

fn image(frame: &FrameSummary, name: &str, planes: usize, step: &str, positions: &str) -> String {
    let (bits, channels) = (frame.bits, frame.channels);
    let kind = if bits <= 8 { "uint8" } else { "uint16" };
    // The samples of a pixel are interleaved.
    let (order, interleaved) = if channels == 1 { ("XYZCT", "") } else { ("XYCZT", " Interleaved=\"true\"") };
    document(
        frame,
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

/// Returns the OME-XML of layers of labels, each a channel.
pub(super) fn labels_description(frame: &FrameSummary, group: Group, layers: &[LabelRuns]) -> String {
    let kind = if layers.iter().all(LabelRuns::fits_16_bits) { "uint16" } else { "uint32" };
    let layers = layers.len();
    let channels: String = (0..layers)
        .map(|layer| {
            format!("<Channel ID=\"Channel:0:{layer}\" Name=\"{} {layer}\" SamplesPerPixel=\"1\"/>", group.name())
        })
        .collect();
    document(
        frame,
        &format!("{} {}", numbered(frame.index), group.name()),
        &format!("DimensionOrder=\"XYCZT\" Type=\"{kind}\" SizeZ=\"1\" SizeC=\"{layers}\" SizeT=\"1\""),
        &format!("{channels}<TiffData IFD=\"0\" PlaneCount=\"{layers}\"/>"),
    )
}

fn document(frame: &FrameSummary, name: &str, attributes: &str, content: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\
         <OME xmlns=\"http://www.openmicroscopy.org/Schemas/OME/2016-06\" \
         xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"http://www.openmicroscopy.org/Schemas/OME/2016-06 \
         http://www.openmicroscopy.org/Schemas/OME/2016-06/ome.xsd\" Creator=\"papsynth\">\
         <Image ID=\"Image:0\" Name=\"{name}\"><Pixels ID=\"Pixels:0\" SizeX=\"{width}\" SizeY=\"{height}\" \
         PhysicalSizeX=\"{pixel}\" PhysicalSizeXUnit=\"{MICROMETRE}\" \
         PhysicalSizeY=\"{pixel}\" PhysicalSizeYUnit=\"{MICROMETRE}\" {attributes}>{content}</Pixels></Image></OME>",
        width = frame.width,
        height = frame.height,
        pixel = frame.pixel_um,
    )
}

pub(super) fn page<'a>(frame: &FrameSummary, text: Option<&'a str>) -> Page<'a> {
    Page { width: frame.width, channels: frame.channels, pixel_um: frame.pixel_um, text }
}

/// Camera levels in the smallest sample type that holds them.
pub(super) enum Levels<'a> {
    U8(Vec<u8>),
    U16(&'a [u16]),
}

impl<'a> Levels<'a> {
    pub(super) fn new(levels: &'a [u16], frame: &FrameSummary) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "levels of at most 8 bits")]
        let narrow = |&level: &u16| level as u8;
        if frame.bits <= 8 { Self::U8(levels.iter().map(narrow).collect()) } else { Self::U16(levels) }
    }

    pub(super) fn pixels(&self) -> Pixels<'_> {
        match self {
            Self::U8(levels) => Pixels::U8(levels),
            Self::U16(levels) => Pixels::U16(levels),
        }
    }
}

pub(super) fn image_tiff(levels: &[u16], frame: &FrameSummary, text: Option<&str>) -> io::Result<Vec<u8>> {
    compressed(Levels::new(levels, frame).pixels(), &page(frame, text))
}

/// Encodes an image of one plane as OME-TIFF, with a pyramid if it is large.
pub(super) fn ome_image(levels: &[u16], frame: &FrameSummary) -> io::Result<Vec<u8>> {
    let text = image_description(frame);
    if !is_large(frame.width, frame.height) {
        return image_tiff(levels, frame, Some(&text));
    }
    pyramid(Levels::new(levels, frame).pixels(), &page(frame, Some(&text)))
}

/// Encodes a label image with 16 bits, or 32 if a label needs them.
pub(super) fn label_tiff(labels: LabelRuns, frame: &FrameSummary) -> io::Result<Vec<u8>> {
    label_pages(&[labels], &Page { channels: 1, ..page(frame, None) })
}

/// Encodes layers of labels as the channels of an OME-TIFF.
pub(super) fn ome_labels(layers: &[LabelRuns], group: Group, frame: &FrameSummary) -> io::Result<Vec<u8>> {
    let text = labels_description(frame, group, layers);
    label_pages(layers, &Page { channels: 1, ..page(frame, Some(&text)) })
}

#[derive(Default)]
pub(super) struct Images {
    image: Option<Pages>,
}

pub(super) fn name(index: u64) -> String {
    format!("ome-tiff/{index:06}.ome.tif")
}

fn labels_name(group: Group, index: u64) -> String {
    format!("ome-tiff/{index:06}.{}.ome.tif", group.name())
}

pub(super) fn check(written: &Written) -> Result<(), Error> {
    let frame = written.field.frame;
    written.file(&name(frame.index), |bytes| {
        written.planes(bytes, Depth::Camera)?;
        is_described(bytes, &description(frame))
    })?;
    Group::ALL.into_iter().try_for_each(|group| {
        let pages = layers(written.field.truth, group);
        written.file(&labels_name(group, frame.index), |bytes| {
            written.layers(bytes, &pages)?;
            is_described(bytes, &labels_description(frame, group, &pages))
        })
    })
}

impl Sink for Images {
    fn begin(&mut self, frame: &FrameSummary, files: &Files) -> Result<(), Error> {
        let (pending, planes) = (files.folder.pending(&name(frame.index))?, frame.planes_um.len());
        let bytes = (frame.values() * planes) as u64 * 3;
        self.image = Some(match is_large(frame.width, frame.height) {
            true => Pages::pyramids(pending, bytes)?,
            false => Pages::new(pending, planes, bytes)?,
        });
        Ok(())
    }

    fn plane(&mut self, plane: &Plane, frame: &FrameSummary, _: &Files) -> Result<(), Error> {
        let Some(pages) = &mut self.image else { return Ok(()) };
        let text = (plane.index == 0).then(|| description(frame));
        pages.write(Levels::new(&plane.grey, frame).pixels(), &page(frame, text.as_deref()))
    }

    fn field(&mut self, field: &Field, files: &mut Files) -> Result<(), Error> {
        if let Some(pages) = self.image.take() {
            files.written.push(pages.commit()?);
        }
        for group in Group::ALL {
            let pages = layers(field.truth, group);
            files.encode(&labels_name(group, field.frame.index), ome_labels(&pages, group, field.frame))?;
        }
        Ok(())
    }
}

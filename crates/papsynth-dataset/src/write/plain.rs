//! Uncompressed TIFF pages, written from front to back: each page is its directory, then its pixels. Noisy images
//! hardly compress, and this takes a tenth of the time.

use std::io::{self, Write};

use tiff::encoder::TiffValue;
use tiff::tags::{CompressionMethod, ResolutionUnit, Tag};

use super::tiff::{CLASSIC_BYTES, Page, Pixels, per_centimetre, photometric};

/// Smallest size of a strip, bytes.
const STRIP_BYTES: usize = 1_000_000;

/// Directories and pixels begin at multiples of this number of bytes.
const ALIGNMENT: usize = 8;

/// Writes a given number of pages, as classic TIFF, or as BigTIFF if they are large.
pub(crate) struct PlainPages<W> {
    out: W,
    is_big: bool,
    /// Pages that are not written yet.
    left: usize,
    /// Bytes that are written.
    at: u64,
}

/// A field of a directory.
struct Field {
    tag: Tag,
    kind: u16,
    count: u64,
    value: Vec<u8>,
}

impl Field {
    fn new<T: TiffValue + ?Sized>(tag: Tag, value: &T) -> Self {
        Self { tag, kind: T::FIELD_TYPE.to_u16(), count: value.count() as u64, value: value.data().into_owned() }
    }
}

impl<W: Write> PlainPages<W> {
    /// Starts a file of `pages` pages, with about `bytes` bytes of pixels.
    pub(crate) fn new(mut out: W, pages: usize, bytes: u64) -> io::Result<Self> {
        let is_big = bytes >= CLASSIC_BYTES;
        let order = if cfg!(target_endian = "big") { b"MM" } else { b"II" };
        let mut header = order.to_vec();
        match is_big {
            true => {
                [43, 8, 0_u16].into_iter().for_each(|value| header.extend(value.to_ne_bytes()));
                header.extend(16_u64.to_ne_bytes());
            }
            false => {
                header.extend(42_u16.to_ne_bytes());
                header.extend(8_u32.to_ne_bytes());
            }
        }
        out.write_all(&header)?;
        Ok(Self { out, is_big, left: pages, at: header.len() as u64 })
    }

    /// Writes the next page.
    pub(crate) fn write(&mut self, pixels: Pixels, page: &Page) -> io::Result<()> {
        self.left = self.left.checked_sub(1).ok_or_else(|| io::Error::other("too many pages"))?;
        let pixels_at = self.at + self.directory(pixels, page, 0)?.len() as u64;
        let directory = self.directory(pixels, page, pixels_at)?;
        let bytes = pixels.bytes(0..pixels.len());
        self.out.write_all(&directory)?;
        self.out.write_all(&bytes)?;
        self.out.write_all(&[0; ALIGNMENT][..aligned(bytes.len()) - bytes.len()])?;
        self.at = pixels_at + aligned(bytes.len()) as u64;
        Ok(())
    }

    pub(crate) fn inner(&self) -> &W {
        &self.out
    }

    pub(crate) fn into_inner(self) -> W {
        self.out
    }

    /// Returns the directory of a page whose pixels begin at `pixels_at`.
    fn directory(&self, pixels: Pixels, page: &Page, pixels_at: u64) -> io::Result<Vec<u8>> {
        let fields = self.fields(pixels, page, pixels_at)?;
        let size = self.number(0)?.len();
        let mut directory = if self.is_big { self.number(fields.len() as u64)? } else { short(fields.len())? };
        let values_at = self.at + (directory.len() + fields.len() * (4 + 2 * size) + size) as u64;
        let mut values = Vec::new();
        for Field { tag, kind, count, value } in fields {
            directory.extend(tag.to_u16().to_ne_bytes());
            directory.extend(kind.to_ne_bytes());
            directory.extend(self.number(count)?);
            if value.len() <= size {
                directory.extend(&value);
                directory.resize(directory.len() + size - value.len(), 0);
            } else {
                directory.extend(self.number(values_at + values.len() as u64)?);
                values.extend(&value);
                values.resize(values.len().next_multiple_of(2), 0);
            }
        }
        let bytes = pixels.bytes(0..pixels.len()).len();
        let next = if self.left > 0 { pixels_at + aligned(bytes) as u64 } else { 0 };
        directory.extend(self.number(next)?);
        directory.extend(values);
        directory.resize(aligned(directory.len()), 0);
        Ok(directory)
    }

    /// Returns the fields of a directory, sorted by tag.
    fn fields(&self, pixels: Pixels, page: &Page, pixels_at: u64) -> io::Result<Vec<Field>> {
        let (bits, format) = pixels.sample();
        let row = (page.width * page.channels).max(1);
        let (height, row_bytes) = (pixels.len() / row, row * usize::from(bits / 8));
        let rows = STRIP_BYTES.div_ceil(row_bytes);
        let strips = (0..height).step_by(rows);
        let offsets = strips.clone().map(|first| pixels_at + (first * row_bytes) as u64).collect();
        let sizes = strips.map(|first| (rows.min(height - first) * row_bytes) as u64).collect();
        let long = |number: usize| u32::try_from(number).map_err(io::Error::other);
        let per_centimetre = per_centimetre(page.pixel_um);
        let mut fields = vec![
            Field::new(Tag::ImageWidth, &long(page.width)?),
            Field::new(Tag::ImageLength, &long(height)?),
            Field::new(Tag::BitsPerSample, vec![bits; page.channels].as_slice()),
            Field::new(Tag::Compression, &CompressionMethod::None.to_u16()),
            Field::new(Tag::PhotometricInterpretation, &photometric(page.channels)),
            self.offsets(Tag::StripOffsets, offsets)?,
            Field::new(Tag::SamplesPerPixel, &u16::try_from(page.channels).map_err(io::Error::other)?),
            Field::new(Tag::RowsPerStrip, &long(rows)?),
            self.offsets(Tag::StripByteCounts, sizes)?,
            Field::new(Tag::XResolution, &per_centimetre),
            Field::new(Tag::YResolution, &per_centimetre),
            Field::new(Tag::ResolutionUnit, &ResolutionUnit::Centimeter.to_u16()),
            Field::new(Tag::SampleFormat, vec![format.to_u16(); page.channels].as_slice()),
        ];
        fields.extend(page.text.map(|text| Field::new(Tag::ImageDescription, text)));
        fields.sort_by_key(|field| field.tag.to_u16());
        Ok(fields)
    }

    /// Returns a field of offsets or sizes.
    fn offsets(&self, tag: Tag, values: Vec<u64>) -> io::Result<Field> {
        if self.is_big {
            return Ok(Field::new(tag, values.as_slice()));
        }
        let narrow =
            values.into_iter().map(u32::try_from).collect::<Result<Vec<u32>, _>>().map_err(io::Error::other)?;
        Ok(Field::new(tag, narrow.as_slice()))
    }

    /// Returns the bytes of a count or an offset.
    fn number(&self, number: u64) -> io::Result<Vec<u8>> {
        match self.is_big {
            true => Ok(number.to_ne_bytes().to_vec()),
            false => Ok(u32::try_from(number).map_err(io::Error::other)?.to_ne_bytes().to_vec()),
        }
    }
}

fn short(number: usize) -> io::Result<Vec<u8>> {
    Ok(u16::try_from(number).map_err(io::Error::other)?.to_ne_bytes().to_vec())
}

fn aligned(bytes: usize) -> usize {
    bytes.next_multiple_of(ALIGNMENT)
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use tiff::decoder::{Decoder, DecodingResult};

    use super::*;

    /// Writes pages of random levels and reads them back with the library.
    fn check(pages: usize, [width, height, channels]: [usize; 3], bytes: u64) {
        let mut state = 1_u64;
        let planes: Vec<Vec<u16>> = (0..pages)
            .map(|_| {
                let next = || {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    u16::try_from(state >> 48).unwrap()
                };
                std::iter::repeat_with(next).take(width * height * channels).collect()
            })
            .collect();
        let mut writer = PlainPages::new(Vec::new(), pages, bytes).unwrap();
        for (number, plane) in planes.iter().enumerate() {
            let page = Page { width, channels, pixel_um: 0.25, text: (number == 0).then_some("a text") };
            writer.write(Pixels::U16(plane), &page).unwrap();
        }
        let page = Page { width, channels, pixel_um: 0.25, text: None };
        assert!(writer.write(Pixels::U16(&planes[0]), &page).is_err(), "too many pages");
        let file = writer.into_inner();
        let mut decoder = Decoder::new(Cursor::new(&file)).unwrap();
        assert_eq!(decoder.get_tag_ascii_string(Tag::ImageDescription).unwrap(), "a text");
        assert_eq!(decoder.get_tag_u64(Tag::ResolutionUnit).unwrap(), 3);
        for (number, plane) in planes.iter().enumerate() {
            let (columns, rows) = decoder.dimensions().unwrap();
            assert_eq!([columns as usize, rows as usize], [width, height]);
            assert!(matches!(decoder.read_image().unwrap(), DecodingResult::U16(read) if read == *plane), "{number}");
            assert_eq!(decoder.more_images(), number + 1 < pages);
            if decoder.more_images() {
                decoder.next_image().unwrap();
            }
        }
    }

    #[test]
    fn pages_are_read_back_by_a_library() {
        for bytes in [0, CLASSIC_BYTES] {
            check(1, [70, 50, 1], bytes);
            check(3, [7, 5, 3], bytes);
            // Several strips.
            check(2, [1001, 1101, 1], bytes);
        }
    }

    #[test]
    fn floats_are_read_back() {
        let values: Vec<f32> = (0..35).map(|i| i as f32 / 3.0).collect();
        let mut writer = PlainPages::new(Vec::new(), 1, 0).unwrap();
        writer.write(Pixels::F32(&values), &Page { width: 7, channels: 1, pixel_um: 0.25, text: None }).unwrap();
        let mut decoder = Decoder::new(Cursor::new(writer.into_inner())).unwrap();
        assert!(matches!(decoder.read_image().unwrap(), DecodingResult::F32(read) if read == values));
    }
}

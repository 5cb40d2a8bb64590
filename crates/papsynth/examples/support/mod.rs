//! Functions shared by the examples that draw pages: images of frames, text, PNG files.

#![allow(dead_code, clippy::cast_sign_loss, reason = "each example uses only some functions; numbers are small")]

use font8x8::UnicodeFonts;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, Rgb, RgbImage};
use papsynth::Frame;

/// Writes a page as a PNG with maximum compression; a page without colours is written as greyscale.
pub(crate) fn save(page: RgbImage, out: &str) -> Outcome<()> {
    let coloured = page.pixels().any(|Rgb([r, g, b])| r != g || g != b);
    let page = DynamicImage::from(page);
    let page = if coloured { page } else { page.into_luma8().into() };
    let file = std::io::BufWriter::new(std::fs::File::create(out)?);
    page.write_with_encoder(PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Adaptive))?;
    Ok(())
}

/// The result of a step of an example.
pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Line height of text of size 1, px.
pub(crate) const LINE: u32 = 12;

/// Returns the first plane of a frame as an RGB image.
pub(crate) fn to_image(frame: &Frame) -> RgbImage {
    let (view, plane) = (frame.finished.scene.view, &frame.planes[0]);
    RgbImage::from_fn(view.width as u32, view.height as u32, |x, y| {
        let at = (y as usize * view.width + x as usize) * plane.channels;
        let grey = |channel: usize| plane.grey[at + channel.min(plane.channels - 1)].min(255) as u8;
        Rgb([grey(0), grey(1), grey(2)])
    })
}

/// Crops an image to a size around a point, shifted to stay inside the image.
pub(crate) fn crop_around(whole: &RgbImage, [x, y]: [f64; 2], [width, height]: [u32; 2]) -> RgbImage {
    let corner =
        |centre: f64, side: u32, length: u32| ((centre - f64::from(side) / 2.0).max(0.0) as u32).min(length - side);
    let (x, y) = (corner(x, width, whole.width()), corner(y, height, whole.height()));
    image::imageops::crop_imm(whole, x, y, width, height).to_image()
}

/// Enlarges an image by an integer factor.
pub(crate) fn enlarged(image: &RgbImage, zoom: u32) -> RgbImage {
    let filter = image::imageops::FilterType::CatmullRom;
    image::imageops::resize(image, image.width() * zoom, image.height() * zoom, filter)
}

/// Writes a line of text in characters of 8 x 8 dots.
pub(crate) fn write(page: &mut RgbImage, text: &str, [left, top]: [u32; 2], dot: u32) {
    for (place, letter) in (0_u32..).zip(text.chars()) {
        let rows = font8x8::BASIC_FONTS.get(letter).or_else(|| font8x8::LATIN_FONTS.get(letter)).unwrap_or_default();
        for (y, row) in (0_u32..).zip(rows) {
            for x in (0..8).filter(|x| row >> x & 1 == 1) {
                for at in 0..dot * dot {
                    let at = [left + (place * 8 + x) * dot + at % dot, top + y * dot + at / dot];
                    if at[0] < page.width() && at[1] < page.height() {
                        page.put_pixel(at[0], at[1], Rgb([0; 3]));
                    }
                }
            }
        }
    }
}

//! What the examples that draw pages share: pictures of frames, labels.

#![allow(dead_code, clippy::cast_sign_loss, reason = "no example uses all of it; numbers are small")]

use font8x8::UnicodeFonts;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, Rgb, RgbImage};
use papsynth::Frame;

/// Writes a page as a PNG, as small as it gets: grey where it has no colours.
pub(crate) fn save(page: RgbImage, out: &str) -> Outcome<()> {
    let coloured = page.pixels().any(|Rgb([r, g, b])| r != g || g != b);
    let page = DynamicImage::from(page);
    let page = if coloured { page } else { page.into_luma8().into() };
    let file = std::io::BufWriter::new(std::fs::File::create(out)?);
    page.write_with_encoder(PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Adaptive))?;
    Ok(())
}

/// What an example's steps give.
pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Height of a line of letters of size 1, with the space about it.
pub(crate) const LINE: u32 = 12;

/// The first plane of a frame, in colours.
pub(crate) fn picture(frame: &Frame) -> RgbImage {
    let (view, plane) = (frame.finished.scene.view, &frame.planes[0]);
    RgbImage::from_fn(view.width as u32, view.height as u32, |x, y| {
        let at = (y as usize * view.width + x as usize) * plane.channels;
        let grey = |channel: usize| plane.grey[at + channel.min(plane.channels - 1)].min(255) as u8;
        Rgb([grey(0), grey(1), grey(2)])
    })
}

/// A part of a picture about a place, as large as asked for, moved where it would leave the picture.
pub(crate) fn around(whole: &RgbImage, [x, y]: [f64; 2], [width, height]: [u32; 2]) -> RgbImage {
    let corner =
        |middle: f64, side: u32, length: u32| ((middle - f64::from(side) / 2.0).max(0.0) as u32).min(length - side);
    let (x, y) = (corner(x, width, whole.width()), corner(y, height, whole.height()));
    image::imageops::crop_imm(whole, x, y, width, height).to_image()
}

/// A picture so many times as large.
pub(crate) fn enlarged(picture: &RgbImage, zoom: u32) -> RgbImage {
    let filter = image::imageops::FilterType::CatmullRom;
    image::imageops::resize(picture, picture.width() * zoom, picture.height() * zoom, filter)
}

/// Writes a line of letters of eight by eight dots.
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

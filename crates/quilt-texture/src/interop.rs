//! Conversions from and to images of the `image` crate.

use image::{GrayImage, ImageBuffer, Luma};

use crate::{Error, Source, Texture};

impl Source {
    /// Creates a source from 8-bit images: grey levels 0 to 255, used where the mask is 128 or more.
    ///
    /// ```
    /// use image::{GrayImage, ImageBuffer, Luma};
    /// use quilt_texture::{QuiltParams, Quilter, Source};
    /// use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
    ///
    /// let nucleus = GrayImage::from_fn(32, 32, |x, y| Luma([(x * y % 7) as u8]));
    /// let source = Source::from_image(&nucleus, &GrayImage::from_pixel(32, 32, Luma([255])))?;
    /// let quilter = Quilter::new(&[&source], &QuiltParams::paper())?;
    /// let texture = quilter.synthesise(&[1.0; 50 * 40], 50, &mut Xoshiro256PlusPlus::seed_from_u64(1));
    /// let image: ImageBuffer<Luma<f32>, Vec<f32>> = texture.into();
    /// assert_eq!(image.dimensions(), (50, 40));
    /// # Ok::<(), quilt_texture::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// If the sizes differ, or the mask is empty.
    pub fn from_image(pixels: &GrayImage, mask: &GrayImage) -> Result<Self, Error> {
        let levels: Vec<f32> = pixels.iter().map(|&v| f32::from(v)).collect();
        let coverage: Vec<f32> = mask.iter().map(|&v| f32::from(v) / 255.0).collect();
        if pixels.width() != mask.width() {
            return Err(Error::Shape { pixels: pixels.len(), mask: mask.len(), width: pixels.width() as usize });
        }
        Self::new(&levels, &coverage, pixels.width() as usize)
    }
}

impl From<Texture> for ImageBuffer<Luma<f32>, Vec<f32>> {
    /// # Panics
    ///
    /// If `width` does not divide the number of pixels.
    fn from(texture: Texture) -> Self {
        let [width, height] = [texture.width, texture.pixels.len() / texture.width]
            .map(|side| u32::try_from(side).expect("sizes are far below 2^32"));
        Self::from_raw(width, height, texture.pixels).expect("whole rows")
    }
}

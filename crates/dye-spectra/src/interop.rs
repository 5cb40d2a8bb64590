//! Light as images of `image`.

use image::{Rgb, RgbImage};

use crate::{Colour, encode_srgb};

impl Colour {
    /// The picture that a screen shows: light of [`Colour::transmittance_into`], row by row of `width`, by the matrix
    /// [`Colour::to_srgb`] and the curve [`encode_srgb`].
    ///
    /// ```
    /// use dye_spectra::{Colour, ColourParams, Dye, amounts};
    ///
    /// let colour = Colour::new(&ColourParams::default())?;
    /// let ramp: Vec<f32> = (0..64 * 48).map(|i| (i % 64) as f32 / 64.0).collect();
    /// let mut light = [(); 3].map(|()| vec![0.0; ramp.len()]);
    /// let eosin = colour.curve(&amounts([(Dye::EosinY, 1.0)]))?;
    /// eosin.transmittance_into(&ramp, light.each_mut().map(|plane| &mut plane[..]));
    /// let picture = colour.srgb_image(light.each_ref().map(|plane| &plane[..]), 64);
    /// assert_eq!(picture.get_pixel(0, 0).0, [255; 3]);
    /// # Ok::<(), dye_spectra::Error>(())
    /// ```
    ///
    /// # Panics
    ///
    /// If the planes of `light` are not whole rows of `width`, all of one length.
    #[must_use]
    pub fn srgb_image(&self, light: [&[f32]; 3], width: usize) -> RgbImage {
        let pixels = light[0].len();
        assert!(light.iter().all(|plane| plane.len() == pixels), "the channels differ in length");
        assert!(width > 0 && pixels.is_multiple_of(width), "width {width} must divide the {pixels} pixels");
        let side = |pixels: usize| u32::try_from(pixels).expect("sides are below 2^32");
        RgbImage::from_fn(side(width), side(pixels / width), |x, y| {
            let i = y as usize * width + x as usize;
            let seen = light.map(|plane| f64::from(plane[i]));
            Rgb(self.to_srgb().map(|row| encode_srgb(row.iter().zip(seen).map(|(m, v)| m * v).sum())))
        })
    }
}

//! Draws the image of the README: Brownian noise, the same noise thresholded, a Matérn field and low-frequency Gaussian
//! noise. Optional argument: the output path.

use image::GrayImage;
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
use spectral_field::{Error, FieldParams, SpectralField, Spectrum};

const SIDE: usize = 160;
const GAP: usize = 4;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/fields.png".into());
    let draw = |spectrum| -> Result<Vec<f32>, Error> {
        let params = FieldParams { width: SIDE, height: SIDE, spectrum, ..FieldParams::default() };
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(7);
        Ok(SpectralField::new(&params)?.draw(&mut rng))
    };
    let brownian = draw(Spectrum::BROWNIAN)?;
    let flecks = brownian.iter().map(|v| 2.5 * (v - 1.0).max(0.0) - 2.0).collect();
    let chromatin = draw(Spectrum::Matern { nu: 1.0, length_px: 4.0 })?;
    let clouds = draw(Spectrum::Gaussian { sigma_px: 7.0 })?;

    let panels: [Vec<f32>; 4] = [brownian, flecks, chromatin, clouds];
    let stride = SIDE + GAP;
    let mut output = GrayImage::from_pixel(u32::try_from(4 * stride - GAP)?, u32::try_from(SIDE)?, image::Luma([255]));
    for (panel, field) in panels.iter().enumerate() {
        for (i, v) in field.iter().enumerate() {
            // 128 is the mean, 40 grey levels are one standard deviation; larger values are darker.
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let grey = (128.0 - 40.0 * v).clamp(0.0, 255.0) as u8;
            let x = u32::try_from(panel * stride + i % SIDE)?;
            output.put_pixel(x, u32::try_from(i / SIDE)?, image::Luma([grey]));
        }
    }
    output.save(path)?;
    Ok(())
}

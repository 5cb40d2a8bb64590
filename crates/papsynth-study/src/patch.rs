//! A patch as it is sent: with noise, as a PNG of which nothing but the pixels differs between patches.

use png::{BitDepth, ColorType, Compression, Encoder, Filter};
use portable_numerics::random::Normals;
use rand_core::Rng;

/// Adds Gaussian noise of `sigma` grey levels and rounds to 8 bits. Each pixel takes the same random numbers whatever its level.
pub(crate) fn noisy<R: Rng + ?Sized>(levels: &[f32], sigma: f64, rng: &mut R) -> Vec<u8> {
    let mut normals = Normals::new(rng);
    levels
        .iter()
        .map(|&level| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates: black and white")]
            let grey = (f64::from(level) + sigma * normals.draw() + 0.5) as u8;
            grey
        })
        .collect()
}

/// A square in 8-bit grey. It is not compressed, so that the size of the file is the same for all: what packs well and what
/// does not would tell real from synthetic. It holds no chunk but those that every PNG has.
pub(crate) fn png(grey: &[u8], side: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(grey.len() + grey.len() / 64);
    let length = u32::try_from(side).unwrap_or_default();
    let mut encoder = Encoder::new(&mut out, length, length);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::NoCompression);
    encoder.set_filter(Filter::NoFilter);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(grey)?;
        writer.finish()
    });
    debug_assert!(written.is_ok(), "memory takes every byte, and the size is right: {written:?}");
    out
}

#[cfg(test)]
mod tests {
    use rand_core::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;

    #[test]
    fn noise_has_the_deviation_that_is_asked_for() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let n = 200_000;
        for sigma in [0.7, 5.0] {
            let noisy = noisy(&vec![100.25; n], sigma, &mut rng);
            let mean = noisy.iter().map(|&g| f64::from(g)).sum::<f64>() / n as f64;
            let variance = noisy.iter().map(|&g| (f64::from(g) - mean) * (f64::from(g) - mean)).sum::<f64>() / n as f64;
            // Rounding adds 1/12. Within 5 standard errors.
            let wanted = sigma * sigma + 1.0 / 12.0;
            assert!((mean - 100.25).abs() < 5.0 * (wanted / n as f64).sqrt(), "{mean}");
            assert!((variance - wanted).abs() < 5.0 * wanted * (2.0 / n as f64).sqrt(), "{variance} for {wanted}");
        }
    }

    #[test]
    fn without_noise_levels_are_rounded_and_bounded() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        assert_eq!(noisy(&[0.0, 0.49, 0.5, 254.6, 300.0, -3.0], 0.0, &mut rng), [0, 0, 1, 255, 255, 0]);
    }

    #[test]
    fn files_differ_in_their_pixels_alone() {
        let flat = png(&vec![128; 200 * 200], 200);
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let rough = png(&noisy(&vec![128.0; 200 * 200], 20.0, &mut rng), 200);
        assert_eq!(flat.len(), rough.len());
        let chunks = |file: &[u8]| {
            let (mut at, mut chunks) = (8, Vec::new());
            while at < file.len() {
                let length = usize::try_from(u32::from_be_bytes(file[at..at + 4].try_into().unwrap())).unwrap();
                chunks.push((String::from_utf8(file[at + 4..at + 8].to_vec()).unwrap(), length));
                at += 12 + length;
            }
            chunks
        };
        assert_eq!(chunks(&flat), chunks(&rough));
        assert!(chunks(&flat).iter().all(|(kind, _)| ["IHDR", "IDAT", "IEND"].contains(&kind.as_str())));
        let mut reader = png::Decoder::new(std::io::Cursor::new(&rough)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (200, 200, ColorType::Grayscale));
    }
}

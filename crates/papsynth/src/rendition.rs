//! Colours as microscope cameras show them: sRGB primaries and tone curve (IEC 61966-2-1) from the sensor's channels.

/// Steps of the tone curve's table: between two of them it is straight to a twentieth of an 8-bit grey level.
const STEPS: usize = 4096;

/// From balanced, linear grey levels of three channels to sRGB.
pub(crate) struct Srgb {
    matrix: [[f32; 3]; 3],
    inner: f32,
    largest: f32,
    /// The curve at even steps from 0 to 1, in grey levels, and once more its end.
    curve: Vec<f32>,
}

impl Srgb {
    /// `matrix` leads from the channels to linear sRGB; grey levels come with `inner_bits` and leave with `bits`.
    pub(crate) fn new(matrix: &[[f64; 3]; 3], inner_bits: u32, bits: u32) -> Self {
        let levels = |bits: u32| libm::exp2(f64::from(bits)) - 1.0;
        let largest = levels(bits);
        let curve =
            (0..=STEPS + 1).map(|step| (largest * encoded((step as f64 / STEPS as f64).min(1.0))) as f32).collect();
        Self {
            matrix: matrix.map(|row| row.map(|v| v as f32)),
            inner: (1.0 / levels(inner_bits)) as f32,
            largest: largest as f32,
            curve,
        }
    }

    pub(crate) fn levels(&self, channels: &[Vec<u16>], out: &mut [u16]) {
        let [r, g, b] = channels else { return };
        for (((out, r), g), b) in out.chunks_exact_mut(3).zip(r).zip(g).zip(b) {
            let colour = self.convert([f32::from(*r), f32::from(*g), f32::from(*b)]);
            for (out, value) in out.iter_mut().zip(colour) {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "within the range of the bits"
                )]
                let level = (value + 0.5).min(self.largest) as u16;
                *out = level;
            }
        }
    }

    pub(crate) fn means(&self, channels: &[Vec<f32>], out: &mut [f32]) {
        let [r, g, b] = channels else { return };
        for (((out, r), g), b) in out.chunks_exact_mut(3).zip(r).zip(g).zip(b) {
            out.copy_from_slice(&self.convert([*r, *g, *b]));
        }
    }

    /// Between 0 and the largest grey level.
    #[inline(always)]
    fn convert(&self, levels: [f32; 3]) -> [f32; 3] {
        self.matrix.map(|row| {
            let linear = self.inner * (row[0] * levels[0] + row[1] * levels[1] + row[2] * levels[2]);
            let at = linear.clamp(0.0, 1.0) * STEPS as f32;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to STEPS")]
            let step = at as usize;
            let (low, high) = (self.curve[step], self.curve[step + 1]);
            low + (at - step as f32) * (high - low)
        })
    }
}

/// The tone curve, 0 to 1.
fn encoded(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

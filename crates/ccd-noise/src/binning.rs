use crate::error::{Error, within};
use crate::field::assert_rows;
use crate::{CameraParams, ReadNoise};

/// Pixel binning: `side` × `side` pixels become one.
///
/// With n = side² pixels, [`CameraParams::binned`] sets these values for a binned pixel, in electrons of the complete
/// square:
///
/// | | charge | digital |
/// |---|---|---|
/// | full well, dark current | n times | n times |
/// | gain | K / n | K / n |
/// | PRNU | 1 / side | 1 / side |
/// | DSNU | side times | side times |
/// | read noise² | σ² | n·σ² + n / 12K² |
///
/// The scale of grey levels does not change: a square of n equal pixels has the same mean level as one of these pixels.
/// Charge binning reads each square once. Digital binning averages n readings; the last term is their quantisation
/// noise, 1/12 each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Binning {
    /// Sums charge on the sensor and reads it once, as in a CCD. The register is assumed to hold n full wells; lower
    /// [`CameraParams::full_well_e`] otherwise.
    Charge {
        /// Side of the square in pixels, 1 to 8.
        side: usize,
    },
    /// Reads each pixel and averages the grey levels, as in CMOS.
    Digital {
        /// Side of the square in pixels, 1 to 8.
        side: usize,
    },
}

impl Binning {
    /// Returns the side of the square in pixels.
    #[must_use]
    pub fn side(self) -> usize {
        match self {
            Self::Charge { side } | Self::Digital { side } => side,
        }
    }

    /// Sums `electrons`, in rows of `width` pixels, over squares. Returns the binned image and its width. Incomplete
    /// squares at the right and bottom edges are dropped.
    ///
    /// # Panics
    ///
    /// If the length of `electrons` is not a multiple of `width`.
    #[must_use]
    pub fn sum_electrons(self, electrons: &[f32], width: usize) -> (Vec<f32>, usize) {
        assert_rows(electrons.len(), width);
        let side = self.side().max(1);
        let binned_width = width / side;
        let mut binned = Vec::with_capacity(electrons.len() / (side * side));
        for rows in electrons.chunks_exact(side * width) {
            let first = binned.len();
            binned.resize(first + binned_width, 0.0);
            for row in rows.chunks_exact(width) {
                for (sum, pixels) in binned[first..].iter_mut().zip(row.chunks_exact(side)) {
                    *sum += pixels.iter().sum::<f32>();
                }
            }
        }
        (binned, binned_width)
    }
}

impl CameraParams {
    /// Returns the parameters of this camera with `binning`. The binned camera takes the electrons of complete squares,
    /// as [`Binning::sum_electrons`] returns them.
    ///
    /// The sum of n log-normal read noise variances is approximated by a log-normal distribution of the same mean and
    /// variance (Fenton, doi:10.1109/TCOM.1960.1097606).
    ///
    /// # Errors
    ///
    /// If `side` is not 1 to 8.
    pub fn binned(&self, binning: Binning) -> Result<Self, Error> {
        let side = within("binning.side", binning.side() as f64, 1.0..=8.0, "from 1 to 8")?;
        let n = side * side;
        let read_noise = match (binning, self.read_noise) {
            (Binning::Charge { .. } | Binning::Digital { side: 1 }, noise) => noise,
            (Binning::Digital { .. }, noise) => {
                let rounding = 1.0 / (12.0 * self.gain_dn_per_e * self.gain_dn_per_e);
                let rms_e = (n * (noise.rms_e() * noise.rms_e() + rounding)).sqrt();
                match noise {
                    ReadNoise::Same { .. } => ReadNoise::Same { e: rms_e },
                    ReadNoise::PerPixel { median_e, rms_e: one } => {
                        // Relative variance of the per-pixel noise variances: exp(4s²) - 1.
                        let uneven = one / median_e;
                        let relative = one * one / (one * one + rounding);
                        let variance = (uneven * uneven * uneven * uneven - 1.0) * relative * relative / n;
                        let spread = libm::log1p(variance) / 4.0;
                        ReadNoise::PerPixel { median_e: rms_e * libm::exp(-spread), rms_e }
                    }
                }
            }
        };
        Ok(Self {
            dark_current_e_per_s: n * self.dark_current_e_per_s,
            prnu: self.prnu / side,
            dsnu_e: side * self.dsnu_e,
            full_well_e: n * self.full_well_e,
            gain_dn_per_e: self.gain_dn_per_e / n,
            read_noise,
            ..self.clone()
        })
    }
}

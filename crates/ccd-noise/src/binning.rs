use crate::error::{Error, within};
use crate::field::whole_rows;
use crate::{CameraParams, ReadNoise};

/// How the pixels of a square are made one.
///
/// With n = side² pixels, [`CameraParams::binned`] gives a binned pixel
///
/// | | charge | digital |
/// |---|---|---|
/// | full well, dark current | n times | n times |
/// | gain | K / n | K / n |
/// | PRNU | 1 / side | 1 / side |
/// | DSNU | side times | side times |
/// | read noise² | σ² | n·σ² + n / 12K² |
///
/// in electrons of the whole square. The scale of grey levels stays as it is: the mean of n equal pixels has their level.
/// Charge is read once; digitally, n readings are averaged, whose own roundings, 1/12 each, are the last term.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Binning {
    /// The charges are joined on the sensor and read once, as in a CCD. The register is taken to hold n full wells; lower
    /// [`CameraParams::full_well_e`] if it does not.
    Charge {
        /// Pixels along a side of the square, 1 to 8.
        side: usize,
    },
    /// The pixels are read one by one and their levels averaged, as in CMOS.
    Digital {
        /// Pixels along a side of the square, 1 to 8.
        side: usize,
    },
}

impl Binning {
    /// Pixels along a side of the square.
    #[must_use]
    pub fn side(self) -> usize {
        match self {
            Self::Charge { side } | Self::Digital { side } => side,
        }
    }

    /// Sums `electrons`, rows of `width` pixels, over squares. Columns and rows at the right and at the bottom that do
    /// not fill a square are left out. Returns the binned image and its width.
    ///
    /// # Panics
    ///
    /// If `electrons` is not whole rows of `width`.
    #[must_use]
    pub fn gather(self, electrons: &[f32], width: usize) -> (Vec<f32>, usize) {
        whole_rows(electrons.len(), width);
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
    /// The camera whose pixels are squares of those of this one. It expects the electrons of a whole
    /// square, as [`Binning::gather`] sums them.
    ///
    /// The log-normal read noise of n pixels together is again taken as log-normal, of the right mean square and the
    /// right variance of the squares (Fenton, doi:10.1109/TCOM.1960.1097606).
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
                        // Of the squares: exp(4s²) - 1 is their variance over the square of their mean.
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

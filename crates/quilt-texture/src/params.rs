use crate::Error;

/// Parameters of the synthesis.
#[derive(Debug, Clone, PartialEq)]
pub struct QuiltParams {
    /// Size of a square patch including its overlaps, px, 2 to 256. Default 9 (ours).
    pub patch_px: usize,
    /// Overlap of neighbouring patches, px, 1 to half of `patch_px`. Default 3 (ours).
    pub overlap_px: usize,
    /// Acceptance of candidates. Default [`Acceptance::Near`] (ours).
    pub acceptance: Acceptance,
    /// Seam between neighbouring patches. Default [`Seam::MinCut`] (ours).
    pub seam: Seam,
    /// Whether central patches come from the centres of sources. Default weighted (the paper's), with strength 0.5
    /// (ours).
    pub centre_bias: CentreBias,
    /// Algorithm that compares all candidates. Default [`Search::Auto`] (ours). [`Acceptance::Threshold`] ignores it:
    /// it tries some candidates and compares the others directly.
    pub search: Search,
}

impl Default for QuiltParams {
    fn default() -> Self {
        Self {
            patch_px: 9,
            overlap_px: 3,
            acceptance: Acceptance::Near { factor: 1.1, floor: 0.05 },
            seam: Seam::MinCut { feather_px: 0 },
            centre_bias: CentreBias::Weighted { strength: 0.5 },
            search: Search::Auto,
        }
    }
}

impl QuiltParams {
    /// Returns the parameters of the paper ("Texture synthesis", Fig. 4) and its program: patches of 7 px with an
    /// overlap of 2, random candidates within 15 grey levels, feathered.
    ///
    /// The paper does not state the number of tries and the strength of the weighting; these are ours.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            patch_px: 7,
            overlap_px: 2,
            acceptance: Acceptance::Threshold { d_max: 15.0, max_tries: 1000 },
            seam: Seam::Feather,
            centre_bias: CentreBias::Weighted { strength: 2.0 },
            ..Self::default()
        }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        #[expect(clippy::cast_precision_loss, reason = "for a message")]
        let size = |field, value: usize, accepted, inside: bool| number(field, value as f64, accepted, inside);
        let patch = (2..=256).contains(&self.patch_px);
        size("patch_px", self.patch_px, "2 to 256", patch)?;
        let overlap = (1..=self.patch_px / 2).contains(&self.overlap_px);
        size("overlap_px", self.overlap_px, "1 to half of patch_px", overlap)?;
        match self.acceptance {
            Acceptance::Threshold { d_max, max_tries } => {
                number("acceptance.d_max", d_max, "0 or more", d_max >= 0.0)?;
                let tries = "acceptance.max_tries";
                size(tries, max_tries, "1 or more", max_tries >= 1)?;
            }
            Acceptance::Near { factor, floor } => {
                number("acceptance.factor", factor, "1 or more", factor >= 1.0)?;
                number("acceptance.floor", floor, "0 or more", floor >= 0.0)?;
            }
        }
        if let Seam::MinCut { feather_px } = self.seam {
            let inside = feather_px <= self.overlap_px;
            size("seam.feather_px", feather_px, "0 to overlap_px", inside)?;
        }
        if let CentreBias::Weighted { strength } = self.centre_bias {
            let inside = (0.0..=1e6).contains(&strength);
            number("centre_bias.strength", strength, "0 to 1000000", inside)?;
        }
        Ok(())
    }
}

fn number(field: &'static str, value: f64, accepted: &'static str, inside: bool) -> Result<(), Error> {
    if inside && value.is_finite() { Ok(()) } else { Err(Error::Parameter { field, value, accepted }) }
}

/// Acceptance of candidates, by their squared differences from the target pixels in the overlaps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Acceptance {
    /// The paper's: random candidates are tried until one is below a threshold.
    Threshold {
        /// Largest root mean square difference, in the unit of the pixels, 0 or more. The paper's program uses 15 grey
        /// levels, for textures with a standard deviation of 17.
        d_max: f64,
        /// Maximum number of tries, after which the best candidate is used. 1 or more; 1000 (ours).
        max_tries: usize,
    },
    /// Ours, after Efros and Freeman: all candidates are compared, and one is drawn uniformly from those with
    /// SSD <= factor · minimum + floor · n · σ², for n compared pixels and the variance σ² of the sources.
    Near {
        /// 1 or more; 1.1 by default.
        factor: f64,
        /// Accepted mismatch, as a fraction of the variance, 0 or more; 0.05 by default. With 0, a patch whose overlap
        /// was copied from one position is always continued by the adjacent pixels, so that sources are copied
        /// verbatim.
        floor: f64,
    },
}

/// Seam between a patch and its neighbours.
///
/// Measured on nuclei of Matérn texture with the default patches: a sharp cut preserves 0.91 of the variance, and grey
/// level differences across it are 1.04 times those between adjacent source pixels. For a blurred cut these are 0.87
/// and 0.83, for a feathered seam 0.85 and 0.77.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seam {
    /// The paper's: linear blending over the overlap, with weights that sum to one.
    Feather,
    /// A cut along the path of least difference through the overlap (Efros and Freeman, 2001).
    MinCut {
        /// Half width of the box that blurs the cut, 2 · `feather_px` + 1 pixels wide. 0 to `overlap_px`. Default 0:
        /// every pixel is a pixel of a source.
        feather_px: usize,
    },
}

/// Whether "patches that are to be placed close to the center of the phantom are more likely to
/// be found in central parts of the sample images".
///
/// Positions are compared by Δ, the difference of their distances from the edge of the mask, each relative to the
/// largest in its mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CentreBias {
    /// No preference.
    Off,
    /// Under [`Acceptance::Threshold`] a candidate is tried with probability
    /// exp(-strength · Δ²); under [`Acceptance::Near`] strength · n · σ² · Δ² is added to its SSD.
    Weighted {
        /// 0 (off) to 10^6; the paper states none.
        strength: f64,
    },
}

impl CentreBias {
    pub(crate) fn strength(self) -> f64 {
        match self {
            Self::Off => 0.0,
            Self::Weighted { strength } => strength,
        }
    }
}

/// Algorithm that compares all candidates. Results agree except for rounding errors, which may change the choice
/// between equally good candidates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Search {
    /// Direct comparison with early rejection: faster for small patches.
    Direct,
    /// Fourier transforms: faster for large patches on large sources.
    Fft,
    /// The estimated faster one for each source.
    Auto,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn out_of_range_parameters_are_rejected() {
        let good = QuiltParams::default;
        let near = |factor, floor| Acceptance::Near { factor, floor };
        let threshold = |d_max, max_tries| Acceptance::Threshold { d_max, max_tries };
        for bad in [
            QuiltParams { patch_px: 1, ..good() },
            QuiltParams { patch_px: 257, ..good() },
            QuiltParams { overlap_px: 0, ..good() },
            QuiltParams { overlap_px: 5, ..good() },
            QuiltParams { acceptance: near(0.9, 0.0), ..good() },
            QuiltParams { acceptance: near(f64::NAN, 0.0), ..good() },
            QuiltParams { acceptance: near(1.1, -1.0), ..good() },
            QuiltParams { acceptance: near(1.1, f64::INFINITY), ..good() },
            QuiltParams { acceptance: threshold(-1.0, 9), ..good() },
            QuiltParams { acceptance: threshold(1.0, 0), ..good() },
            QuiltParams { seam: Seam::MinCut { feather_px: 4 }, ..good() },
            QuiltParams { centre_bias: CentreBias::Weighted { strength: f64::NAN }, ..good() },
        ] {
            assert!(matches!(bad.check(), Err(Error::Parameter { .. })), "{bad:?}");
        }
        let message = QuiltParams { patch_px: 1, ..good() }.check().unwrap_err();
        assert_eq!(message.to_string(), "patch_px = 1 is out of range: expected 2 to 256");
    }
}

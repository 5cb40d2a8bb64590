use crate::Error;

/// How a texture is stitched from patches.
#[derive(Debug, Clone, PartialEq)]
pub struct QuiltParams {
    /// Side of a square patch with its overlaps, px, 2 to 256. Default 9 (ours).
    pub patch_px: usize,
    /// How far a patch lies on its neighbours, px, 1 to half of `patch_px`. Default 3 (ours).
    pub overlap_px: usize,
    /// Which candidates are good enough. Default [`Acceptance::Near`] (ours).
    pub acceptance: Acceptance,
    /// How a patch is joined to its neighbours. Default [`Seam::MinCut`] (ours).
    pub seam: Seam,
    /// Whether central patches come from the centres of sources. Default weighted (the paper's)
    /// with strength 0.5 (ours).
    pub centre_bias: CentreBias,
    /// How all candidates are compared. Default [`Search::Auto`] (ours). Has no effect on
    /// [`Acceptance::Threshold`], which tries some and compares the rest directly.
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
    /// The paper's way ("Texture synthesis", Fig. 4), with the numbers of its program: patches of
    /// 7 px with an overlap of 2, random candidates within 15 grey levels, feathered.
    ///
    /// The number of tries and the strength of the weighting are not given; these are ours.
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

/// Which candidates are good enough to be pasted.
///
/// A candidate is judged by the squared differences from what already lies under its overlaps,
/// over those pixels that will be seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Acceptance {
    /// The paper's: candidates are tried at random until one is close enough.
    Threshold {
        /// Greatest root mean square difference, in units of the pixels, 0 or more. The paper's
        /// program has 15 grey levels, for textures with a standard deviation of 17.
        d_max: f64,
        /// After so many candidates the best of them is taken. 1 or more; 1000 (ours).
        max_tries: usize,
    },
    /// Ours, after Efros and Freeman: all candidates are compared, and one is chosen evenly from
    /// those with SSD <= factor · minimum + floor · n · σ², n pixels compared, σ² the variance of
    /// the sources.
    Near {
        /// 1 or more; 1.1 by default.
        factor: f64,
        /// Mismatch that counts as none, a part of the variance, 0 or more; 0.05 by default.
        /// Without it a patch whose overlap was copied from one place is always continued by the
        /// pixels beside that place, and sources reappear verbatim.
        floor: f64,
    },
}

/// How a patch is joined to what lies under its overlaps.
///
/// Measured on nuclei of Matérn texture with the default patches: a sharp cut keeps 0.91 of the
/// variance, and its steps are 1.04 times those between neighbours in a source; a blurred cut
/// keeps 0.87 and a feathered seam 0.85, with steps of 0.83 and 0.77.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seam {
    /// The paper's: the new patch fades in over the overlap, with weights that sum to one.
    Feather,
    /// The path of least difference through the overlap (Efros and Freeman, 2001).
    MinCut {
        /// The cut is blurred by a box of 2 · `feather_px` + 1 pixels. 0 to `overlap_px`. 0 by
        /// default: every pixel is one pixel of a source.
        feather_px: usize,
    },
}

/// Whether "patches that are to be placed close to the center of the phantom are more likely to
/// be found in central parts of the sample images".
///
/// Places are compared by Δ, the difference of their distances from the mask's edge, each
/// relative to the largest in its mask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CentreBias {
    /// Any place will do.
    Off,
    /// Under [`Acceptance::Threshold`] a candidate is tried with probability
    /// exp(-strength · Δ²); under [`Acceptance::Near`] strength · n · σ² · Δ² is added to its SSD.
    Weighted {
        /// 0 (off) to 10^6; the paper gives none.
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

/// How all candidates are compared. The results agree but for rounding, which may tip a choice
/// between candidates that are equally good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Search {
    /// Difference by difference, with early rejection: best for small patches.
    Direct,
    /// By Fourier transform: best for large patches on large sources.
    Fft,
    /// Whichever should be faster for a source.
    Auto,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_numbers_are_errors() {
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
        assert_eq!(message.to_string(), "patch_px is 1; accepted: 2 to 256");
    }
}

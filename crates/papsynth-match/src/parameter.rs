//! The sought parameters with their prior ranges.

use serde::{Deserialize, Serialize};

/// Scale of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Differences.
    Linear,
    /// Ratios.
    Logarithmic,
}

/// Method that finds a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// Measurement: a statistic of the real fields is the parameter.
    Measured,
    /// Simulation: recipes with the statistics of the real fields.
    Simulated,
}

/// Prior range of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Fields of the recipe, and the number of their distribution.
    pub path: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Minimum.
    pub low: f64,
    /// Maximum.
    pub high: f64,
    /// Scale on which the prior distribution is uniform.
    pub scale: Scale,
    /// Method.
    pub source: Source,
}

macro_rules! parameters {
    ($($(#[$doc:meta])* $name:ident: $source:ident, $scale:ident $low:literal..$high:literal $unit:literal, $path:literal;)*) => {
        /// A parameter of a match.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "kebab-case")]
        pub enum Parameter {
            $($(#[$doc])* $name,)*
        }

        /// All parameters, in the order of reports.
        pub const PARAMETERS: [Parameter; [$(Parameter::$name),*].len()] = [$(Parameter::$name),*];

        impl Parameter {
            /// Returns the prior range.
            #[must_use]
            pub fn prior(self) -> Prior {
                match self {
                    $(Self::$name => Prior {
                        path: $path, unit: $unit, low: $low, high: $high, scale: Scale::$scale, source: Source::$source,
                    },)*
                }
            }
        }
    };
}

parameters! {
    /// Mean light of the empty slide, fraction of full scale, after the mean loss by the background texture.
    Level: Measured, Linear 0.55..1.0 "", "background.level: mean light";
    /// Standard deviation of the level between fields.
    LevelSd: Measured, Linear 0.0..0.04 "", "background.level: sd";
    /// Fall-off of the light towards the left and right border.
    FalloffX: Measured, Linear 0.0..0.12 "", "background.illumination.falloff_x: mean";
    /// Fall-off of the light towards the upper and lower border.
    FalloffY: Measured, Linear 0.0..0.12 "", "background.illumination.falloff_y: mean";
    /// Standard deviation of noise of the empty slide, grey levels of 255.
    Noise: Measured, Logarithmic 0.5..6.0 "dn", "camera.full_well_e, camera.read_noise_e: noise of the empty slide";
    /// Fraction of the noise variance that is the same in all images.
    Pattern: Measured, Linear 0.0..0.8 "", "camera.prnu: part of the variance of noise";
    /// Correlation of noise with the next pixel of the row, in fused images.
    NoiseCorrelationX: Measured, Linear 0.0..0.45 "", "focus.noise_correlation_x";
    /// Correlation of noise with the next pixel of the column, in fused images.
    NoiseCorrelationY: Measured, Linear 0.0..0.45 "", "focus.noise_correlation_y";
    /// Pixel size; sought on request only.
    Pixel: Simulated, Logarithmic 0.15..0.75 "um", "field.pixel_um";
    /// Fraction of photon noise in the noise variance of the empty slide, without the fixed pattern.
    Photons: Simulated, Linear 0.05..0.95 "", "camera.full_well_e, camera.read_noise_e: part of photons";
    /// Blur beyond diffraction, median over fields.
    Blur: Simulated, Logarithmic 0.08..0.9 "um", "optics.extra_blur_um: median";
    /// Standard deviation of the logarithm of the blur between fields.
    BlurSd: Simulated, Linear 0.0..0.4 "", "optics.extra_blur_um: log sd";
    /// Depth range of cells.
    Depth: Simulated, Logarithmic 0.5..12.0 "um", "slide.depth_um";
    /// Stain of the cytoplasm of a field, median over fields.
    FieldCytoplasm: Simulated, Logarithmic 0.35..2.5 "", "stain.field_cytoplasm: median";
    /// Standard deviation of the logarithm of this stain between fields.
    FieldCytoplasmSd: Simulated, Linear 0.02..0.7 "", "stain.field_cytoplasm: log sd";
    /// Stain of the nuclei of a field, median over fields.
    FieldNucleus: Simulated, Logarithmic 0.35..2.0 "", "stain.field_nucleus: median";
    /// Standard deviation of the logarithm of this stain between fields.
    FieldNucleusSd: Simulated, Linear 0.02..0.4 "", "stain.field_nucleus: log sd";
    /// Contrast of chromatin, median over fields.
    Texture: Simulated, Logarithmic 0.15..2.5 "", "stain.field_texture: median";
    /// Standard deviation of the logarithm of this contrast between fields.
    TextureSd: Simulated, Linear 0.02..0.7 "", "stain.field_texture: log sd";
    /// Standard deviation of the logarithm of the stain of cytoplasm between cells, in addition to that of the model.
    CellCytoplasm: Simulated, Linear 0.0..0.7 "", "cells.*.cytoplasm_stain: log sd";
    /// Standard deviation of the logarithm of the stain of nuclei between cells, in addition to that of the model.
    CellNucleus: Simulated, Linear 0.0..0.4 "", "cells.*.nucleus_stain: log sd";
    /// Domed fraction of the thickness of a nucleus.
    Dome: Simulated, Linear 0.0..1.0 "", "nucleus.dome: mean";
    /// Absorbance of the rim of nuclei over that of the inside.
    Rim: Simulated, Linear 0.0..0.4 "", "nucleus.rim: mean";
    /// Strength of the structures of the cytoplasm, relative to the initial recipe.
    Structure: Simulated, Logarithmic 0.2..3.0 "", "cytoplasm.clouds, flecks, cytoskeleton, grain: factor";
    /// Number of cells, median over fields.
    Cells: Simulated, Logarithmic 40.0..700.0 "/mm2", "cells.*.count: median";
    /// Standard deviation of the logarithm of the number of cells between fields.
    CellsSd: Simulated, Linear 0.05..0.9 "", "cells.*.count: log sd";
    /// Fraction of superficial cells among superficial and intermediate cells.
    Superficial: Simulated, Linear 0.02..0.98 "", "cells.superficial.count: share";
    /// Factor on the size of cells and nuclei.
    Size: Simulated, Logarithmic 0.6..1.6 "", "cells.*.size";
    /// Radius of clusters of cells.
    ClusterRadius: Simulated, Logarithmic 8.0..80.0 "um", "layout.radius_um";
    /// Weight of positions outside clusters.
    Outside: Simulated, Logarithmic 0.01..1.0 "", "layout.outside";
    /// Clusters of leukocytes.
    Leukocytes: Simulated, Logarithmic 3.0..400.0 "/mm2", "debris.leukocytes.clusters: median";
    /// Clusters of bacilli.
    Bacilli: Simulated, Logarithmic 3.0..400.0 "/mm2", "debris.bacilli.clusters: median";
    /// Specks.
    Speckles: Simulated, Logarithmic 6.0..2000.0 "/mm2", "debris.speckles.count: median";
    /// Amorphous clumps.
    Smudges: Simulated, Logarithmic 6.0..800.0 "/mm2", "debris.smudges.count: median";
    /// Clusters of faint dirt.
    Dirt: Simulated, Logarithmic 12.0..1500.0 "/mm2", "debris.dirt.clusters: median";
    /// Strength of the background texture.
    BackgroundTexture: Simulated, Logarithmic 0.002..0.06 "", "background.texture: mean";
}

impl Parameter {
    /// Returns the name.
    #[must_use]
    pub fn name(self) -> String {
        serde_json::to_value(self).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
    }

    /// Returns the index in [`PARAMETERS`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}

impl Prior {
    /// Returns the position of a value in the range: 0 to 1 inside.
    #[must_use]
    pub fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Logarithmic => libm::log(value.max(1e-12) / self.low) / libm::log(self.high / self.low),
        }
    }

    /// Returns the value at a position.
    #[must_use]
    pub fn value(&self, place: f64) -> f64 {
        match self.scale {
            Scale::Linear => self.low + place * (self.high - self.low),
            Scale::Logarithmic => self.low * libm::exp(place * libm::log(self.high / self.low)),
        }
    }
}

/// A value for each parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Values(pub(crate) [f64; PARAMETERS.len()]);

impl Values {
    /// Returns the values at these positions in their ranges.
    #[must_use]
    pub fn at(places: &[f64; PARAMETERS.len()]) -> Self {
        Self(std::array::from_fn(|i| PARAMETERS[i].prior().value(places[i])))
    }

    /// Returns the value of a parameter.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter.index()]
    }

    /// Sets the value of a parameter.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        self.0[parameter.index()] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn place_and_value_are_inverses() {
        for parameter in PARAMETERS {
            let prior = parameter.prior();
            assert!(prior.low < prior.high && (prior.scale == Scale::Linear || prior.low > 0.0), "{parameter:?}");
            for place in [0.0, 0.3, 1.0] {
                assert!((prior.place(prior.value(place)) - place).abs() < 1e-12, "{parameter:?}");
            }
        }
    }
}

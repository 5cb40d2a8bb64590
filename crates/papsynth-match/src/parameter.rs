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

/// What shares a value of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// Each field has a value of its own.
    Field,
    /// All fields share one value.
    All,
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
    /// What shares a value.
    pub level: Level,
}

macro_rules! parameters {
    ($($(#[$doc:meta])* $name:ident: $source:ident, $level:ident, $scale:ident $low:literal..$high:literal $unit:literal, $path:literal;)*) => {
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
                        path: $path,
                        unit: $unit,
                        low: $low,
                        high: $high,
                        scale: Scale::$scale,
                        source: Source::$source,
                        level: Level::$level,
                    },)*
                }
            }
        }
    };
}

parameters! {
    /// Light of the empty slide, fraction of full scale, after the mean loss by the background texture.
    Level: Measured, Field, Linear 0.55..1.0 "", "background.level";
    /// Fall-off of the light towards the left and right border.
    FalloffX: Measured, Field, Linear 0.0..0.12 "", "background.illumination.falloff_x";
    /// Fall-off of the light towards the upper and lower border.
    FalloffY: Measured, Field, Linear 0.0..0.12 "", "background.illumination.falloff_y";
    /// Standard deviation of noise of the empty slide, grey levels of 255.
    Noise: Measured, Field, Logarithmic 0.5..6.0 "dn", "camera.full_well_e, camera.read_noise_e: noise of the empty slide";
    /// Fraction of the noise variance that is the same in all images.
    Pattern: Simulated, All, Linear 0.0..0.8 "", "camera.prnu, camera.dsnu_e: part of the variance of noise";
    /// Correlation of noise with the next pixel of the row, in EDF images.
    NoiseCorrelationX: Measured, Field, Linear 0.0..0.45 "", "focus.noise_correlation_x";
    /// Correlation of noise with the next pixel of the column, in EDF images.
    NoiseCorrelationY: Measured, Field, Linear 0.0..0.45 "", "focus.noise_correlation_y";
    /// Pixel size; sought on request only.
    Pixel: Simulated, All, Logarithmic 0.15..0.75 "um", "field.pixel_um";
    /// Fraction of photon noise in the noise variance of the empty slide, without the fixed pattern.
    Photons: Simulated, All, Linear 0.05..0.95 "", "camera.full_well_e, camera.read_noise_e: part of photons";
    /// Blur beyond diffraction. The fields of EDF images share one value.
    Blur: Simulated, Field, Logarithmic 0.08..0.9 "um", "optics.extra_blur_um";
    /// Fraction of the light that is stray light. Fields share one value if it is evenly distributed.
    StrayLight: Simulated, Field, Linear 0.0..0.35 "", "optics.stray_light";
    /// Depth range of cells.
    Depth: Simulated, All, Logarithmic 0.5..12.0 "um", "slide.depth_um";
    /// Stain of the cytoplasm of a field.
    FieldCytoplasm: Simulated, Field, Logarithmic 0.35..2.5 "", "stain.field_cytoplasm";
    /// Stain of the nuclei of a field.
    FieldNucleus: Simulated, Field, Logarithmic 0.35..3.5 "", "stain.field_nucleus";
    /// Contrast of chromatin.
    Texture: Simulated, Field, Logarithmic 0.2..1.6 "", "stain.field_texture";
    /// Factor on the standard deviation of the absorbance of cytoplasm between cells.
    CytoplasmVariation: Simulated, All, Linear 0.0..2.5 "", "stain.cytoplasm_variation";
    /// Factor on the standard deviations of absorbance and texture between nuclei.
    NucleusVariation: Simulated, All, Linear 0.0..2.5 "", "stain.nucleus_variation";
    /// Domed fraction of the thickness of a nucleus.
    Dome: Simulated, Field, Linear 0.0..1.0 "", "nucleus.dome: mean";
    /// Absorbance of the rim of nuclei over that of the inside.
    Rim: Simulated, All, Linear 0.0..0.4 "", "nucleus.rim: mean";
    /// Softness of the edges of nuclei.
    Edge: Simulated, Field, Linear 0.0..1.0 "um", "nucleus.edge_um: mean";
    /// Clumping of chromatin.
    Clumping: Simulated, All, Linear 0.0..1.0 "", "nucleus.clumping: mean";
    /// Fraction of nuclei that are small, dark and without structure.
    Pyknotic: Simulated, Field, Linear 0.0..0.3 "", "nucleus.pyknotic";
    /// Width of the border in which cells become thin.
    CellEdge: Simulated, Field, Logarithmic 0.8..8.0 "um", "cytoplasm.rim_um";
    /// Specks and spots of the cytoplasm, relative to the initial recipe. The strengths of clouds and of the
    /// cytoskeleton change by its root.
    Structure: Simulated, Field, Logarithmic 0.1..6.0 "", "cytoplasm.specks, flecks: factor; clouds, cytoskeleton: root";
    /// Strength of the fine texture of the cytoplasm, relative to the initial recipe.
    FineTexture: Simulated, Field, Logarithmic 0.1..6.0 "", "cytoplasm.texture: factor";
    /// Number of cells.
    Cells: Simulated, Field, Logarithmic 40.0..700.0 "/mm2", "cells.*.count: all classes";
    /// Fraction of superficial cells among superficial and intermediate cells.
    Superficial: Simulated, Field, Linear 0.02..0.98 "", "cells.superficial.count: share";
    /// Fraction of cells of the classes of lesions among all cells.
    Lesion: Simulated, Field, Linear 0.02..0.98 "", "cells.*.count: share of lesions";
    /// Factor on the size of cells and nuclei.
    Size: Simulated, Field, Logarithmic 0.6..1.6 "", "cells.*.size";
    /// Factor on the standard deviation of the logarithm of sizes.
    SizeVariation: Simulated, All, Linear 0.0..2.0 "", "cells.*.size_variation";
    /// Additional factor on the size of nuclei.
    NucleusSize: Simulated, Field, Logarithmic 0.6..1.6 "", "cells.*.nucleus_size";
    /// Radius of clusters of cells.
    ClusterRadius: Simulated, All, Logarithmic 8.0..80.0 "um", "layout.radius_um";
    /// Weight of positions outside clusters.
    Outside: Simulated, All, Logarithmic 0.01..1.0 "", "layout.outside";
    /// Granular material at the rim of cells.
    Degeneration: Simulated, Field, Logarithmic 0.03..1.5 "", "cytoplasm.degeneration";
    /// Clusters of leukocytes.
    Leukocytes: Simulated, Field, Logarithmic 3.0..400.0 "/mm2", "debris.leukocytes.clusters";
    /// Clusters of bacilli.
    Bacilli: Simulated, Field, Logarithmic 3.0..400.0 "/mm2", "debris.bacilli.clusters";
    /// Specks.
    Speckles: Simulated, Field, Logarithmic 6.0..2000.0 "/mm2", "debris.speckles.count";
    /// Amorphous clumps.
    Smudges: Simulated, Field, Logarithmic 6.0..800.0 "/mm2", "debris.smudges.count";
    /// Clusters of faint dirt.
    Dirt: Simulated, Field, Logarithmic 12.0..1500.0 "/mm2", "debris.dirt.clusters";
    /// Strength of the background texture.
    BackgroundTexture: Simulated, Field, Logarithmic 0.002..0.06 "", "background.texture";
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

    /// Returns a difference on the scale of the parameter for a difference of positions.
    #[must_use]
    pub fn difference(&self, places: f64) -> f64 {
        match self.scale {
            Scale::Linear => places * (self.high - self.low),
            Scale::Logarithmic => places * libm::log(self.high / self.low),
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

/// A value for each parameter, with a standard deviation around it on the scale of the parameter: of the logarithm for
/// a logarithmic one.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    values: [f64; PARAMETERS.len()],
    spreads: [f64; PARAMETERS.len()],
}

impl Values {
    /// Returns the values at these positions in their ranges, without spread.
    #[must_use]
    pub fn at(places: &[f64; PARAMETERS.len()]) -> Self {
        Self { values: std::array::from_fn(|i| PARAMETERS[i].prior().value(places[i])), ..Self::zero() }
    }

    pub(crate) fn zero() -> Self {
        Self { values: [0.0; PARAMETERS.len()], spreads: [0.0; PARAMETERS.len()] }
    }

    /// Returns the value of a parameter.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> f64 {
        self.values[parameter.index()]
    }

    /// Returns the standard deviation around the value of a parameter.
    #[must_use]
    pub fn spread(&self, parameter: Parameter) -> f64 {
        self.spreads[parameter.index()]
    }

    /// Sets the value of a parameter.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        self.values[parameter.index()] = value;
    }

    /// Sets the standard deviation around the value of a parameter.
    pub fn set_spread(&mut self, parameter: Parameter, spread: f64) {
        self.spreads[parameter.index()] = spread;
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

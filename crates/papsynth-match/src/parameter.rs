//! What is sought: every parameter with the range that is thought possible before anything is seen.

use serde::{Deserialize, Serialize};

/// How a parameter counts: in steps or in factors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// In steps.
    Linear,
    /// In factors.
    Logarithmic,
}

/// How a parameter is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// A statistic of the real fields is the parameter.
    Measured,
    /// By simulation: which recipes have statistics like those of the real fields.
    Simulated,
}

/// What is known of a parameter beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Its fields in a recipe, and which number of their distribution.
    pub path: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// All values between them are equally likely, in steps or in factors.
    pub scale: Scale,
    /// How it is found.
    pub source: Source,
}

macro_rules! parameters {
    ($($(#[$doc:meta])* $name:ident: $source:ident, $scale:ident $low:literal..$high:literal $unit:literal, $path:literal;)*) => {
        /// A parameter that is sought.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        #[serde(rename_all = "kebab-case")]
        pub enum Parameter {
            $($(#[$doc])* $name,)*
        }

        /// All parameters, in the order in which they are told.
        pub const PARAMETERS: [Parameter; [$(Parameter::$name),*].len()] = [$(Parameter::$name),*];

        impl Parameter {
            /// What is known of it beforehand: the one table of ranges.
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
    /// Mean light of the empty slide, a part of full scale: what scatter takes, half its strength, is off.
    Level: Measured, Linear 0.55..1.0 "", "background.level: mean light";
    /// Its standard deviation between fields.
    LevelSd: Measured, Linear 0.0..0.04 "", "background.level: sd";
    /// Fall of the light towards the left and right border.
    BowlAcross: Measured, Linear 0.0..0.12 "", "background.illumination.falloff_x: mean";
    /// Towards the upper and lower border.
    BowlDown: Measured, Linear 0.0..0.12 "", "background.illumination.falloff_y: mean";
    /// Standard deviation of all noise of the empty slide, levels of 8 bits.
    Noise: Measured, Logarithmic 0.5..6.0 "dn", "camera.full_well_e, camera.read_noise_e: noise of the empty slide";
    /// Part of its variance that is the same in every picture.
    Pattern: Measured, Linear 0.0..0.8 "", "camera.prnu: part of the variance of noise";
    /// Noise shared with the next pixel of the row, in a fused picture.
    Across: Measured, Linear 0.0..0.45 "", "focus.noise_correlation_x";
    /// With the next pixel of the column.
    Down: Measured, Linear 0.0..0.45 "", "focus.noise_correlation_y";
    /// Size of a pixel; sought only where it is asked for.
    Pixel: Simulated, Logarithmic 0.15..0.75 "um", "field.pixel_um";
    /// Part of the noise of the empty slide, without its fixed pattern, that is that of photons.
    Photons: Simulated, Linear 0.05..0.95 "", "camera.full_well_e, camera.read_noise_e: part of photons";
    /// Spread of light beyond diffraction, median over fields.
    Blur: Simulated, Logarithmic 0.08..0.9 "um", "optics.extra_blur_um: median";
    /// Standard deviation of its logarithm between fields.
    BlurSd: Simulated, Linear 0.0..0.4 "", "optics.extra_blur_um: log sd";
    /// Depth over which cells lie.
    Depth: Simulated, Logarithmic 0.5..12.0 "um", "slide.depth_um";
    /// Stain of all cytoplasm of a field, median over fields.
    FieldCytoplasm: Simulated, Logarithmic 0.35..2.5 "", "stain.field_cytoplasm: median";
    /// Standard deviation of its logarithm between fields.
    FieldCytoplasmSd: Simulated, Linear 0.02..0.7 "", "stain.field_cytoplasm: log sd";
    /// Stain of all nuclei of a field, median over fields.
    FieldNucleus: Simulated, Logarithmic 0.35..2.0 "", "stain.field_nucleus: median";
    /// Standard deviation of its logarithm between fields.
    FieldNucleusSd: Simulated, Linear 0.02..0.4 "", "stain.field_nucleus: log sd";
    /// Contrast of chromatin, median over fields.
    Texture: Simulated, Logarithmic 0.15..2.5 "", "stain.field_texture: median";
    /// Standard deviation of its logarithm between fields.
    TextureSd: Simulated, Linear 0.02..0.7 "", "stain.field_texture: log sd";
    /// Standard deviation of the logarithm of the cytoplasm's stain between cells, beyond that of the model.
    CellCytoplasm: Simulated, Linear 0.0..0.7 "", "cells.*.cytoplasm_stain: log sd";
    /// Of that of nuclei.
    CellNucleus: Simulated, Linear 0.0..0.4 "", "cells.*.nucleus_stain: log sd";
    /// Share of a nucleus's thickness that is domed.
    Dome: Simulated, Linear 0.0..1.0 "", "nucleus.dome: mean";
    /// Absorbance of the rim of nuclei over that of the inside.
    Rim: Simulated, Linear 0.0..0.4 "", "nucleus.rim: mean";
    /// Strength of all structure of the cytoplasm, over that of the recipe to begin with.
    Structure: Simulated, Logarithmic 0.2..3.0 "", "cytoplasm.clouds, flecks, cytoskeleton, grain: factor";
    /// Cells, median over fields.
    Cells: Simulated, Logarithmic 40.0..700.0 "/mm2", "cells.*.count: median";
    /// Standard deviation of the logarithm of their number between fields.
    CellsSd: Simulated, Linear 0.05..0.9 "", "cells.*.count: log sd";
    /// Share of superficial among superficial and intermediate cells.
    Superficial: Simulated, Linear 0.02..0.98 "", "cells.superficial.count: share";
    /// Factor on the size of cells with their nuclei.
    Size: Simulated, Logarithmic 0.6..1.6 "", "cells.*.size";
    /// Radius of clusters of cells.
    ClusterRadius: Simulated, Logarithmic 8.0..80.0 "um", "layout.radius_um";
    /// Weight of the places outside clusters.
    Outside: Simulated, Logarithmic 0.01..1.0 "", "layout.outside";
    /// Clusters of leukocytes.
    Leukocytes: Simulated, Logarithmic 3.0..400.0 "/mm2", "debris.leukocytes.clusters: median";
    /// Clusters of bacilli.
    Bacilli: Simulated, Logarithmic 3.0..400.0 "/mm2", "debris.bacilli.clusters: median";
    /// Specks.
    Speckles: Simulated, Logarithmic 6.0..2000.0 "/mm2", "debris.speckles.count: median";
    /// Amorphous clumps.
    Smudges: Simulated, Logarithmic 6.0..800.0 "/mm2", "debris.smudges.count: median";
    /// Drifts of faint dirt.
    Dirt: Simulated, Logarithmic 12.0..1500.0 "/mm2", "debris.dirt.clusters: median";
    /// Unevenness of the light.
    Scatter: Simulated, Logarithmic 0.002..0.06 "", "background.texture: mean";
}

impl Parameter {
    /// Its name.
    #[must_use]
    pub fn name(self) -> String {
        serde_json::to_value(self).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
    }

    /// Its place in [`PARAMETERS`].
    #[must_use]
    pub fn index(self) -> usize {
        self as usize
    }
}

impl Prior {
    /// From a value to its place in the range, 0 to 1; beyond it where the value is.
    #[must_use]
    pub fn place(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Logarithmic => libm::log(value.max(1e-12) / self.low) / libm::log(self.high / self.low),
        }
    }

    /// The value at a place.
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
    /// Of their places in their ranges.
    #[must_use]
    pub fn at(places: &[f64; PARAMETERS.len()]) -> Self {
        Self(std::array::from_fn(|i| PARAMETERS[i].prior().value(places[i])))
    }

    /// One of them.
    #[must_use]
    pub fn get(&self, parameter: Parameter) -> f64 {
        self.0[parameter.index()]
    }

    /// Another value of one.
    pub fn set(&mut self, parameter: Parameter, value: f64) {
        self.0[parameter.index()] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_values_are_inverses() {
        for parameter in PARAMETERS {
            let prior = parameter.prior();
            assert!(prior.low < prior.high && (prior.scale == Scale::Linear || prior.low > 0.0), "{parameter:?}");
            for place in [0.0, 0.3, 1.0] {
                assert!((prior.place(prior.value(place)) - place).abs() < 1e-12, "{parameter:?}");
            }
        }
    }
}

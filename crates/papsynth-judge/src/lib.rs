#![doc = include_str!("../README.md")]

mod background;
mod control;
mod crops;
mod describe;
mod error;
#[doc(hidden)]
pub mod filter;
mod forest;
mod html;
mod image;
mod judge;
mod measure;
mod moments;
mod nuclei;
#[doc(hidden)]
pub mod number;
mod region;
mod statistics;
pub mod svg;
mod table;
mod text;
mod tree;
mod two_sample;

pub use control::{Control, Phase, Progress};
pub use describe::describe;
pub use error::Error;
pub use image::{FieldImage, NucleiAnnotation};
pub use judge::{
    Conclusion, Curve, FeatureSet, FieldComparison, Judge, JudgeParams, Percentiles, Report, Scalar, Test,
};
pub use measure::{
    BareCytoplasm, CYTOPLASM_NAMES, Detail, Field, HISTOGRAM, HISTOGRAM_FROM, HISTOGRAM_STEP, Measurer, MeasurerParams,
    Named, NucleiFrom, PROFILE, RADII_UM, Statistics, TEXTURE, clark_evans, frequencies, ripley,
};
pub use moments::{Descriptor, Moments, qq_slope};
pub use nuclei::NucleiParams;
pub use statistics::auc;
pub use table::{Feature, FeatureKind, FeatureTable};
pub use two_sample::{DistinguishingFeature, KindAuc, TwoSample, TwoSampleParams, two_sample};

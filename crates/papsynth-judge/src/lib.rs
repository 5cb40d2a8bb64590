#![doc = include_str!("../README.md")]

mod background;
mod crops;
mod error;
#[doc(hidden)]
pub mod filter;
mod html;
mod judge;
mod measure;
mod moments;
mod nuclei;
#[doc(hidden)]
pub mod number;
mod picture;
mod region;
mod statistics;
pub mod svg;
mod table;
mod tree;
mod two_sample;

pub use error::Error;
pub use judge::{Beside, Curve, Judge, JudgeParams, Report, Scalar, Spread, Test, Verdict};
pub use measure::{
    Detail, Field, Gauge, GaugeParams, HISTOGRAM, HISTOGRAM_FROM, HISTOGRAM_STEP, Named, NucleiFrom, PROFILE, RADII_UM,
    Statistics, clark_evans, frequencies, ripley,
};
pub use moments::{Descriptor, Moments, qq_slope};
pub use nuclei::NucleiParams;
pub use picture::{Known, Picture};
pub use statistics::auc;
pub use table::{Family, Feature, Table};
pub use two_sample::{FamilyAlone, Giveaway, TwoSample, TwoSampleParams, two_sample};

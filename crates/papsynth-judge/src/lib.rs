#![doc = include_str!("../README.md")]

mod background;
mod beside;
mod crops;
mod error;
mod filter;
mod forest;
mod html;
mod judge;
mod measure;
mod moments;
mod nuclei;
mod number;
mod picture;
mod region;
mod statistics;
pub mod svg;
mod table;
mod tree;
mod two_sample;

pub use beside::{Beside, Curve, Scalar, Spread};
pub use error::Error;
pub use judge::{Judge, JudgeParams, Report, Test, Verdict};
pub use measure::{
    Detail, Field, Gauge, GaugeParams, HISTOGRAM, HISTOGRAM_FROM, HISTOGRAM_STEP, Named, NucleiFrom, PROFILE, RADII_UM,
    Statistics, clark_evans, frequencies, ripley,
};
pub use moments::{Descriptor, Histogram, Moments, qq_slope};
pub use nuclei::NucleiParams;
pub use picture::{Known, Picture};
pub use statistics::auc;
pub use table::{Family, Feature, Table};
pub use two_sample::{FamilyAlone, Giveaway, TwoSample, TwoSampleParams, two_sample};

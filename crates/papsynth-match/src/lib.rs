#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod error;
mod fit;
mod measured;
mod noise;
mod parameter;
mod recipe;
mod refine;
mod regression;
mod summary;
mod table;
mod text;
mod view;

pub use error::Error;
pub use fit::{Distance, Fit, Match, MatchParams, Origin, ParameterFit, PixelSize, Statistic};
pub use measured::{Measured, measure, measure_with};
pub use parameter::{PARAMETERS, Parameter, Prior, Scale, Source, Values};
pub use recipe::{FieldSd, Setting, recipe};
pub use regression::{Estimate, Regression, WIDEST};
pub use summary::Summary;
pub use table::{Plan, SimulationTable, TableParams, unseen};
pub use view::{MakeEngine, WindowSampler};

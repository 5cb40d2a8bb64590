#![doc = include_str!("../README.md")]

mod error;
mod fit;
mod interval;
mod measured;
mod noise;
mod number;
mod parameter;
mod recipe;
mod refine;
mod regression;
mod ridge;
mod small;
mod summary;
mod table;
mod text;
mod view;

pub use error::Error;
pub use fit::{Answer, Distance, Fit, Match, MatchParams, Origin, PixelSize, Statistic, WIDEST};
pub use measured::{Measured, measure};
pub use parameter::{PARAMETERS, Parameter, Prior, Scale, Source, Values};
pub use recipe::{Setting, Spreads, recipe};
pub use regression::{Estimate, Regression};
pub use summary::Summary;
pub use table::{Step, Table, TableParams, unseen};
pub use view::{MakeEngine, View};

#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod breakdown;
mod design;
mod error;
mod fields;
mod key;
mod parameters;
mod grey_image;
mod plan;
mod results;
mod saved;
mod score;
mod session;
#[cfg(test)]
mod support;
mod table;

pub use breakdown::Group;
pub use design::{Answer, Grey, RANDOM, Side, Stage, StudyParams, TrialDesign};
pub use error::Error;
pub use results::{Exposures, Pool, Precision, Row, Summary};
pub use saved::Exposure;
pub use score::{Counts, DEFAULT_HALF_WIDTH, Detection, Interval, Proportion, trials_for};
pub use session::{Session, SessionError, State};
pub use table::{breakdown_table, table};

#![doc = include_str!("../README.md")]

mod design;
mod error;
mod fields;
mod normal;
mod parameters;
mod patch;
mod picture;
mod plan;
mod results;
mod score;
mod session;
#[cfg(test)]
mod support;
mod web;

pub use design::{Grey, Order, RANDOM, Side, Stage, StudyParams, Task, order};
pub use error::Error;
pub use rand_core::Rng;
pub use results::{Claim, Exposures, Group, Pool, Row, Summary, breakdown_table, table};
pub use score::{CLAIM_HALF_WIDTH, Counts, Detection, Interval, Proportion, mean_over_subjects, trials_for};
pub use session::{Answer, Exposure, Session, State};
pub use web::Server;

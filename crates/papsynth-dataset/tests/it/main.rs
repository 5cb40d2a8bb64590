//! Integration tests, linked as one program.

mod corpus;
mod formats;
mod hostile;
mod parquet;
mod reading;
mod resuming;
mod slide;
mod store;
#[path = "../support/mod.rs"]
mod support;
mod verifying;
mod writing;

#![doc = include_str!("../README.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod elementary;
pub mod fourier;
pub mod random;
pub mod rounding;
pub mod statistics;

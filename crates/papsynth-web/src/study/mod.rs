//! The visual study: patches, and what people say of them.

mod site;

pub use site::{Study, serve_study};

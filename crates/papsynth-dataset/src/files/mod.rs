//! Whole files or none, in folders and object stores.

#[cfg(feature = "cloud")]
mod cloud;
pub(crate) mod fault;
mod file_record;
mod folder;
mod pending;
mod place;
mod store;

#[cfg(feature = "cloud")]
pub use cloud::Bucket;
pub use file_record::{Check, FileRecord};
pub(crate) use folder::Folder;
pub use folder::write_file;
pub(crate) use pending::{Handle, Output, Pending, is_temporary};
pub use store::{Home, Store};

//! Integration tests, linked as one program.

mod emva;
mod jpeg;
mod properties;

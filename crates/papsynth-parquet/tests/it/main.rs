//! Integration tests, linked as one program.

mod hostile;
mod round_trip;

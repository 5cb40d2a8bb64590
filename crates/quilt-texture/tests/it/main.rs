//! Integration tests, linked as one program.

mod synthesis;

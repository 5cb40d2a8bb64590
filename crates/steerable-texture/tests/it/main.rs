//! Tests of the public interface.

mod pyramid;
mod statistics;
mod synthesis;
mod textures;

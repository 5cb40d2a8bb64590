//! Integration tests, linked as one program.

mod camera;
mod density;
mod golden;
mod light;
mod live;
mod nuclei;
mod outlines;
mod same_bytes;
mod scenes;
mod slide;

//! Integration tests, linked as one program.

#[cfg(feature = "calibrate")]
mod calibrate;
mod cli;
mod hostile;
#[cfg(feature = "judge")]
mod judge;
#[cfg(feature = "learn")]
mod learn;
#[cfg(not(all(
    feature = "calibrate",
    feature = "completions",
    feature = "judge",
    feature = "learn",
    feature = "web"
)))]
mod left_out;
#[cfg(feature = "judge")]
mod match_fields;
mod memory;
#[cfg(all(unix, feature = "calibrate", feature = "judge", feature = "learn", feature = "web"))]
mod readme;
mod scenes;
mod sets;
mod slide;
#[cfg(feature = "web")]
mod study;
#[path = "../support/mod.rs"]
mod support;
#[cfg(feature = "web")]
mod view;
#[cfg(feature = "web")]
mod workbench;

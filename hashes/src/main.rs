//! Prints the hashes, one per line.

#![forbid(unsafe_code)]

use std::io::Write;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let lines = papsynth_hashes::lines()?;
    std::io::stdout().write_all(lines.as_bytes())?;
    Ok(())
}

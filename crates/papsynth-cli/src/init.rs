//! `papsynth init`: a recipe to start from.

use std::fs::OpenOptions;
use std::io::Write;

use papsynth::recipe::Preset;

use crate::args::Init;
use crate::exit::{self, Failure};

pub(crate) fn run(args: &Init) -> Result<(), Failure> {
    if args.list {
        let longest = Preset::ALL.iter().map(|preset| preset.name().len()).max().unwrap_or(0);
        let lines = Preset::ALL.map(|preset| format!("{:<longest$}  {}\n", preset.name(), preset.summary()));
        return exit::print(&lines.concat());
    }
    let text = args.preset.recipe().to_commented_toml();
    match &args.out {
        None => exit::print(&text),
        // A recipe that someone wrote by hand is never replaced.
        Some(path) => OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(path)
            .and_then(|mut file| file.write_all(text.as_bytes()))
            .map_err(|error| Failure::file("write", path, &error)),
    }
}

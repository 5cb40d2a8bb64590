#![doc = include_str!("../README.md")]
#![deny(unsafe_code)]

mod args;
#[cfg(feature = "calibrate")]
mod calibrate;
mod exit;
mod findings;
mod generate;
mod inspect;
#[cfg(feature = "judge")]
mod judge;
#[cfg(feature = "learn")]
mod learn;
#[cfg(feature = "judge")]
mod match_fields;
mod memory;
mod plan;
mod preview;
mod recipe_file;
mod report;
mod rerender;
mod setup;
mod share;
mod slide;
mod status;
mod submit;
mod sweep;
mod text_file;
#[cfg(feature = "web")]
mod web;
mod words;

use std::fs::OpenOptions;
use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use papsynth::recipe::{Preset, Recipe};

use args::{Cli, Init, Verb};
use exit::Failure;

fn main() -> ExitCode {
    memory::settle();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version arrive here too, with code 0; a closed pipe is no failure.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { exit::INPUT } else { 0 });
        }
    };
    let json = matches!(&cli.verb, Verb::Generate(args) if args.json);
    match args::check_addresses(&cli.verb, std::env::args_os()).and_then(|()| run(cli.verb)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let code = failure.code();
            if json {
                // Whoever reads JSON reads it to the end, or closed the pipe.
                let _ = report::event(&failure.json());
            } else {
                failure.print();
            }
            ExitCode::from(code)
        }
    }
}

fn run(verb: Verb) -> Result<(), Failure> {
    match verb {
        Verb::Init(args) => init(&args),
        Verb::Generate(args) => generate::run(&args),
        Verb::Preview(args) => preview::run(&args),
        Verb::Render(args) => preview::render(*args),
        #[cfg(feature = "learn")]
        Verb::Learn(args) => learn::run(&args),
        #[cfg(feature = "calibrate")]
        Verb::Calibrate(args) => calibrate::run(&args),
        #[cfg(feature = "judge")]
        Verb::Judge(args) => judge::run(&args),
        #[cfg(feature = "judge")]
        Verb::Match(args) => match_fields::run(&args),
        Verb::Inspect(args) => inspect::run(&args),
        Verb::Verify(args) => status::verify(&args),
        Verb::Convert(args) => rerender::convert(&args),
        Verb::Rerender(args) => rerender::run(&args),
        Verb::Sweep(args) => sweep::run(&args),
        Verb::Plan(args) => plan::run(&args),
        Verb::Submit(args) => submit::run(&args),
        Verb::Status(args) => status::run(&args),
        Verb::Merge(args) => status::merge(&args),
        Verb::Clean(args) => status::clean(&args),
        Verb::Slide(args) => slide::run(args.verb),
        #[cfg(feature = "web")]
        Verb::Study(args) => web::study(&args),
        #[cfg(feature = "web")]
        Verb::View(args) => web::view(&args),
        Verb::Schema(_) => {
            let schema = Recipe::schema();
            exit::print(&format!("{schema:#}\n"))
        }
        #[cfg(feature = "completions")]
        Verb::Completions(args) => {
            let (mut command, mut script) = (<Cli as clap::CommandFactory>::command(), Vec::new());
            clap_complete::generate(args.shell, &mut command, "papsynth", &mut script);
            exit::print(&String::from_utf8_lossy(&script))
        }
        #[cfg(not(feature = "calibrate"))]
        Verb::Calibrate(_) => Err(Failure::left_out("calibrate")),
        #[cfg(not(feature = "completions"))]
        Verb::Completions(_) => Err(Failure::left_out("completions")),
        #[cfg(not(feature = "judge"))]
        Verb::Judge(_) | Verb::Match(_) => Err(Failure::left_out("judge")),
        #[cfg(not(feature = "learn"))]
        Verb::Learn(_) => Err(Failure::left_out("learn")),
        #[cfg(not(feature = "web"))]
        Verb::Study(_) | Verb::View(_) => Err(Failure::left_out("web")),
    }
}

/// `papsynth init`: a recipe to start from.
fn init(args: &Init) -> Result<(), Failure> {
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

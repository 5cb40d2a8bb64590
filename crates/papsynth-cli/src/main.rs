#![doc = include_str!("../README.md")]
#![deny(unsafe_code)]

mod allocator;
mod args;
mod browser;
mod calibrate;
mod convert;
mod exit;
mod generate;
mod init;
mod inspect;
mod interrupt;
mod judge;
mod learn;
mod match_fields;
mod memory;
mod place;
mod plan;
mod preview;
mod profile;
mod recipe_file;
mod render;
mod report;
mod rerender;
mod setup;
mod share;
mod slide;
mod status;
mod study;
mod submit;
mod sweep;
mod text_file;
mod verify;
mod view;

use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use args::{Cli, Verb};
use exit::Failure;

fn main() -> ExitCode {
    allocator::settle();
    exit::install_reports();
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version arrive here too, with code 0; a closed pipe is no failure.
            let _ = error.print();
            return ExitCode::from(if error.use_stderr() { exit::Exit::Input.code() } else { 0 });
        }
    };
    let json = matches!(&cli.verb, Verb::Generate(args) if args.json);
    match place::check(&cli.verb, std::env::args_os()).and_then(|()| run(cli.verb)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            let code = failure.exit().code();
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
        Verb::Init(args) => init::run(&args),
        Verb::Generate(args) => generate::run(&args),
        Verb::Preview(args) => preview::run(&args),
        Verb::Render(args) => render::run(*args),
        Verb::Learn(args) => learn::run(&args),
        Verb::Calibrate(args) => calibrate::run(&args),
        Verb::Judge(args) => judge::run(&args),
        Verb::Match(args) => match_fields::run(&args),
        Verb::Inspect(args) => inspect::run(&args),
        Verb::Verify(args) => verify::run(&args),
        Verb::Convert(args) => convert::run(&args),
        Verb::Rerender(args) => rerender::run(&args),
        Verb::Sweep(args) => sweep::run(&args),
        Verb::Plan(args) => plan::run(&args),
        Verb::Submit(args) => submit::run(&args),
        Verb::Status(args) => status::run(&args),
        Verb::Merge(args) => status::merge(&args),
        Verb::Clean(args) => verify::clean(&args),
        Verb::Slide(args) => slide::run(args.verb),
        Verb::Study(args) => study::run(&args),
        Verb::View(args) => view::run(&args),
        Verb::Schema(_) => {
            let schema = papsynth::recipe::Recipe::schema();
            exit::print(&format!("{schema:#}\n"))
        }
        Verb::Completions(args) => {
            let mut script = Vec::new();
            clap_complete::generate(args.shell, &mut Cli::command(), "papsynth", &mut script);
            exit::print(&String::from_utf8_lossy(&script))
        }
    }
}

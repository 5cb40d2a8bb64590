#![doc = include_str!("../README.md")]
#![deny(unsafe_code)]

mod args;
#[cfg(feature = "calibrate")]
mod calibrate;
mod exit;
mod findings;
mod generate;
mod input_file;
mod inspect;
#[cfg(feature = "judge")]
mod judge;
#[cfg(feature = "learn")]
mod learn;
#[cfg(feature = "completions")]
mod man;
#[cfg(feature = "judge")]
mod match_fields;
mod memory;
mod output_file;
mod plan;
mod preview;
mod recipe_file;
mod report;
mod rerender;
mod setup;
mod slide;
mod status;
mod submit;
mod sweep;
mod task;
#[cfg(feature = "web")]
mod web;
mod words;

use std::process::ExitCode;

use papsynth::recipe::{Preset, Recipe};

use args::{Init, Verb};
use exit::ExitError;
use output_file::{Kind, OutputFile};
use recipe_file::RecipeFile;

fn main() -> ExitCode {
    memory::configure_allocator();
    let cli = match args::parse(std::env::args_os()) {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version arrive here too, with exit code 0. Ignores broken pipes.
            let _ = args::print_error(&error);
            return ExitCode::from(if error.use_stderr() { exit::INPUT } else { 0 });
        }
    };
    let json = matches!(&cli.verb, Verb::Generate(args) if args.json);
    exit::set_quiet(cli.verb.is_quiet());
    match args::check_addresses(&cli.verb, std::env::args_os()).and_then(|()| run(cli.verb)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let code = error.code();
            if json {
                // Ignores a standard output that cannot be written.
                let _ = report::event(&error.json());
            } else {
                error.print();
            }
            ExitCode::from(code)
        }
    }
}

fn run(verb: Verb) -> Result<(), ExitError> {
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
        #[cfg(feature = "web")]
        Verb::Workbench(args) => web::workbench(&args),
        Verb::Schema(_) => {
            let schema = Recipe::schema();
            exit::print(&format!("{schema:#}\n"))
        }
        #[cfg(feature = "completions")]
        Verb::Completions(args) => {
            let (mut command, mut script) = (<args::Cli as clap::CommandFactory>::command(), Vec::new());
            clap_complete::generate(args.shell, &mut command, "papsynth", &mut script);
            exit::print(&String::from_utf8_lossy(&script))
        }
        #[cfg(feature = "completions")]
        Verb::Man(args) => man::run(&args),
        #[cfg(not(feature = "calibrate"))]
        Verb::Calibrate(_) => Err(ExitError::missing_feature("calibrate")),
        #[cfg(not(feature = "completions"))]
        Verb::Completions(_) | Verb::Man(_) => Err(ExitError::missing_feature("completions")),
        #[cfg(not(feature = "judge"))]
        Verb::Judge(_) | Verb::Match(_) => Err(ExitError::missing_feature("judge")),
        #[cfg(not(feature = "learn"))]
        Verb::Learn(_) => Err(ExitError::missing_feature("learn")),
        #[cfg(not(feature = "web"))]
        Verb::Study(_) | Verb::View(_) | Verb::Workbench(_) => Err(ExitError::missing_feature("web")),
    }
}

/// `papsynth init`: prints or writes a commented recipe.
fn init(args: &Init) -> Result<(), ExitError> {
    if args.list {
        let longest = Preset::ALL.iter().map(|preset| preset.name().len()).max().unwrap_or(0);
        let lines = Preset::ALL.map(|preset| format!("{:<longest$}  {}\n", preset.name(), preset.summary()));
        return exit::print(&lines.concat());
    }
    let recipe = || Ok::<_, ExitError>(RecipeFile::load(&args.recipe)?.recipe.to_commented_toml());
    match &args.out {
        None => exit::print(&recipe()?),
        Some(path) => {
            let out = OutputFile::check(path, Kind::Recipe, args.force)?;
            out.write(recipe()?.as_bytes())?;
            let path = path.display();
            exit::print(&format!("{path}: recipe written; `papsynth preview {path}` shows one of its fields\n"))
        }
    }
}

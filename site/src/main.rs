//! Generates the documentation site: plain files that need no server.
//!
//! `papsynth-site ROOT PROGRAM ENGINE OUT [--no-pictures]` reads the pages of the repository in ROOT, asks the program
//! for the schema and the presets, and replaces the folder OUT. ENGINE is the engine in WebAssembly. Links and anchors
//! within the site are checked.

#![forbid(unsafe_code)]
#![expect(clippy::print_stdout, reason = "a command line program")]

mod gallery;
mod layout;
mod links;
mod markdown;
mod page;
mod reference;
mod sources;
mod workbench;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail, ensure};

/// The file that marks a folder as a site, which may be replaced.
const MARK: &str = "papsynth-site.txt";

/// What the site is made of.
pub(crate) struct Input {
    /// Root folder of the repository.
    pub(crate) root: PathBuf,
    /// The program `papsynth`.
    program: PathBuf,
    /// The engine in WebAssembly.
    pub(crate) engine: PathBuf,
    /// Folder to write.
    pub(crate) out: PathBuf,
    /// Whether the pictures of the gallery are rendered.
    pub(crate) pictures: Pictures,
}

/// Whether the pictures of the gallery are rendered.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pictures {
    Rendered,
    LeftOut,
}

impl Input {
    fn from_arguments() -> Result<Self> {
        let words: Vec<String> = std::env::args().skip(1).collect();
        let (paths, pictures) = match words.split_last() {
            Some((option, paths)) if option == "--no-pictures" => (paths, Pictures::LeftOut),
            _ => (&words[..], Pictures::Rendered),
        };
        let [root, program, engine, out] = paths else {
            bail!("expected ROOT PROGRAM ENGINE OUT [--no-pictures]; `cargo xtask site` gives these arguments")
        };
        Ok(Self { root: root.into(), program: program.into(), engine: engine.into(), out: out.into(), pictures })
    }

    /// Reads a file of the repository.
    pub(crate) fn read(&self, path: &str) -> Result<String> {
        let path = self.root.join(path);
        fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))
    }

    /// Runs `papsynth` and returns its standard output.
    pub(crate) fn papsynth(&self, words: &[&str]) -> Result<String> {
        let mut command = Command::new(&self.program);
        command.args(words).stdin(Stdio::null()).stderr(Stdio::inherit());
        let output = command.output().with_context(|| format!("cannot start {}", self.program.display()))?;
        ensure!(output.status.success(), "papsynth {} failed ({})", words.join(" "), output.status);
        String::from_utf8(output.stdout).with_context(|| format!("the output of papsynth {}", words.join(" ")))
    }
}

fn main() -> ExitCode {
    match Input::from_arguments().and_then(|input| build(&input)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn build(input: &Input) -> Result<()> {
    replace(&input.out)?;
    let mut pages = sources::pages(input)?;
    pages.extend(reference::pages(input)?);
    pages.push(gallery::page(input)?);
    sources::sort(&mut pages);
    let sources = sources::by_path(&pages);
    for page in &mut pages {
        let body = markdown::html(input, page, &sources)?;
        page.set_body(body);
    }
    for page in &pages {
        write(&input.out.join(&page.path), layout::html(page, &pages))?;
    }
    write(&input.out.join("style.css"), include_str!("style.css"))?;
    write(&input.out.join("site.js"), include_str!("site.js"))?;
    write(&input.out.join("search.js"), layout::search(&pages)?)?;
    workbench::write_page(input)?;
    let count = links::check(input, &pages)?;
    println!("{} pages; {count} links and anchors within the site are valid", pages.len());
    println!("open {}", input.out.join("index.html").display());
    Ok(())
}

/// Removes an older site. Another folder is not removed.
fn replace(out: &Path) -> Result<()> {
    if out.exists() {
        let is_empty = fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_none());
        ensure!(is_empty || out.join(MARK).exists(), "{} is not an older site: choose another folder", out.display());
        fs::remove_dir_all(out).with_context(|| format!("cannot remove {}", out.display()))?;
    }
    write(&out.join(MARK), "Made by `cargo xtask site`, which replaces this folder.\n")
}

/// Writes a file and the folders above it.
pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<()> {
    let write = || {
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::write(path, content)
    };
    write().with_context(|| format!("cannot write {}", path.display()))
}

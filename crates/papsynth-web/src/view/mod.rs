//! Data sets and slides, with their truth over them: what is answered to the page.

mod fields;
mod grid;
mod labels;
mod levels;
#[cfg(feature = "zarr")]
mod slide;
mod source;

use std::path::Path;

use papsynth::truth::Group;
use papsynth_dataset::Dataset;
use serde_json::json;

use crate::error::Error;
use crate::page::{self, CSS, File, HTML, JS};
use crate::server::{Reply, Request, Site};
use fields::Fields;
use source::{At, Source};

const PAGE: [File; 4] = [
    ("/", HTML, include_str!("page/index.html")),
    ("/view.css", CSS, include_str!("page/view.css")),
    ("/tiles.js", JS, include_str!("page/tiles.js")),
    ("/view.js", JS, include_str!("page/view.js")),
];

/// A data set or a slide, as a page shows it. Nothing is written, and of what is read a few frames are kept.
pub struct View {
    title: String,
    kind: &'static str,
    source: Box<dyn Source>,
}

impl View {
    /// Opens the folder of a data set or, with the feature `zarr`, of a slide.
    ///
    /// # Errors
    /// If it holds neither, or what a build without that feature cannot show, or cannot be read.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let (kind, source) = source(path)?;
        Ok(Self { title: title(path), kind, source })
    }

    /// What is shown: "data set" or "slide".
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    fn answer(&mut self, target: &str) -> Result<Reply, Reply> {
        let words: Vec<&str> = target.split('/').skip(1).take(7).collect();
        match words[..] {
            ["info"] => {
                let (kind, pictures) = (self.kind, self.source.count()?);
                let groups = Group::ALL.map(Group::name);
                Ok(Reply::json(&json!({ "title": self.title, "kind": kind, "pictures": pictures, "groups": groups })))
            }
            ["picture", picture] => Ok(Reply::json(&self.source.picture(number(picture)?)?)),
            ["tile", picture, plane, level, name] => {
                self.source.tile(number(picture)?, number(plane)?, place(level, name)?)
            }
            ["label", picture, group, level, name] => {
                let group = Group::ALL.into_iter().find(|known| known.name() == group);
                let group = group.ok_or_else(|| Reply::refusal(404, "there are no such labels"))?;
                self.source.label(number(picture)?, group, place(level, name)?)
            }
            ["at", picture, x, y] => {
                let (picture, x, y) = (number(picture)?, number(x)?, number(y)?);
                Ok(Reply::json(&json!({ "x": x, "y": y, "objects": self.source.under(picture, x, y)? })))
            }
            _ => Err(Reply::refusal(404, "there is nothing here")),
        }
    }
}

impl Site for View {
    fn reply(&mut self, request: &Request) -> Reply {
        if request.method != "GET" {
            return Reply::method("GET");
        }
        let answer = || self.answer(request.target).unwrap_or_else(|refusal| refusal);
        page::file(&PAGE, request).unwrap_or_else(answer)
    }
}

fn title(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    whole.file_name().unwrap_or(whole.as_os_str()).to_string_lossy().into_owned()
}

/// What lies in a folder: "data set" or "slide".
fn source(path: &Path) -> Result<(&'static str, Box<dyn Source>), Error> {
    if path.join("slide.json").is_file() {
        return slide(path);
    }
    if !path.join("manifest.json").is_file() {
        let what = if path.is_dir() { "holds neither a data set nor a slide" } else { "there is no such folder" };
        return Err(folder(path, format!("{what}; expected a folder of `papsynth generate` or `slide make`")));
    }
    let dataset = Dataset::open(path)?;
    let formats = &dataset.layout().formats;
    let needs: Option<Vec<&str>> = formats.iter().map(|format| format.needs()).collect();
    match needs.as_deref() {
        Some([feature, ..]) => Err(folder(path, format!("{} needs {}", formats[0].name(), built_with(feature)))),
        _ => Ok(("data set", Box::new(Fields::new(dataset)))),
    }
}

fn folder(path: &Path, message: String) -> Error {
    papsynth_dataset::Error::Folder { path: path.to_owned(), message }.into()
}

fn built_with(feature: &str) -> String {
    format!("a build of papsynth with `--features {feature}`")
}

#[cfg(feature = "zarr")]
fn slide(path: &Path) -> Result<(&'static str, Box<dyn Source>), Error> {
    Ok(("slide", Box::new(slide::Slide::new(papsynth_dataset::slide::SlideSet::open(path)?))))
}

#[cfg(not(feature = "zarr"))]
fn slide(path: &Path) -> Result<(&'static str, Box<dyn Source>), Error> {
    Err(folder(path, format!("a slide needs {}", built_with("zarr"))))
}

/// A number as the page writes it: digits alone, and not too many.
fn number(word: &str) -> Result<usize, Reply> {
    let is_number = (1..=9).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_digit());
    let number = if is_number { word.parse().ok() } else { None };
    number.ok_or_else(|| Reply::refusal(400, "a number of 1 to 9 digits is expected"))
}

/// A level, and ROW-COLUMN.png.
fn place(level: &str, name: &str) -> Result<At, Reply> {
    let name = name.strip_suffix(".png").and_then(|name| name.split_once('-'));
    let (row, column) = name.ok_or_else(|| Reply::refusal(400, "ROW-COLUMN.png is expected"))?;
    Ok(At { level: number(level)?, row: number(row)?, column: number(column)? })
}

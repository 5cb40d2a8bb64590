//! The viewer of data sets and slides: replies to the requests of the page.

mod fields;
pub(crate) mod grid;
pub(crate) mod labels;
mod levels;
pub(crate) mod objects;
#[cfg(feature = "zarr")]
mod slide;
pub(crate) mod source;

use std::path::Path;

use papsynth::truth::Group;
use papsynth_dataset::Dataset;
use serde_json::json;

use crate::error::Error;
use crate::page::{self, CSS, File, HTML, JS};
use crate::server::{Reply, Request, Site};
use fields::DatasetSource;
use source::{Source, TileIndex};

const PAGE: [File; 4] = [
    ("/", HTML, include_str!("page/index.html")),
    ("/view.css", CSS, include_str!("page/view.css")),
    ("/tiles.js", JS, include_str!("page/tiles.js")),
    ("/view.js", JS, include_str!("page/view.js")),
];

/// The viewer of a data set or a slide. It writes nothing.
pub struct Viewer {
    title: String,
    kind: &'static str,
    source: Box<dyn Source>,
}

impl Viewer {
    /// Opens the folder of a data set or, with the feature `zarr`, of a slide.
    ///
    /// # Errors
    /// If the folder contains neither, cannot be read, or needs a feature that this build lacks.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let (kind, source) = source(path)?;
        Ok(Self { title: title(path), kind, source })
    }

    /// Returns "data set" or "slide".
    #[must_use]
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    /// Returns the reply to a request. `Err` contains a reply with an error status.
    fn answer(&mut self, target: &str) -> Result<Reply, Reply> {
        let words: Vec<&str> = target.split('/').skip(1).take(7).collect();
        match words[..] {
            ["info"] => {
                let (kind, images) = (self.kind, self.source.count()?);
                let groups = Group::ALL.map(Group::name);
                Ok(Reply::json(&json!({ "title": self.title, "kind": kind, "images": images, "groups": groups })))
            }
            ["image", image] => Ok(Reply::json(&self.source.image(number(image)?)?)),
            ["tile", image, plane, level, name] => {
                self.source.tile(number(image)?, number(plane)?, place(level, name)?)
            }
            ["label", image, group, level, name] => {
                let Some(known) = Group::ALL.into_iter().find(|known| known.name() == group) else {
                    let group = excerpt(group);
                    let message = format!("unknown label group `{group}`; expected cytoplasm, nucleus or debris");
                    return Err(Reply::error(404, &message));
                };
                self.source.label(number(image)?, known, place(level, name)?)
            }
            ["at", image, x, y] => {
                let (image, x, y) = (number(image)?, number(x)?, number(y)?);
                Ok(Reply::json(&json!({ "x": x, "y": y, "objects": self.source.objects_at(image, x, y)? })))
            }
            _ => Err(Reply::error(404, "not found")),
        }
    }
}

impl Site for Viewer {
    fn reply(&mut self, request: &Request) -> Reply {
        if request.method != "GET" {
            return Reply::wrong_method("GET");
        }
        let answer = || self.answer(request.target).unwrap_or_else(|error| error);
        page::file(&PAGE, request).unwrap_or_else(answer)
    }
}

fn title(path: &Path) -> String {
    let whole = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    whole.file_name().unwrap_or(whole.as_os_str()).to_string_lossy().into_owned()
}

/// Opens a folder as a data set or a slide.
fn source(path: &Path) -> Result<(&'static str, Box<dyn Source>), Error> {
    if path.join("slide.json").is_file() {
        return slide(path);
    }
    if !path.join("manifest.json").is_file() {
        let what = match (path.is_dir(), path.exists()) {
            (true, _) => "contains neither a data set nor a slide",
            (false, true) => "is a file",
            (false, false) => "no such folder",
        };
        return Err(folder(
            path,
            format!("{what}; expected a folder that `papsynth generate` or `papsynth slide make` wrote"),
        ));
    }
    let dataset = Dataset::open(path)?;
    let formats = &dataset.layout().formats;
    let needs: Option<Vec<&str>> = formats.iter().map(|format| format.needs()).collect();
    match needs.as_deref() {
        Some([feature, ..]) => {
            Err(folder(path, format!("the format {} needs {}", formats[0].name(), built_with(feature))))
        }
        _ => Ok(("data set", Box::new(DatasetSource::new(dataset)))),
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
    Ok(("slide", Box::new(slide::SlideSource::new(papsynth_dataset::slide::SlideSet::open(path)?))))
}

#[cfg(not(feature = "zarr"))]
fn slide(path: &Path) -> Result<(&'static str, Box<dyn Source>), Error> {
    Err(folder(path, format!("a slide needs {}", built_with("zarr"))))
}

/// Returns the first characters of a word of a request, escaped.
pub(crate) fn excerpt(word: &str) -> String {
    /// Maximum number of characters.
    const CHARS: usize = 30;
    word.chars().take(CHARS).flat_map(char::escape_default).collect()
}

/// Parses a number of 1 to 9 digits.
pub(crate) fn number(word: &str) -> Result<usize, Reply> {
    let is_number = (1..=9).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_digit());
    let number = if is_number { word.parse().ok() } else { None };
    number.ok_or_else(|| Reply::error(400, &format!("`{}`: expected a number of 1 to 9 digits", excerpt(word))))
}

/// Parses a level and `ROW-COLUMN.png`.
fn place(level: &str, name: &str) -> Result<TileIndex, Reply> {
    let Some((row, column)) = name.strip_suffix(".png").and_then(|name| name.split_once('-')) else {
        return Err(Reply::error(400, &format!("`{}`: expected ROW-COLUMN.png", excerpt(name))));
    };
    Ok(TileIndex { level: number(level)?, row: number(row)?, column: number(column)? })
}

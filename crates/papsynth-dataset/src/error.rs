//! What can go wrong, and whether trying again can help.

use std::io;
use std::path::{Path, PathBuf};

/// Why files cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file given by the user cannot be used.
    #[error("{}: {problem}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: Problem,
    },
    /// The system refused to read or write.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// What was tried: "read", "write", ….
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The folder of a data set cannot be used.
    #[error("{}: {message}", path.display())]
    Folder {
        /// The folder, or the file in it that stands in the way.
        path: PathBuf,
        /// What is wrong, and what would help.
        message: String,
    },
    /// What was handed over to be written does not fit together.
    #[error("frame {index}: {message}")]
    Frame {
        /// Index of the frame.
        index: u64,
        /// What does not fit.
        message: String,
    },
    /// The engine cannot make a frame.
    #[error(transparent)]
    Engine(#[from] papsynth::Error),
}

impl Error {
    /// Whether the system failed (full disk, no permission), so that trying again may help; everything else lies in
    /// what was asked for, such as a name that is too long or that a folder has already.
    #[must_use]
    pub fn is_io(&self) -> bool {
        use io::ErrorKind::{AlreadyExists, InvalidFilename, InvalidInput, IsADirectory, NotADirectory};
        let is_asked_for = |source: &io::Error| {
            matches!(source.kind(), AlreadyExists | InvalidFilename | InvalidInput | IsADirectory | NotADirectory)
        };
        matches!(self, Self::Io { source, .. } if !is_asked_for(source))
    }

    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }

    pub(crate) fn input(path: &Path) -> impl FnOnce(Problem) -> Self {
        move |problem| Self::Input { path: path.to_owned(), problem }
    }

    pub(crate) fn folder(path: &Path, message: impl Into<String>) -> Self {
        Self::Folder { path: path.to_owned(), message: message.into() }
    }

    /// What to say of a path that needs a feature which this build lacks.
    pub(crate) fn missing_feature(what: &str, feature: &str, path: &Path) -> Self {
        Self::folder(path, format!("{what} needs a build of papsynth with `--features {feature}`"))
    }
}

/// What is wrong with a file that was read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// There is no such "file" or "folder".
    #[error("there is no such {0}")]
    Missing(&'static str),
    /// There is a folder of that name.
    #[error("is a folder; a file is expected")]
    Folder,
    /// The file, or a folder on the way to it, is a link.
    #[error("is or lies behind a symbolic link; links in a data set are not followed")]
    Link,
    /// The path is a pipe, device or socket.
    #[error("is a pipe, device or socket; expected a regular file")]
    NotAFile,
    /// The file is of another format.
    #[error("is not a PNG, JPEG or TIFF file")]
    Format,
    /// The "PNG", "JPEG" or "TIFF" file ends before its image does.
    #[error("the {0} file is truncated: it ends before its image does")]
    Truncated(&'static str),
    /// The file does not follow its format.
    #[error("the {format} file cannot be decoded: {message}")]
    Broken {
        /// "PNG", "TIFF", "CSV", ….
        format: &'static str,
        /// What the decoder said.
        message: String,
    },
    /// The file is larger than it may be.
    #[error("the file has {bytes} bytes; at most {limit} are read")]
    FileSize {
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// The image is larger than it may be, or has no pixel.
    #[error(
        "the image is {width} x {height}; accepted are 1 to {max_side} pixels a side and at most {max_pixels} in all"
    )]
    ImageSize {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// Limit of either.
        max_side: u64,
        /// Limit of their product.
        max_pixels: u64,
    },
    /// A pixel has a colour, or a transparency.
    #[error("the pixel at ({x}, {y}) is {what}; accepted are grey and opaque pixels")]
    NotGrey {
        /// "coloured" or "transparent".
        what: &'static str,
        /// Column.
        x: usize,
        /// Row.
        y: usize,
    },
    /// The samples are of a type that has no meaning here.
    #[error("has {found}; accepted are {accepted}")]
    Samples {
        /// The type in the file.
        found: String,
        /// The types that can be read.
        accepted: &'static str,
    },
    /// What is in the file does not fit: an empty mask, a mask of another size than its image, a file of a data set that says
    /// something else than the others. The text says what is wrong, and what would be accepted.
    #[error("{0}")]
    Unfit(String),
    /// A folder without anything to read.
    #[error("the folder has no PNG, JPEG or TIFF file")]
    NoImages,
    /// A line of a table.
    #[error("line {line}: {message}")]
    Row {
        /// Number of the line, from 1.
        line: u64,
        /// What is wrong with it, and what would be accepted.
        message: String,
    },
}

impl Problem {
    pub(crate) fn broken(format: &'static str, message: impl ToString) -> Self {
        Self::Broken { format, message: message.to_string() }
    }

    pub(crate) fn unfit(what: impl Into<String>) -> Self {
        Self::Unfit(what.into())
    }

    /// What does not fit, unless it `fits`.
    pub(crate) fn unless(fits: bool, what: impl Into<String>) -> Result<(), Self> {
        if fits { Ok(()) } else { Err(Self::unfit(what)) }
    }

    pub(crate) fn samples(found: impl Into<String>, accepted: &'static str) -> Self {
        Self::Samples { found: found.into(), accepted }
    }
}

impl From<serde_json::Error> for Problem {
    fn from(error: serde_json::Error) -> Self {
        Self::broken("JSON", error)
    }
}

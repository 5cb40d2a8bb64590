//! Errors of reading and writing files.

use std::io;
use std::path::{Path, PathBuf};

/// An error of reading or writing files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The content of a file is invalid.
    #[error("{}: {problem}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// The defect.
        problem: InputError,
    },
    /// An operation on a file failed.
    #[error("cannot {action} {}: {source}", path.display())]
    Io {
        /// The operation: "read", "write", …
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The folder of a data set cannot be used.
    #[error("{}: {message}", path.display())]
    Folder {
        /// The folder, or the file in it that causes the error.
        path: PathBuf,
        /// The defect and its remedy.
        message: String,
    },
    /// The data given for a frame is inconsistent.
    #[error("frame {index}: {message}")]
    Frame {
        /// Index of the frame.
        index: u64,
        /// The inconsistency.
        message: String,
    },
    /// The engine cannot generate a frame.
    #[error(transparent)]
    Engine(#[from] papsynth::Error),
}

impl Error {
    /// Whether the system failed (full disk, no permission), so that a retry may succeed. All other errors are in the
    /// input, for example a file name that is too long.
    #[must_use]
    pub fn is_io(&self) -> bool {
        use io::ErrorKind::{AlreadyExists, InvalidFilename, InvalidInput, IsADirectory, NotADirectory};
        let is_input = |source: &io::Error| {
            matches!(source.kind(), AlreadyExists | InvalidFilename | InvalidInput | IsADirectory | NotADirectory)
        };
        matches!(self, Self::Io { source, .. } if !is_input(source))
    }

    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { action, path: path.to_owned(), source }
    }

    pub(crate) fn input(path: &Path) -> impl FnOnce(InputError) -> Self {
        move |problem| Self::Input { path: path.to_owned(), problem }
    }

    pub(crate) fn folder(path: &Path, message: impl Into<String>) -> Self {
        Self::Folder { path: path.to_owned(), message: message.into() }
    }

    /// An error for a path that needs a feature which this build lacks.
    pub(crate) fn missing_feature(what: &str, feature: &str, path: &Path) -> Self {
        Self::folder(path, format!("{what} needs a build of papsynth with `--features {feature}`"))
    }
}

/// A defect of a file that was read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The "file" or "folder" does not exist.
    #[error("there is no such {0}")]
    Missing(&'static str),
    /// The path is not a folder.
    #[error("is not a folder; expected a folder of images")]
    NotAFolder,
    /// The path is a folder.
    #[error("is a folder; expected a file")]
    Folder,
    /// The file, or a folder in its path, is a symbolic link.
    #[error("the path contains a symbolic link; links in a data set are not followed")]
    Link,
    /// The path is a pipe, device or socket.
    #[error("is a pipe, device or socket; expected a regular file")]
    NotAFile,
    /// The file is of another format.
    #[error("is not a PNG, JPEG or TIFF file")]
    Format,
    /// The "PNG", "JPEG" or "TIFF" file is truncated.
    #[error("the {0} file is truncated")]
    Truncated(&'static str),
    /// The file does not follow its format.
    #[error("the {format} file cannot be decoded: {message}")]
    Broken {
        /// "PNG", "TIFF", "CSV", ….
        format: &'static str,
        /// The message of the decoder.
        message: String,
    },
    /// The file is too large.
    #[error("the file has {bytes} bytes; the maximum is {limit}")]
    FileSize {
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// The image is empty or too large.
    #[error(
        "the image is {width} x {height} pixels; expected 1 to {max_side} in each direction and at most {max_pixels} in total"
    )]
    ImageSize {
        /// Columns.
        width: u64,
        /// Rows.
        height: u64,
        /// Largest width and height.
        max_side: u64,
        /// Largest number of pixels.
        max_pixels: u64,
    },
    /// A pixel is coloured or transparent.
    #[error("the pixel at ({x}, {y}) is {what}; expected grey and opaque pixels")]
    NotGrey {
        /// "coloured" or "transparent".
        what: &'static str,
        /// Column.
        x: usize,
        /// Row.
        y: usize,
    },
    /// The type of the samples is not supported.
    #[error("has {found}; expected {accepted}")]
    Samples {
        /// The type in the file.
        found: String,
        /// The supported types.
        accepted: &'static str,
    },
    /// The content is invalid or contradicts other files: an empty mask, a mask whose size differs from its image. The
    /// text states the defect and what is accepted.
    #[error("{0}")]
    Unfit(String),
    /// A folder without images.
    #[error("contains no PNG, JPEG or TIFF file")]
    NoImages,
    /// A line of a table is invalid.
    #[error("line {line}: {message}")]
    Row {
        /// Number of the line, from 1.
        line: u64,
        /// The defect and what is accepted.
        message: String,
    },
}

impl InputError {
    pub(crate) fn broken(format: &'static str, message: impl ToString) -> Self {
        Self::Broken { format, message: message.to_string() }
    }

    pub(crate) fn unfit(what: impl Into<String>) -> Self {
        Self::Unfit(what.into())
    }

    /// Returns the defect `what` unless `fits`.
    pub(crate) fn unless(fits: bool, what: impl Into<String>) -> Result<(), Self> {
        if fits { Ok(()) } else { Err(Self::unfit(what)) }
    }

    pub(crate) fn samples(found: impl Into<String>, accepted: &'static str) -> Self {
        Self::Samples { found: found.into(), accepted }
    }
}

impl From<serde_json::Error> for InputError {
    fn from(error: serde_json::Error) -> Self {
        Self::broken("JSON", error)
    }
}

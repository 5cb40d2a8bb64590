//! What is written as Parquet: the table of objects, and the format `huggingface`.

mod features;
mod frames;
mod objects;

use std::fs::File;
use std::io::{BufWriter, ErrorKind};
use std::path::Path;

use papsynth_parquet::{Limits, Reader};

pub(crate) use features::card;
pub(crate) use frames::{Frames, images, sink};
#[cfg(feature = "zarr")]
pub(crate) use objects::write_cells;
pub(crate) use objects::{ObjectRows, ObjectTable, merge};

use crate::error::{Error, Problem};
use crate::files::{Handle, Pending};
use crate::image_of::LIMITS;

pub(crate) const IS_HERE: bool = true;

/// A file on its way to the disk.
type Writer = papsynth_parquet::Writer<BufWriter<Handle>>;

/// What an error of a table says of a file.
fn failed(action: &'static str, path: &Path) -> impl Fn(papsynth_parquet::Error) -> Error {
    move |error| match error {
        papsynth_parquet::Error::Io(error) => Error::io(action, path)(error),
        other => Error::input(path)(Problem::Broken { format: "Parquet", message: other.to_string() }),
    }
}

fn open(path: &Path) -> Result<Reader, Error> {
    let file = File::open(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => Error::input(path)(Problem::Missing { wanted: "file" }),
        _ => Error::io("read", path)(error),
    })?;
    let limits = Limits {
        column_bytes: LIMITS.max_file_bytes,
        row_bytes: usize::try_from(LIMITS.max_file_bytes).unwrap_or(usize::MAX),
        ..Limits::default()
    };
    Reader::open(file, &limits).map_err(failed("read", path))
}

fn begin(pending: &Pending, columns: &[papsynth_parquet::Column], metadata: &[(&str, &str)]) -> Result<Writer, Error> {
    let out = BufWriter::with_capacity(1 << 18, pending.handle()?);
    Writer::new(out, columns, metadata).map_err(failed("write", pending.path()))
}

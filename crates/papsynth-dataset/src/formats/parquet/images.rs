//! Images of the format `huggingface` read back, from a file whose SHA-256 is that of its record.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{List, ListAccessor, Row, RowAccessor};
use parquet::schema::types::Type;

use super::failed::failed;
use crate::error::{Error, Problem};
use crate::formats::huggingface::{PICTURE, PLANES};

/// The files of an image: its picture, or all its planes.
pub(crate) fn images(path: &Path, image: &str) -> Result<Vec<Vec<u8>>, Error> {
    let named = image.strip_suffix(PICTURE).map(|index| (index, "image"));
    let named = named.or(image.strip_suffix(PLANES).map(|index| (index, "planes")));
    let wanted = named.and_then(|(index, column)| Some((index.parse().ok()?, column)));
    let found = match wanted {
        Some((index, column)) => find(path, index, column).map_err(failed("read", path))?,
        None => None,
    };
    found.ok_or_else(|| {
        Error::input(path)(Problem::broken("Parquet", format!("it has no image `{}`", image.escape_default())))
    })
}

/// The images in a column of the row of a frame, if there is that row. Each group of rows is read by itself.
fn find(path: &Path, index: i64, column: &str) -> Result<Option<Vec<Vec<u8>>>, ParquetError> {
    let reader = SerializedFileReader::new(File::open(path)?)?;
    let fields = reader.metadata().file_metadata().schema().get_fields().to_vec();
    let only = |name: &str| {
        let fields = fields.iter().filter(|field| field.name() == name).map(Arc::clone).collect();
        Type::group_type_builder("schema").with_fields(fields).build()
    };
    for number in 0..reader.num_row_groups() {
        let group = reader.get_row_group(number)?;
        for (place, row) in group.get_row_iter(Some(only("index")?))?.enumerate() {
            if row?.get_long(0)? == index {
                let row = group.get_row_iter(Some(only(column)?))?.nth(place).transpose()?;
                return row.map(|row| files(&row, column)).transpose();
            }
        }
    }
    Ok(None)
}

fn files(row: &Row, column: &str) -> Result<Vec<Vec<u8>>, ParquetError> {
    let bytes = |image: &Row| image.get_bytes(0).map(ByteArray::data).map(<[u8]>::to_vec);
    if column == "image" {
        return Ok(vec![bytes(row.get_group(0)?)?]);
    }
    let planes = row.get_list(0)?;
    (0..List::len(planes)).map(|plane| bytes(planes.get_group(plane)?)).collect()
}

//! What is looked at of a footer before its decoder may see it: that allocates what it is told.

use crate::error::Error;
use crate::reader::Limits;
use crate::thrift::Compact;

/// The mark at both ends of a file.
const MAGIC: &[u8] = b"PAR1";

/// The end of a file: the length of the footer, and the mark.
pub(crate) const TAIL: u64 = 8;

/// Length of the footer, from the last bytes of a file.
pub(crate) fn footer_length(tail: &[u8], file: u64, limits: &Limits) -> Result<u64, Error> {
    let [a, b, c, d, magic @ ..] = tail else { return Error::broken("it is too short for a Parquet file") };
    if magic != MAGIC {
        return Error::broken("it does not end as a Parquet file does");
    }
    let length = u64::from(u32::from_le_bytes([*a, *b, *c, *d]));
    if length > limits.footer_bytes || length + TAIL > file {
        let least = limits.footer_bytes.min(file);
        return Error::broken(format!("its footer announces {length} bytes; at most {least} are read"));
    }
    Ok(length)
}

/// Whether a footer keeps within bounds.
pub(crate) fn footer(bytes: &[u8]) -> Result<(), Error> {
    Compact::new(bytes).fields(&mut |_, _, _| Ok(false))
}

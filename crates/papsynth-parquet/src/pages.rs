//! The pages of a column, decoded by ourselves: the decoders of `parquet` take files on trust.

use std::ops::Range;

use bytes::Bytes;
use parquet::data_type::ByteArray;

use crate::error::Error;
use crate::leaf::{Leaf, Values};
use crate::thrift::{Compact, Type};

/// The head of a page lies within so many bytes.
const HEAD: u64 = 1 << 16;

/// Snappy makes at most 64 bytes of 3.
const SNAPPY: usize = 22;

/// Types of pages: data of version 1, and dictionaries.
const DATA: i64 = 0;
const DICTIONARY: i64 = 2;

/// Encodings: plain, by a dictionary under either name, and of levels.
const PLAIN: i64 = 0;
const BY_DICTIONARY: [i64; 2] = [2, 8];
const RLE: i64 = 3;

/// What is known of a column of a group before its pages are.
#[derive(Debug, Clone)]
pub(crate) struct Chunk {
    /// Where it lies in the file.
    pub(crate) range: Range<u64>,
    pub(crate) is_snappy: bool,
    /// Levels that it has, and rows.
    pub(crate) values: u64,
    pub(crate) rows: u64,
    /// How often its values may be repeated within each other.
    pub(crate) max_repetition: i16,
}

/// What the head of a page announces.
#[derive(Debug, Default)]
struct Head {
    kind: i64,
    uncompressed: i64,
    compressed: i64,
    values: i64,
    encodings: Vec<i64>,
}

impl Head {
    fn read(compact: &mut Compact) -> Result<Self, Error> {
        let mut head = Self { kind: -1, ..Self::default() };
        compact.fields(&mut |compact, id, kind| {
            let place = match id {
                1 => &mut head.kind,
                2 => &mut head.uncompressed,
                3 => &mut head.compressed,
                // The heads of data and of dictionaries.
                5 | 7 if kind == Type::STRUCT => {
                    let last = if id == 5 { 4 } else { 2 };
                    let Self { values, encodings, .. } = &mut head;
                    compact.fields(&mut |compact, id, kind| match id {
                        1 if kind.is_integer() => {
                            *values = compact.integer()?;
                            Ok(true)
                        }
                        2.. if id <= last && kind.is_integer() => {
                            encodings.push(compact.integer()?);
                            Ok(true)
                        }
                        _ => Ok(false),
                    })?;
                    return Ok(true);
                }
                _ => return Ok(false),
            };
            if !kind.is_integer() {
                return Error::broken("the head of a page has a field of another type");
            }
            *place = compact.integer()?;
            Ok(true)
        })?;
        Ok(head)
    }
}

/// Decodes the levels and values of some rows of a column. `read` gives so many bytes from a place in the file on.
pub(crate) fn decode(
    chunk: &Chunk,
    leaf: &mut Leaf,
    wanted: Range<u64>,
    read: impl Fn(u64, u64) -> Result<Bytes, Error>,
) -> Result<(), Error> {
    let Range { start, end } = chunk.range;
    let (mut at, mut levels, mut row, mut dictionary) = (start, 0_u64, 0_u64, None);
    while at < end {
        // Whole rows follow where nothing is repeated.
        if chunk.max_repetition == 0 && row >= wanted.end {
            return Ok(());
        }
        let bytes = read(at, HEAD.min(end - at))?;
        let mut compact = Compact::new(&bytes);
        let head = Head::read(&mut compact)?;
        let body = at + compact.at() as u64;
        let (compressed, count) = (size(head.compressed)?, size(head.values)?);
        at = body.saturating_add(compressed);
        if at > end {
            return Error::broken("a page is longer than its column");
        }
        match (head.kind, head.encodings.as_slice()) {
            (DICTIONARY, [PLAIN | 2]) if body - compact.at() as u64 == start => {
                let page = unpacked(chunk, &head, read(body, compressed)?)?;
                let mut values = leaf.empty();
                plain(&page, usize::try_from(count).unwrap_or(usize::MAX), &mut values)?;
                dictionary = Some(values);
            }
            (DATA, &[encoding, RLE, RLE]) if encoding == PLAIN || BY_DICTIONARY.contains(&encoding) => {
                levels = levels.saturating_add(count);
                if levels > chunk.values {
                    return Error::broken("a column has more values than its footer says");
                }
                if chunk.max_repetition == 0 && row + count <= wanted.start {
                    row += count;
                    continue;
                }
                let page = Page { bytes: unpacked(chunk, &head, read(body, compressed)?)?, levels: count };
                let dictionary = if encoding == PLAIN { None } else { Some(&dictionary) };
                row = page.rows(chunk, leaf, dictionary.map(Option::as_ref), row, &wanted)?;
            }
            _ => return Error::broken("a page is of a type or an encoding that is not read here"),
        }
    }
    match levels == chunk.values && row == chunk.rows {
        true => Ok(()),
        false => Error::broken("a column has other numbers of values and rows than its footer says"),
    }
}

fn size(size: i64) -> Result<u64, Error> {
    u64::try_from(size).map_err(|_| Error::Broken("a page has a negative size".to_owned()))
}

/// The bytes of a page as they were before compression.
fn unpacked(chunk: &Chunk, head: &Head, page: Bytes) -> Result<Bytes, Error> {
    let length = usize::try_from(head.uncompressed).unwrap_or(usize::MAX);
    if !chunk.is_snappy {
        return if page.len() == length {
            Ok(page)
        } else {
            Error::broken("a page is of another size than its head says")
        };
    }
    if length > page.len().saturating_mul(SNAPPY) || snap::raw::decompress_len(&page).ok() != Some(length) {
        return Error::broken("a page is of another size than its head says");
    }
    match snap::raw::Decoder::new().decompress_vec(&page) {
        Ok(bytes) => Ok(bytes.into()),
        Err(error) => Error::broken(format!("a page cannot be decompressed: {error}")),
    }
}

/// A page of data.
struct Page {
    bytes: Bytes,
    levels: u64,
}

impl Page {
    /// Adds the levels and values of the wanted rows to a leaf; `row` is the number of rows that began before, of which the new number is given.
    fn rows(
        mut self,
        chunk: &Chunk,
        leaf: &mut Leaf,
        dictionary: Option<Option<&Values>>,
        mut row: u64,
        wanted: &Range<u64>,
    ) -> Result<u64, Error> {
        let repetitions = self.levels(chunk.max_repetition)?;
        let definitions = self.levels(leaf.defined)?;
        let there = definitions.iter().filter(|&&definition| definition == leaf.defined).count();
        let mut values = leaf.empty();
        match dictionary {
            None => plain(&self.bytes, there, &mut values)?,
            Some(None) => return Error::broken("a page is encoded by a dictionary that there is not"),
            Some(Some(dictionary)) => by_dictionary(&self.bytes, there, dictionary, &mut values)?,
        }
        let mut at = 0;
        let (mut first, mut last) = (None, 0);
        for (&definition, &repetition) in definitions.iter().zip(&repetitions) {
            row += u64::from(repetition == 0);
            let Some(number) = row.checked_sub(1) else { return Error::broken("a column begins within a row") };
            let is_value = definition == leaf.defined;
            if wanted.contains(&number) {
                leaf.definitions.push(definition);
                leaf.repetitions.push(repetition);
                first = first.or(Some(at));
                last = at + usize::from(is_value);
            }
            at += usize::from(is_value);
        }
        leaf.values.extend(values, first.unwrap_or(0)..last);
        Ok(row)
    }

    /// The next levels, none of which is above `max`; where that is 0, none were written.
    fn levels(&mut self, max: i16) -> Result<Vec<i16>, Error> {
        let count = usize::try_from(self.levels).unwrap_or(usize::MAX);
        if max == 0 {
            return Ok(vec![0; count]);
        }
        let Some(length) = self.bytes.first_chunk().map(|length| u32::from_le_bytes(*length) as usize) else {
            return Error::broken("a page ends within its levels");
        };
        if self.bytes.len() - 4 < length {
            return Error::broken("a page ends within its levels");
        }
        let mut levels = Vec::new();
        let width = u16::BITS - max.unsigned_abs().leading_zeros();
        hybrid(&self.bytes.slice(4..4 + length), width, count, |level| match i16::try_from(level) {
            Ok(level) if level <= max => {
                levels.push(level);
                Ok(())
            }
            _ => Error::broken("a level is larger than its column has"),
        })?;
        self.bytes = self.bytes.slice(4 + length..);
        Ok(levels)
    }
}

/// Numbers of `width` bits in runs: of one that repeats itself, or of eight packed ones and more.
fn hybrid(bytes: &[u8], width: u32, count: usize, mut each: impl FnMut(u32) -> Result<(), Error>) -> Result<(), Error> {
    let (mut rest, mut left) = (bytes, count);
    while left > 0 {
        let mut head = Compact::new(rest);
        let run = head.varint()?;
        rest = &rest[head.at()..];
        let length = usize::try_from(run >> 1).unwrap_or(usize::MAX);
        let (is_packed, width) = (run & 1 == 1, width as usize);
        let stored = if is_packed { length.saturating_mul(width) } else { width.div_ceil(8) };
        if length == 0 || stored > rest.len() {
            return Error::broken("a page ends within a run");
        }
        let (run, after) = rest.split_at(stored);
        rest = after;
        if is_packed {
            let values = length.saturating_mul(8).min(left);
            for value in 0..values {
                let bits = (value * width..(value + 1) * width).enumerate();
                each(bits.fold(0, |sum, (to, from)| sum | u32::from(run[from / 8] >> (from % 8) & 1) << to))?;
            }
            left -= values;
        } else {
            let value = run.iter().rev().fold(0, |sum, &byte| sum << 8 | u32::from(byte));
            let values = length.min(left);
            (0..values).try_for_each(|_| each(value))?;
            left -= values;
        }
    }
    Ok(())
}

/// Values one after the other.
fn plain(bytes: &Bytes, count: usize, values: &mut Values) -> Result<(), Error> {
    fn fixed<const N: usize, T>(bytes: &[u8], count: usize, of: fn([u8; N]) -> T) -> Option<Vec<T>> {
        let (values, _) = bytes.get(..count.checked_mul(N)?)?.as_chunks::<N>();
        Some(values.iter().map(|value| of(*value)).collect())
    }
    fn long(bytes: &Bytes, count: usize) -> Option<Vec<ByteArray>> {
        let (mut at, mut values) = (0_usize, Vec::new());
        for _ in 0..count {
            let from = at.checked_add(4)?;
            let length = bytes.get(at..from)?.first_chunk().map(|length| u32::from_le_bytes(*length) as usize)?;
            at = from.checked_add(length).filter(|end| *end <= bytes.len())?;
            values.push(bytes.slice(from..at).into());
        }
        Some(values)
    }
    let bit = |i: usize| bytes.get(i / 8).map(|byte| byte >> (i % 8) & 1 == 1);
    let decoded = match values {
        Values::Bool(values) if count.div_ceil(8) <= bytes.len() => {
            (0..count).map(bit).collect::<Option<Vec<_>>>().map(|bits| *values = bits)
        }
        Values::Bool(_) => None,
        Values::U32(values) => fixed(bytes, count, i32::from_le_bytes).map(|decoded| *values = decoded),
        Values::I64(values) => fixed(bytes, count, i64::from_le_bytes).map(|decoded| *values = decoded),
        Values::F64(values) => fixed(bytes, count, f64::from_le_bytes).map(|decoded| *values = decoded),
        Values::Text(values) | Values::Bytes(values) => long(bytes, count).map(|decoded| *values = decoded),
    };
    decoded.map_or_else(|| Error::broken("a page ends within its values"), Ok)
}

/// Values by their numbers in a dictionary.
fn by_dictionary(bytes: &Bytes, count: usize, dictionary: &Values, values: &mut Values) -> Result<(), Error> {
    fn look<T: Clone>(numbers: &[u32], dictionary: &[T]) -> Option<Vec<T>> {
        numbers.iter().map(|number| dictionary.get(*number as usize).cloned()).collect()
    }
    let (width, runs) = match bytes.split_first() {
        Some((width, runs)) if u32::from(*width) <= u32::BITS => (u32::from(*width), runs),
        _ if count == 0 => return Ok(()),
        _ => return Error::broken("a page ends before its values"),
    };
    let mut numbers = Vec::new();
    hybrid(runs, width, count, |number| {
        numbers.push(number);
        Ok(())
    })?;
    let found = match (dictionary, values) {
        (Values::U32(from), Values::U32(to)) => look(&numbers, from).map(|values| *to = values),
        (Values::I64(from), Values::I64(to)) => look(&numbers, from).map(|values| *to = values),
        (Values::F64(from), Values::F64(to)) => look(&numbers, from).map(|values| *to = values),
        (Values::Text(from), Values::Text(to)) | (Values::Bytes(from), Values::Bytes(to)) => {
            look(&numbers, from).map(|values| *to = values)
        }
        _ => None,
    };
    found.map_or_else(|| Error::broken("a dictionary has no such value"), Ok)
}

//! The compact protocol of Thrift, as far as it takes to walk over a structure and bound what it announces.

use crate::error::Error;

/// Longest list, and deepest nesting: far beyond what a file of tables has, and little memory.
const MAX_LIST: u64 = 1 << 16;
const MAX_DEPTH: usize = 16;

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Type(u8);

impl Type {
    const STOP: Self = Self(0);
    pub(crate) const STRUCT: Self = Self(12);

    pub(crate) fn is_integer(self) -> bool {
        (4..=6).contains(&self.0)
    }
}

/// Takes a field by its number and type, or says that it does not and it is passed over.
type Take<'t, 'b> = dyn FnMut(&mut Compact<'b>, i64, Type) -> Result<bool, Error> + 't;

/// Reads from the front of some bytes.
#[derive(Debug)]
pub(crate) struct Compact<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Compact<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// How many bytes were read.
    pub(crate) fn at(&self) -> usize {
        self.at
    }

    fn byte(&mut self) -> Result<u8, Error> {
        let Some(&byte) = self.bytes.get(self.at) else { return Error::broken("a structure ends within a field") };
        self.at += 1;
        Ok(byte)
    }

    fn pass(&mut self, bytes: u64) -> Result<(), Error> {
        match usize::try_from(bytes).ok().and_then(|bytes| self.at.checked_add(bytes)) {
            Some(end) if end <= self.bytes.len() => {
                self.at = end;
                Ok(())
            }
            _ => Error::broken("a structure ends within a field"),
        }
    }

    /// A number without a sign.
    pub(crate) fn varint(&mut self) -> Result<u64, Error> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Error::broken("a number is too long")
    }

    /// An integer with a sign.
    pub(crate) fn integer(&mut self) -> Result<i64, Error> {
        let value = self.varint()?;
        Ok((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    /// Hands the fields of a structure over, one after the other.
    pub(crate) fn fields(&mut self, take: &mut Take<'_, 'a>) -> Result<(), Error> {
        self.walk(0, take)
    }

    fn walk(&mut self, depth: usize, take: &mut Take<'_, 'a>) -> Result<(), Error> {
        if depth > MAX_DEPTH {
            return Error::broken("a structure is nested too deeply");
        }
        let mut last = 0_i64;
        loop {
            let head = self.byte()?;
            let kind = Type(head & 0x0f);
            if kind == Type::STOP {
                return Ok(());
            }
            let id = match head >> 4 {
                0 => self.integer()?,
                step => last.saturating_add(step.into()),
            };
            // Nobody writes them otherwise, and a field that comes twice might be read either way.
            if id <= last {
                return Error::broken("the fields of a structure are out of order");
            }
            last = id;
            if !take(self, id, kind)? {
                self.skip(kind, depth)?;
            }
        }
    }

    fn skip(&mut self, kind: Type, depth: usize) -> Result<(), Error> {
        match kind.0 {
            // True and false stand in the head of a field.
            1 | 2 => Ok(()),
            3 => self.pass(1),
            4..=6 => self.varint().map(|_| ()),
            7 => self.pass(8),
            8 => {
                let length = self.varint()?;
                self.pass(length)
            }
            9 | 10 => self.list(depth),
            12 => self.walk(depth + 1, &mut |_, _, _| Ok(false)),
            _ => Error::broken("a structure has a field of a type that no table has"),
        }
    }

    fn list(&mut self, depth: usize) -> Result<(), Error> {
        let head = self.byte()?;
        let kind = Type(head & 0x0f);
        let length = match head >> 4 {
            15 => self.varint()?,
            short => short.into(),
        };
        if length > MAX_LIST {
            return Error::broken(format!("a list announces {length} things; at most {MAX_LIST} are read"));
        }
        for _ in 0..length {
            match kind.0 {
                1 | 2 => self.pass(1)?,
                _ if kind == Type::STRUCT => self.walk(depth + 1, &mut |_, _, _| Ok(false))?,
                _ => self.skip(kind, depth + 1)?,
            }
        }
        Ok(())
    }
}

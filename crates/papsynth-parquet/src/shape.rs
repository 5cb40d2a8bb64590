//! Rows taken apart into columns, and put together again, as Dremel does: Melnik et al., VLDB 3 (2010) 330-339.

use std::ops::Range;

use crate::error::Error;
use crate::leaf::{Leaf, Values};
use crate::schema::{Column, Kind};
use crate::value::Value;

/// A column or a part of one, with the leaves below it.
#[derive(Debug)]
pub(crate) struct Node {
    name: String,
    kind: NodeKind,
    nullable: bool,
    /// How many optional and repeated things there are above it, and how many repeated ones.
    definition: i16,
    repetition: i16,
    /// Numbers of its leaves.
    leaves: Range<usize>,
}

#[derive(Debug)]
enum NodeKind {
    Leaf,
    List(Box<Node>),
    Struct(Vec<Node>),
}

/// The columns as trees, and their leaves without a row.
pub(crate) fn trees(columns: &[Column]) -> (Vec<Node>, Vec<Leaf>) {
    let mut leaves = Vec::new();
    let nodes = columns.iter().map(|column| Node::new(column, 0, 0, &mut leaves)).collect();
    (nodes, leaves)
}

impl Node {
    fn new(column: &Column, definition: i16, repetition: i16, leaves: &mut Vec<Leaf>) -> Self {
        let first = leaves.len();
        let there = definition + i16::from(column.nullable);
        let kind = match &column.kind {
            Kind::List(kind) => {
                let element = Column { name: column.name.clone(), kind: (**kind).clone(), nullable: true };
                NodeKind::List(Box::new(Self::new(&element, there + 1, repetition + 1, leaves)))
            }
            Kind::Struct(fields) => {
                NodeKind::Struct(fields.iter().map(|field| Self::new(field, there, repetition, leaves)).collect())
            }
            kind => {
                leaves.push(Leaf::new(kind, there));
                NodeKind::Leaf
            }
        };
        let leaves = first..leaves.len();
        Self { name: column.name.clone(), kind, nullable: column.nullable, definition, repetition, leaves }
    }

    /// The numbers of its leaves.
    pub(crate) fn leaves(&self) -> Range<usize> {
        self.leaves.clone()
    }

    /// The definition of something that is there.
    fn there(&self) -> i16 {
        self.definition + i16::from(self.nullable)
    }

    /// Whether a value has room here.
    pub(crate) fn check(&self, value: &Value, leaves: &[Leaf]) -> Result<(), Error> {
        let fits = match (value, &self.kind) {
            (Value::Null, _) => self.nullable,
            (Value::List(values), NodeKind::List(element)) => {
                return values.iter().try_for_each(|value| element.check(value, leaves));
            }
            (Value::Struct(values), NodeKind::Struct(fields)) if values.len() == fields.len() => {
                return values.iter().zip(fields).try_for_each(|(value, field)| field.check(value, leaves));
            }
            (value, NodeKind::Leaf) => matches!(
                (value, &leaves[self.leaves.start].values),
                (Value::Bool(_), Values::Bool(_))
                    | (Value::U32(_), Values::U32(_))
                    | (Value::I64(_), Values::I64(_))
                    | (Value::F64(_), Values::F64(_))
                    | (Value::Text(_), Values::Text(_))
                    | (Value::Bytes(_), Values::Bytes(_))
            ),
            _ => false,
        };
        match fits {
            true => Ok(()),
            false => Error::table(format!("column `{}` has no room for {}", self.name, value.name())),
        }
    }

    /// Takes a value that was checked apart, and says how many bytes it takes in memory, about.
    pub(crate) fn shred(&self, value: Value, repetition: i16, leaves: &mut [Leaf]) -> usize {
        match (value, &self.kind) {
            (Value::Null, _) => self.lack(self.definition, repetition, leaves),
            (Value::List(values), _) if values.is_empty() => self.lack(self.there(), repetition, leaves),
            (Value::List(values), NodeKind::List(element)) => {
                let repetitions = std::iter::once(repetition).chain(std::iter::repeat(element.repetition));
                let each = values.into_iter().zip(repetitions);
                each.map(|(value, repetition)| element.shred(value, repetition, leaves)).sum()
            }
            (Value::Struct(values), NodeKind::Struct(fields)) => {
                values.into_iter().zip(fields).map(|(value, field)| field.shred(value, repetition, leaves)).sum()
            }
            (value, _) => leaves[self.leaves.start].push(value, self.there(), repetition),
        }
    }

    fn lack(&self, definition: i16, repetition: i16, leaves: &mut [Leaf]) -> usize {
        leaves[self.leaves()].iter_mut().map(|leaf| leaf.push(Value::Null, definition, repetition)).sum()
    }

    /// Puts a value of at most `room` bytes together from the front of its leaves.
    pub(crate) fn assemble(&self, leaves: &mut [Leaf], room: &mut usize) -> Result<Value, Error> {
        let [definition, _] = self.next(leaves)?;
        if self.nullable && definition <= self.definition {
            return self.take_lack(leaves, self.definition, Value::Null);
        }
        match &self.kind {
            NodeKind::Leaf if definition == self.there() => {
                let leaf = &mut leaves[self.leaves.start];
                leaf.take(room)
            }
            NodeKind::Leaf => Error::broken(format!("column `{}` lacks a value", self.name)),
            NodeKind::Struct(fields) => {
                fields.iter().map(|field| field.assemble(leaves, room)).collect::<Result<_, _>>().map(Value::Struct)
            }
            NodeKind::List(_) if definition <= self.there() => {
                self.take_lack(leaves, self.there(), Value::List(Vec::new()))
            }
            NodeKind::List(element) => {
                let mut values = Vec::new();
                loop {
                    // An element takes room itself, however small it is.
                    match room.checked_sub(size_of::<Value>()) {
                        Some(left) => *room = left,
                        None => return Error::broken("a row has more values than are read"),
                    }
                    values.push(element.assemble(leaves, room)?);
                    match leaves[self.leaves.start].next() {
                        Some([_, repetition]) if repetition == element.repetition => {}
                        _ => return Ok(Value::List(values)),
                    }
                }
            }
        }
    }

    fn next(&self, leaves: &[Leaf]) -> Result<[i16; 2], Error> {
        leaves[self.leaves.start].next().map_or_else(|| self.disagree(), Ok)
    }

    /// Something is not there in all leaves alike.
    fn take_lack(&self, leaves: &mut [Leaf], definition: i16, value: Value) -> Result<Value, Error> {
        for leaf in &mut leaves[self.leaves()] {
            match leaf.next() {
                Some([found, _]) if found == definition => leaf.take_lack(),
                _ => return self.disagree(),
            }
        }
        Ok(value)
    }

    /// Whether all leaves begin a row, or all have ended.
    pub(crate) fn is_at(&self, leaves: &[Leaf], repetition: Option<i16>) -> Result<(), Error> {
        match leaves[self.leaves()].iter().all(|leaf| leaf.next().map(|[_, repetition]| repetition) == repetition) {
            true => Ok(()),
            false => self.disagree(),
        }
    }

    fn disagree<T>(&self) -> Result<T, Error> {
        Error::broken(format!("the parts of column `{}` do not fit together", self.name))
    }
}

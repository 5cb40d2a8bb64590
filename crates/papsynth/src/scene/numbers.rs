//! Numbers that belong to a whole field.

use crate::key::{Key, Stream};
use crate::recipe::number::Number;

/// Draws numbers that belong to a whole field, each from a stream named after its place in the recipe: giving one of
/// them a distribution changes none of the others.
pub(crate) struct FieldNumbers {
    pub(crate) key: Key,
}

impl FieldNumbers {
    pub(super) fn stream(&self, path: &str) -> Stream {
        self.key.stream("field", 0, path)
    }

    pub(crate) fn draw(&self, (path, number): (&str, &Number)) -> f64 {
        number.draw(&mut self.stream(path))
    }

    pub(crate) fn count(&self, (path, number): (&str, &Number)) -> usize {
        number.draw_count(&mut self.stream(path))
    }
}

/// Border mode: values outside of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Border {
    /// Zeros: `0 0 | a b c | 0 0`. For an object alone in its tile.
    Zero,
    /// Mirrored at the edge: `b a | a b c | c b`. Constants and the sum of the image are preserved at every blur width.
    #[default]
    Reflect,
    /// Edge pixel repeated: `a a | a b c | c c`. Constants are preserved.
    Replicate,
}

impl Border {
    /// Returns the index in `0..len` of the pixel that `index` maps to, or `None` for a zero.
    pub(crate) fn source(self, index: isize, len: usize) -> Option<usize> {
        if let Some(inside) = usize::try_from(index).ok().filter(|&i| i < len) {
            return Some(inside);
        }
        match self {
            Self::Zero => None,
            Self::Reflect => {
                let phase = index.rem_euclid(2 * len.cast_signed()).cast_unsigned();
                Some(phase.min(2 * len - 1 - phase))
            }
            Self::Replicate => Some(if index < 0 { 0 } else { len - 1 }),
        }
    }

    /// Prepares extended rows: `line.len()` pixels from index `start` of rows of `len` pixels. `start` may be negative.
    pub(crate) fn extension(self, len: usize, start: isize, line: &mut [f32]) -> Extension<'_> {
        let before = usize::try_from(-start).unwrap_or(0).min(line.len());
        let skipped = usize::try_from(start).unwrap_or(0).min(len);
        let inside = (len - skipped).min(line.len() - before);
        line[..before].fill(0.0);
        line[before + inside..].fill(0.0);
        Extension { border: self, start, line, before, skipped, inside }
    }
}

/// A row buffer with extrapolated values.
pub(crate) struct Extension<'a> {
    border: Border,
    start: isize,
    line: &'a mut [f32],
    /// Pixels before the row, skipped pixels of the row, and copied pixels.
    before: usize,
    skipped: usize,
    inside: usize,
}

impl Extension<'_> {
    pub(crate) fn of(&mut self, row: &[f32]) -> &[f32] {
        let inside = self.before..self.before + self.inside;
        self.line[inside.clone()].copy_from_slice(&row[self.skipped..self.skipped + self.inside]);
        // Zeros outside of the row are already set.
        if self.border != Border::Zero {
            for i in (0..inside.start).chain(inside.end..self.line.len()) {
                let source = self.border.source(self.start + i.cast_signed(), row.len());
                self.line[i] = source.map_or(0.0, |s| row[s]);
            }
        }
        self.line
    }
}

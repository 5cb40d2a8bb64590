/// What lies outside an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Border {
    /// Nothing: `0 0 | a b c | 0 0`. Right for an object alone in its tile.
    Zero,
    /// The image, mirrored in its edge: `b a | a b c | c b`. A constant stays constant and the sum
    /// stays the sum, whatever the width of the blur: what leaves over the edge comes back.
    #[default]
    Reflect,
    /// The pixel at the edge, for ever: `a a | a b c | c c`. A constant stays constant.
    Replicate,
}

impl Border {
    /// The index in `0..len` that stands for `index`; none where the border holds nothing.
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

    /// Rows of `len` pixels from index `start` on, which may lie before or beyond them, as long as `line`, which holds them
    /// one after the other.
    pub(crate) fn extension(self, len: usize, start: isize, line: &mut [f32]) -> Extension<'_> {
        let before = usize::try_from(-start).unwrap_or(0).min(line.len());
        let skipped = usize::try_from(start).unwrap_or(0).min(len);
        let inside = (len - skipped).min(line.len() - before);
        line[..before].fill(0.0);
        line[before + inside..].fill(0.0);
        Extension { border: self, start, line, before, skipped, inside }
    }
}

/// Rows and what surrounds them.
pub(crate) struct Extension<'a> {
    border: Border,
    start: isize,
    line: &'a mut [f32],
    /// Places before the row, pixels of it that are left out, and pixels that are not.
    before: usize,
    skipped: usize,
    inside: usize,
}

impl Extension<'_> {
    pub(crate) fn of(&mut self, row: &[f32]) -> &[f32] {
        let inside = self.before..self.before + self.inside;
        self.line[inside.clone()].copy_from_slice(&row[self.skipped..self.skipped + self.inside]);
        // Where the border holds nothing, nothing was there before.
        if self.border != Border::Zero {
            for i in (0..inside.start).chain(inside.end..self.line.len()) {
                let source = self.border.source(self.start + i.cast_signed(), row.len());
                self.line[i] = source.map_or(0.0, |s| row[s]);
            }
        }
        self.line
    }
}

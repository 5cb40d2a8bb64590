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

    /// Fills `line` with `row` from index `start` on, which may lie before or beyond it.
    pub(crate) fn extend(self, row: &[f32], start: isize, line: &mut [f32]) {
        let before = usize::try_from(-start).unwrap_or(0).min(line.len());
        let skipped = usize::try_from(start).unwrap_or(0).min(row.len());
        let inside = (row.len() - skipped).min(line.len() - before);
        line[before..before + inside].copy_from_slice(&row[skipped..skipped + inside]);
        if self == Self::Zero {
            line[..before].fill(0.0);
            line[before + inside..].fill(0.0);
            return;
        }
        for i in (0..before).chain(before + inside..line.len()) {
            let source = self.source(start + i.cast_signed(), row.len());
            line[i] = source.map_or(0.0, |s| row[s]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extended(border: Border, start: isize, len: usize) -> Vec<f32> {
        let mut line = vec![-1.0; len];
        border.extend(&[1.0, 2.0, 3.0], start, &mut line);
        line
    }

    #[test]
    fn borders_are_what_the_words_say() {
        assert_eq!(extended(Border::Zero, -2, 7), [0., 0., 1., 2., 3., 0., 0.]);
        assert_eq!(extended(Border::Reflect, -2, 7), [2., 1., 1., 2., 3., 3., 2.]);
        assert_eq!(extended(Border::Replicate, -2, 7), [1., 1., 1., 2., 3., 3., 3.]);
    }

    #[test]
    fn a_border_wider_than_the_image_folds_again() {
        let folded = [1., 2., 3., 3., 2., 1., 1., 2., 3., 3., 2., 1., 1., 2., 3.];
        assert_eq!(extended(Border::Reflect, -6, 15), folded);
        assert_eq!(extended(Border::Zero, 5, 2), [0., 0.]);
        assert_eq!(extended(Border::Zero, -9, 2), [0., 0.]);
        assert_eq!(extended(Border::Replicate, 1, 4), [2., 3., 3., 3.]);
    }
}

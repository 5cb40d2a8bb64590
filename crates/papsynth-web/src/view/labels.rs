//! Labels as colours: each object filled thinly, its outline opaque.

use super::grid::Cut;

/// Opacity of what lies within an outline.
const FILL: u8 = 76;

/// Colours that people with defective colour vision tell apart, too (Okabe and Ito), without black.
const COLOURS: [[u8; 3]; 7] =
    [[230, 159, 0], [86, 180, 233], [0, 158, 115], [240, 228, 66], [0, 114, 178], [213, 94, 0], [204, 121, 167]];

/// Ids of a part of a level of labels, with a pixel more on every side.
#[derive(Debug)]
pub(crate) struct Ids {
    width: usize,
    height: usize,
    /// Rows of `width + 2`; nothing beyond the border of the picture, or where it is not known.
    ids: Vec<Option<u32>>,
}

impl Ids {
    /// No object in a part of a level of so many columns and rows; beyond its borders nothing is.
    pub(crate) fn empty(cut: &Cut, size: [usize; 2]) -> Self {
        let known = vec![0; cut.wider(size).rows.len() * cut.wider(size).width()];
        Self::new(cut, &cut.wider(size), &known)
    }

    /// `ids` are those of `known`, a part of the level that holds `cut` and may reach a pixel further on every side.
    pub(crate) fn new(cut: &Cut, known: &Cut, ids: &[u32]) -> Self {
        let (width, height) = (cut.width(), cut.rows.len());
        let mut all = vec![None; (width + 2) * (height + 2)];
        for (y, row) in known.rows.clone().zip(ids.chunks_exact(known.width().max(1))) {
            let start = (y + 1 - cut.rows.start) * (width + 2) + known.columns.start + 1 - cut.columns.start;
            all[start..start + row.len()].iter_mut().zip(row).for_each(|(to, id)| *to = Some(*id));
        }
        Self { width, height, ids: all }
    }

    /// Sets pixels of a row of the level, as far as they are known here.
    pub(crate) fn paint(&mut self, cut: &Cut, y: usize, columns: std::ops::Range<usize>, id: u32) {
        let Some(row) = (y + 1).checked_sub(cut.rows.start).filter(|row| *row < self.height + 2) else { return };
        let along = |x: usize| (x + 1).saturating_sub(cut.columns.start).min(self.width + 2);
        let row = row * (self.width + 2);
        let pixels = &mut self.ids[row + along(columns.start)..row + along(columns.end)];
        pixels.iter_mut().flatten().for_each(|pixel| *pixel = id);
    }

    /// Red, green, blue and opacity of every pixel.
    pub(crate) fn rgba(&self) -> Vec<u8> {
        let row = self.width + 2;
        let mut bytes = Vec::with_capacity(4 * self.width * self.height);
        for y in 1..=self.height {
            for at in y * row + 1..=y * row + self.width {
                let Some(id) = self.ids[at].filter(|id| *id != 0) else {
                    bytes.extend([0; 4]);
                    continue;
                };
                let is_other = |at: usize| self.ids[at].is_some_and(|other| other != id);
                let is_edge = [at - 1, at + 1, at - row, at + row].into_iter().any(is_other);
                let [red, green, blue] = colour(id);
                bytes.extend([red, green, blue, if is_edge { u8::MAX } else { FILL }]);
            }
        }
        bytes
    }
}

/// The colour of an object: the same wherever and whenever it is shown.
fn colour(id: u32) -> [u8; 3] {
    // Fibonacci hashing: ids that follow each other are as far apart as they can be.
    let hash = u64::from(id.wrapping_mul(0x9E37_79B9));
    let number = usize::try_from((hash * 3 * COLOURS.len() as u64) >> u32::BITS).unwrap_or_default();
    let [colour, shade] = [number % COLOURS.len(), number / COLOURS.len()];
    let shaded = |value: u8| match shade {
        0 => value,
        1 => value - value / 4,
        _ => value + (u8::MAX - value) / 3,
    };
    COLOURS[colour].map(shaded)
}

/// The same as a style sheet writes it.
pub(crate) fn colour_text(id: u32) -> String {
    let [red, green, blue] = colour(id);
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn ids_that_follow_each_other_have_colours_of_their_own() {
        let colours: Vec<_> = (1..2000).map(colour).collect();
        assert_eq!(colours.iter().collect::<BTreeSet<_>>().len(), 21);
        assert!(colours.windows(3).all(|three| three[0] != three[1] && three[0] != three[2]));
    }

    #[test]
    fn outlines_do_not_depend_on_where_tiles_are_cut() {
        let (width, height) = (23, 17);
        let id = |x: usize, y: usize| u32::try_from((x / 5 + 3 * (y / 4)) % 4).unwrap();
        let ids = |cut: &Cut| -> Vec<u32> {
            cut.rows.clone().flat_map(|y| cut.columns.clone().map(move |x| id(x, y))).collect()
        };
        let all = Cut { rows: 0..height, columns: 0..width };
        let whole = Ids::new(&all, &all, &ids(&all)).rgba();
        let mut edges = 0;
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let four = [[x.wrapping_sub(1), y], [x + 1, y], [x, y.wrapping_sub(1)], [x, y + 1]];
            let is_edge = four.iter().any(|&[i, j]| i < width && j < height && id(i, j) != id(x, y));
            let expected = if id(x, y) == 0 {
                0
            } else if is_edge {
                255
            } else {
                FILL
            };
            assert_eq!(whole[4 * (y * width + x) + 3], expected, "{x} {y}");
            edges += usize::from(is_edge);
        }
        assert!(edges > 20);
        for (top, left) in (0..height).step_by(6).flat_map(|top| (0..width).step_by(6).map(move |left| (top, left))) {
            let cut = Cut { rows: top..(top + 6).min(height), columns: left..(left + 6).min(width) };
            let wider = cut.wider([width, height]);
            let part = Ids::new(&cut, &wider, &ids(&wider)).rgba();
            let expected: Vec<u8> = cut
                .rows
                .clone()
                .flat_map(|y| &whole[4 * (y * width + cut.columns.start)..4 * (y * width + cut.columns.end)])
                .copied()
                .collect();
            assert_eq!(part, expected, "{cut:?}");
            // Painted run by run it is the same.
            let mut painted = Ids::empty(&cut, [width, height]);
            for y in 0..height {
                (0..width).for_each(|x| painted.paint(&cut, y, x..x + 1, id(x, y)));
            }
            assert_eq!(painted.rgba(), expected, "{cut:?}");
        }
    }
}

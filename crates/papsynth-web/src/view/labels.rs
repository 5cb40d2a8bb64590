//! Label colours: transparent fill, opaque outline.

use super::grid::Region;

/// Opacity of the fill.
const FILL: u8 = 76;

/// The colour-blind-safe palette of Okabe and Ito, without black.
const COLOURS: [[u8; 3]; 7] =
    [[230, 159, 0], [86, 180, 233], [0, 158, 115], [240, 228, 66], [0, 114, 178], [213, 94, 0], [204, 121, 167]];

/// Label ids of a region, with a margin of one pixel.
#[derive(Debug)]
pub(crate) struct Ids {
    width: usize,
    height: usize,
    /// Rows of `width + 2` ids; `None` outside the image and where the id is unknown.
    ids: Vec<Option<u32>>,
}

impl Ids {
    /// Creates a region without objects in a level of the given size.
    pub(crate) fn empty(region: &Region, size: [usize; 2]) -> Self {
        let known = vec![0; region.wider(size).rows.len() * region.wider(size).width()];
        Self::new(region, &region.wider(size), &known)
    }

    /// Creates the ids of `region` from those of `known`, a region that contains it and may have the margin.
    pub(crate) fn new(region: &Region, known: &Region, ids: &[u32]) -> Self {
        let (width, height) = (region.width(), region.rows.len());
        let mut all = vec![None; (width + 2) * (height + 2)];
        for (y, row) in known.rows.clone().zip(ids.chunks_exact(known.width().max(1))) {
            let start = (y + 1 - region.rows.start) * (width + 2) + known.columns.start + 1 - region.columns.start;
            all[start..start + row.len()].iter_mut().zip(row).for_each(|(to, id)| *to = Some(*id));
        }
        Self { width, height, ids: all }
    }

    /// Sets the pixels of a row of the level that are in this region.
    pub(crate) fn paint(&mut self, region: &Region, y: usize, columns: std::ops::Range<usize>, id: u32) {
        let Some(row) = (y + 1).checked_sub(region.rows.start).filter(|row| *row < self.height + 2) else { return };
        let along = |x: usize| (x + 1).saturating_sub(region.columns.start).min(self.width + 2);
        let row = row * (self.width + 2);
        let pixels = &mut self.ids[row + along(columns.start)..row + along(columns.end)];
        pixels.iter_mut().flatten().for_each(|pixel| *pixel = id);
    }

    /// Returns red, green, blue and opacity of every pixel.
    pub(crate) fn rgba(&self) -> Vec<u8> {
        self.rgba_with(FILL, colour)
    }

    /// As [`rgba`](Self::rgba), with another opacity of the fill and the colours of `colour_of` an id.
    pub(crate) fn rgba_with(&self, fill: u8, colour_of: impl Fn(u32) -> [u8; 3]) -> Vec<u8> {
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
                let [red, green, blue] = colour_of(id);
                bytes.extend([red, green, blue, if is_edge { u8::MAX } else { fill }]);
            }
        }
        bytes
    }
}

/// Returns one of 21 colours: the palette, then two shades of it.
pub(crate) fn numbered_colour(number: usize) -> [u8; 3] {
    let shaded = |value: u8| match number / COLOURS.len() % 3 {
        0 => value,
        1 => value - value / 4,
        _ => value + (u8::MAX - value) / 3,
    };
    COLOURS[number % COLOURS.len()].map(shaded)
}

/// Returns the colour of an object, which depends on its id only.
pub(crate) fn colour(id: u32) -> [u8; 3] {
    // Fibonacci hashing: consecutive ids get colours that are far apart.
    let hash = u64::from(id.wrapping_mul(0x9E37_79B9));
    let number = usize::try_from((hash * 3 * COLOURS.len() as u64) >> u32::BITS).unwrap_or_default();
    numbered_colour(number)
}

/// Returns the colour of an object in CSS notation.
pub(crate) fn colour_text(id: u32) -> String {
    css(colour(id))
}

/// Returns a colour in CSS notation.
pub(crate) fn css([red, green, blue]: [u8; 3]) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn consecutive_ids_have_different_colours() {
        let colours: Vec<_> = (1..2000).map(colour).collect();
        assert_eq!(colours.iter().collect::<BTreeSet<_>>().len(), 21);
        assert!(colours.windows(3).all(|three| three[0] != three[1] && three[0] != three[2]));
    }

    #[test]
    fn outlines_do_not_depend_on_where_tiles_are_cut() {
        let (width, height) = (23, 17);
        let id = |x: usize, y: usize| u32::try_from((x / 5 + 3 * (y / 4)) % 4).unwrap();
        let ids = |region: &Region| -> Vec<u32> {
            region.rows.clone().flat_map(|y| region.columns.clone().map(move |x| id(x, y))).collect()
        };
        let all = Region { rows: 0..height, columns: 0..width };
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
            let region = Region { rows: top..(top + 6).min(height), columns: left..(left + 6).min(width) };
            let wider = region.wider([width, height]);
            let part = Ids::new(&region, &wider, &ids(&wider)).rgba();
            let expected: Vec<u8> = region
                .rows
                .clone()
                .flat_map(|y| &whole[4 * (y * width + region.columns.start)..4 * (y * width + region.columns.end)])
                .copied()
                .collect();
            assert_eq!(part, expected, "{region:?}");
            // Painted run by run it is the same.
            let mut painted = Ids::empty(&region, [width, height]);
            for y in 0..height {
                (0..width).for_each(|x| painted.paint(&region, y, x..x + 1, id(x, y)));
            }
            assert_eq!(painted.rgba(), expected, "{region:?}");
        }
    }
}

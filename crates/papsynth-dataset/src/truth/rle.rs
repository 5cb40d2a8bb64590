//! Run-length masks of COCO.
//!
//! In column-major order, the numbers of pixels outside, inside, outside, … the mask. From the fourth number on, the
//! difference to the number two before. Groups of five bits are printable characters.

use papsynth::truth::{Mask, Run};

use crate::error::InputError;

/// Largest width or height of a decoded mask, the largest size of a field. It bounds the memory for a short string.
const MAX_SIDE: usize = 1 << 15;

/// Returns the `counts` of a mask in an image of `width` x `height` pixels.
///
/// # Panics
/// If the mask has a pixel outside the image.
#[must_use]
pub fn encode(mask: &Mask, width: usize, height: usize) -> String {
    let mut out = String::new();
    let counts = counts(mask, width, height);
    for (i, &count) in counts.iter().enumerate() {
        let before = if i > 2 { counts[i - 2] } else { 0 };
        push(count - before, &mut out);
    }
    out
}

/// Returns the `counts` of a mask within its bounding box; an empty string for an empty mask.
#[cfg(feature = "zarr")]
pub(crate) fn encode_in_box(mask: &Mask) -> String {
    let Some(bounds) = mask.bounds() else { return String::new() };
    let moved = |run: &Run| Run { y: run.y - bounds.y, x0: run.x0 - bounds.x, x1: run.x1 - bounds.x };
    let within = Mask::from_runs(mask.runs().iter().map(moved).collect());
    encode(&within, bounds.width as usize, bounds.height as usize)
}

/// Returns the numbers of pixels outside, inside, outside, … in column-major order. A last count of 0 is left out, a
/// first one is not.
fn counts(mask: &Mask, width: usize, height: usize) -> Vec<i64> {
    let mut counts = Vec::new();
    let mut inside: Option<[u64; 2]> = None;
    let mut end = 0;
    let mut close = |[from, to]: [u64; 2]| {
        counts.extend([(from - end) as i64, (to - from) as i64]);
        end = to;
    };
    for column in transposed(mask.runs()) {
        let [from, to] = [column.x0, column.x1].map(|y| u64::from(column.y) * height as u64 + u64::from(y));
        match &mut inside {
            // The end of a column and the start of the next are neighbours.
            Some(last) if last[1] == from => last[1] = to,
            _ => {
                if let Some(last) = inside.replace([from, to]) {
                    close(last);
                }
            }
        }
    }
    if let Some(last) = inside {
        close(last);
    }
    let total = (width * height) as u64;
    if end < total {
        counts.push((total - end) as i64);
    }
    counts
}

/// Returns the runs of the same pixels with rows and columns exchanged. The time is proportional to the length of the
/// outline, not to the area.
fn transposed(runs: &[Run]) -> Vec<Run> {
    // Columns and rows at which a run of a column begins, or has ended, as numbers for fast sorting.
    let mut edges: Vec<u64> = Vec::new();
    let mut ends = Vec::new();
    let mut add = |above: &[Run], here: &[Run], y: u32| {
        ends.clear();
        ends.extend(above.iter().chain(here).flat_map(|run| [run.x0, run.x1]));
        ends.sort_unstable();
        // Sorted in pairs, the ends are the columns that are in one of the rows, but not in both.
        for pair in ends.chunks_exact(2) {
            edges.extend((pair[0]..pair[1]).map(|x| u64::from(x) << 32 | u64::from(y)));
        }
    };
    let mut above: &[Run] = &[];
    for here in runs.chunk_by(|a, b| a.y == b.y).chain([&[][..]]) {
        let below = above.first().map_or(0, |run| run.y + 1);
        match here.first() {
            Some(run) if run.y == below => add(above, here, below),
            first => {
                add(above, &[], below);
                add(&[], here, first.map_or(0, |run| run.y));
            }
        }
        above = here;
    }
    edges.sort_unstable();
    #[expect(clippy::cast_possible_truncation, reason = "the lower half is a row")]
    let row = |edge: u64| edge as u32;
    edges.chunks_exact(2).map(|pair| Run { y: (pair[0] >> 32) as u32, x0: row(pair[0]), x1: row(pair[1]) }).collect()
}

/// Encodes a number with five bits per character, lowest first. The sixth bit is set if more follow; the fifth bit of
/// the last character is the sign.
fn push(mut value: i64, out: &mut String) {
    loop {
        #[expect(clippy::cast_sign_loss, reason = "five bits")]
        let bits = (value & 0x1f) as u8;
        value >>= 5;
        let last = value == if bits & 0x10 == 0 { 0 } else { -1 };
        out.push(char::from(48 + bits + if last { 0 } else { 0x20 }));
        if last {
            return;
        }
    }
}

/// Decodes the `counts` of a mask in an image of `width` x `height` pixels.
///
/// # Errors
/// If the string is invalid, or the counts do not fill the image exactly.
pub fn decode(counts: &str, width: usize, height: usize) -> Result<Mask, InputError> {
    let wrong = |message: String| InputError::broken("RLE", message);
    if width.max(height) > MAX_SIDE {
        return Err(wrong(format!("the image is {width} x {height} pixels; expected at most {MAX_SIDE} per side")));
    }
    let total = width * height;
    let mut columns = Vec::new();
    let mut last_two = [0_i64; 2];
    let (mut position, mut number) = (0_usize, 0_usize);
    let mut bytes = counts.bytes();
    while let Some(difference) = pull(&mut bytes).map_err(|m| wrong(m.to_owned()))? {
        let count = difference + if number > 2 { last_two[0] } else { 0 };
        last_two = [last_two[1], count];
        let length = usize::try_from(count).map_err(|_| wrong(format!("count {number} is negative")))?;
        let end = position.saturating_add(length);
        if end > total {
            return Err(wrong(format!("the counts exceed the {total} pixels of the image")));
        }
        let mut from = position;
        while number % 2 == 1 && from < end {
            let (column, to) = (from / height, end.min((from / height + 1) * height));
            let [y, x0, x1] = [column, from - column * height, to - column * height].map(to_u32);
            columns.push(Run { y, x0, x1 });
            from = to;
        }
        (position, number) = (end, number + 1);
    }
    if position != total {
        return Err(wrong(format!("the counts fill {position} of {total} pixels")));
    }
    Ok(Mask::from_runs(transposed(&columns)))
}

/// Converts a row or column of an image.
fn to_u32(position: usize) -> u32 {
    u32::try_from(position).unwrap_or(u32::MAX)
}

fn pull(bytes: &mut std::str::Bytes) -> Result<Option<i64>, &'static str> {
    /// A count has at most 2³² pixels, in seven groups of five bits.
    const MAX_SHIFT: u32 = 35;
    let mut value = 0_i64;
    let mut shift = 0;
    loop {
        let Some(byte) = bytes.next() else {
            return if shift == 0 { Ok(None) } else { Err("the string ends within a number") };
        };
        let group = match byte.checked_sub(48) {
            Some(group) if group < 64 && shift <= MAX_SHIFT => group,
            Some(group) if group < 64 => return Err("a number is too large"),
            _ => return Err("invalid character"),
        };
        value |= i64::from(group & 0x1f) << shift;
        shift += 5;
        if group & 0x20 == 0 {
            let sign = if group & 0x10 == 0 { 0 } else { -1_i64 << shift };
            return Ok(Some(value | sign));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mask(pixels: &[bool], width: usize) -> Mask {
        let tile: Vec<f32> = pixels.iter().map(|&p| f32::from(u8::from(p))).collect();
        Mask::from_tile(&tile, width, [0, 0], width, pixels.len() / width, |v| v > 0.5)
    }

    /// The counts, pixel by pixel in column-major order.
    fn slow_counts(pixels: &[bool], width: usize) -> Vec<i64> {
        let height = pixels.len() / width;
        let mut counts = vec![0];
        let mut value = false;
        for i in 0..pixels.len() {
            let pixel = pixels[i % height * width + i / height];
            if pixel != value {
                counts.push(0);
                value = pixel;
            }
            *counts.last_mut().unwrap() += 1;
        }
        counts
    }

    #[test]
    fn strings_equal_those_of_pycocotools() {
        let checkers: Vec<bool> = (0..35).map(|i| (i / 7 + i % 7) % 2 == 0).collect();
        assert_eq!(encode(&mask(&checkers, 7), 7, 5), r"011000000000000000000000000000000000");
        assert_eq!(encode(&mask(&[false; 12], 4), 4, 3), "<");
        assert_eq!(encode(&mask(&[true; 12], 4), 4, 3), "0<");
        let block: Vec<bool> = (0..40_000).map(|i| (50..150).contains(&(i % 200)) && i / 200 >= 20).collect();
        assert_eq!(
            encode(&mask(&block, 200), 200, 200),
            r"Ti9d5d000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000lg9"
        );
    }

    #[test]
    fn invalid_strings_are_refused() {
        for (text, what) in [
            ("", "fill 0 of 12"),
            ("3", "fill 3 of 12"),
            ("=", "exceed"),
            ("\u{20}", "invalid character"),
            ("é", "invalid character"),
            ("P", "ends within"),
            ("oooooooooo0", "too large"),
            ("O", "negative"),
        ] {
            let problem = decode(text, 4, 3).unwrap_err().to_string();
            assert!(problem.contains(what), "{text}: {problem}");
        }
        assert!(decode("0", usize::MAX, usize::MAX).is_err());
        assert_eq!(decode("", 0, 0).unwrap(), Mask::default());
    }

    proptest! {
        #[test]
        fn counts_equal_the_slow_version_and_are_read_back(
            width in 1_usize..24,
            pixels in proptest::collection::vec(proptest::bool::weighted(0.6), 24 * 20),
            height in 1_usize..20,
        ) {
            let pixels = &pixels[..width * height];
            let mask = mask(pixels, width);
            prop_assert_eq!(counts(&mask, width, height), slow_counts(pixels, width));
            prop_assert_eq!(decode(&encode(&mask, width, height), width, height), Ok(mask));
        }

        #[test]
        fn any_text_is_a_mask_or_refused(text in ".{0,40}", plain in "[0-o]{0,40}", width in 0_usize..300, height in 0_usize..300) {
            for text in [text, plain] {
                if let Ok(mask) = decode(&text, width, height) {
                    prop_assert!(mask.area() <= (width * height) as u64);
                }
            }
        }
    }
}

//! What the classifier was most and least sure of, cut from the fields.

use crate::measure::Field;
use crate::number::whole;
use crate::table::Table;
use crate::two_sample::TwoSample;

/// How many are shown of each kind.
const SHOWN: usize = 20;

/// Side of the picture of a nucleus, pixels.
const NUCLEUS_PX: usize = 64;

/// A piece of a field.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Crop {
    /// "nuclei" or "patches".
    pub(crate) of: &'static str,
    pub(crate) synthetic: bool,
    /// Among the 20 that looked most real of their side, or most synthetic.
    pub(crate) looks_real: bool,
    pub(crate) field: String,
    /// How synthetic it looked, 0 to 1.
    pub(crate) score: f64,
    pub(crate) grey: Vec<u8>,
    pub(crate) width: usize,
}

/// A name, the table of it, and the side of its picture.
type Kind = (&'static str, fn(&Field) -> &Table, usize);

pub(crate) fn crops<'a>(
    real: &[Field],
    synthetic: &[Field],
    result: impl Fn(&str) -> Option<&'a TwoSample>,
) -> Vec<Crop> {
    let kinds: [Kind; 2] =
        [("nuclei", |f| &f.nuclei, NUCLEUS_PX), ("patches", |f| &f.patches, crate::measure::PATCH_PX)];
    let mut crops = Vec::new();
    for (of, table, side) in kinds {
        let Some(result) = result(of) else { continue };
        for (is_synthetic, fields) in [(false, real), (true, synthetic)] {
            let places = fields.iter().flat_map(|f| table(f).places.iter().map(move |p| (f, *p)));
            let scores = &result.scores[usize::from(is_synthetic)];
            let mut all: Vec<(f64, &Field, [f64; 2])> =
                scores.iter().zip(places).map(|(s, (f, p))| (*s, f, p)).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            let shown = SHOWN.min(all.len());
            for (looks_real, part) in [(true, &all[..shown]), (false, &all[all.len() - shown..])] {
                crops.extend(part.iter().filter_map(|(score, field, place)| {
                    let (grey, width) = cut(field, *place, side)?;
                    Some(Crop {
                        of,
                        synthetic: is_synthetic,
                        looks_real,
                        field: field.name.clone(),
                        score: *score,
                        grey,
                        width,
                    })
                }));
            }
        }
    }
    crops
}

/// The square around a place, moved into the field where it would reach beyond.
fn cut(field: &Field, [x, y]: [f64; 2], side: usize) -> Option<(Vec<u8>, usize)> {
    if field.thumbnail.is_empty() {
        return None;
    }
    let (wide, high) = (side.min(field.width), side.min(field.height));
    let left = whole(x - wide as f64 / 2.0 + 0.5).min(field.width - wide);
    let top = whole(y - high as f64 / 2.0 + 0.5).min(field.height - high);
    let rows = field.thumbnail.chunks_exact(field.width).skip(top).take(high);
    Some((rows.flat_map(|row| row[left..left + wide].iter().copied()).collect(), wide))
}

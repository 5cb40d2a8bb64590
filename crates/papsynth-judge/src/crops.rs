//! Crops of the nuclei and patches with the highest and lowest scores.

use crate::measure::{Field, PATCH_PX};
use crate::number::whole;
use crate::table::FeatureTable;
use crate::two_sample::TwoSample;

/// Number of crops of a sheet.
const SHOWN: usize = 20;

/// Width and height of the crop of a nucleus, pixels.
const NUCLEUS_PX: usize = 64;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sheet {
    /// "nuclei" or "patches".
    pub(crate) of: &'static str,
    pub(crate) title: &'static str,
    pub(crate) crops: Vec<Crop>,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Crop {
    pub(crate) field: String,
    /// Score of the classifier: 0 looks real, 1 looks synthetic.
    pub(crate) score: f64,
    pub(crate) grey: Vec<u8>,
    pub(crate) width: usize,
}

/// Name, feature table and crop size of one kind of objects.
type Kind = (&'static str, fn(&Field) -> &FeatureTable, usize);

pub(crate) fn sheets<'a>(
    real: &[Field],
    synthetic: &[Field],
    result: impl Fn(&str) -> Option<&'a TwoSample>,
) -> Vec<Sheet> {
    let kinds: [Kind; 2] = [("nuclei", |f| &f.nuclei, NUCLEUS_PX), ("patches", |f| &f.patches, PATCH_PX)];
    let mut sheets = Vec::new();
    for (of, table, side) in kinds {
        let Some(result) = result(of) else { continue };
        for (fields, scores, titles) in [
            (synthetic, &result.scores[1], ["Synthetic, look most real", "Synthetic, look least real"]),
            (real, &result.scores[0], ["Real, look most real", "Real, look most synthetic"]),
        ] {
            let places = fields.iter().flat_map(|f| table(f).places.iter().map(move |p| (f, *p)));
            let mut all: Vec<(f64, (&Field, [f64; 2]))> = scores.iter().copied().zip(places).collect();
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            let shown = SHOWN.min(all.len());
            for (title, part) in titles.into_iter().zip([&all[..shown], &all[all.len() - shown..]]) {
                let crops = part.iter().filter_map(|(score, (field, place))| cut(field, *place, side, *score));
                sheets.push(Sheet { of, title, crops: crops.collect() });
            }
        }
    }
    sheets
}

/// Cuts a square around a place, shifted into the field if it crosses the border.
fn cut(field: &Field, [x, y]: [f64; 2], side: usize, score: f64) -> Option<Crop> {
    if field.thumbnail.is_empty() {
        return None;
    }
    let (wide, high) = (side.min(field.width), side.min(field.height));
    let left = whole(x - wide as f64 / 2.0 + 0.5).min(field.width - wide);
    let top = whole(y - high as f64 / 2.0 + 0.5).min(field.height - high);
    let rows = field.thumbnail.chunks_exact(field.width).skip(top).take(high);
    let grey = rows.flat_map(|row| row[left..left + wide].iter().copied()).collect();
    Some(Crop { field: field.name.clone(), score, grey, width: wide })
}

//! Learning of classes, and comparison of synthetic with real fields.

use papsynth::learn::{Donors, LearnParams, Material, NucleusImage};
use papsynth_judge::{
    FeatureSet, Field, FieldImage, Judge, JudgeParams, Measurer, MeasurerParams, NucleiAnnotation, NucleiFrom,
};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::array::{ArrayLike, channels, nth, pixels, pixels_within, points};
use crate::engine::read_model;
use crate::error::wrong;
use crate::pool;

/// Returns the model of `papsynth.learn` as JSON.
#[pyfunction]
#[pyo3(signature = (name, pixel_um, *, nuclei=None, nucleus_outlines=None, cytoplasm_outlines=None, like=None, bethesda="", source="", numbers_only=false, model=None))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn learn(
    py: Python<'_>,
    name: &str,
    pixel_um: f64,
    nuclei: Option<Vec<(ArrayLike<'_>, ArrayLike<'_>)>>,
    nucleus_outlines: Option<Vec<ArrayLike<'_>>>,
    cytoplasm_outlines: Option<Vec<ArrayLike<'_>>>,
    like: Option<String>,
    bethesda: &str,
    source: &str,
    numbers_only: bool,
    model: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let base = read_model(py, model)?;
    let nuclei: Vec<NucleusImage> = nuclei
        .unwrap_or_default()
        .iter()
        .enumerate()
        .map(|(number, (image, mask))| nucleus(number, image, mask))
        .collect::<PyResult<_>>()?;
    let nucleus_outlines = outlines("nucleus_outlines", nucleus_outlines)?;
    let cytoplasm_outlines = outlines("cytoplasm_outlines", cytoplasm_outlines)?;
    if nuclei.is_empty() && nucleus_outlines.is_empty() && cytoplasm_outlines.is_empty() {
        let message = "nuclei, nucleus_outlines, cytoplasm_outlines: expected at least one of these";
        return Err(wrong(message));
    }
    let material =
        Material { nuclei: &nuclei, nucleus_outlines: &nucleus_outlines, cytoplasm_outlines: &cytoplasm_outlines };
    let params = LearnParams {
        class: name.to_owned(),
        like: like.unwrap_or_else(|| name.to_owned()),
        bethesda: bethesda.to_owned(),
        pixel_um,
        source: source.to_owned(),
        donors: if numbers_only { Donors::NumbersOnly } else { Donors::Keep },
    };
    let learned = py.detach(|| papsynth::learn::learn(&base, &material, &params));
    Ok(learned.map_err(wrong)?.to_json())
}

fn nucleus(number: usize, image: &ArrayLike<'_>, mask: &ArrayLike<'_>) -> PyResult<NucleusImage> {
    let name = nth("nuclei", number);
    let (light, width) = pixels(&format!("{name}[0]"), image)?;
    let (mask, mask_width) = pixels_within(&format!("{name}[1]"), mask, [0.0, 1.0])?;
    if (light.len(), width) != (mask.len(), mask_width) {
        let [image, mask] = [(&light, width), (&mask, mask_width)].map(|(values, width)| (values.len() / width, width));
        return Err(wrong(format!(
            "{name}: the image has the shape {image:?} and the mask {mask:?}; expected equal shapes"
        )));
    }
    let mask = mask.into_iter().map(|inside| if inside > 0.5 { 1.0 } else { 0.0 }).collect();
    Ok(NucleusImage { name, light, mask, width })
}

fn outlines(name: &str, outlines: Option<Vec<ArrayLike<'_>>>) -> PyResult<Vec<Vec<[f64; 2]>>> {
    let outlines = outlines.unwrap_or_default();
    let one = |(number, outline): (usize, &ArrayLike<'_>)| {
        let name = nth(name, number);
        let outline = points(&name, outline)?;
        match outline.len() {
            0..3 => Err(wrong(format!("{name}: expected 3 or more points, found {}", outline.len()))),
            _ => Ok(outline),
        }
    };
    outlines.iter().enumerate().map(one).collect()
}

/// Returns the report of `papsynth.judge` as JSON.
#[pyfunction]
#[pyo3(signature = (real, synthetic, pixel_um, full_scale, *, real_nuclei=None, synthetic_nuclei=None, seed=0, quick=false, features="2", threads=0))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn judge(
    py: Python<'_>,
    real: Vec<ArrayLike<'_>>,
    synthetic: Vec<ArrayLike<'_>>,
    pixel_um: f64,
    full_scale: f32,
    real_nuclei: Option<Vec<ArrayLike<'_>>>,
    synthetic_nuclei: Option<Vec<ArrayLike<'_>>>,
    seed: u64,
    quick: bool,
    features: &str,
    threads: usize,
) -> PyResult<String> {
    let nuclei_from = match (&real_nuclei, &synthetic_nuclei) {
        (Some(_), Some(_)) => NucleiFrom::Points,
        (None, None) => NucleiFrom::Search,
        _ => return Err(wrong("real_nuclei, synthetic_nuclei: expected both or neither")),
    };
    let sides = [
        field_images("real", &real, real_nuclei.as_deref(), full_scale)?,
        field_images("synthetic", &synthetic, synthetic_nuclei.as_deref(), full_scale)?,
    ];
    let measurer =
        Measurer::new(&MeasurerParams { pixel_um, nuclei_from, ..MeasurerParams::default() }).map_err(wrong)?;
    let params = if quick { JudgeParams::quick() } else { JudgeParams::default() };
    let features = FeatureSet::ALL.into_iter().find(|set| set.name() == features);
    let features = features.ok_or_else(|| wrong("features: expected '1' or '2'"))?;
    let judge = Judge::new(&JudgeParams { seed, features, ..params }).map_err(wrong)?;
    let pool = pool::of(py, threads)?;
    let report = py.detach(|| {
        pool.install(|| {
            let measured = sides.map(|images| {
                let fields: Vec<Result<Field, String>> = images
                    .par_iter()
                    .map(|image| measurer.measure(image).map_err(|error| format!("{}: {error}", image.name)))
                    .collect();
                fields.into_iter().collect::<Result<Vec<Field>, String>>()
            });
            let [real, synthetic] = measured;
            judge.compare(&real?, &synthetic?).map_err(|error| error.to_string())
        })
    });
    serde_json::to_string(&report.map_err(wrong)?).map_err(wrong)
}

pub(crate) fn field_images(
    side: &str,
    images: &[ArrayLike<'_>],
    nuclei: Option<&[ArrayLike<'_>]>,
    full_scale: f32,
) -> PyResult<Vec<FieldImage>> {
    if images.len() < 2 {
        return Err(wrong(format!("{side}: expected 2 or more fields, found {}", images.len())));
    }
    if nuclei.is_some_and(|nuclei| nuclei.len() != images.len()) {
        return Err(wrong(format!("{side}_nuclei: expected one entry per field, {}", images.len())));
    }
    let one = |(number, image): (usize, &ArrayLike<'_>)| {
        let (grey, red_blue, width) = channels(&nth(side, number), image)?;
        let nuclei = match nuclei {
            None => NucleiAnnotation::None,
            Some(nuclei) => NucleiAnnotation::Points(points(&nth(&format!("{side}_nuclei"), number), &nuclei[number])?),
        };
        Ok(FieldImage {
            name: format!("{side}[{number}]"),
            group: String::new(),
            grey,
            red_blue,
            width,
            full_scale,
            nuclei,
        })
    };
    images.iter().enumerate().map(one).collect()
}

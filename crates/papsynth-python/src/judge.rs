//! How much synthetic fields are like real ones.

use papsynth_judge::{Field, Gauge, GaugeParams, Judge, JudgeParams, Known, NucleiFrom, Picture};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::array::{Given, nth, pixels, points};
use crate::error::wrong;
use crate::pool;

/// The report of `papsynth.judge`, as JSON.
///
/// Parameters
/// ----------
/// real, synthetic : list of array_like
///     Fields, each (height, width).
/// pixel_um : float
/// full_scale : float
/// real_nuclei, synthetic_nuclei : list of array_like, optional
///     Middles of the nuclei of each field, (n, 2): x and y in pixels.
/// seed : int
/// quick : bool
/// threads : int
#[pyfunction]
#[pyo3(signature = (real, synthetic, pixel_um, full_scale, *, real_nuclei=None, synthetic_nuclei=None, seed=0, quick=false, threads=0))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn judge(
    py: Python<'_>,
    real: Vec<Given<'_>>,
    synthetic: Vec<Given<'_>>,
    pixel_um: f64,
    full_scale: f32,
    real_nuclei: Option<Vec<Given<'_>>>,
    synthetic_nuclei: Option<Vec<Given<'_>>>,
    seed: u64,
    quick: bool,
    threads: usize,
) -> PyResult<String> {
    let nuclei_from = match (&real_nuclei, &synthetic_nuclei) {
        (Some(_), Some(_)) => NucleiFrom::Points,
        (None, None) => NucleiFrom::Search,
        _ => return Err(wrong("real_nuclei, synthetic_nuclei: both or neither must be given")),
    };
    let sides = [
        pictures("real", &real, real_nuclei.as_deref(), full_scale)?,
        pictures("synthetic", &synthetic, synthetic_nuclei.as_deref(), full_scale)?,
    ];
    let gauge = Gauge::new(&GaugeParams { pixel_um, nuclei_from, ..GaugeParams::default() }).map_err(wrong)?;
    let params = if quick { JudgeParams::quick() } else { JudgeParams::default() };
    let judge = Judge::new(&JudgeParams { seed, ..params }).map_err(wrong)?;
    let pool = pool::of(py, threads)?;
    let report = py.detach(|| {
        pool.install(|| {
            let measured = sides.map(|pictures| {
                let fields: Vec<Result<Field, String>> = pictures
                    .par_iter()
                    .map(|picture| gauge.measure(picture).map_err(|error| format!("{}: {error}", picture.name)))
                    .collect();
                fields.into_iter().collect::<Result<Vec<Field>, String>>()
            });
            let [real, synthetic] = measured;
            judge.compare(&real?, &synthetic?).map_err(|error| error.to_string())
        })
    });
    serde_json::to_string(&report.map_err(wrong)?).map_err(wrong)
}

fn pictures(side: &str, images: &[Given<'_>], nuclei: Option<&[Given<'_>]>, full_scale: f32) -> PyResult<Vec<Picture>> {
    if images.len() < 2 {
        return Err(wrong(format!("{side}: {} fields; expected 2 or more", images.len())));
    }
    if nuclei.is_some_and(|nuclei| nuclei.len() != images.len()) {
        return Err(wrong(format!("{side}_nuclei: must be as many as {side}, {}", images.len())));
    }
    let one = |(number, image): (usize, &Given<'_>)| {
        let (grey, width) = pixels(&nth(side, number), image)?;
        let nuclei = match nuclei {
            None => Known::Nothing,
            Some(nuclei) => Known::Points(points(&nth(&format!("{side}_nuclei"), number), &nuclei[number])?),
        };
        Ok(Picture { name: format!("{side}[{number}]"), group: String::new(), grey, width, full_scale, nuclei })
    };
    images.iter().enumerate().map(one).collect()
}

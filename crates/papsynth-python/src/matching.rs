//! The recipe of real fields.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use papsynth::{Engine, Inputs};
use papsynth_judge::Control;
use papsynth_match::{Match, MatchParams, PixelSize};
use pyo3::prelude::*;

use crate::array::ArrayLike;
use crate::engine::{Source, read_model};
use crate::error::wrong;
use crate::learn::field_images;
use crate::pool;

/// Interval between checks for Ctrl-C.
const CHECKED: Duration = Duration::from_millis(100);

/// Returns the recipe of `papsynth.match` as TOML with comments, the recipe as plain TOML, and the report as JSON.
#[pyfunction]
#[pyo3(signature = (real, pixel_um, full_scale, *, recipe=None, nuclei=None, find_pixel=false, simulations=None, refine=0, quick=false, seed=0, model=None, threads=0))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
pub(crate) fn match_fields(
    py: Python<'_>,
    real: Vec<ArrayLike<'_>>,
    pixel_um: f64,
    full_scale: f32,
    recipe: Option<&Bound<'_, PyAny>>,
    nuclei: Option<Vec<ArrayLike<'_>>>,
    find_pixel: bool,
    simulations: Option<usize>,
    refine: usize,
    quick: bool,
    seed: u64,
    model: Option<&Bound<'_, PyAny>>,
    threads: usize,
) -> PyResult<(String, String, String)> {
    let fields = field_images("real", &real, nuclei.as_deref(), full_scale)?;
    let base = Source::read(py, recipe)?;
    let problems = base.recipe.problems();
    if !problems.is_empty() {
        return Err(crate::error::engine(py, &base.name, &papsynth::Error::Recipe(problems)));
    }
    let model = read_model(py, model)?;
    let default = if quick { MatchParams::quick() } else { MatchParams::default() };
    let pixel = if find_pixel { PixelSize::Sought(pixel_um) } else { PixelSize::Known(pixel_um) };
    let simulations = simulations.unwrap_or(default.simulations);
    let params = MatchParams { pixel, simulations, refine, seed, ..default };
    let matching = Match::new(&params, &base.recipe).map_err(wrong)?;
    let make = |recipe: &papsynth::recipe::Recipe| Engine::new(recipe, &model, &Inputs::default());
    let pool = pool::of(py, threads)?;
    let stop = AtomicBool::new(false);
    let (result, signal) = thread::scope(|scope| {
        let work = || {
            let control = Control { stop: &stop, report: &|_| () };
            pool.install(|| matching.run(&fields, &make, &control))
        };
        let worker = scope.spawn(work);
        let mut signal = Ok(());
        while !worker.is_finished() {
            py.detach(|| thread::sleep(CHECKED));
            if signal.is_ok() {
                signal = py.check_signals();
                stop.store(signal.is_err(), Ordering::Relaxed);
            }
        }
        (worker.join(), signal)
    });
    signal?;
    let fit = result.map_err(|_| wrong("the match ended unexpectedly"))?.map_err(wrong)?;
    let report = serde_json::to_string(&fit).map_err(wrong)?;
    Ok((fit.to_toml(), fit.recipe.to_toml(), report))
}

//! Matches recipes to simulated fields with known parameters, and counts how often the intervals contain the true
//! values.
//!
//! `cargo run --release -p papsynth-match --example recover -- [TRIALS] [FIELDS] [SEED]`
//!
//! Each trial draws the mean of each parameter from its range, and the values of fields around it. The truth is the
//! mean over the fields.

#![expect(clippy::print_stdout, reason = "a program prints")]

use std::error::Error;

use papsynth::key::Key;
use papsynth::model::Model;
use papsynth::recipe::{Preset, Recipe};
use papsynth::{Engine, Inputs};
use papsynth_judge::{Control, Detail, FieldImage, NucleiFrom};
use papsynth_match::{Match, MatchParams, Origin, PARAMETERS, Sampler, Setting, Values, recipe};
use portable_numerics::random::{normal, uniform};
use portable_numerics::statistics::quantile;
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

const PIXEL_UM: f64 = 0.33;
const SIZE_PX: [usize; 2] = [640, 480];

/// Largest standard deviation between fields, positions in the range.
const MOST_APART: f64 = 0.15;

fn engine(recipe: &Recipe) -> Result<Engine, papsynth::Error> {
    Engine::new(recipe, &Model::builtin(), &Inputs::default())
}

/// Fields with known parameters, and the mean of each parameter over the fields, as positions in the ranges.
fn trial(fields: usize, seed: u64) -> Result<(Vec<FieldImage>, Vec<f64>), Box<dyn Error>> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let setting = Setting {
        base: Preset::Lbc.recipe(),
        size_px: SIZE_PX,
        pixel_um: PIXEL_UM,
        bits: 8,
        extended: true,
        seek_pixel: false,
    };
    let sampler = Sampler::new(SIZE_PX, PIXEL_UM, NucleiFrom::Search, Detail::Statistics)?;
    let middle: Vec<[f64; 2]> = PARAMETERS
        .iter()
        .map(|p| {
            let apart = if setting.varies(*p) { MOST_APART * uniform(&mut rng) } else { 0.0 };
            [0.05 + 0.9 * uniform(&mut rng), apart]
        })
        .collect();
    let places: Vec<[f64; PARAMETERS.len()]> = (0..fields)
        .map(|_| std::array::from_fn(|i| (middle[i][0] + middle[i][1] * normal(&mut rng)).clamp(0.0, 1.0)))
        .collect();
    let image = |index: usize| -> Result<FieldImage, papsynth_match::Error> {
        let engine = engine(&recipe(&setting, &Values::at(&places[index]), |_| true))?;
        sampler.simulate(&engine, None, Key { seed, index: index as u64 }, &Control::NONE)
    };
    let images: Vec<_> = (0..fields).into_par_iter().map(image).collect();
    let images = images.into_iter().collect::<Result<_, _>>()?;
    let means = (0..PARAMETERS.len()).map(|i| places.iter().map(|p| p[i]).sum::<f64>() / fields as f64).collect();
    Ok((images, means))
}

fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Vec<u64> = std::env::args().skip(1).map(|word| word.parse()).collect::<Result<_, _>>()?;
    let get = |i: usize, usual: u64| numbers.get(i).copied().unwrap_or(usual);
    let (trials, fields, seed) = (get(0, 20), usize::try_from(get(1, 8))?, get(2, 20_261_124));
    // For each parameter: widths, errors, and the number of intervals that contain the truth.
    let mut found: Vec<(Vec<f64>, Vec<f64>, usize)> = vec![(Vec::new(), Vec::new(), 0); PARAMETERS.len()];
    let mut done = 0;
    for number in 0..trials {
        let (images, truth) = match trial(fields, seed + number) {
            Ok(made) => made,
            Err(error) => {
                println!("trial {number} was left out: {error}");
                continue;
            }
        };
        let params = MatchParams { seed: number, ..MatchParams::default() };
        let fit = match Match::new(&params, &Preset::Lbc.recipe())?.run(&images, &engine, &Control::NONE) {
            Ok(fit) => fit,
            Err(error) => {
                println!("trial {number} was left out: {error}");
                continue;
            }
        };
        done += 1;
        for answer in fit.parameters.iter().filter(|answer| answer.origin != Origin::NotVisible) {
            let prior = answer.parameter.prior();
            let [value, low, high] = [answer.value, answer.interval[0], answer.interval[1]].map(|v| prior.place(v));
            let truth = truth[answer.parameter.index()];
            let (widths, errors, held) = &mut found[answer.parameter.index()];
            widths.push(high - low);
            errors.push((value - truth).abs());
            *held += usize::from((low - 1e-9..=high + 1e-9).contains(&truth));
        }
        let held: usize = found.iter().map(|(.., held)| held).sum();
        let all: usize = found.iter().map(|(widths, ..)| widths.len()).sum();
        println!("trial {number}: {held} of {all} intervals so far contain the truth");
    }
    println!(
        "\nparameter | method | given of {done} | contain the truth | median width | median error\n---|---|---|---|---|---"
    );
    for (parameter, (widths, errors, held)) in PARAMETERS.iter().zip(&mut found) {
        let (given, source) = (widths.len(), parameter.prior().source);
        let [width, error] = [widths, errors].map(|values| quantile(values, 0.5));
        println!("{} | {source:?} | {given} | {held} | {width:.2} | {error:.3}", parameter.name());
    }
    Ok(())
}

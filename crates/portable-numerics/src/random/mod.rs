//! Random numbers: scalar draws from any generator, and SplitMix64 for values that are a function of a key.
//!
//! Three samplers of standard normal numbers serve three needs:
//!
//! | sampler | numbers | takes | for |
//! |---|---|---|---|
//! | [`normal`], [`Normals`] | `f64`, any size | a generator | scalar draws |
//! | [`Ziggurat`] | `f32`, any size | a generator | white noise: many draws in order, nearly all without a logarithm |
//! | [`normals_of_words`] | `f32`, up to 6.76 | two words for each pair | rows of pixels; vectorises |

mod draws;
mod splitmix;
mod ziggurat;

pub use draws::{
    Normals, below, between, chance, direction, normal, normals_of_words, open_uniform, open_unit, shuffle, uniform,
    unit,
};
pub use rand_core::Rng;
pub use splitmix::SplitMix64;
pub use ziggurat::Ziggurat;

/// Asserts that raw moments are within four standard errors of those of the standard normal distribution.
#[cfg(test)]
fn assert_normal(values: &[f64]) {
    let n = values.len() as f64;
    // Mean and variance of x^p of a standard normal.
    for (p, mean, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)] {
        let moment = values.iter().map(|&x| (0..p).fold(1.0, |m, _| m * x)).sum::<f64>() / n;
        let z = (moment - mean) / (variance / n).sqrt();
        assert!(z.abs() < 4.0, "moment {p}: {z} standard errors");
    }
}

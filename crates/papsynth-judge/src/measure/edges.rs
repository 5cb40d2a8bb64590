//! How sharp edges are.

use super::maps::Maps;

/// Edges are at least so steep, absorbance a pixel after a Gaussian of 1 pixel.
const STEEP: f32 = 0.02;

/// Fewer places on edges tell nothing of their width.
pub(crate) const LEAST: usize = 20;

/// A place on an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    pub(crate) pixel: usize,
    /// Standard deviation of the Gaussian that blurred it, pixels.
    pub(crate) sigma: f64,
}

/// Every place where the slope is steep, and steeper than on both sides of it.
pub(crate) fn edges(maps: &Maps) -> Vec<Edge> {
    let [across, down] = maps.gradient();
    let mut edges = Vec::new();
    for y in 1..maps.height - 1 {
        for x in 1..maps.width - 1 {
            let pixel = y * maps.width + x;
            let slope = maps.slope[pixel];
            if slope < STEEP {
                continue;
            }
            let (gx, gy) = (across[pixel], down[pixel]);
            // One of four directions: tan 22.5° = 0.414.
            let beside = if gy.abs() < 0.414 * gx.abs() {
                1
            } else if gx.abs() < 0.414 * gy.abs() {
                maps.width
            } else if gx * gy > 0.0 {
                maps.width + 1
            } else {
                maps.width - 1
            };
            if slope >= maps.slope[pixel - beside] && slope > maps.slope[pixel + beside] {
                let sigma = sigma(f64::from(slope), f64::from(maps.wide_slope[pixel]));
                edges.extend(sigma.map(|sigma| Edge { pixel, sigma }));
            }
        }
    }
    edges
}

/// Differences between neighbours on both sides blur an edge too, by this variance.
const DIFFERENCE: f64 = 1.0 / 3.0;

/// The blur s of an edge from its slopes after Gaussians of 1 and 2 pixels, which are as 1/√(s² + 1 + ⅓) to 1/√(s² + 4 + ⅓). None
/// where the slope falls faster or slower than that of any edge: there is something thin, or a gentle ramp.
fn sigma(slope: f64, wide_slope: f64) -> Option<f64> {
    let ratio = slope / wide_slope.max(1e-9);
    let square = ratio * ratio;
    (square > 1.0 && square < 4.0).then(|| ((4.0 - square) / (square - 1.0) - DIFFERENCE).max(0.0).sqrt())
}

//! How sharp edges are.

use crate::filter::gradient;

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

/// Every place where the slope is steep, and steeper than on both sides of it: of an image after a Gaussian of 1 pixel, with the
/// lengths of its gradient and of that after a Gaussian of 2 pixels.
pub(crate) fn edges(smooth: &[f32], width: usize, slope: &[f32], wide_slope: &[f32]) -> Vec<Edge> {
    let [across, down] = gradient(smooth, width);
    let mut edges = Vec::new();
    for y in 1..smooth.len() / width - 1 {
        for x in 1..width - 1 {
            let pixel = y * width + x;
            let steepness = slope[pixel];
            if steepness < STEEP {
                continue;
            }
            let (gx, gy) = (across[pixel], down[pixel]);
            // One of four directions: tan 22.5° = 0.414.
            let beside = if gy.abs() < 0.414 * gx.abs() {
                1
            } else if gx.abs() < 0.414 * gy.abs() {
                width
            } else if gx * gy > 0.0 {
                width + 1
            } else {
                width - 1
            };
            if steepness >= slope[pixel - beside] && steepness > slope[pixel + beside] {
                let sigma = sigma(f64::from(steepness), f64::from(wide_slope[pixel]));
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

#[cfg(test)]
mod tests {
    use crate::measure::maps::Maps;
    use crate::picture::Picture;

    #[test]
    fn the_blur_of_an_edge_is_found_whatever_its_direction() {
        let (width, height) = (120, 100);
        for (sigma, turn) in [(0.8, 0.0), (1.0, 0.3), (1.5, 0.8), (2.0, 1.2), (3.0, 2.5)] {
            let (sin, cos) = (libm::sin(turn), libm::cos(turn));
            let at = |i: usize| {
                let d = ((i % width) as f64 - 60.0) * cos + ((i / width) as f64 - 50.0) * sin;
                let a = 0.2 * (1.0 + libm::erf(d / (sigma * std::f64::consts::SQRT_2)));
                crate::number::single(240.0 * libm::pow(10.0, -a))
            };
            let grey = (0..width * height).map(at).collect();
            let maps = Maps::new(&Picture { grey, width, ..Picture::default() });
            let mut sigmas: Vec<f64> = maps.edges.iter().map(|e| e.sigma).collect();
            assert!(sigmas.len() > 80, "{} places", sigmas.len());
            let found = crate::statistics::median(&mut sigmas);
            assert!((found - sigma).abs() < 0.06 * sigma + 0.03, "{found}, not {sigma}, turned by {turn}");
        }
    }
}

//! Dark bodies of the size of leukocytes, which are no nuclei of cells.

use crate::noise::blur;

/// Standard deviation of the narrower Gaussian, µm: the difference of Gaussians is largest for bodies of the size of
/// leukocytes.
const SCALE_UM: f64 = 2.2;

/// Ratio of the two Gaussians.
const RATIO: f64 = 1.6;

/// Minimum contrast of a body, absorbance after the difference of Gaussians. A leukocyte of absorbance 0.45 on an empty
/// slide has 0.09.
const DARKNESS: [f32; 2] = [0.03, 0.06];

/// Minimum distance from the centre of a nucleus, µm.
const FROM_NUCLEI_UM: f64 = 7.0;

/// Maximum distance to another body of a clump, µm.
const CLUMP_UM: f64 = 13.0;

/// Offset of logarithms, per mm².
const OFFSET: f64 = 8.0;

/// Minimum light, relative to the empty slide.
const LEAST_LIGHT: f32 = 0.004;

/// Returns logarithms of the number of dark bodies per mm², and the logarithm of the number of those that are near
/// another one. `empty` is the level of the empty slide, `nuclei` are the centres of nuclei in pixels.
pub(crate) fn bodies(
    grey: &[f32],
    width: usize,
    empty: f32,
    nuclei: &[[f64; 2]],
    pixel_um: f64,
) -> [(&'static str, f64); 3] {
    let absorbance: Vec<f32> = grey.iter().map(|g| -libm::log10f((g / empty).max(LEAST_LIGHT))).collect();
    let [fine, coarse] = [1.0, RATIO].map(|ratio| blur(&absorbance, width, ratio * SCALE_UM / pixel_um));
    let band: Vec<f32> = fine.iter().zip(&coarse).map(|(a, b)| a - b).collect();
    let near = |a: [f64; 2], b: [f64; 2], um: f64| libm::hypot(a[0] - b[0], a[1] - b[1]) * pixel_um < um;
    let height = grey.len() / width;
    let mut found: Vec<([f64; 2], f32)> = Vec::new();
    for y in 1..height.saturating_sub(1) {
        for x in 1..width - 1 {
            let (p, at) = (y * width + x, [x as f64, y as f64]);
            let own = band[p];
            if own < DARKNESS[0] {
                continue;
            }
            let before = [p - width - 1, p - width, p - width + 1, p - 1];
            let after = [p + 1, p + width - 1, p + width, p + width + 1];
            let highest = before.iter().all(|q| band[*q] < own) && after.iter().all(|q| band[*q] <= own);
            if highest && !nuclei.iter().any(|nucleus| near(at, *nucleus, FROM_NUCLEI_UM)) {
                found.push((at, own));
            }
        }
    }
    let mm2 = grey.len() as f64 * pixel_um * pixel_um * 1e-6;
    let log = |count: usize| libm::log(count as f64 / mm2 + OFFSET);
    let above = |level: f32| found.iter().filter(|(_, dark)| *dark >= level).count();
    let clumped = |i: usize| found.iter().enumerate().any(|(j, b)| j != i && near(found[i].0, b.0, CLUMP_UM));
    [
        ("log dark bodies", log(above(DARKNESS[0]))),
        ("log darkest bodies", log(above(DARKNESS[1]))),
        ("log bodies in clumps", log((0..found.len()).filter(|i| clumped(*i)).count())),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_are_counted_except_nuclei() {
        const PIXEL_UM: f64 = 0.33;
        let (width, height) = (400, 300);
        let bodies_at = [[60.0, 60.0], [85.0, 60.0], [200.0, 200.0], [320.0, 80.0]];
        let grey: Vec<f32> = (0..width * height)
            .map(|i| {
                let at = [(i % width) as f64, (i / width) as f64];
                let inside = bodies_at.iter().any(|b| libm::hypot(at[0] - b[0], at[1] - b[1]) * PIXEL_UM < 3.5);
                if inside { 240.0 * libm::powf(10.0, -0.45) } else { 240.0 }
            })
            .collect();
        let mm2 = 120_000.0 * PIXEL_UM * PIXEL_UM * 1e-6;
        let count = |value: f64| (libm::exp(value) - OFFSET) * mm2;
        let found = bodies(&grey, width, 240.0, &[], PIXEL_UM).map(|(_, value)| count(value));
        for (found, expected) in found.iter().zip([4.0, 4.0, 2.0]) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        let found = bodies(&grey, width, 240.0, &[[201.0, 199.0]], PIXEL_UM).map(|(_, value)| count(value));
        assert!((found[0] - 3.0).abs() < 1e-6, "{found:?}");
    }
}

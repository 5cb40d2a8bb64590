//! Counts of dark objects: small ones, and bodies of the size of leukocytes that are no nuclei of cells.

use crate::noise::blur;

/// Ratio of the two Gaussians of a band.
const RATIO: f64 = 1.6;

/// Minimum light, relative to the empty slide.
const LEAST_LIGHT: f32 = 0.004;

/// Scales of small objects, pixels.
const SCALES: [f64; 3] = [1.0, 2.0, 4.0];

/// Minimum contrast of small objects after a difference of Gaussians, absorbance.
const SMALL_DARKNESS: [f32; 3] = [0.006, 0.02, 0.06];

/// Maximum absorbance of empty surroundings, after a wide Gaussian.
const EMPTY_AROUND: f32 = 0.025;

/// Standard deviation of the Gaussian of the surroundings, pixels.
const AROUND_PX: f64 = 10.0;

/// Minimum ratio of the curvatures of an elongated object.
const LONG: f32 = 2.5;

/// Standard deviation of the narrower Gaussian of bodies, µm: the difference of Gaussians is largest for bodies of the
/// size of leukocytes.
const SCALE_UM: f64 = 2.2;

/// Minimum contrast of a body, absorbance after the difference of Gaussians. A leukocyte of absorbance 0.45 on an empty
/// slide has 0.09.
const BODY_DARKNESS: [f32; 2] = [0.03, 0.06];

/// Minimum distance from the centre of a nucleus, µm.
const FROM_NUCLEI_UM: f64 = 7.0;

/// Maximum distance to another body of a clump, µm.
const CLUMP_UM: f64 = 13.0;

/// Offset of logarithms, per mm².
const OFFSET: f64 = 8.0;

/// Returns logarithms of the number of dark bodies per mm², and the logarithm of the number of those that are near
/// another one. `empty` is the level of the empty slide, `nuclei` are the centres of nuclei in pixels.
pub(crate) fn bodies(
    grey: &[f32],
    width: usize,
    empty: f32,
    nuclei: &[[f64; 2]],
    pixel_um: f64,
) -> [(&'static str, f64); 3] {
    let band = band(&absorbance(grey, empty), width, SCALE_UM / pixel_um);
    let near = |a: [f64; 2], b: [f64; 2], um: f64| libm::hypot(a[0] - b[0], a[1] - b[1]) * pixel_um < um;
    let found: Vec<([f64; 2], f32)> = maxima(&band, width, BODY_DARKNESS[0])
        .map(|p| ([(p % width) as f64, (p / width) as f64], band[p]))
        .filter(|(at, _)| !nuclei.iter().any(|nucleus| near(*at, *nucleus, FROM_NUCLEI_UM)))
        .collect();
    let mm2 = grey.len() as f64 * pixel_um * pixel_um * 1e-6;
    let log = |count: usize| libm::log(count as f64 / mm2 + OFFSET);
    let above = |level: f32| found.iter().filter(|(_, dark)| *dark >= level).count();
    let clumped = |i: usize| found.iter().enumerate().any(|(j, b)| j != i && near(found[i].0, b.0, CLUMP_UM));
    [
        ("log dark bodies", log(above(BODY_DARKNESS[0]))),
        ("log darkest bodies", log(above(BODY_DARKNESS[1]))),
        ("log bodies in clumps", log((0..found.len()).filter(|i| clumped(*i)).count())),
    ]
}

/// Returns logarithms of the number of small objects per 1000 pixels, and the fraction of elongated ones; `empty` is
/// the level of the empty slide.
pub(crate) fn counts(grey: &[f32], width: usize, empty: f32) -> Vec<(String, f64)> {
    let absorbance = absorbance(grey, empty);
    let around = blur(&absorbance, width, AROUND_PX);
    let mut out = Vec::new();
    for scale in SCALES {
        let band = band(&absorbance, width, scale);
        let mut found = [[0_u32; SMALL_DARKNESS.len()]; 2];
        let mut long = [0_u32; 2];
        for p in maxima(&band, width, SMALL_DARKNESS[0]) {
            let place = usize::from(around[p] > EMPTY_AROUND);
            for (count, level) in found[place].iter_mut().zip(SMALL_DARKNESS) {
                *count += u32::from(band[p] >= level);
            }
            long[place] += u32::from(is_long(&band, p, width));
        }
        let thousands = grey.len() as f64 / 1000.0;
        for ((found, long), place) in found.into_iter().zip(long).zip(["on empty slide", "on cells"]) {
            out.extend(found.into_iter().zip(SMALL_DARKNESS).map(|(count, level)| {
                let name = format!("objects of {scale} px above {level} {place}");
                (name, libm::log(f64::from(count) / thousands + 0.01))
            }));
            let fraction = if found[0] >= 5 { f64::from(long) / f64::from(found[0]) } else { f64::NAN };
            out.push((format!("elongated objects of {scale} px {place}"), fraction));
        }
    }
    out
}

/// Returns whether a maximum is elongated.
fn is_long(band: &[f32], p: usize, width: usize) -> bool {
    let at = |q: usize| band[q];
    let xx = 2.0 * at(p) - at(p - 1) - at(p + 1);
    let yy = 2.0 * at(p) - at(p - width) - at(p + width);
    let xy = 0.25 * (at(p + width - 1) + at(p - width + 1) - at(p + width + 1) - at(p - width - 1));
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let root = (half * half + xy * xy).sqrt();
    mean + root > LONG * (mean - root).max(0.0)
}

/// Returns the absorbance of each pixel.
fn absorbance(grey: &[f32], empty: f32) -> Vec<f32> {
    grey.iter().map(|g| -libm::log10f((g / empty).max(LEAST_LIGHT))).collect()
}

/// Returns the difference of two Gaussians; `sigma` is the standard deviation of the narrower one, pixels.
fn band(image: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    let [fine, coarse] = [1.0, RATIO].map(|ratio| blur(image, width, ratio * sigma));
    fine.iter().zip(&coarse).map(|(a, b)| a - b).collect()
}

/// Iterates over the local maxima of at least `least` in rows; the first of several equal neighbours counts.
fn maxima(band: &[f32], width: usize, least: f32) -> impl Iterator<Item = usize> {
    let height = band.len() / width;
    (1..height.saturating_sub(1)).flat_map(move |y| (1..width - 1).map(move |x| y * width + x)).filter(move |&p| {
        let own = band[p];
        let before = [p - width - 1, p - width, p - width + 1, p - 1];
        let after = [p + 1, p + width - 1, p + width, p + width + 1];
        own >= least && before.iter().all(|q| band[*q] < own) && after.iter().all(|q| band[*q] <= own)
    })
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

    #[test]
    fn dots_and_rods_are_counted_separately() {
        let width = 100;
        let mut grey = vec![200.0; width * width];
        for k in 0..5 {
            grey[(10 + 18 * k) * width + 20] = 60.0;
            for x in 60..70 {
                grey[(10 + 18 * k) * width + x] = 100.0;
            }
        }
        let found = counts(&grey, width, 200.0);
        assert_eq!(found.len(), 24);
        let things = (libm::exp(found[0].1) - 0.01) * 10.0;
        assert!((9.5..20.5).contains(&things), "{things}");
        assert!((0.2..0.8).contains(&found[3].1), "{:?}", found[3]);
    }
}

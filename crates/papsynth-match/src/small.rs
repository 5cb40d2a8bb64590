//! Small things: how many there are of each size and darkness, on empty slide and on cells, and how long they are.

use crate::number::single;

/// Scales at which they are sought, pixels.
const SCALES: [f64; 3] = [1.0, 2.0, 4.0];

/// Least darkness over the surroundings after a difference of Gaussians, absorbance.
const LEVELS: [f32; 3] = [0.006, 0.02, 0.06];

/// What lies around is empty slide if it is paler, absorbance after a wide Gaussian.
const EMPTY: f32 = 0.025;

/// Width of that Gaussian, pixels.
const AROUND_PX: f64 = 10.0;

/// A thing is long if its curvature across is so many times that along.
const LONG: f32 = 2.5;

/// Least light, a part of that of the empty slide.
const LEAST_LIGHT: f32 = 0.004;

/// Counts of local maxima a thousand pixels, by scale, level and place, then the share of long ones by scale and place.
pub(crate) const COUNT: usize = SCALES.len() * LEVELS.len() * 2 + SCALES.len() * 2;

/// Names of what [`counts`] gives.
pub(crate) fn names() -> Vec<String> {
    let places = ["on empty slide", "on cells"];
    let mut names = Vec::with_capacity(COUNT);
    for scale in SCALES {
        for place in places {
            names.extend(LEVELS.map(|level| format!("things of {scale} px above {level} {place}")));
            names.push(format!("long ones of {scale} px {place}"));
        }
    }
    names
}

/// Of grey levels, with the level of the empty slide.
pub(crate) fn counts(grey: &[f32], width: usize, empty: f32) -> Vec<f64> {
    let height = grey.len() / width;
    let absorbance: Vec<f32> = grey.iter().map(|g| -libm::log10f((g / empty).max(LEAST_LIGHT))).collect();
    let around = blur(&absorbance, width, AROUND_PX);
    let mut out = Vec::with_capacity(COUNT);
    for scale in SCALES {
        let fine = blur(&absorbance, width, scale);
        let coarse = blur(&absorbance, width, 1.6 * scale);
        let band: Vec<f32> = fine.iter().zip(&coarse).map(|(a, b)| a - b).collect();
        let mut found = [[0_u32; LEVELS.len()]; 2];
        let mut long = [0_u32; 2];
        for y in 1..height.saturating_sub(1) {
            for x in 1..width - 1 {
                let p = y * width + x;
                let own = band[p];
                if own < LEVELS[0] {
                    continue;
                }
                let before = [p - width - 1, p - width, p - width + 1, p - 1];
                let after = [p + 1, p + width - 1, p + width, p + width + 1];
                if before.iter().any(|q| band[*q] >= own) || after.iter().any(|q| band[*q] > own) {
                    continue;
                }
                let place = usize::from(around[p] > EMPTY);
                for (count, level) in found[place].iter_mut().zip(LEVELS) {
                    *count += u32::from(own >= level);
                }
                long[place] += u32::from(is_long(&band, p, width));
            }
        }
        let thousands = grey.len() as f64 / 1000.0;
        for place in 0..2 {
            out.extend(found[place].map(|count| libm::log(f64::from(count) / thousands + 0.01)));
            out.push(if found[place][0] >= 5 { f64::from(long[place]) / f64::from(found[place][0]) } else { f64::NAN });
        }
    }
    out
}

/// Whether a maximum is a ridge.
fn is_long(band: &[f32], p: usize, width: usize) -> bool {
    let at = |q: usize| band[q];
    let xx = 2.0 * at(p) - at(p - 1) - at(p + 1);
    let yy = 2.0 * at(p) - at(p - width) - at(p + width);
    let xy = 0.25 * (at(p + width - 1) + at(p - width + 1) - at(p + width + 1) - at(p - width - 1));
    let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let root = (half * half + xy * xy).sqrt();
    mean + root > LONG * (mean - root).max(0.0)
}

/// A Gaussian, mirrored at the border.
pub(crate) fn blur(image: &[f32], width: usize, sigma: f64) -> Vec<f32> {
    let reach = crate::number::whole(3.0 * sigma) + 1;
    let mut kernel: Vec<f32> =
        (0..=reach).map(|i| single(libm::exp(-0.5 * (i * i) as f64 / (sigma * sigma)))).collect();
    let sum = kernel[0] + 2.0 * kernel[1..].iter().sum::<f32>();
    kernel.iter_mut().for_each(|k| *k /= sum);
    let height = image.len() / width;
    let mirrored = |i: isize, count: usize| {
        let i = i.unsigned_abs();
        (if i >= count { (2 * count - 2).saturating_sub(i) } else { i }).min(count - 1)
    };
    let mut rows = vec![0.0; image.len()];
    let mut line = vec![0.0; width + 2 * reach];
    for (row, out) in image.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        for (i, value) in line.iter_mut().enumerate() {
            *value = row[mirrored(i as isize - reach as isize, width)];
        }
        for (value, source) in out.iter_mut().zip(&line[reach..]) {
            *value = kernel[0] * source;
        }
        for (i, k) in kernel.iter().enumerate().skip(1) {
            for ((value, a), b) in out.iter_mut().zip(&line[reach - i..]).zip(&line[reach + i..]) {
                *value += k * (a + b);
            }
        }
    }
    let mut out = vec![0.0; image.len()];
    for (y, row) in out.chunks_exact_mut(width).enumerate() {
        for (i, k) in kernel.iter().enumerate() {
            let [above, below] = [y as isize - i as isize, (y + i) as isize].map(|y| mirrored(y, height) * width);
            let weight = if i == 0 { 0.5 * k } else { *k };
            for ((value, a), b) in row.iter_mut().zip(&rows[above..above + width]).zip(&rows[below..below + width]) {
                *value += weight * (a + b);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blur_keeps_light_and_spreads_a_point_as_wide_as_asked() {
        let width = 41;
        let mut image = vec![0.0; width * width];
        image[20 * width + 20] = 1.0;
        let out = blur(&image, width, 2.0);
        let sum: f32 = out.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
        let off = |i: usize| (i % width) as f64 - 20.0;
        let variance: f64 = out.iter().enumerate().map(|(i, v)| f64::from(*v) * off(i) * off(i)).sum();
        assert!((variance - 4.0).abs() < 0.1, "{variance}");
        assert!(blur(&vec![3.0; 400], 20, 10.0).iter().all(|v| (v - 3.0).abs() < 1e-5));
    }

    #[test]
    fn dots_and_rods_are_counted_apart() {
        let width = 100;
        let mut grey = vec![200.0; width * width];
        for k in 0..5 {
            grey[(10 + 18 * k) * width + 20] = 60.0;
            for x in 60..70 {
                grey[(10 + 18 * k) * width + x] = 100.0;
            }
        }
        let found = counts(&grey, width, 200.0);
        assert_eq!(found.len(), COUNT);
        assert_eq!(names().len(), COUNT);
        let things = (libm::exp(found[0]) - 0.01) * 10.0;
        assert!((9.5..20.5).contains(&things), "{things}");
        assert!((0.2..0.8).contains(&found[3]), "{}", found[3]);
    }
}

//! Segmentation of nuclei.

use crate::filter::blur;
use crate::image::NucleiAnnotation;
use crate::number::whole;
use crate::region::{Region, components, flood};
use crate::tree::{Blob, STEP, blobs};

/// Parameters of the segmentation of nuclei. The defaults are not from the paper.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NucleiParams {
    /// Minimum area, µm². Default 15.
    pub smallest_um2: f64,
    /// Maximum area, µm². Default 400.
    pub largest_um2: f64,
    /// Minimum area over that of the ellipse of the same second moments, 0 to 1. Default 0.92.
    pub least_ellipse: f64,
    /// Minimum area over that of the convex hull, 0 to 1. Default 0.86.
    pub least_solidity: f64,
    /// Minimum difference of absorbance between a nucleus and its surroundings, above 0. Default 0.10.
    pub least_contrast: f64,
    /// Minimum gradient of absorbance at the border, 1/µm. Default 0.05.
    pub least_steepness: f64,
}

impl Default for NucleiParams {
    fn default() -> Self {
        Self {
            smallest_um2: 15.0,
            largest_um2: 400.0,
            least_ellipse: 0.92,
            least_solidity: 0.86,
            least_contrast: 0.10,
            least_steepness: 0.05,
        }
    }
}

/// Blur before thresholding, µm: enough against pixel noise, and less than the width of a border.
const SMOOTH_UM: f64 = 0.3;

/// Lowest threshold, absorbance: nuclei are darker, and empty slide is excluded.
const LIGHTEST: f32 = 0.10;

/// Maximum distance between an annotated point and the centre of its nucleus, µm.
const MARK_UM: f64 = 4.0;

/// Inner and outer distance of the surroundings from the border of a nucleus, µm.
const AROUND_UM: [f64; 2] = [0.8, 2.5];

/// Returns the nuclei of an image, ordered by their first pixels. They do not overlap.
pub(crate) fn nuclei(
    absorbance: &[f32],
    width: usize,
    pixel_um: f64,
    annotation: &NucleiAnnotation,
    params: &NucleiParams,
) -> Vec<Region> {
    let mut regions = match annotation {
        NucleiAnnotation::Masks(labels) => masks(labels, width),
        NucleiAnnotation::None => found(absorbance, width, pixel_um, None, params),
        NucleiAnnotation::Points(points) => found(absorbance, width, pixel_um, Some(points), params),
    };
    regions.retain(|r| r.pixels.len() as f64 * pixel_um * pixel_um >= params.smallest_um2);
    regions.sort_by_key(|r| r.pixels.iter().min().copied());
    regions
}

/// Returns the largest connected component of each label.
fn masks(labels: &[u32], width: usize) -> Vec<Region> {
    let mut largest = std::collections::BTreeMap::<u32, Region>::new();
    for region in components(labels, width) {
        let kept = largest.entry(labels[region.pixels[0] as usize]).or_default();
        if kept.pixels.len() < region.pixels.len() {
            *kept = region;
        }
    }
    largest.into_values().collect()
}

fn found(
    absorbance: &[f32],
    width: usize,
    pixel_um: f64,
    points: Option<&[[f64; 2]]>,
    params: &NucleiParams,
) -> Vec<Region> {
    let smooth = blur(absorbance, width, (SMOOTH_UM / pixel_um).max(0.5));
    let px2 = pixel_um * pixel_um;
    let (smallest, largest) = (params.smallest_um2 / px2, params.largest_um2 / px2);
    let all = blobs(&smooth, width, LIGHTEST, largest * 1.5);
    // An annotated nucleus exists even if it is faint, so the criteria are less strict.
    let leniency = if points.is_some() { 0.5 } else { 1.0 };
    let score = |b: &Blob| b.steepness * b.ellipse * b.ellipse * b.ellipse * b.ellipse;
    let mut candidates: Vec<usize> = (0..all.len())
        .filter(|&i| {
            let b = &all[i];
            b.area >= smallest
                && b.area <= largest
                && b.ellipse >= 1.0 - (1.0 - params.least_ellipse) / leniency
                && b.steepness >= leniency * params.least_steepness * pixel_um
                && b.sum / b.area - f64::from(b.level) * f64::from(STEP) >= leniency * 0.25 * params.least_contrast
        })
        .collect();
    candidates.sort_by(|&a, &b| score(&all[b]).total_cmp(&score(&all[a])).then(a.cmp(&b)));
    let mut marked: Vec<bool> = points.map(|p| vec![false; p.len()]).unwrap_or_default();
    let mut taken = vec![false; absorbance.len()];
    let mut around = vec![false; all.len()];
    let mut regions = Vec::new();
    let mut seen = vec![false; absorbance.len()];
    for &i in &candidates {
        let blob = &all[i];
        if around[i] || taken[blob.pixel as usize] {
            continue;
        }
        let mark = points.and_then(|points| nearest_mark(points, &marked, blob, pixel_um));
        if points.is_some() && mark.is_none() {
            continue;
        }
        let threshold = f32::from(blob.level) * STEP;
        let region = flood(blob.pixel as usize, width, &mut seen, |p| smooth[p] >= threshold);
        region.pixels.iter().for_each(|p| seen[*p as usize] = false);
        let region = region.filled();
        let good = region.pixels.iter().all(|p| !taken[*p as usize])
            && region.pixels.len() as f64 <= largest
            && region.shape().solidity >= 1.0 - (1.0 - params.least_solidity) / leniency
            && contrast(&smooth, &region, pixel_um) >= leniency * params.least_contrast;
        if !good {
            continue;
        }
        if let Some(mark) = mark {
            marked[mark] = true;
        }
        region.pixels.iter().for_each(|p| taken[*p as usize] = true);
        let outer = std::iter::successors(blob.parent, |o| all[*o as usize].parent);
        outer.for_each(|o| around[o as usize] = true);
        regions.push(region);
    }
    regions
}

/// Returns the nearest annotated point to a blob that has no nucleus yet and is not too far.
fn nearest_mark(points: &[[f64; 2]], marked: &[bool], blob: &Blob, pixel_um: f64) -> Option<usize> {
    let reach = (MARK_UM / pixel_um).max(0.7 * (blob.area / std::f64::consts::PI).sqrt());
    let far = |i: usize| crate::region::distance(points[i], blob.centre);
    let near = (0..points.len()).filter(|&i| !marked[i] && far(i) <= reach);
    near.min_by(|&a, &b| far(a).total_cmp(&far(b)))
}

/// Returns the mean absorbance of a region minus the median of its surroundings.
fn contrast(absorbance: &[f32], region: &Region, pixel_um: f64) -> f64 {
    let inner =
        region.pixels.iter().map(|p| f64::from(absorbance[*p as usize])).sum::<f64>() / region.pixels.len() as f64;
    let [from, to] = AROUND_UM.map(|um| um / pixel_um);
    let tile = region.tile(whole(to) + 1);
    let around = tile.heights().into_iter().enumerate().filter(|(_, d)| f64::from(*d) > from && f64::from(*d) <= to);
    let mut outer: Vec<f64> = around.filter_map(|(i, _)| tile.place(i)).map(|p| f64::from(absorbance[p])).collect();
    if outer.is_empty() { 0.0 } else { inner - crate::statistics::median(&mut outer) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::region::distance;

    const PIXEL_UM: f64 = 0.33;

    /// Discs of a radius and absorbance on a pale background, with a blur of 1.2 pixels.
    fn image(discs: &[([f64; 2], f64, f64)]) -> Vec<f32> {
        let at = |i: usize| {
            let rim = |(centre, radius, a): &([f64; 2], f64, f64)| {
                let inside = radius - distance([(i % 200) as f64, (i / 200) as f64], *centre);
                0.5 * a * (1.0 + libm::erf(inside / 1.7))
            };
            crate::number::single(0.12 + discs.iter().map(rim).sum::<f64>())
        };
        (0..200 * 150).map(at).collect()
    }

    fn areas(image: &[f32], known: &NucleiAnnotation) -> Vec<usize> {
        nuclei(image, 200, PIXEL_UM, known, &NucleiParams::default()).iter().map(|r| r.pixels.len()).collect()
    }

    #[test]
    fn the_border_of_a_disc_is_at_half_its_absorbance() {
        for radius in [8.0, 12.0, 20.0] {
            let image = image(&[([80.2, 70.7], radius, 0.3)]);
            let found = nuclei(&image, 200, PIXEL_UM, &NucleiAnnotation::None, &NucleiParams::default());
            assert_eq!(found.len(), 1);
            let shape = found[0].shape();
            let wanted = std::f64::consts::PI * radius * radius;
            assert!((shape.area - wanted).abs() < 0.06 * wanted, "{} {wanted}", shape.area);
            assert!(distance(shape.centre, [80.2, 70.7]) < 0.2);
        }
    }

    #[test]
    fn small_large_faint_and_long_objects_are_not_nuclei() {
        assert_eq!(areas(&image(&[([80.0, 70.0], 5.0, 0.3)]), &NucleiAnnotation::None), [0; 0]);
        assert_eq!(areas(&image(&[([80.0, 70.0], 40.0, 0.3)]), &NucleiAnnotation::None), [0; 0]);
        assert_eq!(areas(&image(&[([80.0, 70.0], 10.0, 0.06)]), &NucleiAnnotation::None), [0; 0]);
        let chain: Vec<([f64; 2], f64, f64)> =
            (0..12).map(|i| ([40.0 + 9.0 * f64::from(i), 60.0 + 20.0 * f64::from(i % 2)], 9.0, 0.1)).collect();
        assert!(areas(&image(&chain), &NucleiAnnotation::None).is_empty());
    }

    #[test]
    fn points_select_nuclei_and_masks_are_used_unchanged() {
        let image = image(&[([50.0, 70.0], 10.0, 0.3), ([120.0, 70.0], 12.0, 0.4), ([170.0, 70.0], 10.0, 0.07)]);
        assert_eq!(areas(&image, &NucleiAnnotation::None).len(), 2);
        assert_eq!(areas(&image, &NucleiAnnotation::Points(vec![[121.0, 72.0], [10.0, 10.0]])).len(), 1);
        // Annotated nuclei may be fainter.
        assert_eq!(areas(&image, &NucleiAnnotation::Points(vec![[170.0, 70.0]])).len(), 1);
        let mut labels = vec![0; image.len()];
        for y in 20..40 {
            labels[y * 200 + 20..y * 200 + 50].fill(7);
            labels[y * 200 + 60..y * 200 + 65].fill(7);
        }
        assert_eq!(areas(&image, &NucleiAnnotation::Masks(labels)), [600]);
    }

    #[test]
    fn adjacent_nuclei_are_separated() {
        let image = image(&[([60.0, 70.0], 10.0, 0.3), ([84.0, 70.0], 10.0, 0.35)]);
        assert_eq!(areas(&image, &NucleiAnnotation::None).len(), 2);
    }
}

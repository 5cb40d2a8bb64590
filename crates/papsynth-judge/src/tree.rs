//! The component tree of absorbance: dark blobs at all thresholds.

use crate::number::{id, nearest, whole};
use crate::region::{Sums, neighbours};

/// Step between thresholds, absorbance: one grey level of 8 bits at level 110.
pub(crate) const STEP: f32 = 0.01;

/// A connected region darker than a threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blob {
    /// Threshold, in steps.
    pub(crate) level: u16,
    /// One of the darkest pixels.
    pub(crate) pixel: u32,
    /// Number of pixels.
    pub(crate) area: f64,
    /// Sum of absorbance.
    pub(crate) sum: f64,
    /// Centre.
    pub(crate) centre: [f64; 2],
    /// Area over that of the ellipse of the same second moments: 1 for an ellipse, less for other shapes.
    pub(crate) ellipse: f64,
    /// Gradient of absorbance at the border, 1/px, from the growth of the area with the threshold.
    pub(crate) steepness: f64,
    /// Enclosing blob at the next lower threshold that has one.
    pub(crate) parent: Option<u32>,
    /// Largest enclosed blob at the next higher threshold.
    largest: Option<u32>,
}

/// Thresholds below and above that of a blob over which its growth is measured.
const AROUND: u16 = 3;

const NONE: u32 = u32::MAX;

/// A connected region during construction.
#[derive(Default)]
struct Root {
    sums: Sums,
    /// Sum of absorbance.
    sum: f64,
    pixel: u32,
    /// Blobs without an enclosing blob.
    waiting: Vec<u32>,
    touched: u16,
}

/// Returns the threshold level of a pixel.
fn level(absorbance: f32, most: u16) -> u16 {
    u16::try_from(whole(f64::from(absorbance / STEP))).unwrap_or(u16::MAX).min(most)
}

/// Returns all blobs of at most `largest` pixels that are darker than `lightest`, the darkest first.
pub(crate) fn blobs(absorbance: &[f32], width: usize, lightest: f32, largest: f64) -> Vec<Blob> {
    const MOST: u16 = 250;
    let least = u16::try_from(nearest(f64::from(lightest / STEP))).unwrap_or(0).max(1);
    let mut by_level: Vec<Vec<u32>> = vec![Vec::new(); usize::from(MOST) + 1];
    for (i, a) in absorbance.iter().enumerate() {
        let level = level(*a, MOST);
        if level >= least {
            by_level[usize::from(level)].push(id(i));
        }
    }
    let mut slot = vec![NONE; absorbance.len()];
    let mut roots: Vec<Root> = Vec::new();
    let mut parents: Vec<u32> = Vec::new();
    let mut blobs: Vec<Blob> = Vec::new();
    let mut touched: Vec<u32> = Vec::new();
    for level in (least..=MOST).rev() {
        touched.clear();
        for &pixel in &by_level[usize::from(level)] {
            let p = pixel as usize;
            let mut joined = None;
            for q in neighbours(p, width, absorbance.len()).filter(|q| slot[*q] != NONE) {
                let root = find(&mut parents, slot[q]);
                joined = match joined {
                    Some(own) if own != root => Some(join(&mut parents, &mut roots, own, root)),
                    _ => Some(root),
                };
            }
            let own = joined.unwrap_or_else(|| {
                roots.push(Root { pixel, ..Root::default() });
                parents.push(id(parents.len()));
                id(parents.len() - 1)
            });
            slot[p] = own;
            let root = &mut roots[own as usize];
            root.sums.add(p % width, p / width);
            root.sum += f64::from(absorbance[p]);
            if root.touched != level {
                root.touched = level;
                touched.push(own);
            }
        }
        for &candidate in &touched {
            let root = &mut roots[find(&mut parents, candidate) as usize];
            // One of the joined candidates creates their common blob.
            if std::mem::take(&mut root.touched) == 0 {
                continue;
            }
            if root.sums.area() > largest {
                root.waiting.clear();
                continue;
            }
            let blob = id(blobs.len());
            let mut main: Option<u32> = None;
            for part in root.waiting.drain(..) {
                blobs[part as usize].parent = Some(blob);
                if main.is_none_or(|m| blobs[m as usize].area < blobs[part as usize].area) {
                    main = Some(part);
                }
            }
            root.waiting.push(blob);
            blobs.push(Blob {
                level,
                pixel: root.pixel,
                area: root.sums.area(),
                sum: root.sum,
                centre: root.sums.centre(),
                ellipse: ellipse(&root.sums),
                steepness: 0.0,
                parent: None,
                largest: main,
            });
        }
    }
    for i in 0..blobs.len() {
        blobs[i].steepness = steepness(&blobs, i);
    }
    blobs
}

fn find(parents: &mut [u32], mut i: u32) -> u32 {
    while parents[i as usize] != i {
        parents[i as usize] = parents[parents[i as usize] as usize];
        i = parents[i as usize];
    }
    i
}

fn join(parents: &mut [u32], roots: &mut [Root], a: u32, b: u32) -> u32 {
    let (into, from) = if roots[a as usize].sums.area() >= roots[b as usize].sums.area() { (a, b) } else { (b, a) };
    parents[from as usize] = into;
    let other = std::mem::take(&mut roots[from as usize]);
    let root = &mut roots[into as usize];
    root.sums.join(&other.sums);
    root.sum += other.sum;
    root.touched = root.touched.max(other.touched);
    root.waiting.extend(other.waiting);
    into
}

/// Returns the area over that of the ellipse of the same second moments.
fn ellipse(sums: &Sums) -> f64 {
    let [xx, xy, yy] = sums.second();
    sums.area() / (4.0 * std::f64::consts::PI * (xx * yy - xy * xy).max(1e-3).sqrt())
}

/// Returns the gradient at the border. With a gradient g and a perimeter P, lowering the threshold by dA adds P dA/g
/// pixels.
fn steepness(blobs: &[Blob], i: usize) -> f64 {
    let blob = &blobs[i];
    let mut outer = blob;
    let mut fallen = 0;
    while let Some(parent) = outer.parent.map(|p| &blobs[p as usize]) {
        if blob.level - parent.level > AROUND {
            break;
        }
        outer = parent;
        fallen = blob.level - parent.level;
    }
    // A blob without an enclosing blob becomes too large at the next threshold: it has no border.
    if outer.parent.is_none() && fallen < AROUND {
        return 0.0;
    }
    // The largest enclosed blob at the raised threshold, if there is one.
    let mut inner = Some(blob);
    while let Some(part) = inner.filter(|part| part.level - blob.level < AROUND) {
        inner = part.largest.map(|p| &blobs[p as usize]);
    }
    let inner = inner.map_or(0.0, |part| part.area);
    let perimeter = 2.0 * (std::f64::consts::PI * blob.area).sqrt();
    let steps = f64::from(2 * AROUND) * f64::from(STEP);
    perimeter * steps / (outer.area - inner).max(1.0)
}

#[cfg(test)]
mod tests {
    use rand_core::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::region::flood;

    #[test]
    fn blobs_equal_the_connected_regions_at_their_thresholds() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
        let width = 31;
        let noise: Vec<f32> =
            (0..width * 24).map(|_| f32::from(u8::try_from(rng.next_u64() >> 56).unwrap()) / 255.0).collect();
        let image = crate::filter::blur(&noise, width, 1.2);
        let blobs = blobs(&image, width, 0.3, 200.0);
        assert!(blobs.len() > 100);
        for blob in &blobs {
            let mut seen = vec![false; image.len()];
            let region = flood(blob.pixel as usize, width, &mut seen, |p| super::level(image[p], 250) >= blob.level);
            let shape = region.shape();
            assert_eq!(shape.area, blob.area);
            assert!((shape.centre[0] - blob.centre[0]).abs() + (shape.centre[1] - blob.centre[1]).abs() < 1e-9);
            let sum: f64 = region.pixels.iter().map(|p| f64::from(image[*p as usize])).sum();
            assert!((sum - blob.sum).abs() < 1e-9);
            if let Some(parent) = blob.parent.map(|p| &blobs[p as usize]) {
                assert!(parent.level < blob.level && parent.area > blob.area);
                let mut seen = vec![false; image.len()];
                let around =
                    flood(parent.pixel as usize, width, &mut seen, |p| super::level(image[p], 250) >= parent.level);
                assert!(around.pixels.contains(&blob.pixel));
            }
        }
    }

    #[test]
    fn the_steepness_of_a_cone_is_its_slope() {
        // A radial ramp of 0.02 a pixel from 0.1 outside to 0.6 in the centre.
        let width = 90;
        let ramp = |i: usize| {
            let (x, y) = ((i % width) as f64 - 45.0, (i / width) as f64 - 45.0);
            crate::number::single((0.9 - 0.02 * (x * x + y * y).sqrt()).clamp(0.1, 0.6))
        };
        let image: Vec<f32> = (0..width * width).map(ramp).collect();
        let blobs = blobs(&image, width, 0.12, 5000.0);
        let middle = blobs.iter().find(|b| b.level == 40).unwrap();
        assert!((middle.steepness - 0.02).abs() < 0.001, "{middle:?}");
        assert!((middle.ellipse - 1.0).abs() < 0.01, "{middle:?}");
    }
}

//! Tests of outlines: tracing, resampling, self-intersections.

use crate::support;
use std::f64::consts::{PI, TAU};

use fsd_shape::{
    Error, Point, Rng, centroid, circularity, perimeter, resample, resample_along, self_intersects, signed_area, trace,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

fn regular(corners: usize, radius: f64) -> Vec<Point> {
    (0..corners)
        .map(|k| {
            let (sin, cos) = libm::sincos(TAU * k as f64 / corners as f64);
            [radius * cos, radius * sin]
        })
        .collect()
}

/// Returns a disc with a ramp of four pixels, 0.5 at the edge.
fn disc(width: usize, height: usize, centre: Point, radius: f64) -> Vec<f32> {
    (0..width * height)
        .map(|i| {
            let (dx, dy) = ((i % width) as f64 - centre[0], (i / width) as f64 - centre[1]);
            #[expect(clippy::cast_possible_truncation, reason = "a mask is f32")]
            let value = ((radius - (dx * dx + dy * dy).sqrt()) / 4.0 + 0.5).clamp(0.0, 1.0) as f32;
            value
        })
        .collect()
}

#[test]
fn a_disc_is_traced_to_a_fraction_of_a_pixel() {
    let centre = [20.3, 17.8];
    let outline = trace(&disc(43, 39, centre, 12.0), 43, 0.5).unwrap();
    for p in &outline {
        let r = ((p[0] - centre[0]) * (p[0] - centre[0]) + (p[1] - centre[1]) * (p[1] - centre[1])).sqrt();
        assert!((r - 12.0).abs() < 0.03, "{r}");
    }
    assert!((signed_area(&outline) - PI * 144.0).abs() < 1.0);
    let c = centroid(&outline);
    assert!((c[0] - centre[0]).abs() < 0.01 && (c[1] - centre[1]).abs() < 0.01);
    assert!(circularity(&outline) > 0.99);
    assert!(!self_intersects(&outline));
}

#[test]
fn tracing_handles_the_smallest_masks_and_the_border() {
    let diamond = trace(&[1.0], 1, 0.5).unwrap();
    assert_eq!(diamond, [[-0.5, 0.0], [0.0, -0.5], [0.5, 0.0], [0.0, 0.5]]);
    assert_eq!(signed_area(&trace(&[1.0; 12], 4, 0.5).unwrap()), 11.5);
    // A value equal to the level is outside; its crossings coincide at its centre.
    let edge = trace(&[0.5, 1.0, 0.5], 3, 0.5).unwrap();
    assert_eq!(edge, [[0.0, 0.0], [1.0, -0.5], [2.0, 0.0], [1.0, 0.5]]);
    // A higher level gives a smaller outline.
    assert_eq!(signed_area(&trace(&[1.0], 1, 0.75).unwrap()), 0.125);
}

#[test]
fn holes_are_ignored_and_diagonal_pixels_are_connected() {
    let mut ring = vec![1.0; 49];
    ring[24] = 0.0;
    assert_eq!(trace(&ring, 7, 0.5).unwrap(), trace(&[1.0; 49], 7, 0.5).unwrap());
    let diagonal = [1.0, 0.0, 0.0, 1.0];
    let outline = trace(&diagonal, 2, 0.5).unwrap();
    assert_eq!(outline.len(), 8);
    assert!(!self_intersects(&outline));
    // The mean at the corner is below the level.
    assert_eq!(trace(&diagonal, 2, 0.6), Err(Error::SeveralComponents { count: 2 }));
}

#[test]
fn masks_without_a_single_outline_are_rejected() {
    assert_eq!(trace(&[0.0; 12], 4, 0.5), Err(Error::EmptyMask { level: 0.5 }));
    assert_eq!(trace(&[], 4, 0.5), Err(Error::EmptyMask { level: 0.5 }));
    assert_eq!(trace(&[1.0, 0.0, 1.0, 0.0, 1.0], 5, 0.5), Err(Error::SeveralComponents { count: 3 }));
    // An island in a hole counts.
    let mut island = vec![1.0; 49];
    for y in 2..5 {
        island[y * 7 + 2..y * 7 + 5].fill(0.0);
    }
    island[24] = 1.0;
    assert_eq!(trace(&island, 7, 0.5), Err(Error::SeveralComponents { count: 2 }));
    assert_eq!(trace(&[1.0; 5], 2, 0.5), Err(Error::MaskSize { len: 5, width: 2 }));
    assert_eq!(trace(&[1.0; 5], 0, 0.5), Err(Error::MaskSize { len: 5, width: 0 }));
    assert!(matches!(trace(&[1.0, f32::NAN], 2, 0.5), Err(Error::MaskValue { x: 1, y: 0, .. })));
    assert!(matches!(trace(&[f32::INFINITY], 1, 0.5), Err(Error::MaskValue { .. })));
    for level in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(trace(&[1.0], 1, level), Err(Error::Parameter { field: "level", .. })));
    }
}

/// Returns the number of 8-connected components, by flood fill.
fn flood_count(mask: &[f32], width: usize) -> usize {
    let height = mask.len() / width;
    let mut seen = vec![false; mask.len()];
    let mut count = 0;
    for start in 0..mask.len() {
        let mut stack = vec![start];
        count += usize::from(mask[start] > 0.5 && !seen[start]);
        while let Some(i) = stack.pop() {
            if mask[i] <= 0.5 || seen[i] {
                continue;
            }
            seen[i] = true;
            let (x, y) = (i % width, i / width);
            for v in y.saturating_sub(1)..(y + 2).min(height) {
                stack.extend((x.saturating_sub(1)..(x + 2).min(width)).map(|u| v * width + u));
            }
        }
    }
    count
}

#[test]
fn components_agree_with_a_flood_fill() {
    let mut rng = rng(0xF100D);
    for round in 0..400 {
        let width = 3 + (round % 7);
        let mask: Vec<f32> = (0..width * 6).map(|_| if rng.next_u32() % 100 < 45 { 1.0 } else { 0.0 }).collect();
        let counted = match trace(&mask, width, 0.5) {
            Ok(outline) => {
                assert!(signed_area(&outline) > 0.0);
                assert!(!self_intersects(&outline));
                1
            }
            Err(Error::SeveralComponents { count }) => count,
            Err(Error::EmptyMask { .. }) => 0,
            Err(other) => panic!("{other}"),
        };
        assert_eq!(counted, flood_count(&mask, width));
    }
}

#[test]
fn an_image_buffer_can_be_traced() {
    let buffer = image::ImageBuffer::<image::Luma<f32>, Vec<f32>>::from_vec(9, 9, disc(9, 9, [4.0, 4.0], 2.0)).unwrap();
    assert!(trace(&buffer, 9, 0.5).is_ok());
}

#[test]
fn measures_of_a_square_are_exact() {
    let square = [[1.0, 2.0], [4.0, 2.0], [4.0, 5.0], [1.0, 5.0]];
    assert_eq!(signed_area(&square), 9.0);
    assert_eq!(perimeter(&square), 12.0);
    assert_eq!(centroid(&square), [2.5, 3.5]);
    assert!((circularity(&square) - PI / 4.0).abs() < 1e-15);
    assert_eq!((signed_area(&[]), perimeter(&[]), circularity(&[]), centroid(&[])), (0.0, 0.0, 0.0, [0.0, 0.0]));
    assert_eq!(centroid(&[[0.0, 0.0], [2.0, 0.0]]), [1.0, 0.0]);
    assert!(circularity(&regular(1000, 3.0)) > 0.999_99);
}

fn spread(points: &[Point]) -> f64 {
    let chords: Vec<f64> = (0..points.len())
        .map(|k| {
            let (p, q) = (points[k], points[(k + 1) % points.len()]);
            perimeter(&[p, q]) / 2.0
        })
        .collect();
    let (mean, sd) = support::mean_and_sd(&chords);
    sd / mean
}

#[test]
fn resampled_points_are_equidistant() {
    let mut rng = rng(0x5E9);
    for count in [64, 420, 512] {
        for _ in 0..40 {
            let outline = support::polygon(100.0, &support::CELL, &mut rng);
            let points = resample(&outline, count);
            assert_eq!(points.len(), count);
            assert_eq!(points[0], outline[0]);
            assert!(spread(&points) < 1e-3, "{count}: {}", spread(&points));
            assert!((signed_area(&points) / signed_area(&outline) - 1.0).abs() < 0.02);
        }
    }
}

#[test]
fn points_along_an_outline_have_equal_arc_lengths() {
    let mut rng = rng(0x5EA);
    for count in [180, 600] {
        let outline = support::polygon(100.0, &support::CELL, &mut rng);
        let points = resample_along(&outline, count);
        assert_eq!((points.len(), points[0]), (count, outline[0]));
        let step = perimeter(&outline) / count as f64;
        let chord = |i: usize| {
            let (p, q) = (points[i], points[(i + 1) % count]);
            ((q[0] - p[0]) * (q[0] - p[0]) + (q[1] - p[1]) * (q[1] - p[1])).sqrt()
        };
        // A chord is as long as the arc, or shorter at a corner.
        assert!((0..count).all(|i| chord(i) <= step * (1.0 + 1e-9)));
        assert!((signed_area(&points) / signed_area(&outline) - 1.0).abs() < 0.02);
    }
}

#[test]
fn resampling_accepts_any_outline() {
    assert!(resample(&[], 5).is_empty());
    assert!(resample_along(&[], 5).is_empty());
    assert_eq!(resample_along(&[[2.0, 3.0]], 3), [[2.0, 3.0]; 3]);
    assert!(resample_along(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0).is_empty());
    assert!(resample(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0).is_empty());
    assert_eq!(resample(&[[2.0, 3.0]], 3), [[2.0, 3.0]; 3]);
    let doubled = [[0.0, 0.0], [0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [2.0, 2.0], [0.0, 2.0]];
    assert_eq!(resample(&doubled, 4), [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
    // A spike narrower than the spacing cannot have equal chords: the best approximation is returned.
    let needle = [[0.0, 0.0], [10.0, 0.0], [10.0, 30.0], [10.1, 0.0], [20.0, 0.0], [20.0, 10.0], [0.0, 10.0]];
    assert_eq!(resample(&needle, 12).len(), 12);
}

/// Compares every pair of edges, by orientation.
fn brute(points: &[Point]) -> bool {
    let n = points.len();
    let side = |a: Point, b: Point, c: Point| {
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).partial_cmp(&0.0).unwrap() as i32
    };
    (0..n).any(|i| {
        (i + 2..n).filter(|j| (j + 1) % n != i).any(|j| {
            let (a, b, c, d) = (points[i], points[(i + 1) % n], points[j], points[(j + 1) % n]);
            side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0
        })
    })
}

#[test]
fn self_intersections_agree_with_brute_force() {
    let mut rng = rng(0xC2055);
    let mut crossing = 0;
    for round in 0..2000 {
        let n = 4 + round % 60;
        let wild = if round % 3 == 0 { 1.0 } else { 1.6 / n as f64 };
        let points: Vec<Point> = regular(n, 1.0)
            .iter()
            .map(|p| [p[0] + wild * support::jitter(&mut rng), p[1] + wild * support::jitter(&mut rng)])
            .collect();
        let expected = brute(&points);
        crossing += usize::from(expected);
        assert_eq!(self_intersects(&points), expected, "{points:?}");
    }
    assert!((500..1500).contains(&crossing), "{crossing}");
}

#[test]
fn touching_counts_as_intersecting() {
    // A vertex on another edge, a repeated edge, a spike, too few points, a NaN.
    assert!(self_intersects(&[[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 0.0], [0.0, 4.0]]));
    assert!(self_intersects(&[[0.0, 0.0], [2.0, 0.0], [4.0, 0.0], [4.0, 1.0], [3.0, 0.0], [1.0, 0.0], [0.0, 3.0]]));
    assert!(self_intersects(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [1.0, 2.0]]));
    assert!(self_intersects(&[[0.0, 0.0], [1.0, 0.0]]));
    assert!(self_intersects(&[[0.0, 0.0], [1.0, f64::NAN], [1.0, 1.0]]));
    // Repeated and collinear points do not count.
    assert!(!self_intersects(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 0.0]]));
}

#[test]
fn self_intersections_of_flat_and_irregular_outlines() {
    let sliver: Vec<Point> = (0..1000).map(|k| [f64::from(k), 0.0]).chain([[500.0, 1e-9]]).collect();
    assert!(!self_intersects(&sliver));
    // Every turn about the centre has the same direction, but there are two rounds.
    let star = |turns: f64| {
        let angle = |k: u32| core::f64::consts::TAU * turns * f64::from(k) / 21.0;
        (0..21).map(|k| [90.0 + libm::cos(angle(k)), libm::sin(angle(k)) - 70.0]).collect::<Vec<Point>>()
    };
    assert_eq!([1.0, -1.0, 2.0, -2.0].map(|turns| self_intersects(&star(turns))), [false, false, true, true]);
    // Two long edges and a thousand short ones.
    let mut comet = regular(1000, 1e-3);
    comet[0] = [1e3, 0.0];
    assert!(!self_intersects(&comet));
}

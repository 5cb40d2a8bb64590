use super::*;
use crate::path::PathEnd;

fn path(points: &[Point]) -> DescentPath {
    let count = points.len() as f64;
    DescentPath {
        points: points.to_vec(),
        heights: (0..points.len()).map(|i| 1.0 - i as f64 / (count - 1.0)).collect(),
        end: PathEnd::Border,
    }
}

/// Draws on an image of the value `base`.
fn drawn(paths: &[DescentPath], params: &LineParams, base: f32) -> Vec<f32> {
    let mut image = vec![base; 60 * 50];
    draw_into(&mut image, 60, paths, params).unwrap();
    image
}

/// Reference implementation: every pixel against every segment.
fn oracle(paths: &[DescentPath], params: &LineParams) -> Vec<f32> {
    let pixel = |i: usize| {
        let (x, y) = ((i % 60) as f64, (i / 60) as f64);
        let mut value = 0.0f64;
        for path in paths {
            for k in 1..path.points.len() {
                let (a, b) = (path.points[k - 1], path.points[k]);
                let d = [b[0] - a[0], b[1] - a[1]];
                let square = d[0] * d[0] + d[1] * d[1];
                let t = (((x - a[0]) * d[0] + (y - a[1]) * d[1]) / square).clamp(0.0, 1.0);
                let (ex, ey) = (x - a[0] - t * d[0], y - a[1] - t * d[1]);
                let distance = (ex * ex + ey * ey).sqrt();
                let height = path.heights[k - 1] + t * (path.heights[k] - path.heights[k - 1]);
                let half = params.width_px / 2.0 * (1.0 - params.taper * (1.0 - height));
                value = value.max(match params.profile {
                    Profile::Flat => ((distance + 0.5).min(half) - (distance - 0.5).max(-half)).max(0.0),
                    Profile::Smooth => {
                        let radius = half * REACH;
                        let drawn = radius.max(NARROWEST);
                        let rest = (1.0 - distance * distance / (drawn * drawn)).max(0.0);
                        radius / drawn * rest * rest
                    }
                });
            }
        }
        single(value * f64::from(params.peak))
    };
    (0..60 * 50).map(pixel).collect()
}

#[test]
fn drawn_lines_agree_with_brute_force() {
    let paths = [
        path(&[[5.3, 7.9], [20.0, 11.2], [31.0, 40.5]]),
        // Horizontal, vertical, partly and completely outside.
        path(&[[3.0, 45.0], [50.0, 45.0]]),
        path(&[[40.25, 2.0], [40.25, 30.0]]),
        path(&[[50.0, 20.0], [90.0, -60.0]]),
        path(&[[-50.0, -20.0], [-9.0, -60.0]]),
        // Across another line.
        path(&[[10.0, 44.0], [20.0, 9.0]]),
    ];
    for profile in [Profile::Flat, Profile::Smooth] {
        for (width_px, taper, peak) in [(1.7, 0.5, 1.0), (0.4, 0.0, 1.0), (6.0, 1.0, 0.3), (30.0, 0.2, 2.0)] {
            let params = LineParams { width_px, profile, taper, peak };
            for (found, expected) in drawn(&paths, &params, 0.2).iter().zip(oracle(&paths, &params)) {
                assert!((found - expected.max(0.2)).abs() < 2e-4 * peak, "{params:?}: {found} {expected}");
            }
        }
    }
}

#[test]
fn smooth_lines_have_half_their_peak_at_half_their_width() {
    let params = LineParams { width_px: 10.0, taper: 0.0, ..LineParams::default() };
    let image = drawn(&[path(&[[-10.0, 20.0], [70.0, 20.0]])], &params, 0.0);
    assert_eq!(image[20 * 60 + 30], 1.0);
    assert!((image[25 * 60 + 30] - 0.5).abs() < 1e-6);
    assert_eq!(image[30 * 60 + 30], 0.0);
}

#[test]
fn flat_lines_cover_their_width() {
    for (width_px, y) in [(3.0, 20.0), (2.6, 20.4), (0.3, 19.8)] {
        let params = LineParams { width_px, profile: Profile::Flat, taper: 0.0, peak: 1.0 };
        let image = drawn(&[path(&[[-10.0, y], [70.0, y]])], &params, 0.0);
        let sum: f64 = (0..50).map(|row| f64::from(image[row * 60 + 30])).sum();
        assert!((sum - width_px).abs() < 1e-5, "{sum}");
    }
}

#[test]
fn out_of_range_parameters_are_reported() {
    let base = LineParams::default();
    let cases = [
        ("width_px = 0", LineParams { width_px: 0.0, ..base }),
        ("width_px = NaN", LineParams { width_px: f64::NAN, ..base }),
        ("width_px = inf", LineParams { width_px: f64::INFINITY, ..base }),
        ("taper = 1.1", LineParams { taper: 1.1, ..base }),
        ("taper = NaN", LineParams { taper: f64::NAN, ..base }),
        ("peak = -1", LineParams { peak: -1.0, ..base }),
        ("peak = NaN", LineParams { peak: f32::NAN, ..base }),
    ];
    for (start, params) in cases {
        let message = draw_into(&mut [0.0; 4], 2, &[], &params).unwrap_err().to_string();
        assert!(message.starts_with(start), "{message}");
    }
}

#[test]
#[should_panic(expected = "4 pixels are not a multiple of the width 3")]
fn a_partial_row_is_rejected() {
    let _ = draw_into(&mut [0.0; 4], 3, &[], &LineParams::default());
}

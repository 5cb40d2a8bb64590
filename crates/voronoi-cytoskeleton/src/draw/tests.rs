use super::*;
use crate::river::Mouth;

fn river(points: &[Point]) -> River {
    let count = points.len() as f64;
    River {
        points: points.to_vec(),
        heights: (0..points.len()).map(|i| 1.0 - i as f64 / (count - 1.0)).collect(),
        mouth: Mouth::Border,
    }
}

/// Drawn upon what is there.
fn drawn(rivers: &[River], params: &LineParams, base: f32) -> Vec<f32> {
    let mut image = vec![base; 60 * 50];
    draw_into(&mut image, 60, rivers, params).unwrap();
    image
}

/// The slow way: every pixel against every segment.
fn oracle(rivers: &[River], params: &LineParams) -> Vec<f32> {
    let pixel = |i: usize| {
        let (x, y) = ((i % 60) as f64, (i / 60) as f64);
        let mut value = 0.0f64;
        for river in rivers {
            for k in 1..river.points.len() {
                let (a, b) = (river.points[k - 1], river.points[k]);
                let d = [b[0] - a[0], b[1] - a[1]];
                let square = d[0] * d[0] + d[1] * d[1];
                let t = (((x - a[0]) * d[0] + (y - a[1]) * d[1]) / square).clamp(0.0, 1.0);
                let (ex, ey) = (x - a[0] - t * d[0], y - a[1] - t * d[1]);
                let distance = (ex * ex + ey * ey).sqrt();
                let height = river.heights[k - 1] + t * (river.heights[k] - river.heights[k - 1]);
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
fn agrees_with_every_pixel_against_every_segment() {
    let rivers = [
        river(&[[5.3, 7.9], [20.0, 11.2], [31.0, 40.5]]),
        // Level, upright, partly and wholly outside.
        river(&[[3.0, 45.0], [50.0, 45.0]]),
        river(&[[40.25, 2.0], [40.25, 30.0]]),
        river(&[[50.0, 20.0], [90.0, -60.0]]),
        river(&[[-50.0, -20.0], [-9.0, -60.0]]),
        // Over another line.
        river(&[[10.0, 44.0], [20.0, 9.0]]),
    ];
    for profile in [Profile::Flat, Profile::Smooth] {
        for (width_px, taper, peak) in [(1.7, 0.5, 1.0), (0.4, 0.0, 1.0), (6.0, 1.0, 0.3), (30.0, 0.2, 2.0)] {
            let params = LineParams { width_px, profile, taper, peak };
            for (found, expected) in drawn(&rivers, &params, 0.2).iter().zip(oracle(&rivers, &params)) {
                assert!((found - expected.max(0.2)).abs() < 2e-4 * peak, "{params:?}: {found} {expected}");
            }
        }
    }
}

#[test]
fn smooth_lines_are_half_as_bright_at_half_their_width() {
    let params = LineParams { width_px: 10.0, taper: 0.0, ..LineParams::default() };
    let image = drawn(&[river(&[[-10.0, 20.0], [70.0, 20.0]])], &params, 0.0);
    assert_eq!(image[20 * 60 + 30], 1.0);
    assert!((image[25 * 60 + 30] - 0.5).abs() < 1e-6);
    assert_eq!(image[30 * 60 + 30], 0.0);
}

#[test]
fn flat_lines_cover_their_width() {
    for (width_px, y) in [(3.0, 20.0), (2.6, 20.4), (0.3, 19.8)] {
        let params = LineParams { width_px, profile: Profile::Flat, taper: 0.0, peak: 1.0 };
        let image = drawn(&[river(&[[-10.0, y], [70.0, y]])], &params, 0.0);
        let sum: f64 = (0..50).map(|row| f64::from(image[row * 60 + 30])).sum();
        assert!((sum - width_px).abs() < 1e-5, "{sum}");
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let base = LineParams::default();
    let cases = [
        ("width_px is 0", LineParams { width_px: 0.0, ..base }),
        ("width_px is NaN", LineParams { width_px: f64::NAN, ..base }),
        ("width_px is inf", LineParams { width_px: f64::INFINITY, ..base }),
        ("taper is 1.1", LineParams { taper: 1.1, ..base }),
        ("taper is NaN", LineParams { taper: f64::NAN, ..base }),
        ("peak is -1", LineParams { peak: -1.0, ..base }),
        ("peak is NaN", LineParams { peak: f32::NAN, ..base }),
    ];
    for (start, params) in cases {
        let message = draw_into(&mut [0.0; 4], 2, &[], &params).unwrap_err().to_string();
        assert!(message.starts_with(start), "{message}");
    }
}

#[test]
#[should_panic(expected = "width 3 must divide the image's 4 pixels")]
fn a_width_that_does_not_divide_panics() {
    let _ = draw_into(&mut [0.0; 4], 3, &[], &LineParams::default());
}

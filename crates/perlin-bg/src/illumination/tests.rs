use super::*;

fn image(shape: &Illumination, width: usize, height: usize) -> Vec<f32> {
    let shade = Shade::new(shape, width, height).unwrap();
    let mut image = vec![0.0; width * height];
    for (number, row) in image.chunks_mut(width).enumerate() {
        shade.row_into(row, 0, number);
    }
    image
}

#[test]
fn border_distance_is_the_distance_transform() {
    let exponent = 0.7;
    for (width, height) in [(9, 6), (5, 5), (1, 4), (16, 3)] {
        let found = image(&Illumination::BorderDistance { exponent }, width, height);
        // Distance to the nearest pixel outside the image, by search; the oracle of Eq. 8.
        let distance = |x: usize, y: usize| {
            let mut nearest = f64::INFINITY;
            for v in 0..height + 2 {
                for u in 0..width + 2 {
                    if u == 0 || v == 0 || u == width + 1 || v == height + 1 {
                        let (dx, dy) = ((u as f64) - (x + 1) as f64, (v as f64) - (y + 1) as f64);
                        nearest = nearest.min((dx * dx + dy * dy).sqrt());
                    }
                }
            }
            nearest
        };
        let distances: Vec<f64> = (0..width * height).map(|i| distance(i % width, i / width)).collect();
        let largest = distances.iter().copied().fold(0.0, f64::max);
        for (value, distance) in found.iter().zip(distances) {
            assert_eq!(*value, single(libm::pow(distance / largest, exponent)));
            assert!(*value > 0.0 && *value <= 1.0);
        }
    }
}

#[test]
fn exponent_zero_is_even() {
    let even = image(&Illumination::BorderDistance { exponent: 0.0 }, 12, 7);
    assert!(even.iter().all(|&v| v == 1.0));
}

#[test]
fn bowl_has_its_curvatures_and_tilts() {
    let bowl = Illumination::Bowl { x2: 0.0325, y2: 0.0112, tilt: [0.01, -0.02] };
    let (width, height) = (101, 51);
    let found = image(&bowl, width, height);
    let at = |x: usize, y: usize| f64::from(found[y * width + x]);
    for (x, y, expected) in [
        (50, 25, 1.0),
        (100, 25, 1.0 - 0.0325 + 0.01),
        (0, 25, 1.0 - 0.0325 - 0.01),
        (50, 50, 1.0 - 0.0112 - 0.02),
        (0, 0, 1.0 - 0.0325 - 0.0112 - 0.01 + 0.02),
    ] {
        assert!((at(x, y) - expected).abs() < 1e-6);
    }
}

#[test]
fn a_field_of_one_pixel_is_at_the_centre() {
    assert_eq!(image(&Illumination::default(), 1, 1), [1.0]);
}

#[test]
fn lowest_is_the_minimum() {
    let rising = Illumination::Bowl { x2: -0.3, y2: 0.1, tilt: [0.0, 0.4] };
    for shape in [rising, Illumination::BorderDistance { exponent: 0.5 }] {
        let lowest = Shade::new(&shape, 40, 30).unwrap().lowest();
        let minimum = image(&shape, 40, 30).into_iter().fold(f32::INFINITY, f32::min);
        assert_eq!(lowest, minimum);
    }
}

#[test]
fn a_bowl_that_reaches_zero_is_refused() {
    let deep = Illumination::Bowl { x2: 0.6, y2: 0.5, tilt: [0.0, 0.0] };
    let message = Shade::new(&deep, 10, 10).unwrap_err().to_string();
    assert!(message.contains("0.6") && message.contains("-0.1"), "{message}");
}

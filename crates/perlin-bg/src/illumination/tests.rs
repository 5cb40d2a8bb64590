use super::*;

fn image(shape: &Illumination, width: usize, height: usize) -> Vec<f32> {
    let shade = IlluminationField::new(shape, width, height).unwrap();
    let mut image = vec![0.0; width * height];
    for (number, row) in image.chunks_mut(width).enumerate() {
        shade.row_into(row, 0, number);
    }
    image
}

#[test]
fn border_distance_matches_the_distance_transform() {
    for (width, height, exponent) in [(9, 6, 0.7), (5, 5, 0.02), (1, 4, 0.7), (16, 3, 2.0), (12, 7, 0.0)] {
        let found = image(&Illumination::BorderDistance { exponent }, width, height);
        // Reference of Eq. 8: distance to the nearest pixel outside of the image, by search.
        let places = (0..height + 2).flat_map(|v| (0..width + 2).map(move |u| (u, v)));
        let outside: Vec<_> = places.filter(|&(u, v)| u == 0 || v == 0 || u == width + 1 || v == height + 1).collect();
        let distance = |x: usize, y: usize| {
            let squares = outside.iter().map(|(u, v)| u.abs_diff(x + 1).pow(2) + v.abs_diff(y + 1).pow(2));
            (squares.min().unwrap() as f64).sqrt()
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
fn quadratic_has_the_specified_falloff_and_tilt() {
    let quadratic = Illumination::Quadratic { falloff_x: 0.0325, falloff_y: 0.0112, tilt: [0.01, -0.02] };
    let (width, height) = (101, 51);
    let found = image(&quadratic, width, height);
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
fn single_pixel_is_at_the_centre() {
    assert_eq!(image(&Illumination::default(), 1, 1), [1.0]);
}

#[test]
fn illumination_that_reaches_zero_is_rejected() {
    for (falloff_x, falloff_y, tilt, lowest) in
        [(0.6, 0.5, [0.0, 0.0], "to -0.100"), (-0.3, 0.1, [0.0, 1.0], "to -0.096")]
    {
        let message = IlluminationField::new(&Illumination::Quadratic { falloff_x, falloff_y, tilt }, 10, 10)
            .unwrap_err()
            .to_string();
        assert!(message.contains(&falloff_x.to_string()) && message.contains(lowest), "{message}");
    }
}

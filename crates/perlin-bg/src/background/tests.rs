use super::*;

const KEY: u64 = 20_150_301;
const SIZE: [usize; 2] = [200, 150];

fn transmitted(params: &BackgroundParams) -> Vec<f32> {
    let mut image = vec![f32::NAN; SIZE[0] * SIZE[1]];
    Background::new(params, SIZE[0], SIZE[1], KEY).unwrap().transmitted_into(&mut image, SIZE[0], [0, 0]);
    image
}

fn without_texture(params: BackgroundParams) -> BackgroundParams {
    BackgroundParams { texture: BackgroundTexture { strength: 0.0, ..params.texture }, ..params }
}

#[test]
fn equation_8_is_the_level_times_the_illumination() {
    let image = transmitted(&without_texture(BackgroundParams::paper()));
    let (low, high) = kernel::extremes(&image, f32::INFINITY, f32::NEG_INFINITY);
    assert_eq!(high, 255.0);
    // A corner has distance 1 of 75.
    assert!((f64::from(low) - 255.0 * libm::pow(1.0 / 75.0, 0.02)).abs() < 1e-4);
}

#[test]
fn equation_9_holds_at_points() {
    for params in [BackgroundParams::paper(), BackgroundParams::default()] {
        let background = Background::new(&params, SIZE[0], SIZE[1], KEY).unwrap();
        let flat = transmitted(&without_texture(params.clone()));
        let noise = Fractal::new(&params.texture.noise, KEY).unwrap();
        let mut field: Vec<f32> = (0..flat.len())
            .map(|i| noise.at(background.window.x(i % SIZE[0]), background.window.y(i / SIZE[0])))
            .collect();
        match params.texture.range {
            UnitRange::Extremes => stretch_to_unit(&mut field),
            UnitRange::Bound => {
                for v in &mut field {
                    *v = single(f64::from(*v) / (2.0 * noise.amplitude_bound()) + 0.5);
                }
            }
        }
        for ((found, even), unit) in transmitted(&params).iter().zip(flat).zip(field) {
            let expected_ratio = 1.0 - params.texture.strength / params.level * f64::from(unit);
            let expected = f64::from(even) * expected_ratio;
            assert!((f64::from(*found) / expected - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn logarithm_matches_transmitted_light() {
    for params in [BackgroundParams::paper(), BackgroundParams::default()] {
        let light = transmitted(&params);
        let mut log = vec![0.0; light.len()];
        Background::new(&params, SIZE[0], SIZE[1], KEY).unwrap().log10_into(&mut log, SIZE[0], [0, 0]);
        for (log, light) in log.into_iter().zip(light) {
            let back = libm::exp10(f64::from(log));
            assert!((back / f64::from(light) - 1.0).abs() < 2e-6);
        }
    }
}

#[test]
fn parts_match_the_complete_field() {
    for params in [BackgroundParams::paper(), BackgroundParams::default()] {
        let background = Background::new(&params, SIZE[0], SIZE[1], KEY).unwrap();
        let whole = transmitted(&params);
        for (x, y, w, h) in [(0, 0, 200, 1), (17, 133, 64, 17), (199, 149, 1, 1)] {
            let mut part = vec![0.0; w * h];
            background.transmitted_into(&mut part, w, [x, y]);
            for (row, line) in part.chunks(w).enumerate() {
                let start = (y + row) * SIZE[0] + x;
                assert_eq!(line, &whole[start..start + w]);
            }
        }
    }
}

#[test]
fn out_of_range_values_are_rejected_by_field() {
    let base = BackgroundParams::default;
    let with_texture = |strength: f64, cell_px: f64| BackgroundParams {
        texture: BackgroundTexture { strength, cell_px, ..BackgroundTexture::default() },
        ..base()
    };
    let lit = |illumination| BackgroundParams { illumination, ..base() };
    let with_exponent = |exponent: f64| lit(Illumination::BorderDistance { exponent });
    let with_tilt = |slope: f64| lit(Illumination::Quadratic { falloff_x: 0.0, falloff_y: 0.0, tilt: [0.0, slope] });
    let cases = [
        ("level is 0", BackgroundParams { level: 0.0, ..base() }),
        ("level is -1", BackgroundParams { level: -1.0, ..base() }),
        ("level is NaN", BackgroundParams { level: f64::NAN, ..base() }),
        ("texture.strength is -0.1", with_texture(-0.1, 100.0)),
        ("texture.strength 0.92 must be less than level 0.913", with_texture(0.92, 100.0)),
        ("texture.strength 0.913 must be less than level 0.913", with_texture(0.913, 100.0)),
        ("texture.cell_px is 0", with_texture(0.01, 0.0)),
        ("texture.cell_px is inf", with_texture(0.01, f64::INFINITY)),
        ("illumination.exponent is -0.5", with_exponent(-0.5)),
        ("illumination.exponent is NaN", with_exponent(f64::NAN)),
        ("illumination.tilt[1] is inf", with_tilt(f64::INFINITY)),
        ("the illumination 1 -", with_tilt(1.5)),
    ];
    for (start, params) in cases {
        let message = Background::new(&params, 100, 100, KEY).unwrap_err().to_string();
        assert!(message.starts_with(start), "{message}");
    }
    for (width, height) in [(0, 5), (5, 0)] {
        let message = Background::new(&base(), width, height, KEY).unwrap_err().to_string();
        assert!(message.contains(&format!("{width} x {height}")), "{message}");
    }
}

#[test]
#[should_panic(expected = "exceeds the field of 20 x 10")]
fn a_part_outside_the_field_panics() {
    let background = Background::new(&BackgroundParams::default(), 20, 10, KEY).unwrap();
    background.transmitted_into(&mut [0.0; 25], 5, [0, 6]);
}

#[test]
fn stretching_reaches_0_and_1() {
    let mut image = [3.0, -1.0, 1.0];
    stretch_to_unit(&mut image);
    assert_eq!(image, [1.0, 0.0, 0.5]);
    let mut flat = [7.0; 4];
    stretch_to_unit(&mut flat);
    assert_eq!(flat, [0.0; 4]);
    stretch_to_unit(&mut []);
}

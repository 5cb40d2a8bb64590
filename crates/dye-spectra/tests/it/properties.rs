//! Tests of the light of stained slides: invariants, and fast routines against a slow sum.

use dye_spectra::{
    Amounts, Colour, ColourParams, Curve, DYES, Dye, Error, Lamp, Mixing, Sensor, absorbance, amounts, encode_srgb,
};
use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const LAMPS: [Lamp; 3] = [Lamp::Halogen { temperature_k: 3200.0 }, Lamp::Led, Lamp::EqualEnergy];
const SENSORS: [Sensor; 2] = [Sensor::Camera, Sensor::Panchromatic];
const MIXINGS: [Mixing; 2] = [Mixing::Spectral, Mixing::ThreeVectors];

fn colour(params: ColourParams) -> Colour {
    Colour::new(&params).unwrap()
}

fn default_colour() -> Colour {
    colour(ColourParams::default())
}

/// Iterates over every lamp, sensor and mixing model.
fn all() -> impl Iterator<Item = Colour> {
    MIXINGS.into_iter().flat_map(all_of)
}

fn all_of(mixing: Mixing) -> impl Iterator<Item = Colour> {
    let params = LAMPS
        .into_iter()
        .flat_map(move |lamp| SENSORS.map(|sensor| ColourParams { lamp, sensor, mixing, ..ColourParams::default() }));
    params.map(colour)
}

/// Returns amounts of all dyes in a Papanicolaou smear, from light to dark.
fn smears() -> Vec<Amounts> {
    let cytoplasms = [
        amounts([(Dye::LightGreen, 0.08), (Dye::EosinY, 0.03)]),
        amounts([(Dye::LightGreen, 0.2), (Dye::EosinY, 0.03)]),
        amounts([(Dye::EosinY, 0.1), (Dye::OrangeG, 0.05)]),
        amounts([(Dye::EosinY, 0.25), (Dye::OrangeG, 0.05)]),
        amounts([(Dye::OrangeG, 0.3)]),
        amounts([(Dye::OrangeG, 0.6)]),
        [0.0; DYES],
    ];
    let nuclei = [0.0, 0.35, 0.6, 1.0];
    let stained = |cytoplasm: Amounts| nuclei.map(|h| sum(&cytoplasm, &amounts([(Dye::Haematein, h)])));
    cytoplasms.into_iter().flat_map(stained).collect()
}

fn sum(a: &Amounts, b: &Amounts) -> Amounts {
    std::array::from_fn(|d| a[d] + b[d])
}

fn cosine(a: [f64; 3], b: [f64; 3]) -> f64 {
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
}

/// Returns random planes of amounts, partly 0.
fn random_planes(pixels: usize, seed: u64) -> [Vec<f32>; DYES] {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    std::array::from_fn(|d| {
        let stained = |i: usize| !(i / (20 + 7 * d)).is_multiple_of(3);
        (0..pixels).map(|i| if stained(i) { rng.random::<f32>() * rng.random::<f32>() * 3.0 } else { 0.0 }).collect()
    })
}

fn fill(pixels: usize, write: impl FnOnce([&mut [f32]; 3])) -> [Vec<f32>; 3] {
    let mut out = [(); 3].map(|()| vec![f32::NAN; pixels]);
    write(out.each_mut().map(|plane| &mut plane[..]));
    out
}

fn rows(colour: &Colour, planes: &[Vec<f32>; DYES]) -> [Vec<f32>; 3] {
    fill(planes[0].len(), |out| colour.transmittance_into(planes.each_ref().map(|plane| &plane[..]), out))
}

/// Reference: the light of a channel by definition.
fn oracle(colour: &Colour, mixing: Mixing, amounts: &Amounts) -> [f64; 3] {
    colour.channels().each_ref().map(|channel| {
        let mean = |f: &dyn Fn(f64) -> f64| channel.nodes.iter().map(|n| n.weight * f(n.wavelength_um)).sum::<f64>();
        match mixing {
            Mixing::Spectral => mean(&|w| libm::exp10(-absorbance(amounts, w))),
            Mixing::ThreeVectors => libm::exp10(-mean(&|w| absorbance(amounts, w))),
        }
    })
}

#[test]
fn light_without_dye_is_one_and_never_exceeds_one() {
    for colour in all() {
        for light in colour.transmittance(&[0.0; DYES]) {
            assert!((light - 1.0).abs() < 1e-15);
        }
        for smear in smears() {
            assert!(colour.transmittance(&smear).iter().all(|light| (0.0..1.0 + 1e-15).contains(light)));
        }
    }
}

#[test]
fn light_decreases_with_dye() {
    let colour = default_colour();
    for dye in Dye::ALL {
        for smear in smears() {
            let more = sum(&smear, &amounts([(dye, 0.1)]));
            let (before, after) = (colour.transmittance(&smear), colour.transmittance(&more));
            assert!(before.iter().zip(after).all(|(before, after)| after < *before));
        }
    }
}

#[test]
fn overlaps_multiply_for_one_wavelength_three_vectors_and_neutral_dust() {
    let one = colour(ColourParams { wavelengths: 1, ..ColourParams::default() });
    let vectors = colour(ColourParams { mixing: Mixing::ThreeVectors, ..ColourParams::default() });
    let narrow = colour(ColourParams { from_um: 0.57, to_um: 0.570_001, ..ColourParams::default() });
    let product = |colour: &Colour, a: &Amounts, b: &Amounts| {
        let (ta, tb, both) = (colour.transmittance(a), colour.transmittance(b), colour.transmittance(&sum(a, b)));
        (0..3).map(|c| (both[c] - ta[c] * tb[c]).abs()).fold(0.0, f64::max)
    };
    for a in smears() {
        for b in smears() {
            assert!(product(&one, &a, &b) < 1e-12);
            assert!(product(&vectors, &a, &b) < 1e-12);
            assert!(product(&narrow, &a, &b) < 1e-6);
        }
        assert!(product(&default_colour(), &a, &amounts([(Dye::Neutral, 0.4)])) < 1e-12);
    }
}

/// Stain vectors published by G. Landini for ImageJ's Colour Deconvolution.
#[test]
fn stain_vectors_match_published_values() {
    let published = [
        (Dye::Haematein, [0.650, 0.704, 0.286], 0.985),
        (Dye::Haematein, [0.644, 0.717, 0.267], 0.985),
        (Dye::EosinY, [0.093, 0.954, 0.283], 0.96),
        (Dye::LightGreen, [0.947, 0.254, 0.197], 0.985),
        (Dye::OrangeG, [0.107, 0.368, 0.924], 0.985),
    ];
    let colour = default_colour();
    for (dye, vector, least) in published {
        let ours = colour.stain_vector(dye);
        assert!((ours.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(cosine(ours, vector) >= least, "{dye:?}: {ours:?}, {}", cosine(ours, vector));
    }
    let even = colour.stain_vector(Dye::Neutral);
    assert!(even.iter().all(|v| (v - 1.0 / 3.0_f64.sqrt()).abs() < 1e-12));
}

#[test]
fn sixteen_wavelengths_are_within_3e_3_of_151() {
    for lamp in LAMPS {
        let coarse = colour(ColourParams { lamp, ..ColourParams::default() });
        let fine = colour(ColourParams { lamp, wavelengths: 151, ..ColourParams::default() });
        // Darker than any dye in a smear.
        let alone = Dye::ALL.map(|dye| amounts([(dye, 0.9)]));
        for c in smears().into_iter().chain(alone) {
            let (coarse, fine) = (coarse.transmittance(&c), fine.transmittance(&c));
            let worst = coarse.iter().zip(fine).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst <= 0.003, "{lamp:?} {c:?}: {worst}");
        }
    }
}

/// The product of the mean lights of two slabs is not the mean light through both. Two cells that absorb in the same
/// part of the channel transmit more, two that absorb in different parts less.
#[test]
fn mean_light_of_overlapping_slabs_does_not_multiply() {
    let cyanophilic = amounts([(Dye::LightGreen, 0.15), (Dye::EosinY, 0.03)]);
    let eosinophilic = amounts([(Dye::EosinY, 0.2), (Dye::OrangeG, 0.05)]);
    let keratinised = amounts([(Dye::OrangeG, 0.45)]);
    let nucleus = amounts([(Dye::Haematein, 0.5), (Dye::EosinY, 0.01), (Dye::LightGreen, 0.02)]);
    let colour = default_colour();
    // Error of the product relative to the absorbed light, over the three channels.
    let error = |a: &Amounts, b: &Amounts| {
        let (ta, tb, both) = (colour.transmittance(a), colour.transmittance(b), colour.transmittance(&sum(a, b)));
        let norm = |f: &dyn Fn(usize) -> f64| (0..3).map(|c| f(c) * f(c)).sum::<f64>().sqrt();
        norm(&|c| ta[c] * tb[c] - both[c]) / norm(&|c| 1.0 - both[c])
    };
    let cases = [
        (cyanophilic, nucleus, 0.0053),
        (eosinophilic, nucleus, 0.0078),
        (keratinised, nucleus, 0.0234),
        (cyanophilic, cyanophilic, 0.0150),
        (cyanophilic, eosinophilic, 0.0160),
        (eosinophilic, eosinophilic, 0.0493),
        (keratinised, keratinised, 0.0758),
        (nucleus, nucleus, 0.0191),
    ];
    for (a, b, measured) in cases {
        assert!((error(&a, &b) - measured).abs() < 2e-4, "{a:?} {b:?}: {}", error(&a, &b));
    }
}

/// A camera channel is wide: twice the dye does not give twice the optical density.
#[test]
fn broad_channels_deviate_from_beer_lambert() {
    let colour = default_colour();
    let bend = |dye: Dye, channel: usize, amount: f64| {
        let density = |amount| -libm::log10(colour.transmittance(&amounts([(dye, amount)]))[channel]);
        density(2.0 * amount) / (2.0 * density(amount))
    };
    for (dye, channel, range) in [(Dye::EosinY, 1, 0.74..0.83), (Dye::LightGreen, 0, 0.85..0.93)] {
        for amount in [0.5, 0.6, 0.75] {
            assert!(range.contains(&bend(dye, channel, amount)), "{dye:?} {amount}");
        }
        // Thin stains do not deviate.
        assert!(bend(dye, channel, 1e-4) > 0.999);
    }
}

#[test]
fn channels_describe_their_light() {
    for colour in all() {
        let [red, green, blue] = colour.channels();
        for channel in [red, green, blue] {
            assert_eq!(channel.nodes.len(), 16);
            let total: f64 = channel.nodes.iter().map(|n| n.weight).sum();
            let centroid: f64 = channel.nodes.iter().map(|n| n.weight * n.wavelength_um).sum();
            assert!((total - 1.0).abs() < 1e-12);
            assert!((centroid - channel.wavelength_um).abs() < 1e-3, "{centroid} {}", channel.wavelength_um);
            assert!(channel.relative_light > 0.0 && channel.relative_light <= 1.0);
            assert!(channel.bandwidth_um > 0.1 && channel.bandwidth_um < 0.3 + 1e-6, "{}", channel.bandwidth_um);
        }
    }
    let even =
        colour(ColourParams { lamp: Lamp::EqualEnergy, sensor: Sensor::Panchromatic, ..ColourParams::default() });
    for channel in even.channels() {
        // The rectangular band.
        assert!((channel.wavelength_um - 0.55).abs() < 1e-12 && (channel.bandwidth_um - 0.3).abs() < 1e-6);
        assert_eq!(channel.relative_light, 1.0);
    }
    let [red, green, blue] = default_colour().channels().clone();
    assert!(red.wavelength_um > green.wavelength_um && green.wavelength_um > blue.wavelength_um);
}

#[test]
fn white_balance_makes_the_empty_slide_grey() {
    for colour in all() {
        let lights = colour.channels().each_ref().map(|channel| channel.relative_light);
        assert_eq!(lights.into_iter().fold(0.0, f64::max), 1.0);
        for (light, gain) in lights.into_iter().zip(colour.white_balance()) {
            assert!((light * gain - 1.0).abs() < 1e-15 && gain >= 1.0);
        }
    }
}

#[test]
fn rows_match_the_definition() {
    let planes = random_planes(4099, 5);
    for (mixing, colour) in MIXINGS.into_iter().flat_map(|mixing| all_of(mixing).map(move |colour| (mixing, colour))) {
        let out = rows(&colour, &planes);
        for i in 0..planes[0].len() {
            let amounts = planes.each_ref().map(|plane| f64::from(plane[i]));
            let (slow, exact) = (oracle(&colour, mixing, &amounts), colour.transmittance(&amounts));
            for c in 0..3 {
                assert!((slow[c] - exact[c]).abs() < 1e-14);
                assert!((f64::from(out[c][i]) - exact[c]).abs() < 1e-5, "{i} {c}: {} {}", out[c][i], exact[c]);
            }
        }
    }
}

#[test]
fn pixels_are_independent() {
    let colour = default_colour();
    let curve = colour.curve(&amounts([(Dye::EosinY, 1.0), (Dye::OrangeG, 0.3)])).unwrap();
    let planes = random_planes(500, 6);
    let deep: Vec<f32> = planes[1].iter().map(|v| v * 3.0).collect();
    let whole = rows(&colour, &planes);
    let whole_curve = fill(deep.len(), |out| curve.transmittance_into(&deep, out));
    for size in [1, 2, 7, 15, 16, 17, 100, 333] {
        for start in (0..planes[0].len()).step_by(size) {
            let window = start..(start + size).min(planes[0].len());
            let part = rows(&colour, &planes.each_ref().map(|plane| plane[window.clone()].to_vec()));
            let part_curve = fill(window.len(), |out| curve.transmittance_into(&deep[window.clone()], out));
            for c in 0..3 {
                assert_eq!(part[c], whole[c][window.clone()]);
                assert_eq!(part_curve[c], whole_curve[c][window.clone()]);
            }
        }
    }
}

#[test]
fn empty_planes_equal_zeros_and_transmit_all_light() {
    for colour in all() {
        let planes = random_planes(100, 7);
        let zeros = vec![0.0; 100];
        let with_zeros = fill(100, |out| {
            colour.transmittance_into([&planes[0], &zeros, &planes[2], &zeros, &zeros], out);
        });
        let without = fill(100, |out| colour.transmittance_into([&planes[0], &[], &planes[2], &[], &[]], out));
        assert_eq!(with_zeros, without);
        for (i, (haematein, green)) in planes[0].iter().zip(&planes[2]).enumerate() {
            if *haematein == 0.0 && *green == 0.0 {
                assert!(without.iter().all(|plane| plane[i] == 1.0));
            }
        }
        let nothing = fill(33, |out| colour.transmittance_into([&[]; DYES], out));
        assert!(nothing.iter().flatten().all(|light| *light == 1.0));
        let curve = colour.curve(&amounts([(Dye::EosinY, 1.0)])).unwrap();
        let nothing = fill(33, |out| curve.transmittance_into(&[0.0; 33], out));
        assert!(nothing.iter().flatten().all(|light| *light == 1.0));
    }
}

#[test]
fn opaque_pixels_are_dark_and_finite() {
    let colour = default_colour();
    for amount in [50.0, 1e6, f32::MAX, f32::INFINITY] {
        let soot = [amount; 40];
        let light = fill(40, |out| colour.transmittance_into([&[], &[], &[], &[], &soot], out));
        assert!(light.iter().flatten().all(|light| light.abs() < 1e-6), "{amount}");
        let curve = colour.curve(&amounts([(Dye::Neutral, 1.0)])).unwrap();
        let light = fill(40, |out| curve.transmittance_into(&soot, out));
        assert!(light.iter().flatten().all(|light| light.abs() < 1e-6), "{amount}");
    }
}

#[test]
fn curves_match_the_sums() {
    let amount: Vec<f32> = (0..6000).map(|i| i as f32 * 1e-3).collect();
    let alone = Dye::ALL.map(|dye| amounts([(dye, 1.0)]));
    let weak = smears().into_iter().map(|smear| smear.map(|amount| amount * 0.1));
    for colour in all() {
        for mix in smears().into_iter().chain(alone).chain(weak.clone()).chain([[0.0; DYES]]) {
            let curve = colour.curve(&mix).unwrap();
            let out = fill(amount.len(), |out| curve.transmittance_into(&amount, out));
            for (i, amount) in amount.iter().enumerate() {
                let exact = colour.transmittance(&mix.map(|amount_of_dye| amount_of_dye * f64::from(*amount)));
                for c in 0..3 {
                    assert!((f64::from(out[c][i]) - exact[c]).abs() < 1e-5, "{mix:?} {amount} {c}: {}", out[c][i]);
                }
            }
        }
    }
}

#[test]
fn invalid_mixtures_are_rejected_by_name() {
    let colour = default_colour();
    for (value, shown) in [(f64::NAN, "NaN"), (-0.5, "-0.5"), (f64::INFINITY, "inf"), (1e4, "10000")] {
        let rejected: Result<Curve, Error> = colour.curve(&[0.0, value, 0.0, 0.0, 0.0]);
        assert_eq!(rejected.unwrap_err().to_string(), format!("mix is {shown}; it must be from 0 to 1000"));
    }
    assert!(Colour::new(&ColourParams { wavelengths: 0, ..ColourParams::default() }).is_err());
}

#[test]
#[should_panic(expected = "planes of amounts must be empty or as long as the channels")]
fn planes_of_other_lengths_panic() {
    let planes = [&[0.0; 8][..], &[0.0; 7], &[], &[], &[]];
    fill(8, |out| default_colour().transmittance_into(planes, out));
}

#[test]
fn single_wavelength_matches_beer_lambert() {
    let single = colour(ColourParams { from_um: 0.565, to_um: 0.575, wavelengths: 1, ..ColourParams::default() });
    for smear in smears() {
        let exact = libm::exp10(-absorbance(&smear, 0.57));
        assert!(single.transmittance(&smear).iter().all(|light| (light - exact).abs() < 1e-12));
    }
}

#[test]
fn display_colours_of_white_and_dyes_are_plausible() {
    for colour in all() {
        for row in colour.to_srgb() {
            assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
    let screen = |smear: Amounts| {
        let colour = default_colour();
        let light = colour.transmittance(&smear);
        colour.to_srgb().map(|row| row.iter().zip(light).map(|(m, light)| m * light).sum::<f64>())
    };
    let [r, g, b] = screen(amounts([(Dye::LightGreen, 0.3)]));
    assert!(r < g && r < b, "blue-green: {r} {g} {b}");
    let [r, g, b] = screen(amounts([(Dye::EosinY, 0.3)]));
    assert!(r > b && b > g, "pink: {r} {g} {b}");
    let [r, g, b] = screen(amounts([(Dye::OrangeG, 0.5)]));
    assert!(r > g && g > b, "orange: {r} {g} {b}");
    let [r, g, b] = screen(amounts([(Dye::Haematein, 0.5)]));
    assert!(b > r && b > g, "blue-violet: {r} {g} {b}");
    // A monochrome camera needs no conversion.
    let grey = colour(ColourParams { sensor: Sensor::Panchromatic, ..ColourParams::default() });
    for (i, row) in grey.to_srgb().iter().enumerate() {
        assert!((row[i] - 1.0).abs() < 1e-9, "{row:?}");
    }
}

#[test]
fn srgb_encoding_follows_the_standard() {
    // IEC 61966-2-1: a linear section, then a power function.
    let cases = [(0.0, 0), (1.0, 255), (0.003_130_8, 10), (0.215_860_5, 128), (0.5, 188), (-3.0, 0), (7.0, 255)];
    for (linear, encoded) in cases {
        assert_eq!(encode_srgb(linear), encoded, "{linear}");
    }
    assert!((0..1000).all(|i| encode_srgb(f64::from(i) * 1e-3) <= encode_srgb(f64::from(i + 1) * 1e-3)));
}

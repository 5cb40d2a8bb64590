//! Conversion of camera channels to display colours.

use crate::dye::{Amounts, DYES, Dye, amounts};
use crate::light::{Lobe, lobe, sum};
use crate::params::ColourParams;
use crate::rows::{Wavelength, exact};

type Matrix = [[f64; 3]; 3];

/// Returns the sRGB value of a linear value, both 0 to 1 (IEC 61966-2-1). Values outside of the range are clamped.
#[must_use]
pub fn tone_curve(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 }
}

/// Encodes a linear sRGB value, 0 to 1, as 8 bits (IEC 61966-2-1). Values outside of the range are clamped.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255 after clamping")]
pub fn encode_srgb(linear: f64) -> u8 {
    (255.0 * tone_curve(linear) + 0.5) as u8
}

/// Colour matching functions of the CIE 1931 standard observer by Wyman, Sloan and Shirley, *Simple Analytic
/// Approximations to the CIE XYZ Color Matching Functions*, J. Comput. Graph. Tech. 2(2), 2013.
const X: [Lobe; 3] = [lobe(1.056, 599.8, 37.9, 31.0), lobe(0.362, 442.0, 16.0, 26.7), lobe(-0.065, 501.1, 20.4, 26.2)];
const Y: [Lobe; 2] = [lobe(0.821, 568.8, 46.9, 40.5), lobe(0.286, 530.9, 16.3, 31.1)];
const Z: [Lobe; 2] = [lobe(1.217, 437.0, 11.8, 36.0), lobe(0.681, 459.0, 26.0, 13.8)];

/// Bands of the observer's integral: 5 nm, the convention in colorimetry.
const OBSERVER_BANDS: usize = 60;

/// Bradford cone responses, their inverse, and the white point D65 (ICC.1:2022, annex E).
const CONES: Matrix = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];
const FROM_CONES: Matrix = [
    [0.986_992_9, -0.147_054_3, 0.159_962_7],
    [0.432_305_3, 0.518_360_3, 0.049_291_2],
    [-0.008_528_7, 0.040_042_8, 0.968_486_7],
];
const D65: [f64; 3] = [0.950_47, 1.0, 1.088_83];
/// IEC 61966-2-1.
const XYZ_TO_SRGB: Matrix = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

/// Regularisation towards the identity. It matters only if all channels are equal.
const RIDGE: f64 = 1e-6;

/// Returns the colour matrix. Its rows sum to 1, so that white stays white, and it is the best fit from camera light of
/// stained smears to the observer's colours.
pub(crate) fn matrix(params: &ColourParams, spectral: &[Wavelength]) -> Matrix {
    let observer = observer(params);
    let pairs: Vec<[[f64; 3]; 2]> = smears().map(|c| [exact(spectral, &c), exact(&observer, &c)]).collect();
    std::array::from_fn(|row| {
        // m·t with m = (p, q, 1 − p − q) is p·(t₀ − t₂) + q·(t₁ − t₂) + t₂: least squares in p and q, by Cramer's rule.
        let identity = |column: usize| if row == column { 1.0 } else { 0.0 };
        let (mut aa, mut ab, mut bb) = (RIDGE, 0.0, RIDGE);
        let (mut ay, mut by) = (RIDGE * identity(0), RIDGE * identity(1));
        for [camera, observed] in &pairs {
            let (a, b, y) = (camera[0] - camera[2], camera[1] - camera[2], observed[row] - camera[2]);
            aa += a * a;
            ab += a * b;
            bb += b * b;
            ay += a * y;
            by += b * y;
        }
        let determinant = aa * bb - ab * ab;
        let (p, q) = ((ay * bb - by * ab) / determinant, (by * aa - ay * ab) / determinant);
        [p, q, 1.0 - p - q]
    })
}

/// Returns the mixtures of the fit: two strengths of three cytoplasms, alone, overlapping, and with a nucleus.
fn smears() -> impl Iterator<Item = Amounts> {
    let cytoplasms = [
        amounts([(Dye::LightGreen, 0.15), (Dye::EosinY, 0.03)]),
        amounts([(Dye::EosinY, 0.18), (Dye::OrangeG, 0.05)]),
        amounts([(Dye::OrangeG, 0.45)]),
    ];
    let pair = move |i: usize, j: usize| std::array::from_fn::<f64, DYES, _>(|d| cytoplasms[i][d] + cytoplasms[j][d]);
    let backgrounds =
        cytoplasms.into_iter().chain([[0.0; DYES], pair(0, 0), pair(0, 1), pair(0, 2), pair(1, 1), pair(1, 2)]);
    backgrounds.flat_map(|background| {
        [0.0, 0.3, 0.6].map(|nucleus| {
            let mut smear = background;
            smear[Dye::Haematein as usize] += nucleus;
            smear
        })
    })
}

/// Returns the standard observer, adapted to the lamp, with weights for linear sRGB. The weights of each colour sum to
/// 1.
fn observer(params: &ColourParams) -> Vec<Wavelength> {
    let visible = ColourParams { from_um: 0.40, to_um: 0.70, ..params.clone() };
    let observed = |w: f64| [sum(&X, w), sum(&Y, w), sum(&Z, w)].map(|response| response * params.lamp.power(w));
    let mut white = [0.0; 3];
    for w in visible.band_centres(OBSERVER_BANDS) {
        for (white, observed) in white.iter_mut().zip(observed(w)) {
            *white += observed;
        }
    }
    let (cones, cones_d65) = (times(&CONES, white), times(&CONES, D65));
    let adapt = |xyz: [f64; 3]| {
        let responses = times(&CONES, xyz);
        times(&FROM_CONES, std::array::from_fn(|c| responses[c] * cones_d65[c] / cones[c]))
    };
    let srgb_white = times(&XYZ_TO_SRGB, adapt(white));
    let term = |w: f64| {
        let srgb = times(&XYZ_TO_SRGB, adapt(observed(w)));
        (Dye::ALL.map(|dye| dye.absorbance(w)), std::array::from_fn(|c| srgb[c] / srgb_white[c]))
    };
    visible.band_centres(OBSERVER_BANDS).map(term).collect()
}

fn times(matrix: &Matrix, vector: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row.iter().zip(vector).map(|(m, v)| m * v).sum())
}

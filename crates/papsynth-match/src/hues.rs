//! Hues of stains in colour images: their measurement, and the amounts of dyes that produce them.

use dye_spectra::{Amounts, Colour, ColourParams, Lamp, tone_curve};
use papsynth::recipe::{DyeAmounts, LightSection, Number, Recipe, Rendition};
use papsynth_judge::FieldImage;
use papsynth_judge::number::whole;
use portable_numerics::statistics::quantile;

use crate::recipe::{centre, rounded_to, times};

/// Names of the statistics of hues: absorbances of the red and the blue channel relative to that of the green one, of
/// nuclei without the cytoplasm around them and of the two kinds of cytoplasm, and the share of pink cytoplasm.
pub(crate) const HUES: [&str; 7] = [
    "red over green absorbance of nuclei",
    "blue over green absorbance of nuclei",
    "red over green absorbance of blue-green cytoplasm",
    "blue over green absorbance of blue-green cytoplasm",
    "red over green absorbance of pink cytoplasm",
    "blue over green absorbance of pink cytoplasm",
    "log odds of pink cytoplasm",
];

/// Means of a field, in the order of [`HUES`]; NaN if unknown.
pub(crate) type Hues = [f64; HUES.len()];

/// Size of the blocks that are measured, µm. Their means have little noise.
const BLOCK_UM: f64 = 1.3;

/// The brightest blocks are empty slide.
const EMPTY: f64 = 0.9;

/// Distance from the centre of a nucleus to the cytoplasm beside it, and radius without cytoplasm alone, µm.
const BESIDE_UM: f64 = 9.0;
const NUCLEUS_UM: f64 = 7.0;

/// Minimum absorbance of nuclei above the surroundings, and range of absorbance of cytoplasm, in the green channel.
const LEAST_NUCLEUS: f64 = 0.06;
const CYTOPLASM: [f64; 2] = [0.04, 0.35];

/// Minimum numbers of nuclei, of blocks of cytoplasm, and of blocks of one kind of it.
const LEAST_NUCLEI: usize = 4;
const LEAST_BLOCKS: usize = 60;
const LEAST_OF_KIND: usize = 15;

/// Absorbances of the three channels in blocks of pixels.
struct Blocks {
    side: usize,
    width: usize,
    height: usize,
    absorbance: Vec<[f64; 3]>,
}

impl Blocks {
    fn new(image: &FieldImage, [red, blue]: &[Vec<f32>; 2], pixel_um: f64) -> Option<Self> {
        let side = whole((BLOCK_UM / pixel_um).round()).max(1);
        let (width, height) = (image.width / side, image.height() / side);
        let mean = |plane: &[f32], x: usize, y: usize| {
            let rows = (y * side..(y + 1) * side).map(|row| &plane[row * image.width + x * side..][..side]);
            rows.flatten().map(|v| f64::from(*v)).sum::<f64>() / (side * side) as f64
        };
        let light: Vec<[f64; 3]> = (0..width * height)
            .map(|i| [red, &image.grey, blue].map(|plane| mean(plane, i % width, i / width)))
            .collect();
        let mut green: Vec<f64> = light.iter().map(|rgb| rgb[1]).collect();
        if green.is_empty() {
            return None;
        }
        let bright = quantile(&mut green, EMPTY);
        let empty = [0, 1, 2].map(|c| {
            let mut of: Vec<f64> = light.iter().filter(|rgb| rgb[1] >= bright).map(|rgb| rgb[c]).collect();
            quantile(&mut of, 0.5)
        });
        let least = 1e-3 * f64::from(image.full_scale);
        let absorbance = |rgb: [f64; 3]| std::array::from_fn(|c| -libm::log10(rgb[c].max(least) / empty[c].max(least)));
        Some(Self { side, width, height, absorbance: light.into_iter().map(absorbance).collect() })
    }

    /// Returns the block of a place in pixels, plus an offset in blocks.
    fn at(&self, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) -> Option<usize> {
        let (x, y) = (libm::floor(x / self.side as f64 + dx), libm::floor(y / self.side as f64 + dy));
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        inside.then(|| whole(y) * self.width + whole(x))
    }
}

/// Measures the hues of a colour image with nuclei at `places`.
pub(crate) fn hues(image: &FieldImage, places: &[[f64; 2]], pixel_um: f64) -> Hues {
    const UNKNOWN: Hues = [f64::NAN; HUES.len()];
    let Some(blocks) = image.red_blue.as_ref().and_then(|colours| Blocks::new(image, colours, pixel_um)) else {
        return UNKNOWN;
    };
    let block_um = blocks.side as f64 * pixel_um;
    let middle = |values: &mut [f64]| quantile(values, 0.5);
    let mut out = UNKNOWN;
    let mut nuclei = [Vec::new(), Vec::new()];
    let mut free = vec![true; blocks.absorbance.len()];
    for place in places {
        let around: Vec<usize> = (0..8)
            .filter_map(|k| {
                let angle = 0.25 * std::f64::consts::PI * f64::from(k);
                let offset = [libm::cos(angle), libm::sin(angle)].map(|part| BESIDE_UM / block_um * part);
                blocks.at(*place, offset)
            })
            .collect();
        let reach = i32::try_from(whole(NUCLEUS_UM / block_um)).unwrap_or(0);
        for (dx, dy) in (-reach..=reach).flat_map(|dx| (-reach..=reach).map(move |dy| (dx, dy))) {
            if let Some(block) = blocks.at(*place, [f64::from(dx), f64::from(dy)]) {
                free[block] = false;
            }
        }
        if let (Some(core), true) = (blocks.at(*place, [0.0; 2]), around.len() >= 5) {
            let above: [f64; 3] = std::array::from_fn(|c| {
                let mut beside: Vec<f64> = around.iter().map(|block| blocks.absorbance[*block][c]).collect();
                blocks.absorbance[core][c] - middle(&mut beside)
            });
            if above[1] > LEAST_NUCLEUS {
                nuclei[0].push(above[0] / above[1]);
                nuclei[1].push(above[2] / above[1]);
            }
        }
    }
    if nuclei[0].len() >= LEAST_NUCLEI {
        out[0] = middle(&mut nuclei[0]);
        out[1] = middle(&mut nuclei[1]);
    }
    let [pale, dark] = CYTOPLASM;
    let covered = blocks.absorbance.iter().zip(&free).filter(|(a, free)| **free && a[1] > pale && a[1] < dark);
    let ratios: Vec<[f64; 2]> = covered.map(|(a, _)| [a[0] / a[1], a[2] / a[1]]).collect();
    if ratios.len() >= LEAST_BLOCKS {
        let border = border(ratios.iter().map(|ratio| ratio[0]).collect());
        let (green, pink): (Vec<[f64; 2]>, Vec<[f64; 2]>) = ratios.iter().partition(|ratio| ratio[0] > border);
        for (kind, first) in [(&green, 2), (&pink, 4)] {
            if kind.len() >= LEAST_OF_KIND {
                for i in 0..2 {
                    out[first + i] = middle(&mut kind.iter().map(|ratio| ratio[i]).collect::<Vec<f64>>());
                }
            }
        }
        out[6] = libm::log((pink.len() + 1) as f64 / (green.len() + 1) as f64);
    }
    out
}

/// Returns the border between two groups of values (Lloyd's algorithm).
fn border(mut values: Vec<f64>) -> f64 {
    const ROUNDS: usize = 30;
    let mut border = 0.5 * (quantile(&mut values, 0.05) + quantile(&mut values, 0.95));
    for _ in 0..ROUNDS {
        let (low, high): (Vec<f64>, Vec<f64>) = values.iter().partition(|value| **value <= border);
        if low.is_empty() || high.is_empty() {
            break;
        }
        border = 0.5 * [low, high].iter().map(|side| side.iter().sum::<f64>() / side.len() as f64).sum::<f64>();
    }
    border
}

/// Typical absorbances in the green channel.
const NUCLEUS_STRENGTH: f64 = 0.4;
const CYTOPLASM_STRENGTH: f64 = 0.15;

/// Factor on odds of pink cytoplasm, at most.
const MOST_ODDS: f64 = 20.0;

/// Changes the dyes of a recipe so that its hues change from `simulated` to `real`. The absorbance in the green channel
/// stays the same. Unknown hues change nothing.
pub(crate) fn correct(recipe: &mut Recipe, real: &Hues, simulated: &Hues) {
    let LightSection::Colour(light) = &recipe.light else { return };
    let lamp = Lamp::Halogen { temperature_k: centre(&light.lamp_k) };
    let Ok(colour) = Colour::new(&ColourParams { lamp, ..ColourParams::default() }) else { return };
    let camera = Channels { colour, rendition: light.rendition };
    let change = |i: usize| [0, 1].map(|k| real[i + k] - simulated[i + k]);
    let stain = &mut recipe.stain;
    for (dyes, minor, strength, change) in [
        (&mut stain.nucleus, [EOSIN, GREEN], NUCLEUS_STRENGTH, change(0)),
        (&mut stain.cyanophilic, [EOSIN, ORANGE], CYTOPLASM_STRENGTH, change(2)),
        (&mut stain.eosinophilic, [GREEN, ORANGE], CYTOPLASM_STRENGTH, change(4)),
    ] {
        if change.iter().all(|c| c.is_finite()) {
            *dyes = camera.shifted(dyes, minor, strength, change);
        }
    }
    let odds = libm::exp(real[6] - simulated[6]).clamp(1.0 / MOST_ODDS, MOST_ODDS);
    if odds.is_finite() {
        for mix in recipe.cells.values_mut() {
            for weight in [&mut mix.tints.eosinophilic, &mut mix.tints.orangeophilic] {
                *weight = match times(weight, odds) {
                    Number::Fixed(value) => Number::Fixed(value.min(1000.0)),
                    drawn => drawn,
                };
            }
        }
    }
}

/// Indices of dyes in [`Amounts`].
const EOSIN: usize = 1;
const GREEN: usize = 2;
const ORANGE: usize = 3;

/// The channels of a colour camera.
struct Channels {
    colour: Colour,
    rendition: Rendition,
}

impl Channels {
    /// Returns the absorbances of the saved channels.
    fn absorbances(&self, amounts: &Amounts) -> [f64; 3] {
        let light = self.colour.transmittance(amounts);
        let matrix = self.colour.to_srgb();
        let light = match self.rendition {
            Rendition::Raw | Rendition::Display => light,
            Rendition::Srgb => matrix.map(|row| row.iter().zip(light).map(|(m, l)| m * l).sum()),
        };
        light.map(|l| {
            let l: f64 = l.max(1e-3);
            -libm::log10(if self.rendition == Rendition::Raw { l } else { tone_curve(l) })
        })
    }

    /// Returns the red and the blue absorbance over the green one, for dyes of an absorbance in the green channel, and
    /// the factor on the amounts for that absorbance.
    fn ratios(&self, amounts: &Amounts, green: f64) -> ([f64; 2], f64) {
        let mut factor = 1.0;
        let mut found = [0.0; 3];
        for _ in 0..12 {
            found = self.absorbances(&amounts.map(|amount| factor * amount));
            factor *= (green / found[1].max(1e-6)).clamp(0.1, 10.0);
        }
        ([found[0] / green, found[2] / green], factor)
    }

    /// Returns dyes whose ratios differ by `change`, by the amounts of two of them. Amounts that the ratios hardly
    /// determine stay near their values: Gauss–Newton with a quadratic penalty on the logarithms of the factors.
    fn shifted(&self, dyes: &DyeAmounts, minor: [usize; 2], green: f64, change: [f64; 2]) -> DyeAmounts {
        const ROUNDS: usize = 40;
        /// Variance of a measured ratio over that of the logarithm of a factor on an amount.
        const PENALTY: f64 = 0.002;
        const LEAST: f64 = 0.01;
        const MOST: f64 = 20.0;
        let mut amounts = dyes.amounts();
        minor.into_iter().for_each(|dye| amounts[dye] = amounts[dye].max(LEAST));
        let first = amounts;
        let (start, factor) = self.ratios(&amounts, green);
        let goal = [start[0] + change[0], start[1] + change[1]];
        let moved = |amounts: &Amounts, dye: usize, by: f64| {
            let mut moved = *amounts;
            moved[dye] = (moved[dye] * libm::exp(by)).clamp(LEAST, MOST);
            moved
        };
        for _ in 0..ROUNDS {
            let (now, _) = self.ratios(&amounts, green);
            let off = [goal[0] - now[0], goal[1] - now[1]];
            let slope = minor.map(|dye| {
                const STEP: f64 = 1e-3;
                let (then, _) = self.ratios(&moved(&amounts, dye, STEP), green);
                [(then[0] - now[0]) / STEP, (then[1] - now[1]) / STEP]
            });
            let product = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
            let [a, d] = slope.map(|s| product(s, s) + PENALTY);
            let b = product(slope[0], slope[1]);
            let away = minor.map(|dye| libm::log(amounts[dye] / first[dye]));
            let [p, q] = [0, 1].map(|i| product(slope[i], off) - PENALTY * away[i]);
            let determinant = a * d - b * b;
            let step = [(d * p - b * q) / determinant, (a * q - b * p) / determinant];
            for (dye, by) in minor.into_iter().zip(step) {
                amounts = moved(&amounts, dye, by.clamp(-0.5, 0.5));
            }
        }
        let (_, after) = self.ratios(&amounts, green);
        let [haematein, eosin_y, light_green, orange_g, neutral] =
            amounts.map(|amount| rounded_to(amount * after / factor, 4).clamp(0.0, 100.0));
        DyeAmounts { haematein, eosin_y, light_green, orange_g, neutral }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colour() -> Recipe {
        Recipe { light: LightSection::Colour(papsynth::recipe::Colour::default()), ..Recipe::default() }
    }

    #[test]
    fn dyes_get_the_hues_that_are_asked_for() {
        let camera = Channels { colour: Colour::new(&ColourParams::default()).unwrap(), rendition: Rendition::Display };
        for change in [[0.0, 0.0], [0.1, -0.05], [-0.08, 0.1]] {
            let mut recipe = colour();
            let before = recipe.stain.clone();
            let mut wanted = [0.0; HUES.len()];
            (2..6).for_each(|i| wanted[i] = change[i % 2]);
            correct(&mut recipe, &wanted, &[0.0; HUES.len()]);
            for (new, old) in
                [(&recipe.stain.cyanophilic, &before.cyanophilic), (&recipe.stain.eosinophilic, &before.eosinophilic)]
            {
                let [(new, grown), (old, _)] = [new, old].map(|dyes| camera.ratios(&dyes.amounts(), 0.15));
                for i in 0..2 {
                    assert!((new[i] - old[i] - change[i]).abs() < 0.03, "{change:?}: {old:?} {new:?}");
                }
                assert!(grown > 0.0);
            }
            assert_eq!(recipe.stain.nucleus, before.nucleus);
        }
    }

    #[test]
    fn unknown_hues_and_grey_recipes_change_nothing() {
        let unknown = [f64::NAN; HUES.len()];
        for start in [colour(), Recipe::default()] {
            let mut recipe = start.clone();
            correct(&mut recipe, &unknown, &[0.5; HUES.len()]);
            assert_eq!(recipe, start);
        }
        let mut grey = Recipe::default();
        correct(&mut grey, &[0.9; HUES.len()], &[0.5; HUES.len()]);
        assert_eq!(grey, Recipe::default());
    }

    #[test]
    fn the_border_lies_between_two_groups() {
        let values = (0..200).map(|i| if i % 4 == 0 { 0.2 } else { 1.1 } + 0.001 * f64::from(i % 7)).collect();
        let found = border(values);
        assert!((0.4..0.9).contains(&found), "{found}");
    }
}

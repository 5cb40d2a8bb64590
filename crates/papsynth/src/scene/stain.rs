//! The stain of slides, fields and cells: its strength, and the balance of its dyes.

use dye_spectra::{Amounts, DYES};
use rand_core::Rng;

use crate::key::Key;
use crate::random;
use crate::recipe::dyes::DyeAmounts;
use crate::recipe::number::Number;
use crate::recipe::section::named;
use crate::recipe::specimen::{Stain, TintMix};

use super::cell::Tint;
use super::imaging::SceneDyes;
use super::view::FieldNumbers;

/// The stain of a field.
pub(crate) struct FieldStain<'a> {
    stain: &'a Stain,
    /// Factor on the absorbance of cytoplasm.
    pub(super) cytoplasm: f64,
    /// Factor on the absorbance of nuclei.
    pub(crate) nucleus: f64,
    /// Factor on the contrast of the texture inside nuclei.
    pub(super) texture: f64,
    /// Deviation of the texture of cytoplasm from its mean strength, standard deviations between fields.
    pub(super) cytoplasm_texture: f64,
    /// The kind of that texture in the field: a position in the list of kinds, weighted, 0 to 1.
    pub(super) kind_of_texture: f64,
    /// Factors on the standard deviations between the cells of a class: of the absorbance of cytoplasm, and of the
    /// absorbance and texture of nuclei.
    pub(super) cytoplasm_variation: f64,
    pub(super) nucleus_variation: f64,
    /// Factor on the standard deviations of the strength of the texture of cytoplasm between cells and between fields.
    pub(super) texture_variation: f64,
    /// Factors on the amounts of dyes.
    balance: Amounts,
}

impl<'a> FieldStain<'a> {
    pub(super) fn draw(stain: &'a Stain, field: &FieldNumbers, slide: u64) -> Self {
        Self::of(stain, field, &FieldNumbers { key: Key { index: slide, ..field.key } })
    }

    /// Returns the stain of a whole slide.
    pub(super) fn of_slide(stain: &'a Stain, slide: &FieldNumbers) -> Self {
        Self::of(stain, slide, slide)
    }

    fn of(stain: &'a Stain, field: &FieldNumbers, slide: &FieldNumbers) -> Self {
        let of_slide = |(name, number): (&str, &Number)| number.draw(&mut slide.key.stream("slide", 0, name));
        let mut balance = [1.0; DYES];
        let mut shift = |sd: f64, rng: &mut crate::key::Stream| {
            for factor in &mut balance {
                *factor *= libm::exp(sd * random::normal(rng));
            }
        };
        shift(of_slide(named!("stain", stain.slide_balance)), &mut slide.key.stream("slide", 0, "stain.balance"));
        shift(field.draw(named!("stain", stain.field_balance)), &mut field.key.stream("field", 0, "stain.balance"));
        Self {
            stain,
            cytoplasm: of_slide(named!("stain", stain.slide_cytoplasm))
                * field.draw(named!("stain", stain.field_cytoplasm)),
            nucleus: of_slide(named!("stain", stain.slide_nucleus)) * field.draw(named!("stain", stain.field_nucleus)),
            texture: field.draw(named!("stain", stain.field_texture)),
            cytoplasm_texture: random::normal(&mut field.key.stream("field", 0, "strength of texture")),
            kind_of_texture: random::uniform(&mut field.key.stream("field", 0, "kind of texture")),
            cytoplasm_variation: field.draw(named!("stain", stain.cytoplasm_variation)),
            nucleus_variation: field.draw(named!("stain", stain.nucleus_variation)),
            texture_variation: field.draw(named!("stain", stain.texture_variation)),
            balance,
        }
    }

    /// Returns the dyes of debris.
    pub(super) fn debris(&self) -> SceneDyes {
        let stain = self.stain;
        SceneDyes {
            nucleus: self.balanced(&stain.nucleus),
            bacillus: self.balanced(&stain.bacillus),
            // Grey is not part of the stain.
            speckle: stain.speckle.amounts(),
        }
    }

    /// Returns the dyes of pale cytoplasm.
    pub(crate) fn cyanophilic(&self) -> Amounts {
        self.balanced(&self.stain.cyanophilic)
    }

    /// Returns the tint of a cell, and the dyes of its cytoplasm and its nucleus.
    pub(super) fn cell<R: Rng + ?Sized>(&self, tints: &TintMix, rng: &mut R) -> (Tint, Amounts, Amounts) {
        let stain = self.stain;
        let weights = [&tints.cyanophilic, &tints.eosinophilic, &tints.orangeophilic].map(|weight| weight.draw(rng));
        let at = random::uniform(rng) * weights.iter().sum::<f64>();
        let (tint, dyes) = if at < weights[0] || weights[1] + weights[2] == 0.0 {
            (Tint::Cyanophilic, &stain.cyanophilic)
        } else if at < weights[0] + weights[1] || weights[2] == 0.0 {
            (Tint::Eosinophilic, &stain.eosinophilic)
        } else {
            (Tint::Orangeophilic, &stain.orangeophilic)
        };
        let sd = stain.cell_balance.draw(rng);
        let mut shifted =
            |dyes: &DyeAmounts| self.balanced(dyes).map(|amount| amount * libm::exp(sd * random::normal(rng)));
        (tint, shifted(dyes), shifted(&stain.nucleus))
    }

    /// Returns dyes with the balance of this field.
    pub(crate) fn balanced(&self, dyes: &DyeAmounts) -> Amounts {
        let mut amounts = dyes.amounts();
        for (amount, factor) in amounts.iter_mut().zip(&self.balance) {
            *amount *= factor;
        }
        amounts
    }
}

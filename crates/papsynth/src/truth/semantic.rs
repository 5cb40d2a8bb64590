//! Classes for semantic segmentation: nuclei, objects that look like nuclei, and nuclei that cannot be seen.

use super::labels::paint;
use super::object::{ObjectTruth, Truth};
use super::part::Part;
use super::traits::Trait;
use crate::debris::ObjectKind;
use crate::words::words;

/// Value of ignored pixels in semantic label images, as in PASCAL VOC: losses are computed without them
/// (`ignore_index=255`).
pub const IGNORED: u8 = 255;

/// Default minimum of the best detectability of nuclei and mimics that training should not ignore.
///
/// In focus stacks of ±16 µm with the presets `lbc` and `dense`, the contrast of a nucleus to its own cytoplasm was
/// compared with the standard deviation of this cytoplasm (3144 nuclei and planes). The contrast is smaller for two
/// thirds of the nuclei with a detectability of 8 to 15, for half of those with 15 to 20, and for a fourteenth of those
/// with 30 to 50. Detectability is relative to the noise of the camera, so other cameras may need another minimum.
pub const MIN_DETECTABILITY: f64 = 15.0;

words! {
    /// Class of an object in semantic segmentation. A pixel of several objects has the last of their classes in this
    /// order, for any depth.
    #[derive(PartialOrd, Ord, Hash)]
    pub enum SemanticClass {
        /// No object.
        Background = "background",
        /// Cytoplasm of a cell without a fold.
        Cytoplasm = "cytoplasm",
        /// Complete cytoplasm of a cell with a fold: one with the trait `flap`, `rolled` or `folded`.
        FoldedCytoplasm = "folded-cytoplasm",
        /// Objects that neither are nuclei nor belong to the other classes: bacteria, red cells, specks, fibres, ….
        Debris = "debris",
        /// Amorphous debris and mucus: clumps, shreds of cytoplasm, strands.
        Shred = "shred",
        /// Leukocytes with their cytoplasm and remains. Those with a pyknotic nucleus have the trait `pyknotic`.
        Leukocyte = "leukocyte",
        /// Nuclei without cytoplasm.
        BareNucleus = "bare-nucleus",
        /// Nuclei of epithelial cells, also pyknotic ones.
        Nucleus = "nucleus",
    }
}

impl SemanticClass {
    /// Returns the number of the class in semantic label images: its position in [`ALL`](Self::ALL).
    #[must_use]
    pub fn number(self) -> u8 {
        self as u8
    }

    /// Whether objects of the class are mimics of nuclei: shreds, leukocytes and bare nuclei.
    #[must_use]
    pub fn is_mimic(self) -> bool {
        matches!(self, Self::Shred | Self::Leukocyte | Self::BareNucleus)
    }
}

impl ObjectTruth {
    /// Returns the class in semantic segmentation.
    #[must_use]
    pub fn semantic_class(&self) -> SemanticClass {
        let is_folded = || [Trait::Flap, Trait::Rolled, Trait::Folded].into_iter().any(|one| self.traits.contains(one));
        match (self.part, self.kind) {
            (Part::Nucleus, _) => SemanticClass::Nucleus,
            (Part::Cytoplasm, _) if is_folded() => SemanticClass::FoldedCytoplasm,
            (Part::Cytoplasm, _) => SemanticClass::Cytoplasm,
            (Part::Whole, ObjectKind::BareNucleus) => SemanticClass::BareNucleus,
            (Part::Whole, ObjectKind::Leukocyte) => SemanticClass::Leukocyte,
            (Part::Whole, ObjectKind::Smudge | ObjectKind::Mucus) => SemanticClass::Shred,
            (Part::Whole, _) => SemanticClass::Debris,
        }
    }

    /// Whether training should ignore the object: a nucleus or a mimic whose best detectability is below
    /// `min_detectability`. At 0, no object is ignored.
    #[must_use]
    pub fn is_ignored(&self, min_detectability: f64) -> bool {
        let class = self.semantic_class();
        let is_faint = |best: f64| min_detectability > 0.0 && best < min_detectability;
        (class == SemanticClass::Nucleus || class.is_mimic()) && self.best_detectability().is_some_and(is_faint)
    }
}

impl Truth {
    /// Returns the semantic class of each pixel, row by row: the [number](SemanticClass::number) of the last class of
    /// the complete masks that have the pixel, or [`IGNORED`].
    ///
    /// Objects of classes that are not in `classes` are left out. A pixel of an [ignored](ObjectTruth::is_ignored)
    /// object is ignored, unless it also belongs to another nucleus or mimic.
    ///
    /// # Panics
    /// If a mask extends beyond the image.
    #[must_use]
    pub fn semantic(&self, classes: &[SemanticClass], min_detectability: f64) -> Vec<u8> {
        let mut painted: Vec<(SemanticClass, bool, &ObjectTruth)> = self
            .objects
            .iter()
            .map(|object| (object.semantic_class(), object))
            .filter(|(class, _)| classes.contains(class))
            .map(|(class, object)| match object.is_ignored(min_detectability) {
                // Between the other classes and those of nuclei and mimics.
                true => (SemanticClass::Debris, true, object),
                false => (class, false, object),
            })
            .collect();
        painted.sort_by_key(|(class, is_ignored, _)| (*class, *is_ignored));
        let mut pixels = vec![SemanticClass::Background.number(); self.width * self.height];
        for (class, is_ignored, object) in painted {
            let value = if is_ignored { IGNORED } else { class.number() };
            paint(&object.amodal, self.width, &mut pixels, |pixel| *pixel = value);
        }
        pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::Key;
    use crate::model::Model;
    use crate::recipe::Preset;
    use crate::{Engine, Inputs};

    /// Returns the ground truth of a small field with many leukocytes, and with detectabilities from 0 to 9.
    fn truth() -> Truth {
        let mut recipe = Preset::Lbc.recipe();
        (recipe.field.width_px, recipe.field.height_px) = (400.0.into(), 300.0.into());
        recipe.cells.values_mut().for_each(|mix| mix.count = 2.0.into());
        recipe.debris.leukocytes.clusters = 12.into();
        recipe.debris.bare_nuclei.count = 4.into();
        let engine = Engine::new(&recipe, &Model::builtin(), &Inputs::default()).unwrap();
        let mut truth = engine.frame(Key { seed: 5, index: 2 }).unwrap().finished.truth;
        for (number, object) in truth.objects.iter_mut().enumerate() {
            object.detectability = vec![0.0, (7 * number % 10) as f64];
        }
        truth
    }

    /// Reference: for each pixel the objects that cover it.
    fn slow(truth: &Truth, classes: &[SemanticClass], min_detectability: f64) -> Vec<u8> {
        let masks: Vec<Vec<bool>> = truth
            .objects
            .iter()
            .map(|object| {
                let mut inside = vec![false; truth.width * truth.height];
                object.amodal.pixels(truth.width).for_each(|pixel| inside[pixel] = true);
                inside
            })
            .collect();
        let is_due = |class: SemanticClass| class == SemanticClass::Nucleus || class.is_mimic();
        (0..truth.width * truth.height)
            .map(|pixel| {
                let here = || {
                    let all = truth.objects.iter().zip(&masks).filter(|(_, mask)| mask[pixel]);
                    all.map(|(object, _)| (object.semantic_class(), object))
                        .filter(|(class, _)| classes.contains(class))
                };
                let faint = |object: &ObjectTruth| object.detectability[1] < min_detectability;
                let seen = here().filter(|(class, object)| !is_due(*class) || !faint(object)).map(|(class, _)| class);
                let last = seen.max().unwrap_or(SemanticClass::Background);
                let ignored = here().any(|(class, object)| is_due(class) && faint(object));
                if ignored && !is_due(last) { IGNORED } else { last.number() }
            })
            .collect()
    }

    #[test]
    fn pixels_have_the_last_class_of_their_objects_or_are_ignored() {
        let truth = truth();
        let some = [SemanticClass::Nucleus, SemanticClass::Leukocyte, SemanticClass::Cytoplasm];
        for (classes, least) in
            [(&SemanticClass::ALL[..], 0.0), (&SemanticClass::ALL, 4.0), (&some, 8.0), (&some, 20.0)]
        {
            let pixels = truth.semantic(classes, least);
            assert_eq!(pixels, slow(&truth, classes, least), "{classes:?} {least}");
            assert_eq!(pixels.contains(&IGNORED), least > 0.0, "{classes:?} {least}");
            assert_eq!(pixels.contains(&SemanticClass::Nucleus.number()), least < 10.0, "{classes:?} {least}");
        }
    }

    #[test]
    fn classes_follow_part_kind_and_traits() {
        let mut object = truth().objects.swap_remove(0);
        for (part, kind, traits, expected) in [
            (Part::Nucleus, ObjectKind::Cell, "flap;pyknotic", SemanticClass::Nucleus),
            (Part::Cytoplasm, ObjectKind::Cell, "pyknotic", SemanticClass::Cytoplasm),
            (Part::Cytoplasm, ObjectKind::Cell, "rolled;granular", SemanticClass::FoldedCytoplasm),
            (Part::Whole, ObjectKind::Leukocyte, "pyknotic;degenerated", SemanticClass::Leukocyte),
            (Part::Whole, ObjectKind::BareNucleus, "", SemanticClass::BareNucleus),
            (Part::Whole, ObjectKind::Smudge, "", SemanticClass::Shred),
            (Part::Whole, ObjectKind::Mucus, "", SemanticClass::Shred),
            (Part::Whole, ObjectKind::RedCell, "ghost", SemanticClass::Debris),
        ] {
            (object.part, object.kind) = (part, kind);
            object.traits = traits.to_owned().try_into().unwrap();
            assert_eq!(object.semantic_class(), expected);
            object.detectability = vec![0.5, 2.0, 1.0];
            let can_be_ignored = expected.is_mimic() || expected == SemanticClass::Nucleus;
            let ignored = [0.0, 2.0, 2.1].map(|least| object.is_ignored(least));
            assert_eq!(ignored, [false, false, can_be_ignored], "{expected:?}");
        }
        assert_eq!(SemanticClass::ALL.map(SemanticClass::number), [0, 1, 2, 3, 4, 5, 6, 7]);
    }
}

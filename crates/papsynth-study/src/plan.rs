//! The plan of a study: the patches of each trial.

use std::path::Path;

use papsynth_dataset::read::Limits;
use portable_numerics::random::shuffle;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::design::{Grey, Side, Stage, StudyParams, order};
use crate::error::Error;
use crate::fields::{Field, Frame, Root, bytes};
use crate::grey_image::{self, GreyImage, Places, Raw};
use crate::key::{Key, hex};
use crate::parameters::{Objects, Parameters, varied};

/// Relative difference below which pixel sizes count as equal.
const SAME_PIXEL: f64 = 0.005;

/// Level of the glass with [`Grey::Glass`]: bright, with a margin to white for specks and noise.
const GLASS_LEVEL: f32 = 230.0;

/// Bits of grey levels of common cameras.
const BITS: [u32; 5] = [8, 10, 12, 14, 16];

/// Placeholder for a full scale until all fields are read.
const UNKNOWN: f32 = 0.0;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FieldRecord {
    pub(crate) side: Side,
    pub(crate) name: String,
    /// SHA-256 of its file, hexadecimal.
    pub(crate) sha256: String,
    /// Full scale of its camera, grey levels.
    pub(crate) full_scale: f32,
    pub(crate) glass: f32,
    /// Width of a shown pixel in pixels of the file.
    pub(crate) reduce: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Patch {
    pub(crate) side: Side,
    pub(crate) field: usize,
    /// Left border, in shown pixels.
    pub(crate) x_px: usize,
    pub(crate) y_px: usize,
    pub(crate) parameters: Parameters,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Trial {
    pub(crate) stage: Stage,
    /// One patch, or two from left to right.
    pub(crate) patches: Vec<Patch>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Plan {
    pub(crate) fields: Vec<FieldRecord>,
    pub(crate) trials: Vec<Trial>,
    /// Notes for the results.
    pub(crate) notes: Vec<String>,
}

/// The two given folders, in the order of [`Side::ALL`].
pub(crate) struct Folders {
    roots: [Root; 2],
    fields: [Vec<Field>; 2],
}

impl Folders {
    pub(crate) fn new(real: &Path, synthetic: &Path) -> Result<Self, Error> {
        let roots = [Root::new(real)?, Root::new(synthetic)?];
        let fields = [roots[0].fields()?, roots[1].fields()?];
        Ok(Self { roots, fields })
    }
}

impl Plan {
    /// Draws a plan. Fields depend only on the seed, so that they are the same for all subjects; patches, order and
    /// noise also depend on the subject.
    pub(crate) fn draw(params: &StudyParams, folders: &Folders) -> Result<Self, Error> {
        let mut notes = Vec::new();
        let chosen = choose(params, folders, &mut notes);
        let hashes = chosen.iter().map(|(_, field)| hash(field)).collect::<Result<Vec<_>, _>>()?;
        let key = Key::new(params.seed, &params.subject, hashes.iter());
        let orders = order(params, &mut key.stream("order", 0));
        let needed = Side::ALL.map(|side| orders.iter().flat_map(|(_, sides)| sides).filter(|s| **s == side).count());
        let reduce = reductions(params, &chosen, &mut notes);
        let (fields, places) = survey(params, &chosen, hashes, &reduce, needed, &key)?;

        let mut patches_of = [Vec::new(), Vec::new()];
        for side in Side::ALL {
            let (drawn, needed) = (&mut patches_of[side as usize], needed[side as usize]);
            let mut turns: Vec<usize> = (0..fields.len()).filter(|index| fields[*index].side == side).collect();
            shuffle(&mut turns, &mut key.stream("turns", side as usize));
            *drawn = take_in_turn(&turns, &places, needed);
            if drawn.len() < needed {
                let (side, fields, found) = (side.name(), turns.len(), drawn.len());
                return Err(Error::Refused(format!(
                    "{side}: found {found} of {needed} patches with cells and little overlap (fields: {fields}); use more or \
                     larger fields, fewer trials or smaller patches"
                )));
            }
            shuffle(drawn, &mut key.stream("patches", side as usize));
        }
        let known = field_parameters(folders, &chosen, &mut notes);
        let mut patch = |side: Side| {
            let (field, [x_px, y_px]) = patches_of[side as usize].pop()?;
            let reduce = fields[field].reduce;
            let (mut parameters, objects) = (known[field].0.clone(), &known[field].1);
            if let Some((frame, objects)) = objects {
                let place = [x_px, y_px].map(|at| at as f64 * reduce);
                parameters.extend(objects.of_patch(frame, place, params.patch_px as f64 * reduce));
            }
            Some(Patch { side, field, x_px, y_px, parameters })
        };
        let mut trial = |(stage, sides): (Stage, Vec<Side>)| Trial {
            stage,
            patches: sides.into_iter().filter_map(&mut patch).collect(),
        };
        let trials = orders.into_iter().map(&mut trial).collect();
        Ok(Self { fields, trials, notes })
    }

    /// Returns the key of the random streams of this plan.
    pub(crate) fn key(&self, params: &StudyParams) -> Key {
        Key::new(params.seed, &params.subject, self.fields.iter().map(|field| &field.sha256))
    }

    /// Returns the PNG files of the patches: one or two for each trial.
    pub(crate) fn patches(&self, params: &StudyParams, folders: &Folders) -> Result<Vec<Vec<Vec<u8>>>, Error> {
        let key = self.key(params);
        let mut shown: Vec<Vec<Vec<u8>>> =
            self.trials.iter().map(|trial| vec![Vec::new(); trial.patches.len()]).collect();
        // One field at a time is in memory.
        for (index, record) in self.fields.iter().enumerate() {
            let image = record.shown_image(params, folders)?;
            for (number, trial) in self.trials.iter().enumerate() {
                for (slot, patch) in trial.patches.iter().enumerate().filter(|(_, patch)| patch.field == index) {
                    let levels = image.square([patch.x_px, patch.y_px], params.patch_px);
                    let levels = levels.ok_or_else(|| record.changed(folders))?;
                    let mut rng = key.stream("noise", patch_number(number, slot));
                    shown[number][slot] =
                        grey_image::png(&grey_image::noisy(&levels, params.noise_dn, &mut rng), params.patch_px);
                }
            }
        }
        Ok(shown)
    }

    /// Returns the name of a patch for requests: a hash of its position in the study, independent of its content.
    pub(crate) fn patch_name(&self, key: &Key, trial: usize, slot: usize) -> String {
        key.name("patch", patch_number(trial, slot))
    }
}

/// Returns a unique number for each position in the study.
fn patch_number(trial: usize, slot: usize) -> usize {
    2 * trial + slot
}

impl FieldRecord {
    /// Returns the field as shown, before noise.
    fn shown_image(&self, params: &StudyParams, folders: &Folders) -> Result<GreyImage, Error> {
        let field = folders.fields[self.side as usize].iter().find(|field| field.name == self.name);
        let raw = Raw::read(field.ok_or_else(|| self.changed(folders))?)?;
        if hex(&Sha256::digest(&raw.bytes)) != self.sha256 {
            return Err(self.changed(folders));
        }
        let mut image = raw.image.reduced(self.reduce);
        let scale = match params.grey {
            Grey::AsIs => full_scale(8) / self.full_scale,
            Grey::Glass => GLASS_LEVEL / self.glass,
        };
        image.levels.iter_mut().for_each(|level| *level *= scale);
        Ok(image)
    }

    fn changed(&self, folders: &Folders) -> Error {
        let what = "was changed after this study started; use another --subject to start a new study";
        Error::folder(&folders.roots[self.side as usize].given.join(&self.name), what)
    }
}

/// Returns the full scale of a number of bits.
fn full_scale(bits: u32) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "at most 24 bits")]
    let white = ((1_u32 << bits.clamp(1, 24)) - 1) as f32;
    white
}

fn hash(field: &Field) -> Result<String, Error> {
    Ok(hex(&Sha256::digest(bytes(&field.path, Limits::default().max_file_bytes)?)))
}

/// Selects the shown fields: at most the given number of real and synthetic ones.
fn choose<'a>(params: &StudyParams, folders: &'a Folders, notes: &mut Vec<String>) -> Vec<(Side, &'a Field)> {
    let mut chosen = Vec::new();
    for side in Side::ALL {
        let all = &folders.fields[side as usize];
        let key = Key::new(params.seed, "", all.iter().map(|field| field.name.as_bytes()));
        let mut indices: Vec<usize> = (0..all.len()).collect();
        shuffle(&mut indices, &mut key.stream("fields", side as usize));
        indices.truncate(params.fields);
        indices.sort_unstable();
        if all.len() < params.fields {
            let (name, count, wanted) = (side.name(), all.len(), params.fields);
            notes.push(format!("{name}: found {count} of {wanted} fields; all are used"));
        }
        chosen.extend(indices.into_iter().map(|index| (side, &all[index])));
    }
    chosen
}

/// Reads every field: its record, and positions of patches.
fn survey(
    params: &StudyParams,
    chosen: &[(Side, &Field)],
    hashes: Vec<String>,
    reduce: &[f64],
    needed: [usize; 2],
    key: &Key,
) -> Result<(Vec<FieldRecord>, Vec<Places>), Error> {
    let mut fields = Vec::with_capacity(chosen.len());
    let mut places = Vec::with_capacity(chosen.len());
    // Largest level of images with more than 8 bits but unknown full scale, for each side.
    let mut deepest = [0.0_f32; 2];
    for (index, ((side, field), sha256)) in chosen.iter().zip(hashes).enumerate() {
        let raw = Raw::read(field)?;
        let full_scale = match &field.frame {
            Some(frame) => full_scale(frame.summary.bits),
            None if raw.is_deep => UNKNOWN,
            None => full_scale(8),
        };
        if full_scale == UNKNOWN {
            let deepest = &mut deepest[*side as usize];
            *deepest = deepest.max(raw.image.most());
        }
        let image = raw.image.reduced(reduce[index]);
        places.push(image.places(params.patch_px, needed[*side as usize], &mut key.stream("places", index)));
        fields.push(FieldRecord {
            side: *side,
            name: field.name.clone(),
            sha256,
            full_scale,
            // Avoids a division by zero for black images.
            glass: image.glass().max(1.0),
            reduce: reduce[index],
        });
    }
    for field in fields.iter_mut().filter(|field| field.full_scale == UNKNOWN) {
        let most = deepest[field.side as usize];
        field.full_scale = BITS.map(full_scale).into_iter().find(|full| *full >= most).unwrap_or(most);
    }
    Ok((fields, places))
}

/// Returns the factor for each field that gives all fields the largest pixel size.
fn reductions(params: &StudyParams, chosen: &[(Side, &Field)], notes: &mut Vec<String>) -> Vec<f64> {
    let stated = [params.real_pixel_um, params.synthetic_pixel_um];
    let own = |side: Side, field: &Field| {
        stated[side as usize].or_else(|| field.frame.as_ref().map(|frame| frame.summary.pixel_um))
    };
    let sizes: Option<Vec<f64>> = chosen.iter().map(|(side, field)| own(*side, field)).collect();
    let Some(sizes) = sizes else {
        notes.push("not all pixel sizes are known: no field is resampled".to_owned());
        return vec![1.0; chosen.len()];
    };
    let coarsest = sizes.iter().copied().fold(0.0, f64::max);
    let reduce: Vec<f64> =
        sizes.iter().map(|size| if coarsest / size < 1.0 + SAME_PIXEL { 1.0 } else { coarsest / size }).collect();
    for side in Side::ALL {
        let finer = chosen.iter().zip(&reduce).filter(|((own, _), reduce)| *own == side && **reduce > 1.0).count();
        if finer > 0 {
            let side = side.name();
            notes.push(format!("{side}: pixels are resampled to {coarsest} µm in {finer} of the fields"));
        }
    }
    reduce
}

/// Takes patches from the fields in turn, and returns field and position of each.
fn take_in_turn(turns: &[usize], places: &[Places], needed: usize) -> Vec<(usize, [usize; 2])> {
    let rounds = turns.iter().map(|&field| places[field].len()).max().unwrap_or(0);
    let all = (0..rounds)
        .flat_map(|round| turns.iter().filter_map(move |&field| places[field].get(round).map(|place| (field, *place))));
    all.take(needed).collect()
}

/// Reads for each field the differing recipe values and the objects of its data set. They are only needed for the
/// breakdown, so a failure is a note, not an error.
fn field_parameters<'a>(
    folders: &Folders,
    chosen: &[(Side, &'a Field)],
    notes: &mut Vec<String>,
) -> Vec<(Parameters, Option<(&'a Frame, Objects)>)> {
    let mut known = Vec::with_capacity(chosen.len());
    for side in Side::ALL {
        // Real fields come first.
        let fields: Vec<&Field> = chosen.iter().filter(|(own, _)| *own == side).map(|(_, field)| *field).collect();
        for (field, varied) in fields.iter().zip(varied(&fields)) {
            let objects = field.frame.as_ref().and_then(|frame| {
                let found = Objects::read(&folders.roots[side as usize], frame);
                let note = |error: &Error| notes.push(format!("no objects of {}: {error}", field.name));
                found.inspect_err(note).ok().map(|objects| (frame, objects))
            });
            known.push((varied, objects));
        }
    }
    known
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;
    use crate::design::TrialDesign;
    use crate::support::{Scratch, exposed, study_folders, write_image};

    fn params() -> StudyParams {
        StudyParams { trials: 12, patch_px: 48, ..StudyParams::default() }
    }

    #[test]
    fn patches_are_distributed_evenly_and_distinct() {
        let scratch = Scratch::new("plan");
        let folders = study_folders(&scratch, 4, 3);
        let plan = Plan::draw(&params(), &folders).unwrap();
        assert_eq!(plan.trials.len(), 14);
        let mut uses = BTreeMap::new();
        let mut seen = BTreeSet::new();
        for patch in plan.trials.iter().flat_map(|trial| &trial.patches) {
            assert_eq!(plan.fields[patch.field].side, patch.side);
            *uses.entry(patch.field).or_insert(0) += 1;
            assert!(seen.insert((patch.field, patch.x_px, patch.y_px)));
        }
        // Seven patches of each side from four and three fields.
        let counts: Vec<i32> = (0..7).map(|field| uses[&field]).collect();
        assert!(
            counts[..4].iter().all(|n| (1..=2).contains(n)) && counts[4..].iter().all(|n| (2..=3).contains(n)),
            "{counts:?}"
        );
        assert!(plan.notes.iter().any(|note| note.starts_with("real: found 4 of 25 fields")), "{:?}", plan.notes);
    }

    #[test]
    fn plans_depend_on_seed_subject_and_fields() {
        let scratch = Scratch::new("plan-seed");
        let folders = study_folders(&scratch, 3, 3);
        let draw = |params: &StudyParams| Plan::draw(params, &folders).unwrap();
        let first = draw(&params());
        assert_eq!(first, draw(&params()));
        let png = |plan: &Plan| plan.patches(&params(), &folders).unwrap();
        assert_eq!(png(&first), png(&first));
        let sides = |plan: &Plan| plan.trials.iter().map(|trial| trial.patches[0].side).collect::<Vec<_>>();
        let other = StudyParams { subject: "2".to_owned(), ..params() };
        assert_ne!(sides(&first), sides(&draw(&other)));
        assert_ne!(sides(&first), sides(&draw(&StudyParams { seed: 3, ..params() })));
        // The same names with other pixels.
        write_image(&scratch.join("real/f0.png"), 99, [300, 240]);
        let changed = Folders::new(&scratch.join("real"), &scratch.join("synthetic")).unwrap();
        assert_ne!(first, Plan::draw(&params(), &changed).unwrap());
        let error = first.patches(&params(), &changed).unwrap_err().to_string();
        assert!(error.contains("f0.png: was changed after"), "{error}");
    }

    #[test]
    fn fields_are_the_same_for_all_subjects() {
        let scratch = Scratch::new("plan-fields");
        let folders = study_folders(&scratch, 6, 6);
        let few = StudyParams { fields: 3, ..params() };
        let plan = Plan::draw(&few, &folders).unwrap();
        let names = |plan: &Plan| plan.fields.iter().map(|f| (f.side, f.name.clone())).collect::<Vec<_>>();
        assert_eq!(plan.fields.len(), 6);
        let other = StudyParams { subject: "2".to_owned(), ..few.clone() };
        assert_eq!(names(&plan), names(&Plan::draw(&other, &folders).unwrap()));
        assert_ne!(names(&plan), names(&Plan::draw(&StudyParams { seed: 1, ..few }, &folders).unwrap()));
        assert!(!plan.notes.iter().any(|note| note.contains("fields; all are used")));
    }

    #[test]
    fn two_alternatives_show_one_of_each_side() {
        let scratch = Scratch::new("plan-2afc");
        let folders = study_folders(&scratch, 4, 4);
        let pairs = StudyParams { task: TrialDesign::TwoAlternatives, ..params() };
        let plan = Plan::draw(&pairs, &folders).unwrap();
        for Trial { patches, .. } in &plan.trials {
            assert!(patches.len() == 2 && patches[0].side != patches[1].side);
        }
        let key = plan.key(&pairs);
        let names: BTreeSet<String> = (0..14).flat_map(|t| [0, 1].map(|slot| plan.patch_name(&key, t, slot))).collect();
        assert_eq!(names.len(), 28);
    }

    #[test]
    fn too_few_patches_are_an_error() {
        let scratch = Scratch::new("plan-few");
        let folders = study_folders(&scratch, 1, 1);
        let error = Plan::draw(&StudyParams { trials: 2000, ..params() }, &folders).unwrap_err();
        let error = error.to_string();
        assert!(error.starts_with("real: found ") && error.contains(" of 1001 patches"), "{error}");
        let error = Plan::draw(&StudyParams { patch_px: 1024, ..params() }, &folders).unwrap_err();
        assert!(error.to_string().contains("found 0 of "), "{error}");
    }

    #[test]
    fn finer_images_are_resampled_if_all_sizes_are_known() {
        let scratch = Scratch::new("plan-pixel");
        let folders = study_folders(&scratch, 2, 2);
        let few = StudyParams { trials: 4, ..params() };
        let both = StudyParams { real_pixel_um: Some(0.33), synthetic_pixel_um: Some(0.25), ..few.clone() };
        let plan = Plan::draw(&both, &folders).unwrap();
        for field in &plan.fields {
            let wanted = if field.side == Side::Real { 1.0 } else { 0.33 / 0.25 };
            assert_eq!(field.reduce, wanted);
        }
        let told = "synthetic: pixels are resampled to 0.33 µm in 2 of the fields";
        assert!(plan.notes.iter().any(|note| note == told), "{:?}", plan.notes);
        plan.patches(&both, &folders).unwrap();
        let one = StudyParams { real_pixel_um: Some(0.33), ..few };
        assert!(Plan::draw(&one, &folders).unwrap().fields.iter().all(|field| field.reduce == 1.0));
    }

    #[test]
    fn glass_removes_differences_of_exposure_and_as_is_keeps_them() {
        let scratch = Scratch::new("plan-grey");
        let folders = study_folders(&scratch, 2, 2);
        let mean = |grey: Grey, dark: bool| {
            let params = StudyParams { grey, noise_dn: 0.0, trials: 4, ..params() };
            let plan = Plan::draw(&params, &folders).unwrap();
            let image = plan.fields[if dark { 0 } else { 2 }].shown_image(&params, &folders).unwrap();
            image.glass()
        };
        // The real test fields have a darker exposure.
        assert!((mean(Grey::Glass, true) - 230.0).abs() < 1.0 && (mean(Grey::Glass, false) - 230.0).abs() < 1.0);
        assert!(mean(Grey::AsIs, false) - mean(Grey::AsIs, true) > 10.0);
    }

    #[test]
    fn images_with_more_than_8_bits_are_scaled_by_their_camera() {
        assert_eq!([8, 12, 16].map(full_scale), [255.0, 4095.0, 65535.0]);
        let scratch = Scratch::new("plan-deep");
        exposed(&scratch.join("real/a.png"), 1, [300, 240], 3500, 16);
        exposed(&scratch.join("real/b.png"), 1, [300, 240], 900, 16);
        write_image(&scratch.join("synthetic/a.png"), 1, [300, 240]);
        let folders = Folders::new(&scratch.join("real"), &scratch.join("synthetic")).unwrap();
        let plan = Plan::draw(&StudyParams { trials: 4, ..params() }, &folders).unwrap();
        // Both fit into 12 bits.
        assert_eq!(plan.fields.iter().map(|field| field.full_scale).collect::<Vec<_>>(), [4095.0, 4095.0, 255.0]);
    }
}

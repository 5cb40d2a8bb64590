//! Which patch is shown in which trial, and the patches themselves.

use std::path::Path;

use papsynth_dataset::read::Limits;
use portable_numerics::random::shuffle;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::design::{Grey, Side, Stage, StudyParams, order};
use crate::error::Error;
use crate::fields::{Field, Frame, Root, bytes};
use crate::key::{Key, hex};
use crate::parameters::{Objects, Parameters, varied};
use crate::picture::{self, Picture, Places, Raw};

/// Pixel sizes that differ by less than this part are the same.
const SAME_PIXEL: f64 = 0.005;

/// The level that bright glass becomes with [`Grey::Glass`]: bright, and far enough from white for light specks and noise.
const GLASS_LEVEL: f32 = 230.0;

/// Bits of a grey level that cameras have.
const BITS: [u32; 5] = [8, 10, 12, 14, 16];

/// Stands for a full scale until all fields of the side have been seen.
const UNKNOWN: f32 = 0.0;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FieldRecord {
    pub(crate) side: Side,
    pub(crate) name: String,
    /// Of its file, hexadecimal.
    pub(crate) sha256: String,
    /// The level of white of its camera.
    pub(crate) full_scale: f32,
    pub(crate) glass: f32,
    /// How many of its pixels go on the length of one that is shown.
    pub(crate) reduce: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Patch {
    pub(crate) side: Side,
    pub(crate) field: usize,
    /// Left, in pixels as they are shown.
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
    /// What whoever reads the results should know.
    pub(crate) notes: Vec<String>,
}

/// The two folders that were given, in the order of [`Side::ALL`].
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
    /// Draws a study: fields by the seed alone, so that all subjects see the same ones; patches, order and noise by the subject,
    /// too.
    pub(crate) fn draw(params: &StudyParams, folders: &Folders) -> Result<Self, Error> {
        let mut notes = Vec::new();
        let chosen = choose(params, folders, &mut notes);
        let hashes = chosen.iter().map(|(_, field)| hash(field)).collect::<Result<Vec<_>, _>>()?;
        let key = Key::new(params.seed, &params.subject, hashes.iter());
        let orders = order(params, &mut key.stream("order", 0));
        let needed = Side::ALL.map(|side| orders.iter().flat_map(|(_, sides)| sides).filter(|s| **s == side).count());
        let reduce = reductions(params, &chosen, &mut notes);
        let (fields, places) = survey(params, &chosen, hashes, &reduce, needed, &key)?;

        let mut hands = [Vec::new(), Vec::new()];
        for side in Side::ALL {
            let (hand, needed) = (&mut hands[side as usize], needed[side as usize]);
            let mut turns: Vec<usize> = (0..fields.len()).filter(|index| fields[*index].side == side).collect();
            shuffle(&mut turns, &mut key.stream("turns", side as usize));
            *hand = deal(&turns, &places, needed);
            if hand.len() < needed {
                let (side, fields, found) = (side.name(), turns.len(), hand.len());
                return Err(Error::Refused(format!(
                    "{side}: {fields} fields give {found} patches with something on them that do not overlap much, \
                     {needed} are needed; expected more or larger fields, fewer trials or smaller patches"
                )));
            }
            shuffle(hand, &mut key.stream("patches", side as usize));
        }
        let known = known(folders, &chosen, &mut notes);
        let mut patch = |side: Side| {
            let (field, [x_px, y_px]) = hands[side as usize].pop()?;
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

    /// What random numbers of this plan hang on.
    pub(crate) fn key(&self, params: &StudyParams) -> Key {
        Key::new(params.seed, &params.subject, self.fields.iter().map(|field| &field.sha256))
    }

    /// The patches as they are sent: for each trial one or two PNG files.
    pub(crate) fn patches(&self, params: &StudyParams, folders: &Folders) -> Result<Vec<Vec<Vec<u8>>>, Error> {
        let key = self.key(params);
        let mut shown: Vec<Vec<Vec<u8>>> =
            self.trials.iter().map(|trial| vec![Vec::new(); trial.patches.len()]).collect();
        // Field by field, since only one is in memory at a time.
        for (index, record) in self.fields.iter().enumerate() {
            let picture = record.picture(params, folders)?;
            for (number, trial) in self.trials.iter().enumerate() {
                for (slot, patch) in trial.patches.iter().enumerate().filter(|(_, patch)| patch.field == index) {
                    let levels = picture.square([patch.x_px, patch.y_px], params.patch_px);
                    let levels = levels.ok_or_else(|| record.changed(folders))?;
                    let mut rng = key.stream("noise", patch_number(number, slot));
                    shown[number][slot] =
                        picture::png(&picture::noisy(&levels, params.noise_dn, &mut rng), params.patch_px);
                }
            }
        }
        Ok(shown)
    }

    /// The name that a patch is asked for by: a hash of its place in the study alone, whatever is on it.
    pub(crate) fn patch_name(&self, key: &Key, trial: usize, slot: usize) -> String {
        key.name("patch", patch_number(trial, slot))
    }
}

/// A number for each place that a patch can be shown at.
fn patch_number(trial: usize, slot: usize) -> usize {
    2 * trial + slot
}

impl FieldRecord {
    /// The field as it is shown, before noise.
    fn picture(&self, params: &StudyParams, folders: &Folders) -> Result<Picture, Error> {
        let field = folders.fields[self.side as usize].iter().find(|field| field.name == self.name);
        let raw = Raw::read(field.ok_or_else(|| self.changed(folders))?)?;
        if hex(&Sha256::digest(&raw.bytes)) != self.sha256 {
            return Err(self.changed(folders));
        }
        let mut picture = raw.picture.reduced(self.reduce);
        let scale = match params.grey {
            Grey::AsIs => full_scale(8) / self.full_scale,
            Grey::Glass => GLASS_LEVEL / self.glass,
        };
        picture.levels.iter_mut().for_each(|level| *level *= scale);
        Ok(picture)
    }

    fn changed(&self, folders: &Folders) -> Error {
        let what = "has changed since the study of this subject began; --subject with another name begins a new one";
        Error::folder(&folders.roots[self.side as usize].given.join(&self.name), what)
    }
}

/// White of so many bits.
fn full_scale(bits: u32) -> f32 {
    #[expect(clippy::cast_precision_loss, reason = "at most 24 bits")]
    let white = ((1_u32 << bits.clamp(1, 24)) - 1) as f32;
    white
}

fn hash(field: &Field) -> Result<String, Error> {
    Ok(hex(&Sha256::digest(bytes(&field.path, Limits::default().max_file_bytes)?)))
}

/// The fields that are shown: as many of each side as are asked for, or all.
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
            notes.push(format!("{name}: {count} of {wanted} fields are there; patches come from these"));
        }
        chosen.extend(indices.into_iter().map(|index| (side, &all[index])));
    }
    chosen
}

/// Looks at every field: what is to be known of it, and where patches may be taken.
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
    // The largest level of each side's pictures of more than 8 bits that do not say how many.
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
            *deepest = deepest.max(raw.picture.most());
        }
        let picture = raw.picture.reduced(reduce[index]);
        places.push(picture.places(params.patch_px, needed[*side as usize], &mut key.stream("places", index)));
        fields.push(FieldRecord {
            side: *side,
            name: field.name.clone(),
            sha256,
            full_scale,
            // Black glass would have no scale.
            glass: picture.glass().max(1.0),
            reduce: reduce[index],
        });
    }
    for field in fields.iter_mut().filter(|field| field.full_scale == UNKNOWN) {
        let most = deepest[field.side as usize];
        field.full_scale = BITS.map(full_scale).into_iter().find(|full| *full >= most).unwrap_or(most);
    }
    Ok((fields, places))
}

/// How much each field is reduced, so that all have pixels of one size: that of the coarsest.
fn reductions(params: &StudyParams, chosen: &[(Side, &Field)], notes: &mut Vec<String>) -> Vec<f64> {
    let stated = [params.real_pixel_um, params.synthetic_pixel_um];
    let own = |side: Side, field: &Field| {
        stated[side as usize].or_else(|| field.frame.as_ref().map(|frame| frame.summary.pixel_um))
    };
    let sizes: Option<Vec<f64>> = chosen.iter().map(|(side, field)| own(*side, field)).collect();
    let Some(sizes) = sizes else {
        notes.push("the size of a pixel is not known of both sides: nothing is resampled".to_owned());
        return vec![1.0; chosen.len()];
    };
    let coarsest = sizes.iter().copied().fold(0.0, f64::max);
    let reduce: Vec<f64> =
        sizes.iter().map(|size| if coarsest / size < 1.0 + SAME_PIXEL { 1.0 } else { coarsest / size }).collect();
    for side in Side::ALL {
        let finer = chosen.iter().zip(&reduce).filter(|((own, _), reduce)| *own == side && **reduce > 1.0).count();
        if finer > 0 {
            notes.push(format!("{}: {finer} fields are resampled to pixels of {coarsest} µm", side.name()));
        }
    }
    reduce
}

/// Patches of the fields in turn, so that all give about as many: for each the field and the place.
fn deal(turns: &[usize], places: &[Places], needed: usize) -> Vec<(usize, [usize; 2])> {
    let rounds = turns.iter().map(|&field| places[field].len()).max().unwrap_or(0);
    let all = (0..rounds)
        .flat_map(|round| turns.iter().filter_map(move |&field| places[field].get(round).map(|place| (field, *place))));
    all.take(needed).collect()
}

/// What data sets know of each field: in what its recipe differs from those of others, and its objects. Without them nothing
/// is missing but the breakdown, so that it is a note and no error.
fn known<'a>(
    folders: &Folders,
    chosen: &[(Side, &'a Field)],
    notes: &mut Vec<String>,
) -> Vec<(Parameters, Option<(&'a Frame, Objects)>)> {
    let mut known = Vec::with_capacity(chosen.len());
    for side in Side::ALL {
        // Real fields were chosen first.
        let fields: Vec<&Field> = chosen.iter().filter(|(own, _)| *own == side).map(|(_, field)| *field).collect();
        for (field, varied) in fields.iter().zip(varied(&fields)) {
            let objects = field.frame.as_ref().and_then(|frame| {
                let found = Objects::read(&folders.roots[side as usize], frame);
                let note = |error: &Error| notes.push(format!("the objects of {} are not known: {error}", field.name));
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
    use crate::design::Task;
    use crate::support::{Scratch, exposed, picture, study_folders};

    fn params() -> StudyParams {
        StudyParams { trials: 12, patch_px: 48, ..StudyParams::default() }
    }

    #[test]
    fn patches_are_dealt_evenly_and_are_all_different() {
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
        // Seven of each side over four and three fields.
        let counts: Vec<i32> = (0..7).map(|field| uses[&field]).collect();
        assert!(
            counts[..4].iter().all(|n| (1..=2).contains(n)) && counts[4..].iter().all(|n| (2..=3).contains(n)),
            "{counts:?}"
        );
        assert!(plan.notes.iter().any(|note| note.starts_with("real: 4 of 25 fields")), "{:?}", plan.notes);
    }

    #[test]
    fn a_seed_a_subject_and_the_fields_decide_everything() {
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
        // The same names, other pixels.
        picture(&scratch.join("real/f0.png"), 99, [300, 240]);
        let changed = Folders::new(&scratch.join("real"), &scratch.join("synthetic")).unwrap();
        assert_ne!(first, Plan::draw(&params(), &changed).unwrap());
        let error = first.patches(&params(), &changed).unwrap_err().to_string();
        assert!(error.contains("f0.png: has changed since"), "{error}");
    }

    #[test]
    fn fields_are_chosen_for_all_subjects_alike() {
        let scratch = Scratch::new("plan-fields");
        let folders = study_folders(&scratch, 6, 6);
        let few = StudyParams { fields: 3, ..params() };
        let plan = Plan::draw(&few, &folders).unwrap();
        let names = |plan: &Plan| plan.fields.iter().map(|f| (f.side, f.name.clone())).collect::<Vec<_>>();
        assert_eq!(plan.fields.len(), 6);
        let other = StudyParams { subject: "2".to_owned(), ..few.clone() };
        assert_eq!(names(&plan), names(&Plan::draw(&other, &folders).unwrap()));
        assert_ne!(names(&plan), names(&Plan::draw(&StudyParams { seed: 1, ..few }, &folders).unwrap()));
        assert!(!plan.notes.iter().any(|note| note.contains("fields are there")));
    }

    #[test]
    fn two_alternatives_show_one_of_each_side() {
        let scratch = Scratch::new("plan-2afc");
        let folders = study_folders(&scratch, 4, 4);
        let pairs = StudyParams { task: Task::TwoAlternatives, ..params() };
        let plan = Plan::draw(&pairs, &folders).unwrap();
        for Trial { patches, .. } in &plan.trials {
            assert!(patches.len() == 2 && patches[0].side != patches[1].side);
        }
        let key = plan.key(&pairs);
        let names: BTreeSet<String> = (0..14).flat_map(|t| [0, 1].map(|slot| plan.patch_name(&key, t, slot))).collect();
        assert_eq!(names.len(), 28);
    }

    #[test]
    fn too_few_patches_are_told_of() {
        let scratch = Scratch::new("plan-few");
        let folders = study_folders(&scratch, 1, 1);
        let error = Plan::draw(&StudyParams { trials: 2000, ..params() }, &folders).unwrap_err();
        let error = error.to_string();
        assert!(error.starts_with("real: 1 fields give ") && error.contains("1001 are needed"), "{error}");
        let error = Plan::draw(&StudyParams { patch_px: 1024, ..params() }, &folders).unwrap_err();
        assert!(error.to_string().contains("give 0 patches"), "{error}");
    }

    #[test]
    fn the_finer_side_is_resampled_if_both_sizes_are_known() {
        let scratch = Scratch::new("plan-pixel");
        let folders = study_folders(&scratch, 2, 2);
        let few = StudyParams { trials: 4, ..params() };
        let both = StudyParams { real_pixel_um: Some(0.33), synthetic_pixel_um: Some(0.25), ..few.clone() };
        let plan = Plan::draw(&both, &folders).unwrap();
        for field in &plan.fields {
            let wanted = if field.side == Side::Real { 1.0 } else { 0.33 / 0.25 };
            assert_eq!(field.reduce, wanted);
        }
        let told = "synthetic: 2 fields are resampled to pixels of 0.33 µm";
        assert!(plan.notes.iter().any(|note| note == told), "{:?}", plan.notes);
        plan.patches(&both, &folders).unwrap();
        let one = StudyParams { real_pixel_um: Some(0.33), ..few };
        assert!(Plan::draw(&one, &folders).unwrap().fields.iter().all(|field| field.reduce == 1.0));
    }

    #[test]
    fn glass_takes_exposure_away_and_as_is_keeps_it() {
        let scratch = Scratch::new("plan-grey");
        let folders = study_folders(&scratch, 2, 2);
        let mean = |grey: Grey, dark: bool| {
            let params = StudyParams { grey, noise_dn: 0.0, trials: 4, ..params() };
            let plan = Plan::draw(&params, &folders).unwrap();
            let picture = plan.fields[if dark { 0 } else { 2 }].picture(&params, &folders).unwrap();
            picture.glass()
        };
        // The support's real fields are exposed darker.
        assert!((mean(Grey::Glass, true) - 230.0).abs() < 1.0 && (mean(Grey::Glass, false) - 230.0).abs() < 1.0);
        assert!(mean(Grey::AsIs, false) - mean(Grey::AsIs, true) > 10.0);
    }

    #[test]
    fn deep_pictures_are_scaled_by_their_camera() {
        assert_eq!([8, 12, 16].map(full_scale), [255.0, 4095.0, 65535.0]);
        let scratch = Scratch::new("plan-deep");
        exposed(&scratch.join("real/a.png"), 1, [300, 240], 3500, 16);
        exposed(&scratch.join("real/b.png"), 1, [300, 240], 900, 16);
        picture(&scratch.join("synthetic/a.png"), 1, [300, 240]);
        let folders = Folders::new(&scratch.join("real"), &scratch.join("synthetic")).unwrap();
        let plan = Plan::draw(&StudyParams { trials: 4, ..params() }, &folders).unwrap();
        // One camera of 12 bits took both.
        assert_eq!(plan.fields.iter().map(|field| field.full_scale).collect::<Vec<_>>(), [4095.0, 4095.0, 255.0]);
    }
}

//! What is kept of a subject: who is shown what, and what was answered.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::design::{Answer, Side, Stage, StudyParams, Task, check_name};
use crate::error::Error;
use crate::fields::{Root, bytes, entries};
use crate::plan::{Patch, Plan, Trial};

/// What says that a file is the state of a study.
const FORMAT: &str = "papsynth-study";

const VERSION: u32 = 1;

const WRITER: &str = concat!("papsynth-study ", env!("CARGO_PKG_VERSION"));

/// Largest state that is read, bytes.
const LARGEST_STATE: u64 = 1 << 28;

/// Longest time that is believed, ms: eleven days.
const LONGEST_MS: f64 = 1e9;

pub(crate) const STATE: &str = "session.json";

/// How a patch was shown, as the page measured it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// From the frame that showed it first to the frame that no longer did, ms.
    pub exposure_ms: f64,
    /// Frames between.
    pub frames: u32,
    /// The longest of them, ms: well above the others if the machine was busy.
    pub longest_frame_ms: f64,
    /// Pixels of the screen for one of the page; a pixel of the patch is as large as the whole number next to it.
    pub pixel_ratio: f64,
}

impl Exposure {
    pub(crate) fn is_sound(&self) -> bool {
        [self.exposure_ms, self.longest_frame_ms, self.pixel_ratio].into_iter().all(is_time)
    }
}

pub(crate) fn is_time(ms: f64) -> bool {
    (0.0..=LONGEST_MS).contains(&ms)
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Answered {
    pub(crate) answer: Answer,
    /// From the question to the answer.
    pub(crate) response_ms: f64,
    pub(crate) exposure: Exposure,
    /// How often the patch was sent: more than once if the page was loaded again before it had been seen to its end.
    pub(crate) showings: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct UnderWay {
    pub(crate) showings: u32,
    pub(crate) exposure: Option<Exposure>,
}

/// Everything that is kept of a subject, as it stands in the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Saved {
    format: String,
    version: u32,
    writer: String,
    pub(crate) params: StudyParams,
    /// The port that the page was last served at, so that an open page finds its server again.
    pub(crate) port: u16,
    pub(crate) plan: Plan,
    pub(crate) answers: Vec<Answered>,
    pub(crate) under_way: UnderWay,
}

impl Saved {
    /// A study of which nothing has been shown.
    pub(crate) fn new(params: &StudyParams, plan: Plan) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            writer: WRITER.to_owned(),
            params: params.clone(),
            port: 0,
            plan,
            answers: Vec::new(),
            under_way: UnderWay::default(),
        }
    }

    pub(crate) fn read(path: &Path) -> Result<Self, Error> {
        let saved: Self = serde_json::from_slice(&bytes(path, LARGEST_STATE)?)
            .map_err(|error| Error::folder(path, format!("is no state of a study: {error}")))?;
        match saved.flaw() {
            Some(flaw) => Err(Error::folder(path, format!("is no state of a study: {flaw}"))),
            None => Ok(saved),
        }
    }

    /// What is wrong with it, so that nothing that is read later can be missing.
    fn flaw(&self) -> Option<String> {
        let Self { params, plan, answers, .. } = self;
        if self.format != FORMAT || self.version != VERSION {
            return Some(format!("{FORMAT} of version {VERSION} is wanted"));
        }
        if let Err(error) = params.check() {
            return Some(error.to_string());
        }
        let slots = if params.task == Task::YesNo { 1 } else { 2 };
        let fits = |trial: &Trial| {
            let is_of_its_side = |patch: &Patch| plan.fields.get(patch.field).is_some_and(|f| f.side == patch.side);
            trial.patches.len() == slots && trial.patches.iter().all(is_of_its_side)
        };
        let times = |answered: &Answered| {
            answered.exposure.is_sound() && is_time(answered.response_ms) && answered.answer.fits(params.task)
        };
        if plan.trials.len() != params.training + params.trials || !plan.trials.iter().all(fits) {
            return Some("its trials do not fit together".to_owned());
        }
        if answers.len() > plan.trials.len() || !answers.iter().all(times) {
            return Some("its answers do not fit its trials".to_owned());
        }
        None
    }

    pub(crate) fn is_finished(&self) -> bool {
        self.answers.len() == self.plan.trials.len()
    }

    pub(crate) fn answered(&self) -> impl Iterator<Item = Judged<'_>> {
        let pairs = self.plan.trials.iter().zip(&self.answers);
        pairs.map(|(trial, answered)| Judged { plan: &self.plan, trial, answered })
    }

    /// Those of them that count.
    pub(crate) fn counted(&self) -> impl Iterator<Item = Judged<'_>> {
        self.answered().filter(|judged| judged.trial.stage == Stage::Counted)
    }
}

/// A trial and what was said to it.
#[derive(Clone, Copy)]
pub(crate) struct Judged<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) trial: &'a Trial,
    pub(crate) answered: &'a Answered,
}

impl Judged<'_> {
    /// Whether the first patch is real.
    pub(crate) fn is_positive(&self) -> bool {
        self.trial.patches.first().is_some_and(|patch| patch.side == Side::Real)
    }

    pub(crate) fn is_correct(&self) -> bool {
        self.is_positive() == self.answered.answer.is_positive()
    }
}

/// The studies of all subjects in a folder, in the natural order of their names.
pub(crate) fn read_all(out: &Path) -> Result<Vec<Saved>, Error> {
    let root = Root::new(out)?;
    let mut found = entries(out)?;
    found.retain(|(name, path)| check_name(name).is_ok() && path.join(STATE).exists());
    let files: Vec<_> = found.iter().map(|(_, path)| root.inside(&path.join(STATE))).collect::<Result<_, _>>()?;
    files.iter().map(|path| Saved::read(path)).collect()
}

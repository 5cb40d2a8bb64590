//! The saved state of a session.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::design::{Answer, Side, Stage, StudyParams, TrialDesign, check_name};
use crate::error::Error;
use crate::fields::{Root, bytes, entries};
use crate::plan::{Patch, Plan, Trial};

/// Name of the format.
const FORMAT: &str = "papsynth-study";

const VERSION: u32 = 1;

const WRITER: &str = concat!("papsynth-study ", env!("CARGO_PKG_VERSION"));

/// Largest state that is read, bytes.
const MAX_STATE_BYTES: u64 = 1 << 28;

/// Longest valid time, ms: eleven days.
const MAX_MS: f64 = 1e9;

pub(crate) const STATE: &str = "session.json";

/// The exposure of a patch, measured by the page.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// Time from the first frame with the patch to the first frame without it, ms.
    pub exposure_ms: f64,
    /// Number of frames of the screen in this time.
    pub frames: u32,
    /// Longest of these frames, ms; it is long if the machine was busy.
    pub longest_frame_ms: f64,
    /// Device pixels for each CSS pixel. A pixel of the patch has this size, rounded to an integer.
    pub pixel_ratio: f64,
}

impl Exposure {
    pub(crate) fn is_valid(&self) -> bool {
        [self.exposure_ms, self.longest_frame_ms, self.pixel_ratio].into_iter().all(is_time)
    }
}

pub(crate) fn is_time(ms: f64) -> bool {
    (0.0..=MAX_MS).contains(&ms)
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Answered {
    pub(crate) answer: Answer,
    /// Time from the question to the answer, ms.
    pub(crate) response_ms: f64,
    pub(crate) exposure: Exposure,
    /// Number of times the patch was sent: more than 1 if the page was reloaded during the exposure.
    pub(crate) showings: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CurrentTrial {
    pub(crate) showings: u32,
    pub(crate) exposure: Option<Exposure>,
}

/// The state of a session as in the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Saved {
    format: String,
    version: u32,
    writer: String,
    pub(crate) params: StudyParams,
    /// Last port of the page, so that an open page can reconnect.
    pub(crate) port: u16,
    pub(crate) plan: Plan,
    pub(crate) answers: Vec<Answered>,
    pub(crate) current: CurrentTrial,
}

impl Saved {
    /// Returns the state of a new study.
    pub(crate) fn new(params: &StudyParams, plan: Plan) -> Self {
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            writer: WRITER.to_owned(),
            params: params.clone(),
            port: 0,
            plan,
            answers: Vec::new(),
            current: CurrentTrial::default(),
        }
    }

    pub(crate) fn read(path: &Path) -> Result<Self, Error> {
        let saved: Self = serde_json::from_slice(&bytes(path, MAX_STATE_BYTES)?)
            .map_err(|error| Error::folder(path, format!("not a valid state of a study: {error}")))?;
        match saved.defect() {
            Some(defect) => Err(Error::folder(path, format!("not a valid state of a study: {defect}"))),
            None => Ok(saved),
        }
    }

    /// Returns the first inconsistency of the state.
    fn defect(&self) -> Option<String> {
        let Self { params, plan, answers, .. } = self;
        if self.format != FORMAT || self.version != VERSION {
            return Some(format!(
                "expected {FORMAT} version {VERSION}, found {} version {}",
                self.format.escape_default(),
                self.version
            ));
        }
        if let Err(error) = params.check() {
            return Some(error.to_string());
        }
        let slots = if params.task == TrialDesign::YesNo { 1 } else { 2 };
        let fits = |trial: &Trial| {
            let is_of_its_side = |patch: &Patch| plan.fields.get(patch.field).is_some_and(|f| f.side == patch.side);
            trial.patches.len() == slots && trial.patches.iter().all(is_of_its_side)
        };
        let times = |answered: &Answered| {
            answered.exposure.is_valid() && is_time(answered.response_ms) && answered.answer.fits(params.task)
        };
        if plan.trials.len() != params.training + params.trials || !plan.trials.iter().all(fits) {
            return Some("its trials are inconsistent".to_owned());
        }
        if answers.len() > plan.trials.len() || !answers.iter().all(times) {
            return Some("its answers do not match its trials".to_owned());
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

    /// Returns the counted trials with their answers.
    pub(crate) fn counted(&self) -> impl Iterator<Item = Judged<'_>> {
        self.answered().filter(|judged| judged.trial.stage == Stage::Counted)
    }
}

/// A trial with its answer.
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

/// Reads the states of all subjects in a folder, in natural order of their names.
pub(crate) fn read_all(out: &Path) -> Result<Vec<Saved>, Error> {
    let root = Root::new(out)?;
    let mut found = entries(out)?;
    found.retain(|(name, path)| check_name(name).is_ok() && path.join(STATE).exists());
    let files: Vec<_> = found.iter().map(|(_, path)| root.inside(&path.join(STATE))).collect::<Result<_, _>>()?;
    files.iter().map(|path| Saved::read(path)).collect()
}

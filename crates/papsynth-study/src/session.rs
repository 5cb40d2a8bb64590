//! The session of a subject: trials and answers, saved on the disk.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use papsynth_dataset::write_file;
use serde::Serialize;

use crate::design::{Answer, Side, Stage, StudyParams, TrialDesign};
use crate::error::Error;
use crate::fields::Root;
use crate::key::Key;
use crate::plan::{Folders, Plan};
use crate::results::Summary;
use crate::saved::{Answered, CurrentTrial, Exposure, STATE, Saved, is_time};
use crate::table::trials_csv;

const TRIALS: &str = "trials.csv";
const SUMMARY: &str = "summary.json";
const LOCK: &str = ".lock";

/// An error of a request of the page.
#[derive(Debug)]
pub enum SessionError {
    /// The request is for another trial: another page has continued, or the answer was already received.
    Stale,
    /// The content of the request is invalid.
    Invalid,
    /// The state could not be saved; the request has no effect.
    NotWritten(Error),
}

impl From<Error> for SessionError {
    fn from(error: Error) -> Self {
        Self::NotWritten(error)
    }
}

/// The state for the page. It is independent of which patches are real.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct State {
    /// Design of the trials.
    pub task: TrialDesign,
    /// Stage of the next trial; of the last trial if all are answered.
    pub stage: Stage,
    /// Number of the next trial in its stage, from 1.
    pub number: usize,
    /// Number of trials in that stage.
    pub of: usize,
    /// Names of the patches of the next trial, from left to right.
    pub patches: Vec<String>,
    /// Whether they were shown, so that only the answer is missing.
    pub shown: bool,
    /// Specified exposure, ms.
    pub exposure_ms: u32,
    /// Size of a patch, px.
    pub patch_px: usize,
    /// Number of practice trials.
    pub training: usize,
    /// Number of counted trials.
    pub trials: usize,
    /// Number of answered trials, including practice trials.
    pub answered: usize,
    /// Whether all trials are answered.
    pub finished: bool,
}

/// The session of a subject.
#[derive(Debug)]
pub struct Session {
    folder: PathBuf,
    saved: Saved,
    key: Key,
    /// PNG files, one or two for each trial.
    patches: Vec<Vec<Vec<u8>>>,
    /// Lock against a second program that writes to the folder.
    _lock: File,
}

impl Session {
    /// Starts or continues the study of `params.subject` in a folder of that name in `out`.
    ///
    /// # Errors
    /// If a parameter is out of range, the folders have too few patches or cannot be read, the existing study has other
    /// parameters or fields, another program uses it, or a file cannot be written.
    pub fn open(params: &StudyParams, real: &Path, synthetic: &Path, out: &Path) -> Result<Self, Error> {
        params.check()?;
        let folders = Folders::new(real, synthetic)?;
        let folder = out.join(&params.subject);
        let path = folder.join(STATE);
        let (saved, is_new) = if path.exists() {
            let saved = Saved::read(&path)?;
            check_params(params, &saved.params, &path)?;
            (saved, false)
        } else {
            (Saved::new(params, Plan::draw(params, &folders)?), true)
        };
        let patches = saved.plan.patches(params, &folders)?;
        // No file is written before all inputs are read.
        let lock = lock(out, &folder)?;
        let key = saved.plan.key(params);
        let session = Self { folder, saved, key, patches, _lock: lock };
        if is_new {
            session.write(&session.saved)?;
        } else if session.is_finished() {
            session.write_results()?;
        }
        Ok(session)
    }

    /// Returns the state for the page.
    #[must_use]
    pub fn state(&self) -> State {
        let Saved { params, plan, answers, current, .. } = &self.saved;
        let answered = answers.len();
        let finished = self.is_finished();
        let (stage, number, of) = match answered.min(plan.trials.len().saturating_sub(1)) {
            trial if trial < params.training => (Stage::Training, trial + 1, params.training),
            trial => (Stage::Counted, trial + 1 - params.training, params.trials),
        };
        let slots = plan.trials.get(answered).map_or(0, |trial| trial.patches.len());
        State {
            task: params.task,
            stage,
            number,
            of,
            patches: (0..slots).map(|slot| plan.patch_name(&self.key, answered, slot)).collect(),
            shown: current.exposure.is_some(),
            exposure_ms: params.exposure_ms,
            patch_px: params.patch_px,
            training: params.training,
            trials: params.trials,
            answered,
            finished,
        }
    }

    /// Whether all trials are answered.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.saved.is_finished()
    }

    /// Returns the results of the answers so far.
    #[must_use]
    pub fn summary(&self) -> Summary {
        Summary::of(&self.saved)
    }

    /// The folder of the results.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Notes for the results.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.saved.plan.notes
    }

    /// Number of real or synthetic fields.
    #[must_use]
    pub fn fields(&self, side: Side) -> usize {
        self.saved.plan.fields.iter().filter(|field| field.side == side).count()
    }

    /// Last port of the page, or 0.
    #[must_use]
    pub fn port(&self) -> u16 {
        self.saved.port
    }

    /// Saves the port of the page.
    ///
    /// # Errors
    /// If the state cannot be saved.
    pub fn set_port(&mut self, port: u16) -> Result<(), Error> {
        if self.saved.port != port {
            self.change(|saved| saved.port = port)?;
        }
        Ok(())
    }

    /// Returns a patch of the current trial as a PNG file. Requests of the first patch are counted as showings.
    ///
    /// # Errors
    /// If the current trial has no such patch, it was already shown, or the state cannot be saved.
    pub fn patch(&mut self, name: &str) -> Result<&[u8], SessionError> {
        let trial = self.saved.answers.len();
        let slots = self.patches.get(trial).map_or(0, Vec::len);
        let slot = (0..slots).find(|&slot| self.saved.plan.patch_name(&self.key, trial, slot) == name);
        let slot = slot.filter(|_| self.saved.current.exposure.is_none()).ok_or(SessionError::Stale)?;
        if slot == 0 {
            self.change(|saved| saved.current.showings = saved.current.showings.saturating_add(1))?;
        }
        Ok(&self.patches[trial][slot])
    }

    /// Records that the patches of the current trial were shown. A second call has no effect.
    ///
    /// # Errors
    /// If the name is not that of the current trial, a value is invalid, or the state cannot be saved.
    pub fn shown(&mut self, name: &str, exposure: Exposure) -> Result<(), SessionError> {
        if !exposure.is_valid() {
            return Err(SessionError::Invalid);
        }
        self.expect(name)?;
        if self.saved.current.exposure.is_none() {
            self.change(|saved| saved.current.exposure = Some(exposure))?;
        }
        Ok(())
    }

    /// Records the answer to the current trial after its patches were shown.
    ///
    /// # Errors
    /// If the name is not that of the current trial, a value is invalid, or the state cannot be saved.
    pub fn answer(&mut self, name: &str, answer: Answer, response_ms: f64) -> Result<(), SessionError> {
        if !is_time(response_ms) || !answer.fits(self.saved.params.task) {
            return Err(SessionError::Invalid);
        }
        self.expect(name)?;
        let CurrentTrial { showings, exposure } = self.saved.current;
        let exposure = exposure.ok_or(SessionError::Stale)?;
        self.change(|saved| {
            saved.answers.push(Answered { answer, response_ms, exposure, showings });
            saved.current = CurrentTrial::default();
        })?;
        if self.is_finished() {
            // The answers are saved; missing results are written when the study is opened again.
            self.write_results()?;
        }
        Ok(())
    }

    /// Checks that a request is for the current trial.
    fn expect(&self, name: &str) -> Result<(), SessionError> {
        let trial = self.saved.answers.len();
        let is_now = !self.is_finished() && self.saved.plan.patch_name(&self.key, trial, 0) == name;
        if is_now { Ok(()) } else { Err(SessionError::Stale) }
    }

    /// Changes the state after it is saved on the disk, so that no change can be lost.
    fn change(&mut self, change: impl FnOnce(&mut Saved)) -> Result<(), Error> {
        let mut next = self.saved.clone();
        change(&mut next);
        self.write(&next)?;
        self.saved = next;
        Ok(())
    }

    fn write(&self, saved: &Saved) -> Result<(), Error> {
        let text = serde_json::to_vec(saved).map_err(|error| Error::io("write", &self.folder)(error.into()))?;
        Ok(write_file(&self.folder.join(STATE), &text)?)
    }

    fn write_results(&self) -> Result<(), Error> {
        let summary = serde_json::to_vec_pretty(&self.summary());
        let summary = summary.map_err(|error| Error::io("write", &self.folder)(error.into()))?;
        write_file(&self.folder.join(TRIALS), &trials_csv(&self.saved))?;
        Ok(write_file(&self.folder.join(SUMMARY), &summary)?)
    }
}

/// Checks that the parameters are those of the existing study.
fn check_params(given: &StudyParams, existing: &StudyParams, path: &Path) -> Result<(), Error> {
    if given == existing {
        return Ok(());
    }
    let (given, existing) = (serde_json::json!(given), serde_json::json!(existing));
    let given = given.as_object().into_iter().flatten();
    let differing = given.filter(|(name, value)| existing[name.as_str()] != **value);
    let differing = differing.map(|(name, value)| format!("{name} is {value}, expected {}", existing[name.as_str()]));
    let message = format!(
        "the existing study has other parameters: {}; use the same options to continue it, or another subject or folder",
        differing.collect::<Vec<_>>().join(", ")
    );
    Err(Error::folder(path, message))
}

/// Creates and locks the folder of a subject.
fn lock(out: &Path, folder: &Path) -> Result<File, Error> {
    fs::create_dir_all(folder).map_err(Error::io("write", folder))?;
    // The folder may be a symbolic link.
    Root::new(out)?.inside(folder)?;
    let path = folder.join(LOCK);
    if fs::symlink_metadata(&path).is_ok_and(|found| !found.is_file()) {
        return Err(Error::folder(&path, "not a regular file; remove it"));
    }
    let file = File::options().write(true).create(true).truncate(false).open(&path);
    let file = file.map_err(Error::io("write", &path))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(Error::folder(folder, "another program uses the study of this subject; close it first"))
        }
        // File systems without locks skip this protection.
        Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::saved::read_all;
    use crate::support::{EXPOSURE, Scratch, go_on, study_folders};

    fn params() -> StudyParams {
        StudyParams { trials: 6, training: 2, patch_px: 48, ..StudyParams::default() }
    }

    fn open(scratch: &Scratch, params: &StudyParams) -> Result<Session, Error> {
        Session::open(params, &scratch.join("real"), &scratch.join("synthetic"), &scratch.join("out"))
    }

    fn bench(name: &str) -> Scratch {
        let scratch = Scratch::new(name);
        study_folders(&scratch, 3, 3);
        scratch
    }

    #[test]
    fn a_reopened_study_continues_at_the_current_trial() {
        let scratch = bench("session");
        for trial in 0..8 {
            let mut session = open(&scratch, &params()).unwrap();
            let state = session.state();
            assert_eq!((state.answered, state.finished, state.shown), (trial, false, false));
            let (stage, number, of) =
                if trial < 2 { (Stage::Training, trial + 1, 2) } else { (Stage::Counted, trial - 1, 6) };
            assert_eq!((state.stage, state.number, state.of), (stage, number, of));
            go_on(&mut session, Answer::Real);
        }
        let mut session = open(&scratch, &params()).unwrap();
        assert!(session.state().finished && session.state().patches.is_empty());
        let counts = session.summary().row.counts;
        assert_eq!((counts.tp, counts.fp, counts.tn, counts.fn_), (3, 3, 0, 0));
        assert!(matches!(session.shown("", EXPOSURE), Err(SessionError::Stale)));
        // Missing results are written again.
        drop(session);
        let files = [TRIALS, SUMMARY].map(|name| scratch.join("out/1").join(name));
        let before = files.each_ref().map(|path| fs::read(path).unwrap());
        files.iter().for_each(|path| fs::remove_file(path).unwrap());
        open(&scratch, &params()).unwrap();
        assert_eq!(before, files.each_ref().map(|path| fs::read(path).unwrap()));
    }

    #[test]
    fn a_patch_is_shown_once() {
        let scratch = bench("session-once");
        let mut session = open(&scratch, &params()).unwrap();
        let name = session.state().patches[0].clone();
        assert!(matches!(session.answer(&name, Answer::Real, 1.0), Err(SessionError::Stale)), "not shown yet");
        // Reloaded during the exposure, then shown.
        session.patch(&name).unwrap();
        drop(session);
        let mut session = open(&scratch, &params()).unwrap();
        session.patch(&name).unwrap();
        session.shown(&name, EXPOSURE).unwrap();
        assert!(matches!(session.patch(&name), Err(SessionError::Stale)));
        // The first of two reports counts.
        session.shown(&name, Exposure { exposure_ms: 1.0, ..EXPOSURE }).unwrap();
        drop(session);
        let mut session = open(&scratch, &params()).unwrap();
        assert!(session.state().shown);
        session.answer(&name, Answer::Synthetic, 700.0).unwrap();
        assert!(matches!(session.answer(&name, Answer::Real, 1.0), Err(SessionError::Stale)), "already received");
        let answered = session.saved.answers[0];
        assert_eq!((answered.showings, answered.exposure, answered.answer), (2, EXPOSURE, Answer::Synthetic));
    }

    #[test]
    fn invalid_requests_are_refused_and_change_nothing() {
        let scratch = bench("session-nonsense");
        let mut session = open(&scratch, &params()).unwrap();
        let name = session.state().patches[0].clone();
        for bad in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(matches!(
                session.shown(&name, Exposure { exposure_ms: bad, ..EXPOSURE }),
                Err(SessionError::Invalid)
            ));
        }
        session.shown(&name, EXPOSURE).unwrap();
        assert!(matches!(session.answer(&name, Answer::Left, 1.0), Err(SessionError::Invalid)));
        assert!(matches!(session.answer(&name, Answer::Real, f64::NAN), Err(SessionError::Invalid)));
        assert!(matches!(session.answer("", Answer::Real, 1.0), Err(SessionError::Stale)));
        assert!(matches!(session.patch("../session.json"), Err(SessionError::Stale)));
        assert_eq!(session.state().answered, 0);
    }

    #[test]
    fn a_second_program_and_other_options_are_refused() {
        let scratch = bench("session-lock");
        let session = open(&scratch, &params()).unwrap();
        assert!(open(&scratch, &params()).unwrap_err().to_string().contains("another program"));
        let other = StudyParams { subject: "2".to_owned(), ..params() };
        open(&scratch, &other).unwrap();
        drop(session);
        let error = open(&scratch, &StudyParams { trials: 8, seed: 1, ..params() }).unwrap_err().to_string();
        assert!(error.contains("trials is 8, expected 6, seed is 1, expected 0"), "{error}");
        assert_eq!(read_all(&scratch.join("out")).unwrap().len(), 2);
    }

    #[test]
    fn damaged_states_are_refused() {
        let scratch = bench("session-damage");
        drop(open(&scratch, &params()).unwrap());
        let path = scratch.join("out/1/session.json");
        let good = fs::read_to_string(&path).unwrap();
        for (from, to) in [
            ("\"version\":1", "\"version\":2"),
            ("papsynth-study\"", "other\""),
            ("\"field\":0", "\"field\":99"),
            ("\"full_scale\":255.0", "\"full_scale\":\"white\""),
            ("\"trials\":6", "\"trials\":5"),
            ("\"training\":2", "\"training\":-2"),
            ("\"answers\":[]", "\"answers\":[{}]"),
            ("{", "["),
        ] {
            let bad = good.replacen(from, to, 1);
            assert_ne!(bad, good, "{from}");
            fs::write(&path, bad).unwrap();
            let error = open(&scratch, &params()).unwrap_err();
            assert!(error.to_string().contains("session.json: not a valid state of a study"), "{from}: {error}");
        }
        // A position outside the field.
        let far = good.replacen("\"x_px\":", "\"x_px\":1844674407370955", 1);
        fs::write(&path, far).unwrap();
        assert!(open(&scratch, &params()).unwrap_err().to_string().contains("was changed after"));
        for cut in (0..good.len()).step_by(good.len() / 50) {
            fs::write(&path, &good[..cut]).unwrap();
            assert!(open(&scratch, &params()).is_err());
        }
    }

    #[test]
    fn answers_that_cannot_be_saved_do_not_count() {
        let scratch = bench("session-full");
        let mut session = open(&scratch, &params()).unwrap();
        let name = session.state().patches[0].clone();
        session.shown(&name, EXPOSURE).unwrap();
        // A file cannot replace a folder that is not empty.
        let path = scratch.join("out/1/session.json");
        fs::remove_file(&path).unwrap();
        fs::create_dir_all(path.join("in the way")).unwrap();
        assert!(matches!(session.answer(&name, Answer::Real, 1.0), Err(SessionError::NotWritten(_))));
        assert_eq!(session.state().answered, 0);
        fs::remove_dir_all(&path).unwrap();
        session.answer(&name, Answer::Real, 1.0).unwrap();
        assert_eq!(session.state().answered, 1);
    }

    #[cfg(unix)]
    #[test]
    fn results_do_not_follow_links_outside_their_folder() {
        let scratch = bench("session-link");
        fs::create_dir_all(scratch.join("elsewhere")).unwrap();
        fs::create_dir_all(scratch.join("out")).unwrap();
        std::os::unix::fs::symlink(scratch.join("elsewhere"), scratch.join("out/1")).unwrap();
        assert!(open(&scratch, &params()).unwrap_err().to_string().contains("outside"));
        assert_eq!(fs::read_dir(scratch.join("elsewhere")).unwrap().count(), 0);
    }
}

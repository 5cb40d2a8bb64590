//! A subject's way through a study: what is shown next, what was answered, all of it on the disk.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use papsynth_dataset::write_file;
use serde::Serialize;

use crate::design::{Answer, Side, Stage, StudyParams, Task};
use crate::error::Error;
use crate::fields::Root;
use crate::key::Key;
use crate::plan::{Folders, Plan};
use crate::results::Summary;
use crate::saved::{Answered, Exposure, STATE, Saved, UnderWay, is_time};
use crate::table::trials_csv;

const TRIALS: &str = "trials.csv";
const SUMMARY: &str = "summary.json";
const LOCK: &str = ".lock";

/// Why something that a page sent is not taken.
#[derive(Debug)]
pub enum Refusal {
    /// It does not fit what is asked now: another page has gone on, or the answer arrived already.
    Stale,
    /// It is nothing that a page of ours sends.
    Nonsense,
    /// It could not be written down, so it does not count.
    NotWritten(Error),
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self::NotWritten(error)
    }
}

/// What a page has to know to go on; nothing in it depends on what is real.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct State {
    /// What is asked.
    pub task: Task,
    /// Whether the next trial counts; the last one's, if there is none.
    pub stage: Stage,
    /// The number of the next trial in its stage, from 1.
    pub number: usize,
    /// The number of trials in that stage.
    pub of: usize,
    /// What the patches of the next trial are asked for by, from left to right.
    pub patches: Vec<String>,
    /// Whether they have been seen, so that only the answer is missing.
    pub shown: bool,
    /// How long they are to be shown, ms.
    pub exposure_ms: u32,
    /// Their side, pixels.
    pub patch_px: usize,
    /// Trials for practice.
    pub training: usize,
    /// Trials that count.
    pub trials: usize,
    /// Trials that were answered, those for practice among them.
    pub answered: usize,
    /// Whether there is nothing left to answer.
    pub finished: bool,
}

/// A subject's way through a study.
#[derive(Debug)]
pub struct Session {
    folder: PathBuf,
    saved: Saved,
    key: Key,
    /// PNG files, for each trial one or two.
    patches: Vec<Vec<Vec<u8>>>,
    /// Held as long as this lives, so that no second program writes to the folder.
    _lock: File,
}

impl Session {
    /// Begins the study of `params.subject` in a folder of that name in `out`, or goes on with it.
    ///
    /// # Errors
    /// If a parameter is out of range, the folders hold too little or are not readable, a study of other parameters or fields
    /// was begun under that name, another program is at it, or the system refuses to write.
    pub fn open(params: &StudyParams, real: &Path, synthetic: &Path, out: &Path) -> Result<Self, Error> {
        params.check()?;
        let folders = Folders::new(real, synthetic)?;
        let folder = out.join(&params.subject);
        let path = folder.join(STATE);
        let (saved, is_new) = if path.exists() {
            let saved = Saved::read(&path)?;
            same(params, &saved.params, &path)?;
            (saved, false)
        } else {
            (Saved::new(params, Plan::draw(params, &folders)?), true)
        };
        let patches = saved.plan.patches(params, &folders)?;
        // Nothing is written before everything has been read.
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

    /// What a page has to know.
    #[must_use]
    pub fn state(&self) -> State {
        let Saved { params, plan, answers, under_way, .. } = &self.saved;
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
            shown: under_way.exposure.is_some(),
            exposure_ms: params.exposure_ms,
            patch_px: params.patch_px,
            training: params.training,
            trials: params.trials,
            answered,
            finished,
        }
    }

    /// Whether everything has been answered.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.saved.is_finished()
    }

    /// What came out, or would if it ended now.
    #[must_use]
    pub fn summary(&self) -> Summary {
        Summary::of(&self.saved)
    }

    /// Where the results lie.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What whoever reads the results should know.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.saved.plan.notes
    }

    /// Number of fields of one side.
    #[must_use]
    pub fn fields(&self, side: Side) -> usize {
        self.saved.plan.fields.iter().filter(|field| field.side == side).count()
    }

    /// The port that the page was last served at, or 0.
    #[must_use]
    pub fn port(&self) -> u16 {
        self.saved.port
    }

    /// Keeps the port that the page is served at.
    ///
    /// # Errors
    /// If the system refuses to write.
    pub fn set_port(&mut self, port: u16) -> Result<(), Error> {
        if self.saved.port != port {
            self.change(|saved| saved.port = port)?;
        }
        Ok(())
    }

    /// A patch of the trial under way, as a PNG file, if it has not been seen yet. Asking for the first one counts as a showing.
    ///
    /// # Errors
    /// If no patch of that name is asked for now, or the showing could not be written down.
    pub fn patch(&mut self, name: &str) -> Result<&[u8], Refusal> {
        let trial = self.saved.answers.len();
        let slots = self.patches.get(trial).map_or(0, Vec::len);
        let slot = (0..slots).find(|&slot| self.saved.plan.patch_name(&self.key, trial, slot) == name);
        let slot = slot.filter(|_| self.saved.under_way.exposure.is_none()).ok_or(Refusal::Stale)?;
        if slot == 0 {
            self.change(|saved| saved.under_way.showings = saved.under_way.showings.saturating_add(1))?;
        }
        Ok(&self.patches[trial][slot])
    }

    /// The patches of the trial under way were seen. What arrives twice counts once.
    ///
    /// # Errors
    /// If it is not what is asked now, makes no sense, or could not be written down.
    pub fn shown(&mut self, name: &str, exposure: Exposure) -> Result<(), Refusal> {
        if !exposure.is_sound() {
            return Err(Refusal::Nonsense);
        }
        self.expect(name)?;
        if self.saved.under_way.exposure.is_none() {
            self.change(|saved| saved.under_way.exposure = Some(exposure))?;
        }
        Ok(())
    }

    /// The answer to the trial under way, whose patches have been seen.
    ///
    /// # Errors
    /// If it is not what is asked now, makes no sense, or could not be written down.
    pub fn answer(&mut self, name: &str, answer: Answer, response_ms: f64) -> Result<(), Refusal> {
        if !is_time(response_ms) || !answer.fits(self.saved.params.task) {
            return Err(Refusal::Nonsense);
        }
        self.expect(name)?;
        let UnderWay { showings, exposure } = self.saved.under_way;
        let exposure = exposure.ok_or(Refusal::Stale)?;
        self.change(|saved| {
            saved.answers.push(Answered { answer, response_ms, exposure, showings });
            saved.under_way = UnderWay::default();
        })?;
        if self.is_finished() {
            // The answers are safe; results that cannot be written now are written when the study is opened again.
            self.write_results()?;
        }
        Ok(())
    }

    /// Makes sure that a page speaks of the trial under way.
    fn expect(&self, name: &str) -> Result<(), Refusal> {
        let trial = self.saved.answers.len();
        let is_now = !self.is_finished() && self.saved.plan.patch_name(&self.key, trial, 0) == name;
        if is_now { Ok(()) } else { Err(Refusal::Stale) }
    }

    /// Changes what is kept: on the disk first, so that nothing counts that could be lost.
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

/// Makes sure that a study goes on as it began.
fn same(asked: &StudyParams, begun: &StudyParams, path: &Path) -> Result<(), Error> {
    if asked == begun {
        return Ok(());
    }
    let (asked, begun) = (serde_json::json!(asked), serde_json::json!(begun));
    let asked = asked.as_object().into_iter().flatten();
    let differing = asked.filter(|(name, value)| begun[name.as_str()] != **value);
    let differing = differing.map(|(name, value)| format!("{name} was {} and is {value} now", begun[name.as_str()]));
    let message = format!(
        "this study was begun otherwise: {}; the same options go on with it, another subject or folder begins a new one",
        differing.collect::<Vec<_>>().join(", ")
    );
    Err(Error::folder(path, message))
}

/// Makes the folder of a subject and takes it for this program.
fn lock(out: &Path, folder: &Path) -> Result<File, Error> {
    fs::create_dir_all(folder).map_err(Error::io("write", folder))?;
    // The name of a subject holds no separator, but it may be a link.
    Root::new(out)?.inside(folder)?;
    let path = folder.join(LOCK);
    if fs::symlink_metadata(&path).is_ok_and(|found| !found.is_file()) {
        return Err(Error::folder(&path, "is no file; a file or nothing is expected"));
    }
    let file = File::options().write(true).create(true).truncate(false).open(&path);
    let file = file.map_err(Error::io("write", &path))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(Error::folder(folder, "another program is at the study of this subject; end that one first"))
        }
        // File systems without locks do without.
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
    fn a_study_goes_on_where_it_was_whenever_it_is_opened() {
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
        assert!(matches!(session.shown("", EXPOSURE), Err(Refusal::Stale)));
        // Results that are lost are written again.
        drop(session);
        let files = [TRIALS, SUMMARY].map(|name| scratch.join("out/1").join(name));
        let before = files.each_ref().map(|path| fs::read(path).unwrap());
        files.iter().for_each(|path| fs::remove_file(path).unwrap());
        open(&scratch, &params()).unwrap();
        assert_eq!(before, files.each_ref().map(|path| fs::read(path).unwrap()));
    }

    #[test]
    fn a_patch_is_seen_once() {
        let scratch = bench("session-once");
        let mut session = open(&scratch, &params()).unwrap();
        let name = session.state().patches[0].clone();
        assert!(matches!(session.answer(&name, Answer::Real, 1.0), Err(Refusal::Stale)), "not seen yet");
        // Loaded again before it had been seen to its end, then seen.
        session.patch(&name).unwrap();
        drop(session);
        let mut session = open(&scratch, &params()).unwrap();
        session.patch(&name).unwrap();
        session.shown(&name, EXPOSURE).unwrap();
        assert!(matches!(session.patch(&name), Err(Refusal::Stale)));
        // Said twice; the first counts.
        session.shown(&name, Exposure { exposure_ms: 1.0, ..EXPOSURE }).unwrap();
        drop(session);
        let mut session = open(&scratch, &params()).unwrap();
        assert!(session.state().shown);
        session.answer(&name, Answer::Synthetic, 700.0).unwrap();
        assert!(matches!(session.answer(&name, Answer::Real, 1.0), Err(Refusal::Stale)), "arrived already");
        let answered = session.saved.answers[0];
        assert_eq!((answered.showings, answered.exposure, answered.answer), (2, EXPOSURE, Answer::Synthetic));
    }

    #[test]
    fn nonsense_is_refused_and_changes_nothing() {
        let scratch = bench("session-nonsense");
        let mut session = open(&scratch, &params()).unwrap();
        let name = session.state().patches[0].clone();
        for bad in [f64::NAN, -1.0, f64::INFINITY] {
            assert!(matches!(session.shown(&name, Exposure { exposure_ms: bad, ..EXPOSURE }), Err(Refusal::Nonsense)));
        }
        session.shown(&name, EXPOSURE).unwrap();
        assert!(matches!(session.answer(&name, Answer::Left, 1.0), Err(Refusal::Nonsense)));
        assert!(matches!(session.answer(&name, Answer::Real, f64::NAN), Err(Refusal::Nonsense)));
        assert!(matches!(session.answer("", Answer::Real, 1.0), Err(Refusal::Stale)));
        assert!(matches!(session.patch("../session.json"), Err(Refusal::Stale)));
        assert_eq!(session.state().answered, 0);
    }

    #[test]
    fn two_programs_do_not_share_a_subject_and_other_options_are_refused() {
        let scratch = bench("session-lock");
        let session = open(&scratch, &params()).unwrap();
        assert!(open(&scratch, &params()).unwrap_err().to_string().contains("another program"));
        let other = StudyParams { subject: "2".to_owned(), ..params() };
        open(&scratch, &other).unwrap();
        drop(session);
        let error = open(&scratch, &StudyParams { trials: 8, seed: 1, ..params() }).unwrap_err().to_string();
        assert!(error.contains("seed was 0 and is 1 now, trials was 6 and is 8 now"), "{error}");
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
            assert!(error.to_string().contains("session.json: is no state of a study"), "{from}: {error}");
        }
        // A place outside the field.
        let far = good.replacen("\"x_px\":", "\"x_px\":1844674407370955", 1);
        fs::write(&path, far).unwrap();
        assert!(open(&scratch, &params()).unwrap_err().to_string().contains("has changed since"));
        for cut in (0..good.len()).step_by(good.len() / 50) {
            fs::write(&path, &good[..cut]).unwrap();
            assert!(open(&scratch, &params()).is_err());
        }
    }

    #[test]
    fn what_cannot_be_written_does_not_count() {
        let scratch = bench("session-full");
        let mut session = open(&scratch, &params()).unwrap();
        let name = session.state().patches[0].clone();
        session.shown(&name, EXPOSURE).unwrap();
        // No file can be put in the place of a folder.
        let path = scratch.join("out/1/session.json");
        fs::remove_file(&path).unwrap();
        fs::create_dir_all(path.join("in the way")).unwrap();
        assert!(matches!(session.answer(&name, Answer::Real, 1.0), Err(Refusal::NotWritten(_))));
        assert_eq!(session.state().answered, 0);
        fs::remove_dir_all(&path).unwrap();
        session.answer(&name, Answer::Real, 1.0).unwrap();
        assert_eq!(session.state().answered, 1);
    }

    #[cfg(unix)]
    #[test]
    fn results_do_not_follow_links_out_of_their_folder() {
        let scratch = bench("session-link");
        fs::create_dir_all(scratch.join("elsewhere")).unwrap();
        fs::create_dir_all(scratch.join("out")).unwrap();
        std::os::unix::fs::symlink(scratch.join("elsewhere"), scratch.join("out/1")).unwrap();
        assert!(open(&scratch, &params()).unwrap_err().to_string().contains("leads out of"));
        assert_eq!(fs::read_dir(scratch.join("elsewhere")).unwrap().count(), 0);
    }
}

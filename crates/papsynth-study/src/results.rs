//! What came out, of one subject and of all.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Serialize;

use crate::breakdown::{Group, breakdown};
use crate::design::{RANDOM, StudyParams, Task};
use crate::error::Error;
use crate::saved::{Judged, Saved, read_all};
use crate::score::{CLAIM_HALF_WIDTH, Counts, Detection, Interval, Proportion, mean_over_subjects, trials_for};

/// A row of Table 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Who looked.
    pub subject: String,
    /// TP, FP, TN, FN.
    pub counts: Counts,
    /// Real images that were taken for real.
    pub sensitivity: Proportion,
    /// Synthetic images that were taken for synthetic.
    pub specificity: Proportion,
    /// Right answers.
    pub accuracy: Proportion,
    /// d′ and criterion.
    pub detection: Detection,
}

impl Row {
    pub(crate) fn new(subject: &str, counts: Counts, task: Task) -> Self {
        Self {
            subject: subject.to_owned(),
            counts,
            sensitivity: counts.sensitivity(),
            specificity: counts.specificity(),
            accuracy: counts.accuracy(),
            detection: counts.detection(task),
        }
    }

    fn of(subject: &str, judged: &[Judged], task: Task) -> Self {
        let mut counts = Counts::default();
        judged.iter().for_each(|one| counts.count(one.is_positive(), one.answered.answer.is_positive()));
        Self::new(subject, counts, task)
    }
}

/// How long patches were shown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Exposures {
    /// How long they were to be shown, ms.
    pub asked_ms: u32,
    /// The shortest that was given, ms.
    pub shortest_ms: f64,
    /// The median.
    pub median_ms: f64,
    /// The longest.
    pub longest_ms: f64,
    /// Trials whose patch was sent more than once.
    pub shown_again: usize,
}

/// What it takes to claim more.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Claim {
    /// Half the width of an interval of 95 %.
    pub half_width: f64,
    /// Trials that give it for a fraction of ½.
    pub trials: u64,
}

impl Claim {
    fn five_points() -> Self {
        Self { half_width: CLAIM_HALF_WIDTH, trials: trials_for(CLAIM_HALF_WIDTH) }
    }
}

/// The results of one subject.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// What was asked.
    pub study: StudyParams,
    /// Whether everything has been answered.
    pub finished: bool,
    /// The subject's row.
    pub row: Row,
    /// What a coin says to the same trials.
    pub random: Row,
    /// How long patches were shown; nothing if none was.
    pub exposure: Option<Exposures>,
    /// How many trials a claim of ±5 points needs.
    pub claim: Claim,
    /// Right answers by parameter and by field.
    pub breakdown: Vec<Group>,
    /// What else to know.
    pub notes: Vec<String>,
}

impl Summary {
    pub(crate) fn of(saved: &Saved) -> Self {
        let params = &saved.params;
        let counted: Vec<Judged> = saved.counted().collect();
        Self {
            study: params.clone(),
            finished: saved.is_finished(),
            row: Row::of(&params.subject, &counted, params.task),
            random: random(saved),
            exposure: exposures(saved),
            claim: Claim::five_points(),
            breakdown: breakdown(&counted),
            notes: saved.plan.notes.clone(),
        }
    }
}

/// The results of all subjects in a folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pool {
    /// What was asked.
    pub task: Task,
    /// A row for each subject that has finished.
    pub subjects: Vec<Row>,
    /// Their counts together.
    pub pooled: Row,
    /// What a coin says to the first one's trials.
    pub random: Row,
    /// Mean sensitivity over subjects, and its interval of 95 % by Student's t, as the paper states it.
    pub mean_sensitivity: Option<(f64, Interval)>,
    /// Mean specificity, alike.
    pub mean_specificity: Option<(f64, Interval)>,
    /// Mean accuracy, alike.
    pub mean_accuracy: Option<(f64, Interval)>,
    /// How many trials a claim of ±5 points needs.
    pub claim: Claim,
    /// Right answers of all by parameter and by field.
    pub breakdown: Vec<Group>,
    /// What else to know.
    pub notes: Vec<String>,
}

impl Pool {
    /// Reads the results in a folder, a folder for each subject.
    ///
    /// # Errors
    /// If there is no finished study, one cannot be read, or they asked different things.
    pub fn read(out: &Path) -> Result<Self, Error> {
        let (finished, unfinished): (Vec<_>, Vec<_>) = read_all(out)?.into_iter().partition(Saved::is_finished);
        let Some(first) = finished.first() else {
            let message = match unfinished.len() {
                0 => "there is no study in it; expected a folder that `papsynth study --out` has written to".to_owned(),
                count => format!("none of {count} studies is finished; the command that began one goes on with it"),
            };
            return Err(Error::folder(out, message));
        };
        let task = first.params.task;
        if let Some(other) = finished.iter().find(|saved| saved.params.task != task) {
            let [one, two] = [first, other].map(|saved| (&saved.params.subject, saved.params.task.name()));
            let message =
                format!("subject {} was asked {}, subject {} {}; these are not pooled", one.0, one.1, two.0, two.1);
            return Err(Error::folder(out, message));
        }
        let mut notes: Vec<String> = unfinished
            .iter()
            .map(|saved| {
                let (done, all) = (saved.answers.len(), saved.plan.trials.len());
                format!("subject {} is left out: {done} of {all} trials are answered", saved.params.subject)
            })
            .collect();
        let conditions = |saved: &Saved| StudyParams { subject: String::new(), seed: 0, ..saved.params.clone() };
        if finished.iter().any(|saved| conditions(saved) != conditions(first)) {
            notes.push("not all subjects were shown patches under the same conditions".to_owned());
        }
        let fields = |saved: &Saved| saved.plan.fields.iter().map(|f| f.sha256.clone()).collect::<BTreeSet<_>>();
        if finished.iter().any(|saved| fields(saved) != fields(first)) {
            notes.push("not all subjects were shown patches of the same fields".to_owned());
        }
        let subjects: Vec<Row> = finished
            .iter()
            .map(|saved| Row::of(&saved.params.subject, &saved.counted().collect::<Vec<_>>(), task))
            .collect();
        let all: Vec<Judged> = finished.iter().flat_map(Saved::counted).collect();
        let mean = |part: fn(&Row) -> Proportion| {
            mean_over_subjects(&subjects.iter().filter_map(|row| part(row).value()).collect::<Vec<_>>())
        };
        Ok(Self {
            task,
            pooled: Row::of("pooled", &all, task),
            random: random(first),
            mean_sensitivity: mean(|row| row.sensitivity),
            mean_specificity: mean(|row| row.specificity),
            mean_accuracy: mean(|row| row.accuracy),
            claim: Claim::five_points(),
            breakdown: breakdown(&all),
            notes,
            subjects,
        })
    }
}

/// The random row: a coin for each trial that was answered.
fn random(saved: &Saved) -> Row {
    use rand_core::Rng;
    let mut coin = saved.plan.key(&saved.params).stream("random row", 0);
    let mut counts = Counts::default();
    saved.counted().for_each(|one| counts.count(one.is_positive(), coin.next_u64() >> 63 == 1));
    Row::new(RANDOM, counts, saved.params.task)
}

fn exposures(saved: &Saved) -> Option<Exposures> {
    let mut given: Vec<f64> = saved.answers.iter().map(|answered| answered.exposure.exposure_ms).collect();
    given.sort_by(f64::total_cmp);
    Some(Exposures {
        asked_ms: saved.params.exposure_ms,
        shortest_ms: *given.first()?,
        median_ms: *given.get(given.len() / 2)?,
        longest_ms: *given.last()?,
        shown_again: saved.answers.iter().filter(|answered| answered.showings > 1).count(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Answer, Side};
    use crate::session::Session;
    use crate::support::{Scratch, go_on, study_folders};

    /// A subject who gives these answers, over and over, to so many of 2 + 6 trials.
    fn subject(scratch: &Scratch, name: &str, task: Task, answers: &[Answer], trials: usize) {
        let params = StudyParams { subject: name.to_owned(), task, trials: 6, patch_px: 48, ..StudyParams::default() };
        let [real, synthetic, out] = ["real", "synthetic", "out"].map(|folder| scratch.join(folder));
        let mut session = Session::open(&params, &real, &synthetic, &out).unwrap();
        answers.iter().cycle().take(trials).for_each(|answer| go_on(&mut session, *answer));
    }

    #[test]
    fn subjects_are_pooled_in_their_order_and_who_has_not_finished_is_left_out() {
        let scratch = Scratch::new("pool");
        study_folders(&scratch, 3, 3);
        subject(&scratch, "10", Task::YesNo, &[Answer::Real], 8);
        subject(&scratch, "9", Task::YesNo, &[Answer::Synthetic], 8);
        subject(&scratch, "early", Task::YesNo, &[Answer::Real], 5);
        let pool = Pool::read(&scratch.join("out")).unwrap();
        assert_eq!(pool.subjects.iter().map(|row| row.subject.as_str()).collect::<Vec<_>>(), ["9", "10"]);
        assert_eq!(pool.subjects[0].counts, Counts { tp: 0, fp: 0, tn: 3, fn_: 3 });
        assert_eq!(pool.pooled.counts, Counts { tp: 3, fp: 3, tn: 3, fn_: 3 });
        assert_eq!(pool.random.counts.trials(), 6);
        assert_eq!(pool.mean_accuracy.unwrap().0, 0.5);
        assert!(pool.mean_sensitivity.unwrap().1.high > 1.0, "two subjects tell little of others");
        assert!(pool.notes.iter().any(|note| note == "subject early is left out: 5 of 8 trials are answered"));
        // Every patch is of one field: of 12 trials, 6 of either side.
        let fields = |side| pool.breakdown.iter().filter(|group| group.side == side).map(|g| g.correct.of).sum::<u64>();
        assert_eq!([fields(Side::Real), fields(Side::Synthetic)], [6, 6]);
    }

    #[test]
    fn different_questions_are_not_pooled() {
        let scratch = Scratch::new("pool-tasks");
        study_folders(&scratch, 3, 3);
        assert!(Pool::read(&scratch.join("out")).is_err());
        subject(&scratch, "a", Task::TwoAlternatives, &[Answer::Left, Answer::Right], 8);
        let pool = Pool::read(&scratch.join("out")).unwrap();
        assert_eq!(pool.pooled.counts.trials(), 6);
        assert!(pool.mean_accuracy.is_none());
        subject(&scratch, "b", Task::YesNo, &[Answer::Real], 8);
        let error = Pool::read(&scratch.join("out")).unwrap_err().to_string();
        assert!(error.contains("subject a was asked 2afc, subject b yes-no"), "{error}");
    }
}

//! Results of one subject and of all subjects.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Serialize;

use crate::breakdown::{Group, breakdown};
use crate::design::{RANDOM, StudyParams, TrialDesign};
use crate::error::Error;
use crate::saved::{Judged, Saved, read_all};
use crate::score::{Counts, DEFAULT_HALF_WIDTH, Detection, Interval, Proportion, mean_over_subjects, trials_for};

/// A row of Table 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Name of the subject.
    pub subject: String,
    /// TP, FP, TN and FN.
    pub counts: Counts,
    /// Fraction of real images judged real.
    pub sensitivity: Proportion,
    /// Fraction of synthetic images judged synthetic.
    pub specificity: Proportion,
    /// Fraction of correct answers.
    pub accuracy: Proportion,
    /// d′ and criterion.
    pub detection: Detection,
}

impl Row {
    pub(crate) fn new(subject: &str, counts: Counts, task: TrialDesign) -> Self {
        Self {
            subject: subject.to_owned(),
            counts,
            sensitivity: counts.sensitivity(),
            specificity: counts.specificity(),
            accuracy: counts.accuracy(),
            detection: counts.detection(task),
        }
    }

    fn of(subject: &str, judged: &[Judged], task: TrialDesign) -> Self {
        let mut counts = Counts::default();
        judged.iter().for_each(|one| counts.count(one.is_positive(), one.answered.answer.is_positive()));
        Self::new(subject, counts, task)
    }
}

/// Measured exposures of patches.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Exposures {
    /// Specified exposure, ms.
    pub specified_ms: u32,
    /// Shortest exposure, ms.
    pub shortest_ms: f64,
    /// Median exposure, ms.
    pub median_ms: f64,
    /// Longest exposure, ms.
    pub longest_ms: f64,
    /// Number of trials whose patch was sent more than once.
    pub shown_again: usize,
}

/// The number of trials for a given precision.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Precision {
    /// Half-width of the 95 % interval.
    pub half_width: f64,
    /// Number of trials for this half-width at a fraction of ½.
    pub trials: u64,
}

impl Precision {
    fn five_points() -> Self {
        Self { half_width: DEFAULT_HALF_WIDTH, trials: trials_for(DEFAULT_HALF_WIDTH) }
    }
}

/// The results of one subject.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Parameters of the study.
    pub study: StudyParams,
    /// Whether all trials are answered.
    pub finished: bool,
    /// Row of the subject.
    pub row: Row,
    /// Row of random answers to the same trials.
    pub random: Row,
    /// Exposures; `None` if no patch was shown.
    pub exposure: Option<Exposures>,
    /// Number of trials for ±5 points.
    pub precision: Precision,
    /// Correct answers by parameter and by field.
    pub breakdown: Vec<Group>,
    /// Notes.
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
            precision: Precision::five_points(),
            breakdown: breakdown(&counted),
            notes: saved.plan.notes.clone(),
        }
    }
}

/// The results of all subjects in a folder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pool {
    /// Design of the trials.
    pub task: TrialDesign,
    /// One row for each subject that has finished.
    pub subjects: Vec<Row>,
    /// Row of all their answers.
    pub pooled: Row,
    /// Row of random answers to the trials of the first subject.
    pub random: Row,
    /// Mean sensitivity over subjects with Student's 95 % interval, as in the paper.
    pub mean_sensitivity: Option<(f64, Interval)>,
    /// Mean specificity with Student's 95 % interval.
    pub mean_specificity: Option<(f64, Interval)>,
    /// Mean accuracy with Student's 95 % interval.
    pub mean_accuracy: Option<(f64, Interval)>,
    /// Number of trials for ±5 points.
    pub precision: Precision,
    /// Correct answers of all subjects by parameter and by field.
    pub breakdown: Vec<Group>,
    /// Notes.
    pub notes: Vec<String>,
}

impl Pool {
    /// Reads the results in a folder with one folder for each subject.
    ///
    /// # Errors
    /// If no study is finished, one cannot be read, or their designs differ.
    pub fn read(out: &Path) -> Result<Self, Error> {
        let (finished, unfinished): (Vec<_>, Vec<_>) = read_all(out)?.into_iter().partition(Saved::is_finished);
        let Some(first) = finished.first() else {
            let message = match unfinished.len() {
                0 => "contains no study; expected the folder of `papsynth study --out`".to_owned(),
                count => format!("finished studies: 0 of {count}; continue a study with the command that started it"),
            };
            return Err(Error::folder(out, message));
        };
        let task = first.params.task;
        if let Some(other) = finished.iter().find(|saved| saved.params.task != task) {
            let [one, two] = [first, other].map(|saved| (&saved.params.subject, saved.params.task.name()));
            let message = format!(
                "the design of subject {} is {}, that of subject {} is {}; expected one design",
                one.0, one.1, two.0, two.1
            );
            return Err(Error::folder(out, message));
        }
        let mut notes: Vec<String> = unfinished
            .iter()
            .map(|saved| {
                let (done, all) = (saved.answers.len(), saved.plan.trials.len());
                format!("subject {} is excluded: answered trials {done} of {all}", saved.params.subject)
            })
            .collect();
        let conditions = |saved: &Saved| StudyParams { subject: String::new(), seed: 0, ..saved.params.clone() };
        if finished.iter().any(|saved| conditions(saved) != conditions(first)) {
            notes.push("the conditions differ between subjects".to_owned());
        }
        let fields = |saved: &Saved| saved.plan.fields.iter().map(|f| f.sha256.clone()).collect::<BTreeSet<_>>();
        if finished.iter().any(|saved| fields(saved) != fields(first)) {
            notes.push("the fields differ between subjects".to_owned());
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
            precision: Precision::five_points(),
            breakdown: breakdown(&all),
            notes,
            subjects,
        })
    }
}

/// Returns the row of random answers to the answered trials.
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
        specified_ms: saved.params.exposure_ms,
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

    /// Answers `trials` of 2 + 6 trials with these answers in turn.
    fn subject(scratch: &Scratch, name: &str, task: TrialDesign, answers: &[Answer], trials: usize) {
        let params = StudyParams { subject: name.to_owned(), task, trials: 6, patch_px: 48, ..StudyParams::default() };
        let [real, synthetic, out] = ["real", "synthetic", "out"].map(|folder| scratch.join(folder));
        let mut session = Session::open(&params, &real, &synthetic, &out).unwrap();
        answers.iter().cycle().take(trials).for_each(|answer| go_on(&mut session, *answer));
    }

    #[test]
    fn finished_subjects_are_pooled_in_natural_order() {
        let scratch = Scratch::new("pool");
        study_folders(&scratch, 3, 3);
        subject(&scratch, "10", TrialDesign::YesNo, &[Answer::Real], 8);
        subject(&scratch, "9", TrialDesign::YesNo, &[Answer::Synthetic], 8);
        subject(&scratch, "early", TrialDesign::YesNo, &[Answer::Real], 5);
        let pool = Pool::read(&scratch.join("out")).unwrap();
        assert_eq!(pool.subjects.iter().map(|row| row.subject.as_str()).collect::<Vec<_>>(), ["9", "10"]);
        assert_eq!(pool.subjects[0].counts, Counts { tp: 0, fp: 0, tn: 3, fn_: 3 });
        assert_eq!(pool.pooled.counts, Counts { tp: 3, fp: 3, tn: 3, fn_: 3 });
        assert_eq!(pool.random.counts.trials(), 6);
        assert_eq!(pool.mean_accuracy.unwrap().0, 0.5);
        assert!(pool.mean_sensitivity.unwrap().1.high > 1.0, "the interval of two subjects is wide");
        assert!(pool.notes.iter().any(|note| note == "subject early is excluded: answered trials 5 of 8"));
        // Each of the 12 trials has one field, 6 real and 6 synthetic.
        let fields =
            |side| pool.breakdown.iter().filter(|group| group.side == side).map(|g| g.correct.total).sum::<u64>();
        assert_eq!([fields(Side::Real), fields(Side::Synthetic)], [6, 6]);
    }

    #[test]
    fn different_designs_are_not_pooled() {
        let scratch = Scratch::new("pool-tasks");
        study_folders(&scratch, 3, 3);
        assert!(Pool::read(&scratch.join("out")).is_err());
        subject(&scratch, "a", TrialDesign::TwoAlternatives, &[Answer::Left, Answer::Right], 8);
        let pool = Pool::read(&scratch.join("out")).unwrap();
        assert_eq!(pool.pooled.counts.trials(), 6);
        assert!(pool.mean_accuracy.is_none());
        subject(&scratch, "b", TrialDesign::YesNo, &[Answer::Real], 8);
        let error = Pool::read(&scratch.join("out")).unwrap_err().to_string();
        assert!(error.contains("the design of subject a is 2afc, that of subject b is yes-no"), "{error}");
    }
}

//! What came out: a row of Table 1, a breakdown, every trial.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

use serde::Serialize;

use crate::design::{RANDOM, Side, Stage, StudyParams, Task};
use crate::error::Error;
use crate::parameters::Value;
use crate::plan::{Patch, Plan, Trial};
use crate::score::{
    CLAIM_HALF_WIDTH, Counts, Detection, Interval, Proportion, mean_over_subjects, trials_for,
};
use crate::session::{Answered, Saved, read_all};

/// So many different values are a group each; more numbers are sorted into thirds.
const FEW_VALUES: usize = 3;

/// Texts of more kinds than this are not broken down by: what is left in each group says nothing.
const MOST_TEXTS: usize = 12;

/// What the breakdown by field is called.
const FIELD: &str = "field";

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
    /// The row of these counts.
    #[must_use]
    pub fn new(subject: &str, counts: Counts, task: Task) -> Self {
        Self {
            subject: subject.to_owned(),
            counts,
            sensitivity: counts.sensitivity(),
            specificity: counts.specificity(),
            accuracy: counts.accuracy(),
            detection: counts.detection(task),
        }
    }
}

/// Right answers where a parameter had one value, or lay between two.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Group {
    /// Of which side the parameter is.
    pub side: Side,
    /// Its name; that of the patches' field is `field`.
    pub parameter: String,
    /// What it was.
    pub value: String,
    /// Right answers among all.
    pub correct: Proportion,
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
        let Saved { params, plan, answers, .. } = saved;
        let counted: Vec<Judged> = counted(saved).collect();
        Self {
            study: params.clone(),
            finished: saved.is_finished(),
            row: Row::new(&params.subject, counts(&counted), params.task),
            random: random(saved),
            exposure: exposures(params, answers),
            claim: Claim::five_points(),
            breakdown: breakdown(&counted),
            notes: plan.notes.clone(),
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
            let message = format!("subject {} was asked {}, subject {} {}; these are not pooled", one.0, one.1, two.0, two.1);
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
            .map(|saved| Row::new(&saved.params.subject, counts(&counted(saved).collect::<Vec<_>>()), task))
            .collect();
        let all: Vec<Judged> = finished.iter().flat_map(counted).collect();
        let mean = |part: fn(&Row) -> Proportion| {
            mean_over_subjects(&subjects.iter().filter_map(|row| part(row).value()).collect::<Vec<_>>())
        };
        Ok(Self {
            task,
            pooled: Row::new("pooled", counts(&all), task),
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

/// A trial and what was said to it.
#[derive(Clone, Copy)]
struct Judged<'a> {
    plan: &'a Plan,
    trial: &'a Trial,
    answered: &'a Answered,
}

impl Judged<'_> {
    /// Whether the first patch is real.
    fn is_positive(&self) -> bool {
        self.trial.patches.first().is_some_and(|patch| patch.side == Side::Real)
    }

    fn is_correct(&self) -> bool {
        self.is_positive() == self.answered.answer.is_positive()
    }
}

fn answered(saved: &Saved) -> impl Iterator<Item = Judged<'_>> {
    let pairs = saved.plan.trials.iter().zip(&saved.answers);
    pairs.map(|(trial, answered)| Judged { plan: &saved.plan, trial, answered })
}

fn counted(saved: &Saved) -> impl Iterator<Item = Judged<'_>> {
    answered(saved).filter(|judged| judged.trial.stage == Stage::Counted)
}

fn counts(judged: &[Judged]) -> Counts {
    let mut counts = Counts::default();
    judged.iter().for_each(|one| counts.count(one.is_positive(), one.answered.answer.is_positive()));
    counts
}

/// The random row: a coin for each trial that was answered.
fn random(saved: &Saved) -> Row {
    use rand_core::Rng;
    let mut coin = saved.plan.key(&saved.params).stream("random row", 0);
    let mut counts = Counts::default();
    counted(saved).for_each(|one| counts.count(one.is_positive(), coin.next_u64() >> 63 == 1));
    Row::new(RANDOM, counts, saved.params.task)
}

fn exposures(params: &StudyParams, answers: &[Answered]) -> Option<Exposures> {
    let mut given: Vec<f64> = answers.iter().map(|answered| answered.exposure.exposure_ms).collect();
    given.sort_by(f64::total_cmp);
    Some(Exposures {
        asked_ms: params.exposure_ms,
        shortest_ms: *given.first()?,
        median_ms: *given.get(given.len() / 2)?,
        longest_ms: *given.last()?,
        shown_again: answers.iter().filter(|answered| answered.showings > 1).count(),
    })
}

/// Right answers by what is known of the synthetic patch, then by field.
fn breakdown(judged: &[Judged]) -> Vec<Group> {
    let patches = || judged.iter().flat_map(|one| one.trial.patches.iter().map(move |patch| (one, patch)));
    let mut by_name: BTreeMap<&str, Vec<(&Value, bool)>> = BTreeMap::new();
    for (one, patch) in patches().filter(|(_, patch)| patch.side == Side::Synthetic) {
        for (name, value) in &patch.parameters {
            by_name.entry(name).or_default().push((value, one.is_correct()));
        }
    }
    let mut groups: Vec<Group> = by_name.iter().flat_map(|(name, values)| by_value(name, values)).collect();
    let mut by_field: BTreeMap<(bool, &str), Proportion> = BTreeMap::new();
    for (one, patch) in patches() {
        let name = one.plan.fields.get(patch.field).map_or("", |field| &field.name);
        let proportion = by_field.entry((patch.side == Side::Synthetic, name)).or_default();
        proportion.hits += u64::from(one.is_correct());
        proportion.of += 1;
    }
    groups.extend(by_field.into_iter().map(|((is_synthetic, name), correct)| {
        let side = if is_synthetic { Side::Synthetic } else { Side::Real };
        Group { side, parameter: FIELD.to_owned(), value: name.to_owned(), correct }
    }));
    groups
}

/// Groups of one parameter: a few values each by itself, many numbers in thirds.
fn by_value(name: &str, values: &[(&Value, bool)]) -> Vec<Group> {
    let mut numbers = Vec::new();
    let mut texts: BTreeMap<&str, Proportion> = BTreeMap::new();
    for (value, is_correct) in values {
        match value {
            Value::Number(number) => numbers.push((*number, *is_correct)),
            Value::Text(text) => add(texts.entry(text).or_default(), *is_correct),
        }
    }
    let group = |value: String, correct: Proportion| Group {
        side: Side::Synthetic,
        parameter: name.to_owned(),
        value,
        correct,
    };
    let mut groups: Vec<Group> = Vec::new();
    numbers.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    for part in thirds(&numbers) {
        let (Some((low, _)), Some((high, _))) = (part.first(), part.last()) else { continue };
        let value = if low == high { short(*low) } else { format!("{} to {}", short(*low), short(*high)) };
        let mut correct = Proportion::default();
        part.iter().for_each(|(_, is_correct)| add(&mut correct, *is_correct));
        groups.push(group(value, correct));
    }
    if texts.len() <= MOST_TEXTS {
        groups.extend(texts.into_iter().map(|(text, correct)| group(text.to_owned(), correct)));
    }
    // One group alone compares with nothing.
    if groups.len() > 1 { groups } else { Vec::new() }
}

fn add(proportion: &mut Proportion, is_hit: bool) {
    proportion.hits += u64::from(is_hit);
    proportion.of += 1;
}

/// Sorted values, each by itself if there are few, else in three parts of about the same length; equal values stay together.
fn thirds(sorted: &[(f64, bool)]) -> Vec<&[(f64, bool)]> {
    let mut runs: Vec<&[(f64, bool)]> = sorted.chunk_by(|(a, _), (b, _)| a == b).collect();
    if runs.len() > FEW_VALUES {
        let mut cuts = Vec::new();
        let mut seen = 0;
        for run in &runs {
            seen += run.len();
            // The run that reaches a third of all ends it.
            if seen * 3 >= sorted.len() * (cuts.len() + 1) {
                cuts.push(seen);
            }
        }
        cuts.dedup();
        let mut from = 0;
        runs = Vec::new();
        for to in cuts {
            runs.push(&sorted[from..to]);
            from = to;
        }
    }
    runs
}

/// A number in three figures.
fn short(number: f64) -> String {
    let digits = match number.abs() {
        size if size >= 100.0 => 0,
        size if size >= 10.0 => 1,
        size if size >= 1.0 => 2,
        _ => 3,
    };
    let text = format!("{number:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Every trial that was answered, as a table.
pub(crate) fn trials_csv(saved: &Saved) -> Vec<u8> {
    let names: BTreeSet<&String> =
        saved.plan.trials.iter().flat_map(|trial| &trial.patches).flat_map(|patch| patch.parameters.keys()).collect();
    let mut lines = Vec::with_capacity(saved.answers.len() + 1);
    let fixed = [
        "subject", "trial", "stage", "design", "truth", "answer", "correct", "exposure_ms", "frames", "longest_frame_ms",
        "pixel_ratio", "showings", "response_ms", "real_field", "real_x_px", "real_y_px", "synthetic_field",
        "synthetic_x_px", "synthetic_y_px",
    ];
    lines.push(fixed.iter().map(|name| (*name).to_owned()).chain(names.iter().map(|name| (*name).clone())).collect());
    let params = &saved.params;
    for (number, one) in answered(saved).enumerate() {
        let of = |side: Side| one.trial.patches.iter().find(|patch| patch.side == side);
        let field = |patch: Option<&Patch>| {
            let name = patch.and_then(|patch| saved.plan.fields.get(patch.field)).map(|field| field.name.clone());
            [name, patch.map(|patch| patch.x_px.to_string()), patch.map(|patch| patch.y_px.to_string())]
                .map(Option::unwrap_or_default)
        };
        let truth = match (params.task, one.is_positive()) {
            (Task::YesNo, true) => "real",
            (Task::YesNo, false) => "synthetic",
            (Task::TwoAlternatives, true) => "left",
            (Task::TwoAlternatives, false) => "right",
        };
        let stage = match one.trial.stage {
            Stage::Training => "training",
            Stage::Counted => "counted",
        };
        let Answered { answer, response_ms, exposure, showings } = one.answered;
        let mut line: Vec<String> = vec![
            params.subject.clone(),
            (number + 1).to_string(),
            stage.to_owned(),
            params.task.name().to_owned(),
            truth.to_owned(),
            answer.name().to_owned(),
            u8::from(one.is_correct()).to_string(),
            exposure.exposure_ms.to_string(),
            exposure.frames.to_string(),
            exposure.longest_frame_ms.to_string(),
            exposure.pixel_ratio.to_string(),
            showings.to_string(),
            response_ms.to_string(),
        ];
        line.extend(field(of(Side::Real)));
        line.extend(field(of(Side::Synthetic)));
        let known = of(Side::Synthetic).map(|patch| &patch.parameters);
        line.extend(names.iter().map(|name| match known.and_then(|known| known.get(*name)) {
            Some(Value::Number(number)) => number.to_string(),
            Some(Value::Text(text)) => text.clone(),
            None => String::new(),
        }));
        lines.push(line);
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in lines {
        let written: Result<(), csv::Error> = writer.write_record(&line);
        debug_assert!(written.is_ok(), "memory takes every byte, and all lines are of one length: {written:?}");
    }
    writer.into_inner().unwrap_or_default()
}

/// Rows as a table for a terminal, with the intervals of 95 % below their numbers' names.
#[must_use]
pub fn table<'a>(rows: impl IntoIterator<Item = &'a Row>) -> String {
    let rows: Vec<&Row> = rows.into_iter().collect();
    let wide = rows.iter().map(|row| row.subject.len()).max().unwrap_or(0).max("subject".len());
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        "{:<wide$}  {:>4}  {:>4}  {:>4}  {:>4}   {:<15}   {:<15}   {:<15}  {:>5}  {:>5}",
        "subject", "TP", "FP", "TN", "FN", "sensitivity", "specificity", "accuracy", "d′", "c"
    );
    for row in rows {
        let Row { subject, counts, detection, .. } = row;
        let [sensitivity, specificity, accuracy] =
            [row.sensitivity, row.specificity, row.accuracy].map(|proportion| fraction(&proportion));
        let _ = writeln!(
            out,
            "{subject:<wide$}  {:>4}  {:>4}  {:>4}  {:>4}   {sensitivity:<15}   {specificity:<15}   {accuracy:<15}  {:>5.2}  {:>5.2}",
            counts.tp,
            counts.fp,
            counts.tn,
            counts.fn_,
            // No minus before 0.00.
            detection.d_prime + 0.0,
            detection.criterion + 0.0,
        );
    }
    out
}

/// A fraction with its interval, such as `.681 (.646–.714)`.
fn fraction(proportion: &Proportion) -> String {
    let Interval { low, high } = proportion.wilson();
    match proportion.value() {
        Some(value) => format!("{} ({}–{})", three(value), three(low), three(high)),
        None => "–".to_owned(),
    }
}

/// Three digits, without the zero that a fraction below 1 begins with.
fn three(value: f64) -> String {
    let text = format!("{value:.3}");
    text.strip_prefix('0').unwrap_or(&text).to_owned()
}

/// The breakdown by parameter as a table for a terminal, without that by field.
#[must_use]
pub fn breakdown_table(groups: &[Group]) -> String {
    let shown: Vec<&Group> = groups.iter().filter(|group| group.parameter != FIELD).collect();
    let width = |text: fn(&Group) -> &str| shown.iter().map(|group| text(group).chars().count()).max().unwrap_or(0);
    let (name, value) = (width(|group| &group.parameter), width(|group| &group.value));
    let mut out = String::new();
    let mut before = "";
    for group in shown {
        let parameter = if group.parameter == before { "" } else { &group.parameter };
        before = &group.parameter;
        let Proportion { hits, of } = group.correct;
        let _ = writeln!(
            out,
            "{parameter:<name$}  {:<value$}  {:>4} of {:<4}  {}",
            group.value,
            hits,
            of,
            fraction(&group.correct)
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_numbers_are_sorted_into_thirds_and_few_stand_alone() {
        let numbers: Vec<Value> = (0..31).map(|k| Value::Number(f64::from(k * 7 % 31))).collect();
        let values: Vec<_> = numbers.iter().map(|v| (v, true)).collect();
        let groups = by_value("p", &values);
        assert_eq!(groups.iter().map(|g| g.value.as_str()).collect::<Vec<_>>(), ["0 to 10", "11 to 20", "21 to 30"]);
        assert_eq!(groups.iter().map(|g| g.correct.of).collect::<Vec<_>>(), [11, 10, 10]);
        let few = [Value::Number(1.0), Value::Number(0.25), Value::Number(1.0)];
        let groups = by_value("p", &few.iter().map(|v| (v, false)).collect::<Vec<_>>());
        assert_eq!(groups.iter().map(|g| (g.value.as_str(), g.correct.of)).collect::<Vec<_>>(), [("0.25", 1), ("1", 2)]);
        let same = [Value::Number(1.0), Value::Number(1.0)];
        assert!(by_value("p", &same.iter().map(|v| (v, false)).collect::<Vec<_>>()).is_empty());
        let texts = [Value::Text("a".to_owned()), Value::Text("b".to_owned())];
        assert_eq!(by_value("p", &texts.iter().map(|v| (v, true)).collect::<Vec<_>>()).len(), 2);
    }

    #[test]
    fn thirds_lose_nothing_and_keep_equal_values_together() {
        for distinct in [1, 2, 3, 4, 5, 9, 40] {
            let mut values: Vec<(f64, bool)> = (0..59).map(|k| (f64::from(k * k % distinct), true)).collect();
            values.sort_by(|a, b| a.0.total_cmp(&b.0));
            let parts = thirds(&values);
            assert!(parts.len() <= 3 && parts.concat() == values, "{distinct}");
            assert!(parts.windows(2).all(|pair| pair[0].last().unwrap().0 < pair[1][0].0));
        }
        assert!(thirds(&[]).is_empty());
    }

    #[test]
    fn tables_show_the_numbers_as_papers_do() {
        let counts = Counts { tp: 282, fp: 143, tn: 200, fn_: 83 };
        let text = table([&Row::new("pooled", counts, Task::YesNo)]);
        assert!(text.lines().nth(1).unwrap().contains(".681 (.646–.714)"), "{text}");
        let row = Row::new("1", Counts { tp: 2, ..Counts::default() }, Task::YesNo);
        assert!(table([&row]).contains("1.000 (.342–1.000)"));
        assert!(table([&row]).contains('–'));
        assert_eq!([0.0, 0.1234, 12.34, 1234.5].map(short), ["0", "0.123", "12.3", "1234"]);
    }
}

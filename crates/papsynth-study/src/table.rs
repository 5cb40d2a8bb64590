//! Tables of results: trials as CSV, rows and groups as text.

use std::collections::BTreeSet;
use std::fmt::Write;

use crate::breakdown::{FIELD, Group};
use crate::design::{Side, TrialDesign};
use crate::parameters::Value;
use crate::results::Row;
use crate::saved::{Answered, Saved};
use crate::score::{Counts, Interval, Proportion};

/// Returns all answered trials as CSV; empty if there are none.
pub(crate) fn trials_csv(saved: &Saved) -> Vec<u8> {
    let names: BTreeSet<&String> =
        saved.plan.trials.iter().flat_map(|trial| &trial.patches).flat_map(|patch| patch.parameters.keys()).collect();
    let params = &saved.params;
    let mut writer = csv::Writer::from_writer(Vec::new());
    for (number, one) in saved.answered().enumerate() {
        let truth = match (params.task, one.is_positive()) {
            (TrialDesign::YesNo, true) => "real",
            (TrialDesign::YesNo, false) => "synthetic",
            (TrialDesign::TwoAlternatives, true) => "left",
            (TrialDesign::TwoAlternatives, false) => "right",
        };
        let Answered { answer, response_ms, exposure, showings } = one.answered;
        let mut line: Vec<(&str, String)> = vec![
            ("subject", params.subject.clone()),
            ("trial", (number + 1).to_string()),
            ("stage", one.trial.stage.name().to_owned()),
            ("design", params.task.name().to_owned()),
            ("truth", truth.to_owned()),
            ("answer", answer.name().to_owned()),
            ("correct", u8::from(one.is_correct()).to_string()),
            ("exposure_ms", exposure.exposure_ms.to_string()),
            ("frames", exposure.frames.to_string()),
            ("longest_frame_ms", exposure.longest_frame_ms.to_string()),
            ("pixel_ratio", exposure.pixel_ratio.to_string()),
            ("showings", showings.to_string()),
            ("response_ms", response_ms.to_string()),
        ];
        let of = |side: Side| one.trial.patches.iter().find(|patch| patch.side == side);
        for (side, columns) in [
            (Side::Real, ["real_field", "real_x_px", "real_y_px"]),
            (Side::Synthetic, ["synthetic_field", "synthetic_x_px", "synthetic_y_px"]),
        ] {
            let known = of(side).map_or_else(Default::default, |patch| {
                [one.plan.fields[patch.field].name.clone(), patch.x_px.to_string(), patch.y_px.to_string()]
            });
            line.extend(columns.into_iter().zip(known));
        }
        let known = of(Side::Synthetic).map(|patch| &patch.parameters);
        line.extend(names.iter().map(|name| match known.and_then(|known| known.get(*name)) {
            Some(Value::Number(number)) => (name.as_str(), number.to_string()),
            Some(Value::Text(text)) => (name.as_str(), text.clone()),
            None => (name.as_str(), String::new()),
        }));
        let (head, line): (Vec<&str>, Vec<String>) = line.into_iter().unzip();
        let written = if number == 0 { writer.write_record(head) } else { Ok(()) };
        let written = written.and_then(|()| writer.write_record(line));
        debug_assert!(written.is_ok(), "all lines have the same length: {written:?}");
    }
    writer.into_inner().unwrap_or_default()
}

/// Formats rows as a text table with 95 % intervals.
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
        let Row { subject, counts: Counts { tp, fp, tn, fn_ }, detection, .. } = row;
        // Avoids -0.00.
        let [d_prime, criterion] = [detection.d_prime, detection.criterion].map(|number| number + 0.0);
        let [sensitivity, specificity, accuracy] =
            [row.sensitivity, row.specificity, row.accuracy].map(|proportion| fraction(&proportion));
        let _ = writeln!(
            out,
            "{subject:<wide$}  {tp:>4}  {fp:>4}  {tn:>4}  {fn_:>4}   {sensitivity:<15}   {specificity:<15}   {accuracy:<15}  {d_prime:>5.2}  {criterion:>5.2}"
        );
    }
    out
}

/// Formats a fraction with its interval: `.681 (.646–.714)`.
fn fraction(proportion: &Proportion) -> String {
    let Interval { low, high } = proportion.wilson();
    match proportion.value() {
        Some(value) => format!("{} ({}–{})", three(value), three(low), three(high)),
        None => "–".to_owned(),
    }
}

/// Formats three decimals without a leading zero.
fn three(value: f64) -> String {
    let text = format!("{value:.3}");
    text.strip_prefix('0').unwrap_or(&text).to_owned()
}

/// Formats the breakdown by parameter, without that by field, as a text table.
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
        let (Proportion { hits, total }, shown) = (group.correct, fraction(&group.correct));
        let _ = writeln!(out, "{parameter:<name$}  {:<value$}  {hits:>4} of {total:<4}  {shown}", group.value);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::breakdown::short;

    #[test]
    fn tables_format_numbers_as_in_papers() {
        let counts = Counts { tp: 282, fp: 143, tn: 200, fn_: 83 };
        let text = table([&Row::new("pooled", counts, TrialDesign::YesNo)]);
        assert!(text.lines().nth(1).unwrap().contains(".681 (.646–.714)"), "{text}");
        let row = Row::new("1", Counts { tp: 2, ..Counts::default() }, TrialDesign::YesNo);
        assert!(table([&row]).contains("1.000 (.342–1.000)"));
        assert!(table([&row]).contains('–'));
        assert_eq!([0.0, 0.1234, 12.34, 1234.5].map(short), ["0", "0.123", "12.3", "1234"]);
    }
}

//! Correct answers by properties of the patches.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::design::Side;
use crate::parameters::Value;
use crate::saved::Judged;
use crate::score::Proportion;

/// Up to this number, each distinct value is a group; more numbers are divided into thirds.
const MAX_SINGLE_VALUES: usize = 3;

/// Parameters with more distinct texts have no breakdown: the groups would be too small.
const MAX_TEXTS: usize = 12;

pub(crate) const FIELD: &str = "field";

/// Correct answers for one value or range of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Group {
    /// The side of the patch with the parameter.
    pub side: Side,
    /// Name of the parameter; `field` for the field of the patch.
    pub parameter: String,
    /// Its value or range.
    pub value: String,
    /// Fraction of correct answers.
    pub correct: Proportion,
}

/// Returns the correct answers by parameter of the synthetic patch, then by field.
pub(crate) fn breakdown(judged: &[Judged]) -> Vec<Group> {
    let patches = || judged.iter().flat_map(|one| one.trial.patches.iter().map(move |patch| (one, patch)));
    let mut by_name: BTreeMap<&str, Vec<(&Value, bool)>> = BTreeMap::new();
    for (one, patch) in patches().filter(|(_, patch)| patch.side == Side::Synthetic) {
        for (name, value) in &patch.parameters {
            by_name.entry(name).or_default().push((value, one.is_correct()));
        }
    }
    let mut groups: Vec<Group> = by_name.iter().flat_map(|(name, values)| by_value(name, values)).collect();
    let mut by_field: BTreeMap<(Side, &str), Proportion> = BTreeMap::new();
    for (one, patch) in patches() {
        by_field.entry((patch.side, &one.plan.fields[patch.field].name)).or_default().count(one.is_correct());
    }
    groups.extend(by_field.into_iter().map(|((side, name), correct)| Group {
        side,
        parameter: FIELD.to_owned(),
        value: name.to_owned(),
        correct,
    }));
    groups
}

/// Returns the groups of one parameter: one for each of a few values, or thirds of many numbers.
fn by_value(name: &str, values: &[(&Value, bool)]) -> Vec<Group> {
    let mut numbers = Vec::new();
    let mut texts: BTreeMap<&str, Proportion> = BTreeMap::new();
    for (value, is_correct) in values {
        match value {
            Value::Number(number) => numbers.push((*number, *is_correct)),
            Value::Text(text) => texts.entry(text).or_default().count(*is_correct),
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
        part.iter().for_each(|(_, is_correct)| correct.count(*is_correct));
        groups.push(group(value, correct));
    }
    if texts.len() <= MAX_TEXTS {
        groups.extend(texts.into_iter().map(|(text, correct)| group(text.to_owned(), correct)));
    }
    // A single group allows no comparison.
    if groups.len() > 1 { groups } else { Vec::new() }
}

/// Divides sorted values into one part for each of a few distinct values, or into thirds. Equal values stay together.
fn thirds(sorted: &[(f64, bool)]) -> Vec<&[(f64, bool)]> {
    let runs: Vec<&[(f64, bool)]> = sorted.chunk_by(|(a, _), (b, _)| a == b).collect();
    if runs.len() <= MAX_SINGLE_VALUES {
        return runs;
    }
    let (mut parts, mut from, mut to) = (Vec::new(), 0, 0);
    for run in runs {
        to += run.len();
        // The run that reaches a third of all values completes the part.
        if to * 3 >= sorted.len() * (parts.len() + 1) {
            parts.push(&sorted[from..to]);
            from = to;
        }
    }
    parts
}

/// Formats a number with three significant digits.
pub(crate) fn short(number: f64) -> String {
    let digits = match number.abs() {
        size if size >= 100.0 => 0,
        size if size >= 10.0 => 1,
        size if size >= 1.0 => 2,
        _ => 3,
    };
    let text = format!("{number:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_numbers_are_divided_into_thirds_and_few_are_single_groups() {
        let numbers: Vec<Value> = (0..31).map(|k| Value::Number(f64::from(k * 7 % 31))).collect();
        let values: Vec<_> = numbers.iter().map(|v| (v, true)).collect();
        let groups = by_value("p", &values);
        assert_eq!(groups.iter().map(|g| g.value.as_str()).collect::<Vec<_>>(), ["0 to 10", "11 to 20", "21 to 30"]);
        assert_eq!(groups.iter().map(|g| g.correct.total).collect::<Vec<_>>(), [11, 10, 10]);
        let few = [Value::Number(1.0), Value::Number(0.25), Value::Number(1.0)];
        let groups = by_value("p", &few.iter().map(|v| (v, false)).collect::<Vec<_>>());
        assert_eq!(
            groups.iter().map(|g| (g.value.as_str(), g.correct.total)).collect::<Vec<_>>(),
            [("0.25", 1), ("1", 2)]
        );
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
}

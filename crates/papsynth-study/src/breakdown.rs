//! Right answers by what is known of a patch.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::design::Side;
use crate::parameters::Value;
use crate::saved::Judged;
use crate::score::Proportion;

/// So many different values are a group each; more numbers are sorted into thirds.
const FEW_VALUES: usize = 3;

/// Texts of more kinds than this are not broken down by: what is left in each group says nothing.
const MOST_TEXTS: usize = 12;

pub(crate) const FIELD: &str = "field";

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

/// Right answers by what is known of the synthetic patch, then by field.
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

/// Groups of one parameter: a few values each by itself, many numbers in thirds.
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
    if texts.len() <= MOST_TEXTS {
        groups.extend(texts.into_iter().map(|(text, correct)| group(text.to_owned(), correct)));
    }
    // One group alone compares with nothing.
    if groups.len() > 1 { groups } else { Vec::new() }
}

/// Sorted values, each by itself if there are few, else in three parts of about the same length; equal values stay together.
fn thirds(sorted: &[(f64, bool)]) -> Vec<&[(f64, bool)]> {
    let runs: Vec<&[(f64, bool)]> = sorted.chunk_by(|(a, _), (b, _)| a == b).collect();
    if runs.len() <= FEW_VALUES {
        return runs;
    }
    let (mut parts, mut from, mut to) = (Vec::new(), 0, 0);
    for run in runs {
        to += run.len();
        // The run that reaches a third of all ends it.
        if to * 3 >= sorted.len() * (parts.len() + 1) {
            parts.push(&sorted[from..to]);
            from = to;
        }
    }
    parts
}

/// A number in three figures.
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
    fn many_numbers_are_sorted_into_thirds_and_few_stand_alone() {
        let numbers: Vec<Value> = (0..31).map(|k| Value::Number(f64::from(k * 7 % 31))).collect();
        let values: Vec<_> = numbers.iter().map(|v| (v, true)).collect();
        let groups = by_value("p", &values);
        assert_eq!(groups.iter().map(|g| g.value.as_str()).collect::<Vec<_>>(), ["0 to 10", "11 to 20", "21 to 30"]);
        assert_eq!(groups.iter().map(|g| g.correct.of).collect::<Vec<_>>(), [11, 10, 10]);
        let few = [Value::Number(1.0), Value::Number(0.25), Value::Number(1.0)];
        let groups = by_value("p", &few.iter().map(|v| (v, false)).collect::<Vec<_>>());
        assert_eq!(
            groups.iter().map(|g| (g.value.as_str(), g.correct.of)).collect::<Vec<_>>(),
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

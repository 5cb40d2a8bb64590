//! Suggestions for misspelt words.

/// Returns the candidate most similar to a misspelt word, if one is similar enough, or one that begins with the word.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    /// A candidate is similar enough if at most one letter in so many changes.
    const LETTERS_PER_CHANGE: usize = 3;
    let plain = fold(word);
    let reach = (plain.len() / LETTERS_PER_CHANGE).max(1);
    let candidates: Vec<&str> = candidates.into_iter().collect();
    let begins = |candidate: &str| plain.len() >= LETTERS_PER_CHANGE && fold(candidate).starts_with(&plain);
    candidates
        .iter()
        .map(|candidate| (distance(&plain, &fold(candidate)), *candidate))
        .filter(|(changes, _)| *changes <= reach)
        .min_by_key(|(changes, _)| *changes)
        .map(|(_, candidate)| candidate)
        .or_else(|| candidates.iter().copied().find(|candidate| begins(candidate)))
}

/// Ignores case and the difference between dash and underscore.
fn fold(word: &str) -> Vec<char> {
    /// Length to which words are cut; all names are shorter.
    const LONGEST: usize = 64;
    word.chars().take(LONGEST).map(|c| if c == '-' { '_' } else { c.to_ascii_lowercase() }).collect()
}

/// Returns the number of changes, insertions, deletions and swaps of neighbours between two words (optimal string
/// alignment).
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let same = usize::from(a[i - 1] != b[j - 1]);
            let mut best = (last[j - 1] + same).min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(before[j - 2] + 1);
            }
            row.push(best);
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes(a: &str, b: &str) -> usize {
        distance(&a.chars().collect::<Vec<_>>(), &b.chars().collect::<Vec<_>>())
    }

    #[test]
    fn distances_as_by_hand() {
        assert_eq!(changes("", ""), 0);
        assert_eq!(changes("", "abc"), 3);
        assert_eq!(changes("width_px", "widht_px"), 1);
        assert_eq!(changes("kitten", "sitting"), 3);
    }

    #[test]
    fn only_similar_words_are_suggested() {
        let keys = ["width_px", "height_px", "pixel_um"];
        assert_eq!(nearest("widht_px", keys), Some("width_px"));
        assert_eq!(nearest("Width-px", keys), Some("width_px"));
        assert_eq!(nearest("colour", keys), None);
        assert_eq!(
            [nearest("width", keys), nearest("pix", keys), nearest("p", keys)],
            [Some("width_px"), Some("pixel_um"), None]
        );
        assert_eq!(nearest(&"x".repeat(100_000), keys), None);
    }
}

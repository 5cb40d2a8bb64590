//! The words after the name of a chore.

use anyhow::{Context, Result, bail};

/// Words that have not been understood yet.
pub(crate) struct Arguments {
    words: Vec<String>,
}

impl Arguments {
    pub(crate) fn new(words: Vec<String>) -> Self {
        Self { words }
    }

    /// Takes a word that stands alone, such as `--bless` or `peers`; says whether it was there.
    pub(crate) fn flag(&mut self, name: &str) -> bool {
        let place = self.words.iter().position(|word| word == name);
        place.map(|place| self.words.remove(place)).is_some()
    }

    /// Takes a word and the value after it, such as `--save NAME`.
    pub(crate) fn option(&mut self, name: &str) -> Result<Option<String>> {
        let Some(place) = self.words.iter().position(|word| word == name) else {
            return Ok(None);
        };
        self.words.remove(place);
        let value = (place < self.words.len()).then(|| self.words.remove(place));
        value
            .filter(|value| !value.starts_with('-'))
            .with_context(|| format!("{name} needs a value after it"))
            .map(Some)
    }

    /// All words that are left, for a program that understands them itself.
    pub(crate) fn rest(self) -> Vec<String> {
        self.words
    }

    /// Makes sure that no word is left.
    pub(crate) fn finish(self) -> Result<()> {
        match self.words.first() {
            None => Ok(()),
            Some(word) => bail!("`{word}` means nothing here; --help shows what does"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arguments(line: &str) -> Arguments {
        Arguments::new(line.split_whitespace().map(str::to_owned).collect())
    }

    #[test]
    fn words_are_taken_in_any_order_and_none_is_overlooked() {
        let mut words = arguments("--against old peers --save new");
        assert_eq!(words.option("--save").unwrap().as_deref(), Some("new"));
        assert!(words.flag("peers"));
        assert!(!words.flag("peers"));
        assert!(arguments("--against").option("--against").is_err());
        assert!(arguments("--save --against old").option("--save").is_err());
        assert!(words.finish().is_err(), "`--against old` is left");
    }
}

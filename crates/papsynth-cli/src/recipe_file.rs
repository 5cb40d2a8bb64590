//! The recipe that the command line asks for: a file or a preset, with single fields set over it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use papsynth::model::Model;
use papsynth::recipe::diagnose::{self, FieldError, Schema};
use papsynth::recipe::{Preset, Recipe};
use toml::{Table, Value};

use crate::args::RecipeArgs;
use crate::exit::{Complaint, Failure};
use crate::text_file;

/// Largest recipe that is read: a thousand times the largest that `papsynth init` prints would still fit.
const LARGEST: u64 = 1 << 20;

const MOST_FAULTS: usize = 12;

/// A recipe, and where its fields were written.
#[derive(Debug)]
pub(crate) struct RecipeFile {
    /// The recipe, with everything set over it.
    pub(crate) recipe: Recipe,
    /// The folder that files named by the recipe are relative to.
    pub(crate) folder: PathBuf,
    sources: Sources,
}

/// The texts that the user wrote.
#[derive(Debug)]
struct Sources {
    file: Option<(String, Arc<String>)>,
    sets: Vec<Set>,
}

/// A `--set a.b=value`.
#[derive(Debug)]
struct Set {
    argument: Arc<String>,
    /// The key before its `=`.
    key: String,
    /// Where its value begins in that.
    value_at: usize,
    /// What it sets, as a table of tables.
    table: Table,
    path: Vec<String>,
}

impl RecipeFile {
    /// Reads the recipe and lays over it what was set.
    pub(crate) fn load(args: &RecipeArgs) -> Result<Self, Failure> {
        let sets = args.set.iter().map(|argument| Set::parse(argument)).collect::<Result<Vec<_>, _>>()?;
        let (mut base, file, folder) = match &args.recipe {
            None => (args.preset.unwrap_or(Preset::Lbc).recipe(), None, PathBuf::new()),
            Some(path) => {
                let (recipe, file) = read(path, "a recipe", "the recipe cannot be read")?;
                (recipe, Some(file), path.parent().map(Path::to_path_buf).unwrap_or_default())
            }
        };
        for path in &args.with {
            let (found, (_, text)) = read(path, "sections of a recipe", "these sections cannot be read")?;
            let sections: Table = toml::from_str(&text).unwrap_or_default();
            base.replace(&found, |section| sections.contains_key(section));
        }
        if let Some(camera) = args.camera {
            base.camera = camera.camera();
        }
        let sources = Sources { file, sets };
        let recipe = sources
            .overlay(base)
            .map_err(|faults| Failure::from(sources.complaint(faults, "what is set does not fit the recipe")))?;
        let found = Self { recipe, folder, sources };
        match found.recipe.problems() {
            problems if problems.is_empty() => Ok(found),
            problems => Err(found.refuse(&papsynth::Error::Recipe(problems))),
        }
    }

    /// Every class of cells must be one of the model's.
    pub(crate) fn check_classes(&self, model: &Model) -> Result<(), Failure> {
        let faults = diagnose::unknown_classes(&self.recipe, model);
        match faults.is_empty() {
            true => Ok(()),
            false => Err(Failure::from(self.sources.complaint(faults, "the model lacks classes"))),
        }
    }

    /// What is wrong with one field, at the place where it was written.
    pub(crate) fn complaint(&self, field: &str, message: String) -> Complaint {
        let path = field.split('.').map(str::to_owned).collect();
        self.sources.place(FieldError { path, span: None, message, help: None })
    }

    /// What the engine says against the recipe, at the places where its fields were written.
    pub(crate) fn refuse(&self, error: &papsynth::Error) -> Failure {
        let schema = Schema::new();
        let (fields, heading) = match error {
            papsynth::Error::Recipe(problems) => {
                let fields = problems
                    .iter()
                    .map(|p| (p.field.clone(), diagnose::middle_left_out(&p.to_string())))
                    .collect::<Vec<_>>();
                (fields, "the recipe asks for what cannot be")
            }
            papsynth::Error::Layout(_) => return Failure::from(self.complaint("layout", error.to_string())),
            other => return Failure::input(other),
        };
        let faults = fields.into_iter().map(|(field, message)| {
            let path: Vec<String> = field.split('.').map(str::to_owned).collect();
            let meaning = schema.at(&path).and_then(|section| section.meaning()).map(|m| format!("the field: {m}"));
            FieldError { path, span: None, message, help: meaning }
        });
        Failure::from(self.sources.complaint(faults.collect(), heading))
    }
}

/// The recipe of a file, and the name and the text of that.
fn read(path: &Path, what: &str, heading: &str) -> Result<(Recipe, (String, Arc<String>)), Failure> {
    let (name, text) = text_file::read(path, LARGEST, &format!("{what}, a few kilobytes of text"))?;
    let file = (name, Arc::new(text));
    match diagnose::read(&file.1) {
        Ok(recipe) => Ok((recipe, file)),
        Err(faults) => Err(Sources { file: Some(file), sets: Vec::new() }.complaint(faults, heading).into()),
    }
}

impl Sources {
    /// The recipe with every `--set` laid over it, in the order given.
    fn overlay(&self, base: Recipe) -> Result<Recipe, Vec<FieldError>> {
        if self.sets.is_empty() {
            return Ok(base);
        }
        let fault = |message: String| vec![FieldError { path: Vec::new(), span: None, message, help: None }];
        let mut table: Table = toml::from_str(&base.to_toml()).map_err(|e| fault(e.to_string()))?;
        for set in &self.sets {
            // Which cells there are is one answer; a field of one class is another.
            if set.key == "cells" {
                table.remove("cells");
            }
            merge(&mut table, &set.table);
        }
        let text = toml::to_string(&table).map_err(|e| fault(e.to_string()))?;
        // The places found in this text mean nothing to the user; the paths do.
        diagnose::read(&text).map_err(|faults| faults.into_iter().map(|f| FieldError { span: None, ..f }).collect())
    }

    /// Faults at the places where the user wrote the fields: the last `--set` that touches one, or the file.
    fn complaint(&self, faults: Vec<FieldError>, heading: &str) -> Complaint {
        let more = faults.len().saturating_sub(MOST_FAULTS);
        let mut complaints: Vec<_> = faults.into_iter().take(MOST_FAULTS).map(|f| self.place(f)).collect();
        if more > 0 {
            complaints.push(Complaint::new(format!("and {more} more")));
        }
        Complaint::all(heading, complaints)
    }

    fn place(&self, fault: FieldError) -> Complaint {
        let complaint = |message: String| match &fault.help {
            Some(help) => Complaint::new(message).help(help),
            None => Complaint::new(message),
        };
        if let Some(set) = self.sets.iter().rev().find(|set| set.touches(&fault.path)) {
            return complaint(fault.message).at("--set", &set.argument, set.value_at..set.argument.len());
        }
        match &self.file {
            Some((name, text)) => match fault.span.or_else(|| diagnose::find(text, &fault.path)) {
                Some(span) => complaint(fault.message).at(name, text, span),
                None => complaint(format!("{name}: {}", fault.message)),
            },
            None => complaint(fault.message),
        }
    }
}

impl Set {
    fn parse(argument: &str) -> Result<Self, Failure> {
        let text = Arc::new(argument.to_owned());
        let wrong = |message: &str, span| {
            let help = "write it like --set field.width_px=512 or --set 'slide.depth_um={ uniform = [2, 6] }'";
            Failure::from(Complaint::new(message).at("--set", &text, span).help(help))
        };
        let Some((key, value)) = argument.split_once('=') else {
            return Err(wrong("expected a field and its value with `=` between them", 0..argument.len()));
        };
        let value_at = key.len() + 1;
        // A bare word stands for itself, so that no one has to quote quotes for a shell.
        let is_word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.' | '/');
        let parse = |value: &str| toml::from_str::<Table>(&format!("{key} = {value}\n"));
        let trimmed = value.trim();
        let table = match parse(value) {
            Err(_) if !trimmed.is_empty() && trimmed.chars().all(is_word) && trimmed.parse::<f64>().is_err() => {
                parse(&Value::String(trimmed.to_owned()).to_string())
            }
            other => other,
        };
        let table = table.map_err(|error| {
            let at = error.span().map_or(value_at, |s| s.start);
            // The text that was parsed has ` = ` where the argument has `=`.
            let at = if at > key.len() { at.saturating_sub(2).max(value_at) } else { at };
            wrong(error.message(), at.min(argument.len())..argument.len())
        })?;
        let path = leaf(&table);
        Ok(Self { argument: text.clone(), key: key.trim().to_owned(), value_at, table, path })
    }

    /// Whether the path it sets and another lead through one another.
    fn touches(&self, path: &[String]) -> bool {
        self.path.iter().zip(path).all(|(a, b)| a == b)
    }
}

/// The path through tables of one key each.
fn leaf(table: &Table) -> Vec<String> {
    let mut path = Vec::new();
    let mut table = table;
    while let (1, Some((name, value))) = (table.len(), table.iter().next()) {
        path.push(name.clone());
        match value {
            Value::Table(inner) => table = inner,
            _ => break,
        }
    }
    path
}

/// Lays a table over another, field by field. A distribution, or a table of another kind, takes the place of the
/// whole: its fields belong together.
fn merge(base: &mut Table, over: &Table) {
    const LAWS: [&str; 4] = ["uniform", "normal", "log_normal", "choice"];
    for (name, value) in over {
        match (base.get_mut(name), value) {
            (Some(Value::Table(inner)), Value::Table(over)) => {
                let is_law = LAWS.iter().any(|law| over.contains_key(*law));
                let is_other_kind = over.get("kind").is_some_and(|kind| inner.get("kind") != Some(kind));
                let is_density = over.contains_key("per_mm2") && !inner.contains_key("per_mm2");
                if is_law || is_density || is_other_kind {
                    *inner = over.clone();
                } else {
                    merge(inner, over);
                }
            }
            _ => {
                base.insert(name.clone(), value.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(preset: Preset, sets: &[&str]) -> Result<Recipe, String> {
        let set = sets.iter().map(|&s| s.to_owned()).collect();
        let args = RecipeArgs { recipe: None, preset: Some(preset), with: Vec::new(), camera: None, set };
        RecipeFile::load(&args).map(|found| found.recipe).map_err(|failure| failure.json().to_string())
    }

    #[test]
    fn one_field_changes_and_no_other() {
        let recipe = load(Preset::Dense, &["field.width_px=96", "cells.intermediate.count=2"]).unwrap();
        let mut expected = Preset::Dense.recipe();
        expected.field.width_px = 96.0.into();
        expected.cells.get_mut("intermediate").unwrap().count = 2.0.into();
        assert_eq!(recipe, expected);
    }

    #[test]
    fn distributions_and_kinds_replace_the_whole() {
        use papsynth::recipe::{Layout, Number};
        let recipe = load(Preset::Lbc, &["layout.kind=uniform", "slide.depth_um={ normal = [4, 0.5] }"]).unwrap();
        assert_eq!(recipe.layout, Layout::Uniform {});
        assert_eq!(recipe.slide.depth_um, Number::normal(4.0, 0.5));
        for count in ["20", "{ uniform = [1, 4] }", "{ per_mm2 = 120 }", "{ per_mm2 = { uniform = [1, 4] } }"] {
            let sets = [format!("cells.intermediate.count={count}")];
            for preset in [Preset::Lbc, Preset::Paper2015] {
                let recipe = load(preset, &[&sets[0]]).unwrap();
                assert_eq!(recipe.cells["intermediate"].count.to_string(), count);
            }
        }
        let sets = ["layout.kind=band", "layout.width_um=50", "layout.outside=0.1"];
        let band = Layout::Band(papsynth::recipe::Band { width_um: 50.0.into(), outside: 0.1.into() });
        assert_eq!(load(Preset::Lbc, &sets).unwrap().layout, band);
        // The later one wins.
        let recipe = load(Preset::Lbc, &["field.width_px=96", "field.width_px=64"]).unwrap();
        assert_eq!(recipe.field.width_px, 64.0.into());
        // A bound is laid over the distribution it bounds.
        let recipe = load(Preset::Lbc, &["slide.depth_um={uniform=[2, 6]}", "slide.depth_um.max=5"]).unwrap();
        assert_eq!(recipe.slide.depth_um.bounds(), [2.0, 5.0]);
    }

    #[test]
    fn faults_point_at_the_argument() {
        for (set, expected) in [
            ("field.widht_px=96", "did you mean `width_px`"),
            ("field.width_px=-3", "field.width_px: -3 is out of range: expected 16 to 32768"),
            ("field.width_px=nan", "field.width_px: NaN"),
            ("field.width_px=wide", "found a string"),
            ("field.width_px", "with `=` between them"),
            ("field.width_px=", "--set"),
            ("=3", "--set"),
            ("field.width_px=[1,", "--set"),
            ("field=3", "field: expected a table, found an integer"),
            ("layout.kind=map", "missing field"),
            ("camera.bits=8.5", "is not an integer"),
            ("layout.kind=lumps", "layout.kind: unknown value \"lumps\""),
            ("version=2", "version 2"),
            ("cytoplasm.sheet=xpdb", "did you mean `xpbd`"),
        ] {
            let error = load(Preset::Lbc, &[set]).expect_err(set);
            assert!(error.contains(expected), "{set}: {error}");
            assert!(error.contains("\"file\":\"--set\""), "{set}: {error}");
        }
    }

    #[test]
    fn a_field_that_clashes_with_a_default_names_both() {
        let error = load(Preset::Lbc, &["nucleus.patch_um=0.6"]).unwrap_err();
        assert!(error.contains("nucleus.overlap_um") && error.contains("nucleus.patch_um"), "{error}");
    }

    proptest::proptest! {
        /// Whatever stands in a `--set`: an answer, and no panic.
        #[test]
        fn anything_can_be_set_or_is_refused(argument in "(field|layout|cells|[a-z.\"']{0,12})[.=]{0,2}\\PC{0,24}") {
            if let Err(error) = load(Preset::Lbc, &[&argument]) {
                proptest::prop_assert!(error.contains("--set"), "{}", error);
            }
        }
    }
}

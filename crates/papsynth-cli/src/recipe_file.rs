//! The recipe of a command line: a file or a preset, with the changes of `--with`, `--camera` and `--set`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use papsynth::model::Model;
use papsynth::recipe::diagnose::{self, FieldError, Schema};
use papsynth::recipe::{Preset, Recipe};
use toml::{Table, Value};

use crate::args::RecipeArgs;
use crate::exit::{ErrorReport, ExitError};
use crate::input_file;
use crate::words::counted;

/// Size limit of recipes, bytes: far above the size of commented recipes.
const MAX_BYTES: u64 = 1 << 20;

/// Invalid fields that are reported at most.
const MAX_FAULTS: usize = 12;

/// A recipe and the texts that it was read from.
#[derive(Debug)]
pub(crate) struct RecipeFile {
    /// The recipe with all changes.
    pub(crate) recipe: Recipe,
    /// The folder to which paths in the recipe are relative.
    pub(crate) folder: PathBuf,
    sources: Sources,
}

/// The texts of the user, for the locations of errors.
#[derive(Debug)]
struct Sources {
    file: Option<(String, Arc<String>)>,
    sets: Vec<Set>,
}

/// A `--set a.b=value`.
#[derive(Debug)]
struct Set {
    /// The option: `--set` or `--vary`.
    option: &'static str,
    argument: Arc<String>,
    /// The text before `=`.
    key: String,
    /// Byte at which the value begins in the argument.
    value_at: usize,
    /// Number of names in the key.
    depth: usize,
    /// The key and the value as nested tables.
    table: Table,
    path: Vec<String>,
}

impl RecipeFile {
    /// Reads the recipe and applies the changes of the command line.
    pub(crate) fn load(args: &RecipeArgs) -> Result<Self, ExitError> {
        let given = args.set.iter().map(|set| ("--set", set)).chain(args.vary.iter().map(|set| ("--vary", set)));
        let sets = given.map(|(option, argument)| Set::parse(option, argument)).collect::<Result<Vec<_>, _>>()?;
        let (mut base, file, folder) = match &args.recipe {
            None => (args.preset.unwrap_or(Preset::Lbc).recipe(), None, PathBuf::new()),
            Some(path) => {
                let (recipe, file) = read(path, "a recipe")?;
                (recipe, Some(file), path.parent().map(Path::to_path_buf).unwrap_or_default())
            }
        };
        for path in &args.with {
            let (found, (_, text)) = read(path, "sections of a recipe")?;
            let sections: Table = toml::from_str(&text).unwrap_or_default();
            base.replace(&found, |section| sections.contains_key(section));
            if !sections.contains_key("conditions") {
                base.clear_conditions(|path| path.split('.').next().is_some_and(|name| sections.contains_key(name)));
            }
        }
        if let Some(camera) = args.camera {
            base.camera = camera.camera();
            base.clear_conditions(|path| path.starts_with("camera."));
        }
        if let Some(factor) = args.widen {
            base = base.widened(factor);
        }
        let sources = Sources { file, sets };
        let recipe = sources
            .overlay(base)
            .map_err(|faults| ExitError::from(sources.report(faults, "invalid fields in --set")))?;
        let found = Self { recipe, folder, sources };
        match found.recipe.problems() {
            problems if problems.is_empty() => Ok(found),
            problems => Err(found.error(&papsynth::Error::Recipe(problems))),
        }
    }

    /// Checks that the model has all classes of the recipe.
    pub(crate) fn check_classes(&self, model: &Model) -> Result<(), ExitError> {
        let faults = diagnose::unknown_classes(&self.recipe, model);
        match faults.is_empty() {
            true => Ok(()),
            false => Err(ExitError::from(self.sources.report(faults, "classes that the model does not have"))),
        }
    }

    /// An error in one field, with its location.
    pub(crate) fn report(&self, field: &str, message: String) -> ErrorReport {
        let path = field.split('.').map(str::to_owned).collect();
        self.sources.located(FieldError { path, span: None, message, help: None })
    }

    /// An error of the engine, with the locations of its fields.
    pub(crate) fn error(&self, error: &papsynth::Error) -> ExitError {
        let schema = Schema::new();
        let (fields, heading) = match error {
            papsynth::Error::Recipe(problems) => {
                let fields = problems
                    .iter()
                    .map(|p| (p.field.clone(), diagnose::middle_left_out(&p.to_string())))
                    .collect::<Vec<_>>();
                (fields, "invalid fields in the recipe")
            }
            papsynth::Error::Layout(_) => return ExitError::from(self.report("layout", error.to_string())),
            other => return ExitError::input(other),
        };
        let faults = fields.into_iter().map(|(field, message)| {
            let path: Vec<String> = field.split('.').map(str::to_owned).collect();
            let meaning =
                schema.at(&path).and_then(|section| section.meaning()).map(|m| format!("meaning of the field: {m}"));
            FieldError { path, span: None, message, help: meaning }
        });
        ExitError::from(self.sources.report(faults.collect(), heading))
    }
}

/// Reads a recipe, and returns it with the name and the text of its file.
fn read(path: &Path, expected: &str) -> Result<(Recipe, (String, Arc<String>)), ExitError> {
    let (name, text) = input_file::read(path, MAX_BYTES, &format!("{expected}, a few kilobytes of text"))?;
    let file = (name, Arc::new(text));
    match diagnose::read(&file.1) {
        Ok(recipe) => Ok((recipe, file)),
        Err(faults) => {
            let heading = format!("invalid fields in {}", file.0);
            Err(Sources { file: Some(file), sets: Vec::new() }.report(faults, &heading).into())
        }
    }
}

impl Sources {
    /// Applies every `--set` to a recipe, in their order.
    fn overlay(&self, base: Recipe) -> Result<Recipe, Vec<FieldError>> {
        if self.sets.is_empty() {
            return Ok(base);
        }
        let fault = |message: String| vec![FieldError { path: Vec::new(), span: None, message, help: None }];
        let mut table: Table = toml::from_str(&base.to_toml()).map_err(|e| fault(e.to_string()))?;
        for set in &self.sets {
            // `cells` replaces all classes; a field of one class changes only this field.
            if set.key == "cells" {
                table.remove("cells");
            }
            merge(&mut table, &set.table);
        }
        let text = toml::to_string(&table).map_err(|e| fault(e.to_string()))?;
        // The user does not see this text, so only the paths of the fields are kept.
        let mut recipe = diagnose::read(&text)
            .map_err(|faults| faults.into_iter().map(|f| FieldError { span: None, ..f }).collect::<Vec<_>>())?;
        // Conditions hold over the fields that are set before them.
        let conditions = self.sets.iter().rposition(|set| set.key == "conditions");
        let later = &self.sets[conditions.map_or(0, |place| place + 1)..];
        recipe.clear_conditions(|path| {
            let path: Vec<String> = path.split('.').map(str::to_owned).collect();
            later.iter().any(|set| set.replaces(&path))
        });
        Ok(recipe)
    }

    /// Errors with their locations: the last `--set` of the field, or the file.
    fn report(&self, faults: Vec<FieldError>, heading: &str) -> ErrorReport {
        let heading = format!("{} {heading}", faults.len());
        let more = faults.len().saturating_sub(MAX_FAULTS);
        let mut reports: Vec<_> = faults.into_iter().take(MAX_FAULTS).map(|f| self.located(f)).collect();
        if more > 0 {
            reports.push(ErrorReport::new(counted(more as u64, "more error", "more errors")));
        }
        ErrorReport::all(heading, reports)
    }

    fn located(&self, fault: FieldError) -> ErrorReport {
        let report = |message: String| match &fault.help {
            Some(help) => ErrorReport::new(message).help(help),
            None => ErrorReport::new(message),
        };
        if let Some(set) = self.sets.iter().rev().find(|set| set.touches(&fault.path)) {
            let is_key = fault.message.starts_with("unknown key") && fault.path.len() <= set.depth;
            let span = if is_key { 0..set.value_at - 1 } else { set.value_at..set.argument.len() };
            return report(fault.message).at(set.option, &set.argument, span);
        }
        match &self.file {
            Some((name, text)) => match fault.span.or_else(|| diagnose::find(text, &fault.path)) {
                Some(span) => report(fault.message).at(name, text, span),
                None => report(format!("{name}: {}", fault.message)),
            },
            None => report(fault.message),
        }
    }
}

impl Set {
    fn parse(option: &'static str, argument: &str) -> Result<Self, ExitError> {
        let text = Arc::new(argument.to_owned());
        let wrong = |message: &str, span| {
            let help = "examples: --set field.width_px=512, --set 'slide.depth_um={ uniform = [2, 6] }'";
            ExitError::from(ErrorReport::new(message).at(option, &text, span).help(help))
        };
        let Some((key, value)) = argument.split_once('=') else {
            return Err(wrong("expected KEY=VALUE", 0..argument.len()));
        };
        let value_at = key.len() + 1;
        // A bare word is a string, so that a shell needs no quotes.
        let is_word = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.' | '/');
        let parse = |value: &str| toml::from_str::<Table>(&format!("{key} = {value}\n"));
        let trimmed = value.trim();
        if trimmed.is_empty() {
            return Err(wrong("the value is missing: expected KEY=VALUE", 0..argument.len()));
        }
        let table = match parse(value) {
            Err(_) if trimmed.chars().all(is_word) && trimmed.parse::<f64>().is_err() => {
                parse(&Value::String(trimmed.to_owned()).to_string())
            }
            other => other,
        };
        let table = table.map_err(|error| {
            let at = error.span().map_or(value_at, |s| s.start);
            // The parsed text has ` = ` where the argument has `=`.
            let at = if at > key.len() { at.saturating_sub(2).max(value_at) } else { at };
            wrong(&diagnose::plain(error.message()), at.min(argument.len())..argument.len())
        })?;
        let path = leaf(&table);
        let depth = parse("0").map_or(path.len(), |table| leaf(&table).len());
        Ok(Self { option, argument: text.clone(), key: key.trim().to_owned(), value_at, depth, table, path })
    }

    /// Whether one of the two paths contains the other.
    fn touches(&self, path: &[String]) -> bool {
        self.path.iter().zip(path).all(|(a, b)| a == b)
    }

    /// Whether the number at a path has another value or meaning now: another kind changes all numbers of its table.
    fn replaces(&self, path: &[String]) -> bool {
        let changed = self.path.strip_suffix(&["kind".to_owned()]).unwrap_or(&self.path);
        changed.iter().zip(path).all(|(a, b)| a == b)
    }
}

/// The path of the first key in nested tables of one key each.
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

/// Merges a table into another, field by field. A distribution, or a table of another kind, replaces the complete
/// table.
fn merge(base: &mut Table, over: &Table) {
    const DISTRIBUTIONS: [&str; 4] = ["uniform", "normal", "log_normal", "choice"];
    for (name, value) in over {
        match (base.get_mut(name), value) {
            (Some(Value::Table(inner)), Value::Table(over)) => {
                let is_distribution = DISTRIBUTIONS.iter().any(|name| over.contains_key(*name));
                let is_other_kind = over.get("kind").is_some_and(|kind| inner.get("kind") != Some(kind));
                let is_density = over.contains_key("per_mm2") && !inner.contains_key("per_mm2");
                if is_distribution || is_density || is_other_kind {
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
        let args = RecipeArgs {
            recipe: None,
            preset: Some(preset),
            with: Vec::new(),
            camera: None,
            widen: None,
            set,
            vary: Vec::new(),
        };
        RecipeFile::load(&args).map(|found| found.recipe).map_err(|error| error.json().to_string())
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
    fn distributions_and_kinds_replace_the_complete_table() {
        use papsynth::recipe::{Layout, Number};
        let recipe = load(Preset::Lbc, &["layout.kind=uniform", "slide.depth_um={ normal = [4, 0.5] }"]).unwrap();
        assert_eq!(recipe.layout, Layout::Uniform {});
        assert_eq!(recipe.slide.depth_um, Number::normal(4.0, 0.5));
        for count in ["20", "{ uniform = [1.5, 4.5] }", "{ per_mm2 = 120 }", "{ per_mm2 = { uniform = [1.5, 4.5] } }"] {
            let sets = [format!("cells.intermediate.count={count}")];
            for preset in [Preset::Lbc, Preset::Paper2015] {
                let recipe = load(preset, &[&sets[0]]).unwrap();
                assert_eq!(recipe.cells["intermediate"].count.to_string(), count);
            }
        }
        let sets = ["layout.kind=band", "layout.width_um=50", "layout.outside=0.1"];
        let band = Layout::Band(papsynth::recipe::Band { width_um: 50.0.into(), outside: 0.1.into() });
        assert_eq!(load(Preset::Lbc, &sets).unwrap().layout, band);
        // The last one counts.
        let recipe = load(Preset::Lbc, &["field.width_px=96", "field.width_px=64"]).unwrap();
        assert_eq!(recipe.field.width_px, 64.0.into());
        // A bound is added to the distribution.
        let recipe = load(Preset::Lbc, &["slide.depth_um={uniform=[2, 6]}", "slide.depth_um.max=5"]).unwrap();
        assert_eq!(recipe.slide.depth_um.bounds(), [2.0, 5.0]);
    }

    #[test]
    fn a_set_holds_under_all_conditions() {
        let conditions = "conditions=[{ numbers = { 'stain.field_nucleus' = 2, 'layout.radius_um' = 30, \
            'debris.leukocytes.clusters' = { per_mm2 = 5 } } }]";
        let sets = [conditions, "debris.leukocytes.clusters.per_mm2.uniform=[10, 20]", "layout.kind=uniform"];
        let recipe = load(Preset::ExtendedFocus, &sets).unwrap();
        assert_eq!(recipe.conditions[0].numbers.keys().collect::<Vec<_>>(), ["stain.field_nucleus"]);
        assert_eq!(
            recipe.with_condition(0).debris.leukocytes.clusters.to_string(),
            "{ per_mm2 = { uniform = [10.0, 20.0] } }"
        );
        // Conditions that are set later are kept.
        let recipe = load(Preset::ExtendedFocus, &["stain.field_nucleus=1", conditions]).unwrap();
        assert_eq!(recipe.conditions[0].numbers["stain.field_nucleus"].to_string(), "2");
    }

    #[test]
    fn faults_point_at_the_argument() {
        for (set, expected) in [
            ("field.widht_px=96", "did you mean `width_px`"),
            ("field.width_px=-3", "field.width_px: -3 is out of range: expected 16 to 32768"),
            ("field.width_px=nan", "field.width_px: NaN"),
            ("field.width_px=wide", "expected a number, found a string"),
            ("field.width_px", "expected KEY=VALUE"),
            ("field.width_px=", "the value is missing"),
            ("field.width_px= ", "the value is missing"),
            ("field.width_px=99999999999999999999999", "the integer 99999999999999999999999 is too large"),
            ("stain.slide_nucleus={uniform=[1,2,9]}", "expected 2 numbers in `uniform`, found 3"),
            ("field.widht_px=5", "\"column\":1}"),
            ("field.width_px={unifrom=[1,2]}", "\"column\":16}"),
            ("=3", "--set"),
            ("field.width_px=[1,", "--set"),
            ("field=3", "field: expected a table, found an integer"),
            ("layout.kind=density-map", "missing field"),
            ("camera.bits=8.5", "is not an integer"),
            ("layout.kind=lumps", "layout.kind: unknown value"),
            ("version=2", "version 2"),
            ("cytoplasm.sheet=xpdb", "did you mean `xpbd`"),
        ] {
            let error = load(Preset::Lbc, &[set]).expect_err(set);
            assert!(error.contains(expected), "{set}: {error}");
            assert!(error.contains("\"file\":\"--set\""), "{set}: {error}");
        }
    }

    #[test]
    fn a_conflict_with_a_default_names_both_fields() {
        let error = load(Preset::Lbc, &["nucleus.patch_um=0.6"]).unwrap_err();
        assert!(error.contains("nucleus.overlap_um") && error.contains("nucleus.patch_um"), "{error}");
    }

    proptest::proptest! {
        /// No `--set` panics.
        #[test]
        fn any_set_is_accepted_or_rejected(argument in "(field|layout|cells|[a-z.\"']{0,12})[.=]{0,2}\\PC{0,24}") {
            if let Err(error) = load(Preset::Lbc, &[&argument]) {
                proptest::prop_assert!(error.contains("--set"), "{}", error);
            }
        }
    }
}

//! Recipes and models with invalid values in every field, and of excessive size: rejected with the name of the field,
//! fast and in little memory.

#[allow(dead_code, reason = "each test uses a part")]
use std::collections::BTreeSet;
use std::fs;
use std::time::{Duration, Instant};

use crate::support::{Bench, Outcome};
use papsynth::recipe::{Preset, toml_value};
use serde_json::{Map, Value};

/// Values that no numeric field accepts.
const NO_NUMBER: [&str; 34] = [
    "nan",
    "-nan",
    "inf",
    "-inf",
    "1e300",
    "-1e300",
    "-4294967296",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "0x7fffffffffffffff",
    "\"1\"",
    "\"\\u0000\"",
    "true",
    "[]",
    "[1]",
    "[[[[1]]]]",
    "1979-05-27",
    "07:32:00",
    "{}",
    "{ a = { b = { c = 1 } } }",
    "{ gauss = [1, 2] }",
    "{ min = 1 }",
    "{ uniform = [1] }",
    "{ uniform = [2, 1] }",
    "{ uniform = [nan, 1] }",
    "{ uniform = \"1\" }",
    "{ normal = [1, -1] }",
    "{ normal = [inf, 1] }",
    "{ normal = [1, 1e308] }",
    "{ log_normal = [-1, 1] }",
    "{ choice = [] }",
    "{ choice = [1, nan] }",
    "{ uniform = [1, 2], normal = [1, 2] }",
];

/// Values that some numeric fields accept.
const PERHAPS: [&str; 6] = ["0", "-0.0", "-1", "0.5", "1e-320", "{ normal = [1, 1e-9], min = 0, max = 2 }"];

/// Values that no string or boolean field accepts.
const NO_WORD: [&str; 6] = ["3", "nan", "[]", "[\"a\"]", "{}", "1979-05-27"];

/// A field of a recipe and the other fields of its section.
struct Leaf {
    path: String,
    /// The other fields of the section, one per line.
    around: String,
    value: Value,
}

impl Leaf {
    /// A recipe with this value of the field.
    fn with(&self, value: &str) -> String {
        match self.path.rsplit_once('.') {
            Some((section, name)) => format!("[{section}]\n{}{name} = {value}\n", self.around),
            None => format!("{} = {value}\n", self.path),
        }
    }
}

/// All different fields of the presets.
fn leaves() -> Vec<Leaf> {
    let (mut found, mut known) = (Vec::new(), BTreeSet::new());
    for preset in Preset::ALL {
        let value = serde_json::to_value(preset.recipe()).unwrap();
        walk(value.as_object().unwrap(), "", &mut known, &mut found);
    }
    found
}

fn is_number(value: &Value) -> bool {
    let distributions = ["uniform", "normal", "log_normal", "choice", "per_mm2"];
    value.is_number()
        || value.as_object().is_some_and(|table| distributions.iter().any(|name| table.contains_key(*name)))
}

fn walk(table: &Map<String, Value>, path: &str, known: &mut BTreeSet<String>, found: &mut Vec<Leaf>) {
    let kind = table.get("kind").and_then(Value::as_str).unwrap_or_default();
    for (name, value) in table {
        let here = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match value.as_object().filter(|_| !is_number(value)) {
            Some(inner) => walk(inner, &here, known, found),
            None => {
                // Classes of cells have the same fields.
                let class = here.split('.').nth(1).filter(|_| here.starts_with("cells.")).unwrap_or_default();
                if known.insert(format!("{kind} {}", here.replace(class, "*"))) {
                    let is_beside = |(other, value): &(&String, &Value)| {
                        *other != name
                            && !path.is_empty()
                            && (is_number(value) || !value.is_object())
                            && !value.is_null()
                    };
                    let line = |(name, value): (&String, &Value)| format!("{name} = {}\n", toml_value(value));
                    let around = table.iter().filter(is_beside).map(line).collect();
                    found.push(Leaf { path: here, around, value: value.clone() });
                }
            }
        }
    }
}

/// Runs of the program, with their number, times and errors.
struct Gauntlet {
    bench: Bench,
    runs: usize,
    slowest: (Duration, String),
    slow: Vec<String>,
    wrong: Vec<String>,
}

/// A missing model. An error about the model shows that the recipe was accepted.
const NO_MODEL: &str = "no-such-model.json";

/// Address-space limit of the program.
const MEMORY_KB: u64 = 1 << 20;

impl Gauntlet {
    fn new(name: &str) -> Self {
        Self {
            bench: Bench::new(name),
            runs: 0,
            slowest: (Duration::ZERO, String::new()),
            slow: Vec::new(),
            wrong: Vec::new(),
        }
    }

    fn run(&mut self, what: &str, words: &str) -> Outcome {
        #[expect(clippy::disallowed_methods, reason = "times are printed, not asserted")]
        let start = Instant::now();
        let run = self.bench.run_within(MEMORY_KB, words);
        let time = start.elapsed();
        self.runs += 1;
        if time > Duration::from_millis(100) {
            self.slow.push(format!("{:.0} ms: {what:.60}", time.as_secs_f64() * 1e3));
        }
        if time > self.slowest.0 {
            self.slowest = (time, what.to_owned());
        }
        if run.code != 2 || run.err.contains("panicked") || run.err.len() > 20_000 || self.bench.path("out").exists() {
            self.wrong.push(format!("--- {what}: ended with {}\n{:.2000}", run.code, run.err));
        }
        run
    }

    /// Runs a recipe that must be rejected with this name. Without `must`, it may also be accepted.
    fn recipe(&mut self, text: &str, named: &str, must: bool) {
        fs::write(self.bench.path("recipe.toml"), text).unwrap();
        let what = text.chars().take(200).collect::<String>();
        let run = self.run(&what, &format!("generate recipe.toml --out out --frames 1 --model {NO_MODEL}"));
        let accepted = run.err.contains(NO_MODEL);
        if (must && accepted) || !(accepted || run.err.contains(named)) {
            self.wrong.push(format!("--- {what}: expected {named:?}\n{:.2000}", run.err));
        }
    }

    fn end(self, at_least: usize) {
        let Self { runs, slowest: (time, what), slow, wrong, .. } = self;
        eprintln!(
            "{runs} runs, {} of them longer than 100 ms; the slowest took {:.0} ms: {what:?}",
            slow.len(),
            time.as_secs_f64() * 1e3
        );
        slow.iter().for_each(|slow| eprintln!("{slow}"));
        assert!(wrong.is_empty(), "{} wrong\n{}", wrong.len(), wrong.join("\n"));
        assert!(runs >= at_least, "{runs} runs");
    }
}

#[test]
fn every_field_rejects_invalid_values_by_name() {
    let mut gauntlet = Gauntlet::new("fields");
    let leaves = leaves();
    let mut sections = BTreeSet::new();
    for (number, leaf) in leaves.iter().enumerate() {
        // Without `PAPSYNTH_TORTURE`, each field is tested with some of the values.
        let all = std::env::var_os("PAPSYNTH_TORTURE").is_some();
        let mut take = |values: &[&str], count: usize, must: bool| {
            let count = if all { values.len() } else { count.min(values.len()) };
            for i in 0..count {
                gauntlet.recipe(&leaf.with(values[(number * count + i) % values.len()]), &leaf.path, must);
            }
        };
        if is_number(&leaf.value) {
            take(&NO_NUMBER, 4, true);
            take(&PERHAPS, 1, false);
        } else {
            take(&NO_WORD, 2, true);
            if leaf.value.is_boolean() {
                take(&["\"true\"", "1"], 1, true);
            } else if !leaf.path.ends_with(".path") {
                take(&["\"no-such-word\"", "\"\"", "\"\\u0000\""], 1, true);
            }
        }
        if let Some((section, _)) = leaf.path.rsplit_once('.')
            && sections.insert(section.to_owned())
        {
            gauntlet.recipe(&format!("[{section}]\nno_such_field = 1\n{}", leaf.around), "no_such_field", true);
            gauntlet.recipe(&format!("[{section}.{section}]\nx = 1\n"), section, true);
            gauntlet.recipe(&format!("[{section}]\n\"a\\u0000b\" = 1\n{}", leaf.around), section, true);
        }
    }
    eprintln!("{} fields in {} sections", leaves.len(), sections.len());
    gauntlet.end(200);
}

#[test]
fn large_and_deeply_nested_files_are_rejected_in_little_memory() {
    const HUGE: usize = 100_000_000;
    let mut gauntlet = Gauntlet::new("huge");
    let text = "x".repeat(HUGE);
    for (open, close) in [("[field]\nwidth_px = \"", "\"\n"), ("# ", "\n"), ("", " = 1\n"), ("[", "]\n")] {
        gauntlet.recipe(&format!("{open}{text}{close}"), "larger than", true);
    }
    // Nested values of half a megabyte, within the size limit of recipes.
    const DEEP: usize = 100_000;
    for (text, named) in [
        (format!("[field]\nwidth_px = {}1{}", "[".repeat(DEEP), "]".repeat(DEEP)), "recipe.toml:2"),
        (format!("[field]\nwidth_px = {}1{}", "{ a = ".repeat(DEEP), " }".repeat(DEEP)), "recipe.toml"),
        (format!("{}b = 1", "a.".repeat(DEEP)), "recipe.toml"),
        (format!("[{}b]\nc = 1", "a.".repeat(DEEP)), "recipe.toml"),
        (format!("field = {{ {} }}", "a = 1, ".repeat(DEEP)), "recipe.toml"),
        ((0..DEEP / 2).map(|i| format!("a{i} = 1\n")).collect(), "unknown key `a0`"),
        ("[[field]]\n".repeat(DEEP), "field"),
        (format!("[focus]\nplanes = {{ choice = [{}] }}", "1e300,".repeat(DEEP)), "focus.planes"),
        (format!("[field]\nwidth_px = {}", "9".repeat(DEEP)), "recipe.toml:2"),
        (format!("[layout]\nkind = \"density-map\"\npath = {}", "\"".repeat(DEEP)), "recipe.toml"),
    ] {
        gauntlet.recipe(&text, named, true);
    }
    // Models and class files: a long string, number and list, and deep nesting.
    let model = |inner: &str| format!("{{\"version\":1,\"name\":{inner}}}");
    for text in [
        model(&format!("\"{text}\"")),
        model(&"9".repeat(1_000_000)),
        model(&format!("[{}1]", "1,".repeat(1_000_000))),
        model(&"[".repeat(HUGE)),
        model(&"{\"a\":".repeat(1_000_000)),
        format!("version = 1\n{}", "[[classes]]\n".repeat(DEEP)),
        format!("[classes.x]\nlike = \"{}\"", "x".repeat(1_000_000)),
    ] {
        fs::write(gauntlet.bench.path("model.json"), &text).unwrap();
        let what = text.chars().take(100).collect::<String>();
        let run = gauntlet.run(&what, "generate --out out --frames 1 --model model.json");
        if !run.err.contains("model.json") {
            gauntlet.wrong.push(format!("--- {what}\n{:.2000}", run.err));
        }
    }
    gauntlet.end(20);
}

//! Recipes and models that are wrong in every field, and too large in every way: refused by the name of the field, soon, and in little memory.

#[allow(dead_code, reason = "each test uses its part")]
use std::collections::BTreeSet;
use std::fs;
use std::time::{Duration, Instant};

use crate::support::{Bench, Outcome};
use papsynth::recipe::{Preset, toml_value};
use serde_json::{Map, Value};

/// What no field of numbers takes.
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

/// What some fields of numbers take: then the recipe is as good as any.
const PERHAPS: [&str; 6] = ["0", "-0.0", "-1", "0.5", "1e-320", "{ normal = [1, 1e-9], min = 0, max = 2 }"];

/// What no word, path or truth value is.
const NO_WORD: [&str; 6] = ["3", "nan", "[]", "[\"a\"]", "{}", "1979-05-27"];

/// A field of a recipe: where it stands, and the recipe's text around it.
struct Leaf {
    path: String,
    /// The fields beside it, a line each.
    around: String,
    value: Value,
}

impl Leaf {
    /// A recipe in which the field is this.
    fn with(&self, value: &str) -> String {
        match self.path.rsplit_once('.') {
            Some((section, name)) => format!("[{section}]\n{}{name} = {value}\n", self.around),
            None => format!("{} = {value}\n", self.path),
        }
    }
}

/// Every field of every kind of section that a preset shows, each once.
fn leaves() -> Vec<Leaf> {
    let (mut found, mut known) = (Vec::new(), BTreeSet::new());
    for preset in Preset::ALL {
        let value = serde_json::to_value(preset.recipe()).unwrap();
        walk(value.as_object().unwrap(), "", &mut known, &mut found);
    }
    found
}

fn is_number(value: &Value) -> bool {
    let laws = ["uniform", "normal", "log_normal", "choice", "per_mm2"];
    value.is_number() || value.as_object().is_some_and(|table| laws.iter().any(|law| table.contains_key(*law)))
}

fn walk(table: &Map<String, Value>, path: &str, known: &mut BTreeSet<String>, found: &mut Vec<Leaf>) {
    let kind = table.get("kind").and_then(Value::as_str).unwrap_or_default();
    for (name, value) in table {
        let here = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match value.as_object().filter(|_| !is_number(value)) {
            Some(inner) => walk(inner, &here, known, found),
            None => {
                // Classes of cells know the same fields.
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

/// Runs of the program, how many there were and which took longest.
struct Gauntlet {
    bench: Bench,
    runs: usize,
    slowest: (Duration, String),
    slow: Vec<String>,
    wrong: Vec<String>,
}

/// Stands in the command behind the recipe: whoever complains of it has accepted the recipe.
const NO_MODEL: &str = "no-such-model.json";

/// As much memory as the program may ask for, in all.
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
        #[expect(clippy::disallowed_methods, reason = "what takes long is printed, and asserted nowhere")]
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

    /// A recipe that may be good where `must` is false, and is refused by this name otherwise.
    fn recipe(&mut self, text: &str, named: &str, must: bool) {
        fs::write(self.bench.path("recipe.toml"), text).unwrap();
        let what = text.chars().take(200).collect::<String>();
        let run = self.run(&what, &format!("generate recipe.toml --out out --frames 1 --model {NO_MODEL}"));
        let accepted = run.err.contains(NO_MODEL);
        if (must && accepted) || !(accepted || run.err.contains(named)) {
            self.wrong.push(format!("--- {what}: {named:?} is wanted\n{:.2000}", run.err));
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
fn every_field_refuses_what_it_cannot_be_by_its_name() {
    let mut gauntlet = Gauntlet::new("fields");
    let leaves = leaves();
    let mut sections = BTreeSet::new();
    for (number, leaf) in leaves.iter().enumerate() {
        // Without `PAPSYNTH_TORTURE` each field gets a few of the values, so that all meet several fields.
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
fn what_is_too_large_or_too_deep_is_refused_in_little_memory() {
    const HUGE: usize = 100_000_000;
    let mut gauntlet = Gauntlet::new("huge");
    let text = "x".repeat(HUGE);
    for (open, close) in [("[field]\nwidth_px = \"", "\"\n"), ("# ", "\n"), ("", " = 1\n"), ("[", "]\n")] {
        gauntlet.recipe(&format!("{open}{text}{close}"), "larger than", true);
    }
    // Deep things of half a megabyte each, which a recipe may have.
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
    // Models and class files: a text, a number, a list, a depth.
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

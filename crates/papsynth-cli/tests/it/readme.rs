//! Runs every command of the READMEs and of the pages in docs and site, on smaller fields and fewer frames.
//!
//! The commands of a file run in order in one folder: they may only use what previous commands write, fixtures, and
//! blocks of TOML with a file name. [`SMALLER`] lists all changes of commands, [`FIXTURES`] the files of a user.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use ccd_noise::{Camera, CameraParams};
use papsynth_study::{Answer, Exposure, Session, StudyParams};
use tiff::encoder::{TiffEncoder, colortype};

use crate::calibrate::{SIDE, bright_field, nucleus};
use crate::support::{Bench, outlines};

/// A small field, for any preset.
const FIELD: &str = "--set field.width_px=160 --set field.height_px=120 --set layout.kind=uniform \
    --set slide.spacing_um=1 --set cells.intermediate.count=2 --set cells.superficial.count=0 \
    --set cells.parabasal.count=0 --set cells.metaplastic.count=0 --set debris.leukocytes.clusters=1 \
    --set debris.bacilli.clusters=1 --set debris.out_of_focus.count=0";

/// A field with enough nuclei to measure.
const NUCLEI: &str = "--set field.width_px=210 --set field.height_px=160 --set field.pixel_um=0.33 \
    --set cells.intermediate.count=5 --set cells.superficial.count=2 --set cells.parabasal.count=0 \
    --set cells.metaplastic.count=0";

/// A slide whose deposit lies near the first corner.
const SLIDE: &str = "--set scan.frame_px=256 --set scan.deposit.x_um=80 --set scan.deposit.y_um=80";

/// Changes that reduce the time of a command: values of options to replace, and options to insert before those of the
/// command.
struct Smaller {
    /// First words of the command, after `papsynth`.
    command: &'static str,
    replaced: &'static [(&'static str, &'static str)],
    inserted: &'static [&'static str],
}

/// The first entry that matches applies. A command without an entry runs as printed.
const SMALLER: &[Smaller] = &[
    Smaller { command: "generate --out fields", replaced: &[("--frames", "4")], inserted: &[NUCLEI] },
    Smaller { command: "generate matched.toml --out", replaced: &[("--frames", "4")], inserted: &[NUCLEI] },
    Smaller { command: "generate", replaced: &[("--frames", "4")], inserted: &[FIELD] },
    Smaller { command: "preview", replaced: &[], inserted: &[FIELD] },
    Smaller { command: "plan", replaced: &[], inserted: &[FIELD, "--samples 2"] },
    Smaller { command: "status", replaced: &[("--frames", "4")], inserted: &[] },
    Smaller { command: "merge", replaced: &[("--frames", "4")], inserted: &[] },
    Smaller { command: "sweep", replaced: &[("--frames", "1")], inserted: &[FIELD] },
    Smaller { command: "judge", replaced: &[], inserted: &["--quick"] },
    Smaller { command: "match", replaced: &[], inserted: &["--simulations 60"] },
    Smaller { command: "study --results", replaced: &[], inserted: &[] },
    Smaller {
        command: "study",
        replaced: &[("--subject", "01")],
        inserted: &["--trials 4 --training 1 --patch-px 64"],
    },
    Smaller { command: "slide tile", replaced: &[("--size", "64,48")], inserted: &[SLIDE] },
    Smaller { command: "slide make", replaced: &[], inserted: &[SLIDE, "--size 900,600 --shard-px 512"] },
];

/// Commands that only builds with a feature run: words of them, and whether this build has the feature. Options of
/// others are looked up in the help.
const FEATURES: &[(&str, bool)] = &[
    ("slide make", cfg!(feature = "zarr")),
    ("slide finalize", cfg!(feature = "zarr")),
    ("verify slide", cfg!(feature = "zarr")),
    ("view slide", cfg!(feature = "zarr")),
    ("ome-zarr", cfg!(feature = "zarr")),
    ("huggingface", cfg!(feature = "parquet")),
];

/// Words that are replaced wherever they occur: a folder stands for an object store.
const REPLACED: &[(&str, &str)] = &[("s3://bucket/", "store-")];

/// Options that select a part of the work. The other parts are made before a command that needs them all.
const PARTS: &[&str] = &["--shard", "--task"];
const NEED_ALL_PARTS: &[&str] = &["merge", "slide finalize"];

/// Commands that serve a page until they are interrupted.
const SERVERS: &[&str] = &["view", "study real", "workbench"];

/// A function that writes a fixture of this name.
type Make = fn(&Bench, &str);

/// Files and folders of users, by their names in commands.
const FIXTURES: &[(&str, Make)] = &[
    ("cells.csv", |bench, name| fs::write(bench.path(name), outlines(12, 100, 80.0)).unwrap()),
    ("darks", |bench, name| exposures(bench, name, &[0.0])),
    ("dense.toml", |bench, name| drop(bench.good(&format!("init --preset dense --out {name}")))),
    ("edge.png", edge),
    ("fields", |bench, name| drop(bench.good(&format!("generate --out {name} --frames 4 --quiet {NUCLEI}")))),
    ("flats", |bench, name| exposures(bench, name, &[2e3, 4e3, 6e3, 9e3])),
    ("mine.toml", |bench, name| drop(bench.good(&format!("init --out {name}")))),
    ("nuclei", nuclei),
    ("planes", planes),
    ("real", |bench, name| images(bench, name, 5)),
    ("slides", |bench, name| images(bench, name, 6)),
];

/// A folder of images of nuclei, and of their masks.
fn nuclei(bench: &Bench, name: &str) {
    for folder in ["images", "masks"] {
        fs::create_dir_all(bench.path(name).join(folder)).unwrap();
    }
    for i in 0..6_u32 {
        let inside = |x: u32, y: u32| x.abs_diff(24).pow(2) + y.abs_diff(24).pow(2) < (9 + i % 3).pow(2);
        let speckle = |x: u32, y: u32| u8::try_from((x * 7919 + y * 104_729 + i * 31) % 13).unwrap();
        let level = |x, y| if inside(x, y) { 90 + speckle(x, y) } else { 200 };
        bench.grey_png(&format!("{name}/images/{i}.png"), 48, 48, level);
        bench.grey_png(&format!("{name}/masks/{i}.png"), 48, 48, |x, y| if inside(x, y) { 255 } else { 0 });
    }
}

/// A focus stack of a nucleus, one file a plane.
fn planes(bench: &Bench, name: &str) {
    fs::create_dir(bench.path(name)).unwrap();
    let stages: Vec<f64> = (-6..=6).map(|k| 0.5 * f64::from(k)).collect();
    for (k, plane) in bright_field(0.41, &stages, nucleus(3)).iter().enumerate() {
        let level = |x: u32, y: u32| grey(200.0 * f64::from(plane[y as usize * SIDE + x as usize]));
        let side = u32::try_from(SIDE).unwrap();
        bench.grey_png(&format!("{name}/{k}.png"), side, side, level);
    }
}

/// A blurred edge at an angle.
fn edge(bench: &Bench, name: &str) {
    bench.grey_png(name, 128, 128, |x, y| {
        let distance = 0.8 * (f64::from(x) - 60.3) + 0.6 * (f64::from(y) - 60.1);
        grey(80.0 + 60.0 * libm::erfc(-distance / (0.9 * 2_f64.sqrt())))
    });
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "levels are 0 to 255")]
fn grey(level: f64) -> u8 {
    level.round() as u8
}

/// Two frames of each light, as a camera of 12 bits takes them.
fn exposures(bench: &Bench, name: &str, electrons: &[f32]) {
    fs::create_dir(bench.path(name)).unwrap();
    let camera = Camera::new(&CameraParams::orca_05g()).unwrap();
    for (k, &light) in electrons.iter().enumerate() {
        for (frame, letter) in ["a", "b"].into_iter().enumerate() {
            let mut levels = vec![0; SIDE * SIDE];
            camera.expose_window(&vec![light; SIDE * SIDE], SIDE, [0, 0], (2 * k + frame) as u64, &mut levels);
            let file = fs::File::create(bench.path(name).join(format!("{k}{letter}.tif"))).unwrap();
            let mut encoder = TiffEncoder::new(file).unwrap();
            let side = u32::try_from(SIDE).unwrap();
            encoder.write_image::<colortype::Gray16>(side, side, &levels).unwrap();
        }
    }
}

/// A folder of images without ground truth.
fn images(bench: &Bench, name: &str, seed: u32) {
    bench.good(&format!("generate --out made-{name} --frames 6 --seed {seed} --quiet {NUCLEI}"));
    fs::rename(bench.path(&format!("made-{name}/images")), bench.path(name)).unwrap();
}

/// Answers the study that was begun in the folder `results` to its end.
fn answer_all(bench: &Bench) {
    let params =
        StudyParams { subject: "01".to_owned(), trials: 4, training: 1, patch_px: 64, ..StudyParams::default() };
    let folder = |name: &str| bench.path(name);
    let mut session = Session::open(&params, &folder("real"), &folder("fields"), &folder("results")).unwrap();
    while let Some(name) = session.state().patches.first().cloned() {
        let exposure = Exposure { exposure_ms: 2000.0, frames: 120, longest_frame_ms: 16.7, pixel_ratio: 1.0 };
        session.patch(&name).unwrap();
        session.shown(&name, exposure).unwrap();
        session.answer(&name, Answer::Real, 400.0).unwrap();
    }
}

/// One line of a shell: its words, and the file that its output goes to.
#[derive(Debug, Clone)]
struct Line {
    words: Vec<String>,
    output: Option<String>,
}

/// Splits a line into words, as a shell does with quotes and comments; the output of a line may go to a file, and that
/// is all.
fn parse(line: &str) -> Line {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for letter in line.chars() {
        match (quote, letter) {
            (Some(open), _) if letter == open => quote = None,
            (None, '\'' | '"') => {
                quote = Some(letter);
                word.get_or_insert_default();
            }
            (None, '#') if word.is_none() => break,
            (None, _) if letter.is_whitespace() => words.extend(word.take()),
            (None, '|' | ';' | '&' | '$' | '`') => panic!("no rule for `{letter}` in: {line}"),
            _ => word.get_or_insert_default().push(letter),
        }
    }
    assert!(quote.is_none(), "a quote is open at the end of: {line}");
    words.extend(word);
    let redirected = words.iter().position(|word| word == ">");
    let output = redirected.map(|at| words.split_off(at).swap_remove(1));
    Line { words, output }
}

/// The lines of all shell blocks of a page. A line that ends with `\` continues on the next.
fn lines(page: &str) -> Vec<Line> {
    let (mut found, mut open, mut is_shell) = (Vec::new(), false, false);
    let mut continued = String::new();
    for line in page.lines() {
        if let Some(language) = line.trim_start().strip_prefix("```") {
            open = !open;
            is_shell = open && matches!(language.trim(), "sh" | "bash" | "shell" | "console");
        } else if is_shell {
            if let Some(part) = line.strip_suffix('\\') {
                continued.push_str(part);
            } else {
                found.push(parse(&format!("{continued}{line}")));
                continued.clear();
            }
        }
    }
    found.retain(|line| !line.words.is_empty());
    found
}

/// The blocks of TOML with a file name, such as "```toml stain.toml": name and content.
fn files(page: &str) -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    let mut is_file = false;
    for line in page.lines() {
        match (is_file, line.strip_prefix("```")) {
            (false, Some(language)) => {
                if let Some(name) = language.strip_prefix("toml ") {
                    found.push((name.to_owned(), String::new()));
                    is_file = true;
                }
            }
            (true, Some(_)) => is_file = false,
            (true, None) => found.last_mut().unwrap().1.extend([line, "\n"]),
            (false, None) => (),
        }
    }
    found
}

/// The commands of one page, in one folder.
struct Page {
    bench: Bench,
    /// Commands that made a part of something.
    parts: Vec<Line>,
}

impl Page {
    fn run(&mut self, line: &Line) {
        match line.words[0].as_str() {
            "papsynth" => self.papsynth(line),
            "cargo" => cargo(&line.words[1..]),
            "python" => python_script(&line.words[1]),
            // A variable of the environment.
            "export" => (),
            // The tasks of the script that `papsynth submit` printed.
            "sbatch" => self.run_parts(),
            "sed" => self.finish(Command::new("sed").args(&line.words[1..]), line),
            other => panic!("no rule for the program `{other}`"),
        }
    }

    fn papsynth(&mut self, line: &Line) {
        let mut line = line.clone();
        line.words.remove(0);
        let printed = line.words.join(" ");
        let starts = |with: &&str| printed == **with || printed.starts_with(&format!("{with} "));
        if FEATURES.iter().any(|(words, is_on)| !is_on && printed.contains(words)) {
            return self.options_exist(&line.words);
        }
        for word in &mut line.words {
            for (from, to) in REPLACED {
                *word = word.replace(from, to);
            }
        }
        if let Some(smaller) = SMALLER.iter().find(|smaller| starts(&smaller.command)) {
            shrink(&mut line.words, smaller);
        }
        self.bring(&line.words);
        if NEED_ALL_PARTS.iter().any(starts) {
            self.run_parts();
        }
        if let Some(at) = line.words.iter().position(|word| PARTS.contains(&word.as_str())) {
            let mut all = line.clone();
            all.words.drain(at..at + 2);
            self.parts.push(all);
        }
        if let Some(at) = line.words.iter().position(|word| word == "--").filter(|_| starts(&"submit")) {
            let mut words = vec!["generate".to_owned()];
            words.extend_from_slice(&line.words[at + 1..]);
            if let Some(smaller) = SMALLER.iter().find(|smaller| smaller.command == "generate") {
                shrink(&mut words, smaller);
            }
            self.parts.push(Line { words, output: None });
        }
        if starts(&"study --results") {
            answer_all(&self.bench);
        }
        match SERVERS.iter().any(starts) {
            true => self.serve(&line.words),
            false => self.finish(&mut self.command(&line.words), &line),
        }
    }

    /// Runs all tasks of commands that ran one of them, or printed a script for them.
    fn run_parts(&mut self) {
        for part in std::mem::take(&mut self.parts) {
            self.finish(&mut self.command(&part.words), &part);
        }
    }

    /// Makes the fixtures among the words that are not there yet, unless the command writes them.
    fn bring(&self, words: &[String]) {
        let is_output = |at: usize| at > 0 && ["--out", "--report"].contains(&words[at - 1].as_str());
        for (at, word) in words.iter().enumerate().filter(|(at, _)| !is_output(*at)) {
            let fixture = FIXTURES.iter().find(|(name, _)| name == word);
            if let Some((name, make)) = fixture.filter(|_| !self.bench.path(&words[at]).exists()) {
                make(&self.bench, name);
            }
        }
    }

    fn command(&self, words: &[String]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_papsynth"));
        command.args(words);
        command
    }

    /// Runs a command that must succeed.
    fn finish(&self, command: &mut Command, line: &Line) {
        let output = command.current_dir(self.bench.path("")).stdin(Stdio::null()).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        assert!(
            output.status.success(),
            "{}: {}\n{}{}",
            line.words.join(" "),
            output.status,
            text(&output.stdout),
            text(&output.stderr)
        );
        if let Some(file) = &line.output {
            fs::write(self.bench.path(file), output.stdout).unwrap();
        }
    }

    /// Starts a server, waits for its address, and ends it.
    fn serve(&self, words: &[String]) {
        let mut command = self.command(words);
        command.current_dir(self.bench.path("")).stdin(Stdio::null());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut printed = BufReader::new(child.stdout.take().unwrap()).lines().map_while(Result::ok);
        let is_serving = printed.any(|line| line.contains("http://127.0.0.1:"));
        let _ = child.kill();
        let mut message = String::new();
        child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
        child.wait().unwrap();
        assert!(is_serving, "{}: no address was printed\n{message}", words.join(" "));
    }

    /// Looks up the options of a command in the help of its subcommand.
    fn options_exist(&self, words: &[String]) {
        let is_nested = words[0] == "slide";
        let help = self.bench.good(&format!("{} --help", words[..1 + usize::from(is_nested)].join(" "))).out;
        for option in words.iter().filter(|word| word.starts_with("--")) {
            assert!(help.contains(option.as_str()), "{}: there is no option {option}", words.join(" "));
        }
    }
}

/// Replaces and inserts options, before the first one that the command sets itself.
fn shrink(words: &mut Vec<String>, smaller: &Smaller) {
    for (option, value) in smaller.replaced {
        if let Some(at) = words.iter().position(|word| word == option) {
            words[at + 1] = (*value).to_owned();
        }
    }
    let at = words.iter().position(|word| word == "--set").unwrap_or(words.len());
    let inserted = smaller.inserted.iter().flat_map(|options| options.split_whitespace()).map(str::to_owned);
    words.splice(at..at, inserted);
}

/// Checks that a script of the Python package exists; the tests of the package run it.
fn python_script(path: &str) {
    assert!(workspace().join("crates/papsynth-python").join(path).is_file(), "there is no script {path}");
}

/// Checks a command of Cargo: that xtask has the command, or that the package to install has the features.
fn cargo(words: &[String]) {
    match words {
        [command, name, ..] if command == "xtask" => {
            let variant: String = name[..1].to_uppercase() + &name[1..];
            let source = fs::read_to_string(workspace().join("xtask/src/main.rs")).unwrap();
            assert!(source.contains(&format!("DevCommand::{variant}")), "there is no `cargo xtask {name}`");
        }
        [command, path, folder, features @ ..] if command == "install" && path == "--path" => {
            let text = fs::read_to_string(workspace().join(folder).join("Cargo.toml")).unwrap();
            let manifest: toml::Table = toml::from_str(&text).unwrap();
            if let [option, features] = features {
                assert_eq!(option, "--features");
                for feature in features.split(',') {
                    assert!(manifest["features"].get(feature).is_some(), "{folder} has no feature {feature}");
                }
            }
        }
        _ => panic!("no rule for: cargo {}", words.join(" ")),
    }
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every Markdown file of a folder and of those below it.
fn pages(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut found: Vec<PathBuf> = entries
        .flat_map(|path| match path.is_dir() {
            true => pages(&path),
            false => vec![path],
        })
        .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
        .collect();
    found.sort();
    found
}

/// Runs the commands of a text in a new folder, and returns their number.
fn run_text(text: &str) -> usize {
    let mut page = Page { bench: Bench::new("readme"), parts: Vec::new() };
    for (name, content) in files(text) {
        let is_used = text.lines().any(|line| line.starts_with("papsynth ") && line.contains(&name));
        assert!(is_used, "no command uses {name}");
        fs::write(page.bench.path(&name), content).unwrap();
    }
    let lines = lines(text);
    lines.iter().for_each(|line| page.run(line));
    lines.len()
}

fn run_page(path: &Path) -> usize {
    run_text(&fs::read_to_string(path).unwrap())
}

/// Returns the first or the second half of the sections of the README, which run in parallel.
fn half_of_readme(half: usize) -> String {
    let text = fs::read_to_string(workspace().join("README.md")).unwrap();
    let sections: Vec<&str> = text.split("\n## ").collect();
    sections.chunks(sections.len().div_ceil(2)).nth(half).unwrap().join("\n")
}

#[test]
fn every_command_of_the_first_half_of_the_readme_runs() {
    assert!(run_text(&half_of_readme(0)) > 10);
}

#[test]
fn every_command_of_the_second_half_of_the_readme_runs() {
    assert!(run_text(&half_of_readme(1)) > 3);
}

#[test]
fn every_command_of_the_readme_of_the_program_runs() {
    assert!(run_page(&workspace().join("crates/papsynth-cli/README.md")) > 10);
}

#[test]
fn every_command_of_other_readmes_and_of_docs_runs() {
    let mut files = pages(&workspace().join("docs"));
    for entry in fs::read_dir(workspace().join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        let is_program = folder.ends_with("papsynth-cli");
        files.extend((!is_program).then(|| folder.join("README.md")).filter(|path| path.exists()));
    }
    files.push(workspace().join("benches/README.md"));
    assert!(files.iter().map(|path| run_page(path)).sum::<usize>() > 8);
}

/// Runs every third page of the site, because the thirds run in parallel, and returns the number of commands.
fn run_third_of_site(third: usize) -> usize {
    pages(&workspace().join("site/pages")).iter().skip(third).step_by(3).map(|path| run_page(path)).sum()
}

#[test]
fn every_command_of_the_first_third_of_the_site_runs() {
    assert!(run_third_of_site(0) > 5);
}

#[test]
fn every_command_of_the_second_third_of_the_site_runs() {
    assert!(run_third_of_site(1) > 5);
}

#[test]
fn every_command_of_the_last_third_of_the_site_runs() {
    assert!(run_third_of_site(2) > 5);
}

#[test]
fn blocks_with_a_name_are_files() {
    let page = "```toml\na = 1\n```\n```toml mine.toml\nb = 2\nc = 3\n```\n";
    assert_eq!(files(page), [("mine.toml".to_owned(), "b = 2\nc = 3\n".to_owned())]);
}

#[test]
fn lines_are_split_into_words() {
    let line = parse("papsynth init --set 'a={ b = [1, 2] }' > mine.toml   # a recipe");
    assert_eq!(line.words, ["papsynth", "init", "--set", "a={ b = [1, 2] }"]);
    assert_eq!(line.output.as_deref(), Some("mine.toml"));
    let found = lines("text\n```sh\na \\\n  b\n# comment\nc\n```\n```toml\nd = 1\n```\n");
    assert_eq!(found.iter().map(|line| line.words.join(" ")).collect::<Vec<_>>(), ["a b", "c"]);
}

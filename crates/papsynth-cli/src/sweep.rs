//! `papsynth sweep`: the same fields under every combination of settings.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use papsynth::key::Key;
use papsynth_dataset::{Dataset, image_paths, write_file};

use crate::args::Sweep;
use crate::exit::{self, ExitError};
use crate::memory;
use crate::output_file::{Kind, OutputFile};
use crate::rerender::render;
use crate::setup::Setup;

const MAX_COMBINATIONS: usize = 10_000;

const TABLE: &str = "sweep.csv";

/// The beginning of every table.
const TABLE_BEGINS: &[u8] = b"set,image,slide,file";

const COLUMNS: [&str; 4] = ["set", "image", "slide", "file"];

/// A field that is varied.
struct Axis {
    field: String,
    values: Vec<String>,
}

pub(crate) fn run(args: &Sweep) -> Result<(), ExitError> {
    let axes = args.vary.iter().map(|text| axis(text)).collect::<Result<Vec<_>, _>>()?;
    for (number, axis) in axes.iter().enumerate() {
        if axes[..number].iter().any(|before| before.field == axis.field) {
            return Err(ExitError::with_help(
                format!("--vary {}: given twice", axis.field),
                "give all values of a parameter in one option: --vary KEY=A,B,…",
            ));
        }
    }
    let count = axes.iter().try_fold(1_usize, |product, axis| product.checked_mul(axis.values.len()));
    let Some(count) = count.filter(|count| *count <= MAX_COMBINATIONS) else {
        let found = count.map_or_else(|| "too many".to_owned(), |count| count.to_string());
        let message = format!("--vary: {found} combinations; expected at most {MAX_COMBINATIONS}");
        return Err(ExitError::with_help(message, "vary fewer fields or values"));
    };
    let (layout, _) = args.layout.layout(args.frames);
    // Errors of any combination are reported before the first is generated.
    let combinations = combinations(&axes);
    let setups = combinations.iter().map(|values| setup(args, &axes, values)).collect::<Result<Vec<_>, _>>()?;
    check_out(&args.out, count)?;
    for setup in &setups {
        memory::frames_at_once(setup, &layout, 1)?;
        let key = Key { seed: args.engine.seed, index: 0 };
        setup.engine.scene(key).map_err(|error| setup.recipe.error(&error))?;
    }
    let frames = 0..args.frames;
    let stop = exit::stop_flag()?;
    let mut table = csv::Writer::from_writer(Vec::new());
    // Writing to memory does not fail, and all records have the same length.
    let _ = table.write_record(COLUMNS.into_iter().chain(axes.iter().map(|axis| axis.field.as_str())));
    // Each engine is dropped after its data set, with the memory that it keeps between frames.
    for (number, (setup, values)) in setups.into_iter().zip(&combinations).enumerate() {
        let name = set_name(number);
        let out = args.out.join(&name);
        render(&setup, args.engine.seed, std::slice::from_ref(&frames), &layout, &out, args.quiet, stop)?;
        for (index, (slide, file)) in image_paths(&Dataset::open(&out)?)? {
            let fixed = [name.as_str(), &index.to_string(), &slide.to_string(), &file];
            let _ = table.write_record(fixed.into_iter().chain(values.iter().copied()));
        }
        if !args.quiet {
            let set: Vec<String> =
                axes.iter().zip(values).map(|(axis, value)| format!("{}={value}", axis.field)).collect();
            exit::print(&format!("{name} of {count}: {}\n", set.join(" ")))?;
        }
    }
    let path = args.out.join(TABLE);
    write_file(&path, &table.into_inner().unwrap_or_default())?;
    if args.quiet { Ok(()) } else { exit::print(&format!("Look at: {}\n", path.display())) }
}

/// Checks that a folder holds only files of a sweep with `count` combinations.
fn check_out(out: &Path, count: usize) -> Result<(), ExitError> {
    let refuse = |name: &str| {
        let message = format!("{}: the folder holds `{name}`, which is not part of this sweep", out.display());
        Err(ExitError::with_help(message, "choose a new or empty folder"))
    };
    let entries = match fs::read_dir(out) {
        Ok(entries) => entries,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) if error.kind() == ErrorKind::NotADirectory => {
            return Err(ExitError::input(format!("{}: is a file; expected a folder", out.display())));
        }
        Err(error) => return Err(ExitError::file("read", out, &error)),
    };
    for entry in entries {
        let entry = entry.map_err(|error| ExitError::file("read", out, &error))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        // Links are not followed, because they lead out of the folder.
        let kind = entry.file_type().map_err(|error| ExitError::file("read", &entry.path(), &error))?;
        let number = name.parse().ok().filter(|number| *number < count && name == set_name(*number));
        let is_set = kind.is_dir() && number.is_some();
        let is_table = name == TABLE && kind.is_file() && {
            let table = Kind::Text(TABLE_BEGINS, "the table of a sweep");
            OutputFile::check(&entry.path(), table, false).is_ok()
        };
        if !is_table && !is_set && !name.starts_with('.') {
            return refuse(&name);
        }
    }
    Ok(())
}

fn set_name(number: usize) -> String {
    format!("{number:04}")
}

fn axis(text: &str) -> Result<Axis, ExitError> {
    let wrong = || ExitError::input(format!("--vary {text}: expected KEY=A,B,…"));
    let (field, values) = text.split_once('=').ok_or_else(wrong)?;
    let values = parts(values);
    if field.trim().is_empty() || values.iter().any(String::is_empty) {
        return Err(wrong());
    }
    if let Some(twice) = values.iter().enumerate().find(|(number, value)| values[..*number].contains(value)) {
        return Err(ExitError::input(format!("--vary {text}: the value {} occurs twice", twice.1)));
    }
    Ok(Axis { field: field.trim().to_owned(), values })
}

/// Splits at commas outside brackets and quotes.
fn parts(text: &str) -> Vec<String> {
    let (mut parts, mut depth, mut quote) = (vec![String::new()], 0_u32, None);
    for c in text.chars() {
        match (quote, c) {
            (Some(open), _) if open == c => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth = depth.saturating_sub(1),
            (None, ',') if depth == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(last) = parts.last_mut() {
            last.push(c);
        }
    }
    parts.iter().map(|part| part.trim().to_owned()).collect()
}

/// All combinations of values; the last axis changes fastest.
fn combinations(axes: &[Axis]) -> Vec<Vec<&str>> {
    let mut all = vec![Vec::new()];
    for axis in axes {
        let each =
            |before: &Vec<_>| axis.values.iter().map(|value| [&before[..], &[value.as_str()]].concat()).collect();
        all = all.iter().flat_map(|before| -> Vec<_> { each(before) }).collect();
    }
    all
}

fn setup(args: &Sweep, axes: &[Axis], values: &[&str]) -> Result<Setup, ExitError> {
    let mut engine = args.engine.clone();
    engine.recipe.vary = axes.iter().zip(values).map(|(axis, value)| format!("{}={value}", axis.field)).collect();
    Setup::load(&engine, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_are_unique_and_complete() {
        let axes = [axis("a.b=1,2").unwrap(), axis("c = x, y ,z").unwrap()];
        let expected = [["1", "x"], ["1", "y"], ["1", "z"], ["2", "x"], ["2", "y"], ["2", "z"]];
        assert_eq!(combinations(&axes), expected);
        assert!(axis("a").is_err() && axis("a=").is_err() && axis("=1").is_err());
    }

    #[test]
    fn commas_inside_brackets_and_quotes_do_not_split() {
        assert_eq!(parts("1, 2,3"), ["1", "2", "3"]);
        assert_eq!(parts("{ uniform = [2, 6] },3"), ["{ uniform = [2, 6] }", "3"]);
        assert_eq!(parts("[1, [2, 3]],\"a, b\",']'"), ["[1, [2, 3]]", "\"a, b\"", "']'"]);
        assert_eq!(parts("a,,]b,c"), ["a", "", "]b", "c"]);
    }
}

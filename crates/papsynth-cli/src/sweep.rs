//! `papsynth sweep`: the same fields under every combination of some settings.

use std::collections::BTreeMap;

use papsynth_dataset::{Dataset, images_of, write_file};

use crate::args::{EngineArgs, RecipeArgs, Sweep};
use crate::exit::{self, Complaint, Failure};
use crate::interrupt::Interrupt;
use crate::rerender::render;
use crate::setup::Setup;

/// Most combinations of a sweep.
const MOST: usize = 10_000;

/// A field and the values that it takes.
struct Axis {
    field: String,
    values: Vec<String>,
}

pub(crate) fn run(args: &Sweep) -> Result<(), Failure> {
    let axes = args.vary.iter().map(|text| axis(text)).collect::<Result<Vec<_>, _>>()?;
    let count = axes.iter().try_fold(1_usize, |product, axis| product.checked_mul(axis.values.len()));
    let Some(count) = count.filter(|count| *count <= MOST) else {
        return Err(Failure::input(Complaint::new(format!("more than {MOST} combinations; vary fewer at once"))));
    };
    let (layout, _) = args.layout.layout(args.frames);
    // What one combination cannot be made of is told before any is made.
    let combinations: Vec<Vec<&str>> = (0..count).map(|number| combination(&axes, number)).collect();
    let setups = combinations.iter().map(|values| setup(args, &axes, values)).collect::<Result<Vec<_>, _>>()?;
    let interrupt = Interrupt::watch()?;
    let frames: Vec<u64> = (0..args.frames).collect();
    let mut table =
        csv_line(["set", "image", "slide", "file"].into_iter().chain(axes.iter().map(|axis| axis.field.as_str())));
    for (number, (setup, values)) in setups.iter().zip(&combinations).enumerate() {
        let name = format!("{number:04}");
        let out = args.out.join(&name);
        render(setup, args.engine.seed, &frames, &layout, &out, interrupt.flag())?;
        for image in rows(&out)? {
            let fixed = [name.as_str(), &image.index, &image.slide, &image.file];
            table.push_str(&csv_line(fixed.into_iter().chain(values.iter().copied())));
        }
        if !args.quiet {
            let set: Vec<String> =
                axes.iter().zip(values).map(|(axis, value)| format!("{}={value}", axis.field)).collect();
            exit::print(&format!("{name} of {count}: {}\n", set.join(" ")))?;
        }
    }
    let path = args.out.join("sweep.csv");
    write_file(&path, table.as_bytes())?;
    if args.quiet { Ok(()) } else { exit::print(&format!("Look at: {}\n", path.display())) }
}

fn axis(text: &str) -> Result<Axis, Failure> {
    let wrong = || Failure::input(Complaint::new(format!("--vary {text}: expected FIELD=A,B,…")));
    let (field, values) = text.split_once('=').ok_or_else(wrong)?;
    let values: Vec<String> = values.split(',').map(|value| value.trim().to_owned()).collect();
    if field.trim().is_empty() || values.iter().any(String::is_empty) {
        return Err(wrong());
    }
    Ok(Axis { field: field.trim().to_owned(), values })
}

/// The values of a combination: the last axis changes first.
fn combination(axes: &[Axis], mut number: usize) -> Vec<&str> {
    let mut values: Vec<&str> = axes
        .iter()
        .rev()
        .map(|axis| {
            let value = &axis.values[number % axis.values.len()];
            number /= axis.values.len();
            value.as_str()
        })
        .collect();
    values.reverse();
    values
}

fn setup(args: &Sweep, axes: &[Axis], values: &[&str]) -> Result<Setup, Failure> {
    let EngineArgs { recipe, model, seed, threads } = &args.engine;
    let mut set = recipe.set.clone();
    set.extend(axes.iter().zip(values).map(|(axis, value)| format!("{}={value}", axis.field)));
    let RecipeArgs { recipe, preset, with, camera, .. } = recipe;
    let recipe = RecipeArgs { recipe: recipe.clone(), preset: *preset, with: with.clone(), camera: *camera, set };
    Setup::load(&EngineArgs { recipe, model: model.clone(), seed: *seed, threads: *threads }, None)
}

/// An image of a data set, for the table.
struct Row {
    index: String,
    slide: String,
    file: String,
}

fn rows(out: &std::path::Path) -> Result<Vec<Row>, Failure> {
    let dataset = Dataset::open(out)?;
    let images: BTreeMap<u64, (u64, String)> = images_of(&dataset)?;
    Ok(images
        .into_iter()
        .map(|(index, (slide, file))| Row { index: index.to_string(), slide: slide.to_string(), file })
        .collect())
}

/// A line of a table; a value with a comma or a quote is quoted.
fn csv_line<'a>(values: impl Iterator<Item = &'a str>) -> String {
    let cell = |value: &str| match value.contains([',', '"', '\n']) {
        true => format!("\"{}\"", value.replace('"', "\"\"")),
        false => value.to_owned(),
    };
    format!("{}\n", values.map(cell).collect::<Vec<_>>().join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_comes_once() {
        let axes = [axis("a.b=1,2").unwrap(), axis("c = x, y ,z").unwrap()];
        let all: Vec<Vec<&str>> = (0..6).map(|number| combination(&axes, number)).collect();
        assert_eq!(all[0], ["1", "x"]);
        assert_eq!(all[1], ["1", "y"]);
        assert_eq!(all[5], ["2", "z"]);
        assert!(axis("a").is_err() && axis("a=").is_err() && axis("=1").is_err());
        assert_eq!(csv_line(["a", "b,c", "d\"e"].into_iter()), "a,\"b,c\",\"d\"\"e\"\n");
    }
}

//! Recipes as text: their errors, with lines.

use papsynth::model::Model;
use papsynth::recipe::diagnose::{self, FieldError};
use papsynth::recipe::{InvalidField, Recipe};
use serde_json::{Value, json};

/// Reads a recipe. Returns `{"recipe": …, "sections": …}` with the names of the sections in the text, or
/// `{"errors": …}` with the line of each error.
pub(super) fn checked(text: &str, model: &Model) -> Value {
    match diagnose::read(text) {
        Err(errors) => json!({ "errors": errors.iter().map(|error| located(text, error)).collect::<Vec<_>>() }),
        Ok(recipe) => {
            let mut errors: Vec<FieldError> = recipe.problems().iter().map(of_field).collect();
            errors.extend(diagnose::unknown_classes(&recipe, model));
            if errors.is_empty() {
                let sections: toml::Table = toml::from_str(text).unwrap_or_default();
                return json!({ "recipe": recipe, "sections": sections.keys().collect::<Vec<_>>() });
            }
            json!({ "errors": errors.iter().map(|error| located(text, error)).collect::<Vec<_>>() })
        }
    }
}

/// Returns the errors of a recipe, without lines.
pub(super) fn errors(recipe: &Recipe, model: &Model) -> Vec<Value> {
    let problems = recipe.problems();
    let fields = problems.iter().map(of_field).chain(diagnose::unknown_classes(recipe, model));
    fields.map(|error| json!({ "path": error.path, "message": error.message })).collect()
}

fn of_field(problem: &InvalidField) -> FieldError {
    FieldError {
        path: problem.field.split('.').map(str::to_owned).collect(),
        span: None,
        message: problem.to_string(),
        help: None,
    }
}

/// Returns an error with its line, counted from 1.
fn located(text: &str, error: &FieldError) -> Value {
    let span = error.span.clone().or_else(|| diagnose::find(text, &error.path));
    let start = span.map(|span| span.start.min(text.len()));
    let line = start.map(|start| text.as_bytes()[..start].iter().filter(|byte| **byte == b'\n').count() + 1);
    json!({ "path": error.path, "line": line, "message": error.message, "help": error.help })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_the_line_of_their_field() {
        let line = |text: &str| checked(text, &Model::builtin())["errors"][0]["line"].as_u64();
        assert_eq!(line("version = 1\n[field]\nwidht_px = 9\n"), Some(3));
        assert_eq!(line("version = 1\n[field]\nwidth_px = 2\n"), Some(3));
        assert_eq!(line("version = 1\n[field\n"), Some(2));
        assert_eq!(line("version = 1\n\n[cells.unknown]\ncount = 2\n"), Some(3));
        assert_eq!(line(""), Some(1));
        let read = checked("[camera]\nread_noise_e = 7\n", &Model::builtin());
        assert_eq!(read["recipe"]["camera"]["read_noise_e"].as_f64(), Some(7.0));
        assert_eq!(read["sections"], json!(["camera"]));
    }
}

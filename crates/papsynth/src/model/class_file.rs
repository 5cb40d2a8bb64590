//! The model that ships, and class files: classes told by the numbers in which they differ from others.

use serde_json::{Map, Value};

use super::{CellClass, MODEL_VERSION, Model, Provenance};
use crate::error::{Cause, Error};

/// The classes that are told from those of the model that ships, by the numbers in which they differ.
const BUILTIN_CLASSES: [&str; 2] = [include_str!("../../model/cervix.toml"), include_str!("../../model/oral.toml")];

/// The text of the model that ships.
const BUILTIN: &str = include_str!("../../model/default.json");

impl Model {
    /// The model that ships: numbers alone, measured on real cells.
    ///
    /// # Panics
    /// Never: the file is part of the crate and its tests read it.
    #[must_use]
    pub fn builtin() -> Self {
        let learned = Self::from_json(BUILTIN).expect("the model that ships is sound");
        BUILTIN_CLASSES.iter().fold(learned, |model, text| model.with(text).expect("the classes that ship are sound"))
    }

    /// This model and the classes of a text, which take the place of classes of the same names.
    ///
    /// The text is a model as `papsynth learn` writes it, or a class file: TOML whose classes may each say which class they
    /// are `like`, and after that only the numbers in which they differ.
    ///
    /// ```
    /// # use papsynth::model::Model;
    /// let text = r#"
    ///     version = 1
    ///     [classes.spindle]
    ///     like = "intermediate"
    ///     bethesda = "HSIL"
    ///     cytoplasm.form = { elongation = { mean = 0.6, sd = 0.05 } }
    /// "#;
    /// let model = Model::builtin().with(text)?;
    /// assert_eq!(model.classes["spindle"].nucleus, model.classes["intermediate"].nucleus);
    /// # Ok::<(), papsynth::Error>(())
    /// ```
    ///
    /// # Errors
    /// As those of [`from_json`](Self::from_json), or if a class is like one that is not there.
    pub fn with(&self, text: &str) -> Result<Self, Error> {
        merged(self, text).and_then(|model| model.checked().map(|()| model)).map_err(Error::Model)
    }
}

/// A model and the classes of a text.
fn merged(base: &Model, text: &str) -> Result<Model, Cause> {
    let value: Value = if text.trim_start().starts_with('{') {
        serde_json::from_str(text).map_err(Cause::NotAModel)?
    } else {
        toml::from_str(text).map_err(Cause::NotAClassFile)?
    };
    let Value::Object(mut file) = value else { return Err(Cause::NotATable) };
    let version = file.remove("version");
    if version.as_ref().and_then(Value::as_u64) != Some(u64::from(MODEL_VERSION)) {
        let found = version.map_or_else(|| "missing".to_owned(), |v| v.to_string());
        return Err(Cause::ModelVersion(found, MODEL_VERSION));
    }
    let mut model = base.clone();
    if let Some(provenance) = file.remove("provenance") {
        let entries: Vec<Provenance> = serde_json::from_value(provenance).map_err(Cause::Provenance)?;
        model.provenance.retain(|old| !entries.contains(old));
        model.provenance.extend(entries);
    }
    let classes = match file.remove("classes") {
        Some(Value::Object(classes)) => classes,
        Some(_) => return Err(Cause::ClassesNotATable),
        None => Map::new(),
    };
    if let Some(unknown) = file.keys().next() {
        return Err(Cause::UnknownField(unknown.clone()));
    }
    let mut waiting = classes;
    // A class may be like one of the same file, wherever that stands.
    while !waiting.is_empty() {
        let ready: Vec<String> = waiting
            .iter()
            .filter(|(name, class)| like(class).is_none_or(|of| of == name.as_str() || !waiting.contains_key(of)))
            .map(|(name, _)| name.clone())
            .collect();
        if ready.is_empty() {
            return Err(Cause::ClassCircle(waiting.keys().cloned().collect()));
        }
        for name in ready {
            let Some(class) = waiting.remove(&name) else { continue };
            let class = resolved(&model, class)
                .map_err(|cause| Cause::Class { class: name.clone(), cause: Box::new(cause) })?;
            model.classes.insert(name, class);
        }
    }
    Ok(model)
}

/// The name of the class that a class is like, if it says so.
fn like(class: &Value) -> Option<&str> {
    class.get("like").and_then(Value::as_str)
}

fn resolved(model: &Model, mut class: Value) -> Result<CellClass, Cause> {
    let whole = match like(&class).map(str::to_owned) {
        None => class,
        Some(of) => {
            let mut whole = serde_json::to_value(model.class(&of)?)?;
            class.as_object_mut().map(|fields| fields.remove("like"));
            overlay(&mut whole, class);
            whole
        }
    };
    Ok(serde_json::from_value(whole)?)
}

/// Puts the values of one table over those of another, table by table.
fn overlay(under: &mut Value, over: Value) {
    match (under, over) {
        (Value::Object(under), Value::Object(over)) => {
            for (key, value) in over {
                overlay(under.entry(key).or_insert(Value::Null), value);
            }
        }
        (under, over) => *under = over,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(text: &str) -> Result<Model, String> {
        Model::builtin().with(text).map_err(|e| e.to_string())
    }

    #[test]
    fn a_class_says_what_is_different_and_takes_the_rest() {
        let text = "version = 1\n[classes.b]\nlike = \"a\"\nbethesda = \"LSIL\"\n[classes.a]\nlike = \"intermediate\"\n\
                    cytoplasm.radius_um = { median = 9.5, log_sd = 0.1 }\n";
        let model = with(text).unwrap();
        let (a, b, base) = (&model.classes["a"], &model.classes["b"], &model.classes["intermediate"]);
        assert_eq!((a.cytoplasm.radius_um.median, b.cytoplasm.radius_um.median), (9.5, 9.5));
        assert_eq!((a.bethesda.as_str(), b.bethesda.as_str()), ("NILM", "LSIL"));
        assert_eq!(a.nucleus, base.nucleus);
        // A model's own text is read as it is written.
        assert_eq!(Model::builtin().with(&model.to_json()).unwrap(), model);
    }

    #[test]
    fn what_cannot_be_is_said() {
        for (text, said) in [
            ("[classes]", "version is missing"),
            ("version = 2", "version is 2"),
            ("version = 1\nclass = 3", "`class` is not known"),
            ("version = 1\nclasses = 3", "expected a table"),
            ("version = 1\n[classes.a]\nlike = \"b\"\n[classes.b]\nlike = \"a\"", "in a circle"),
            ("version = 1\n[classes.a]\nlike = \"nobody\"", "no class `nobody`"),
            ("version = 1\n[classes.\"../a\"]\nlike = \"intermediate\"", "`../a` is no name"),
            ("version = 1\n[classes.\"\"]\nlike = \"intermediate\"", "`` is no name"),
            ("version = 1\n[classes.a]\nlike = \"intermediate\"\ncytoplasm.form.taper = 4", "cytoplasm.form.taper: 4"),
            ("version = 1\n[classes.a]\nlike = \"intermediate\"\nnucleus.size = 4", "unknown field `size`"),
            ("version = 1\n[classes.a]\nbethesda = \"NILM\"", "missing field"),
            ("{", "no model of papsynth"),
        ] {
            let message = with(text).unwrap_err();
            assert!(message.contains(said), "{text:?}: {message}");
        }
    }
}

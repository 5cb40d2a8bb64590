//! The built-in model, and class files: TOML files that define classes by their differences from other classes.

use std::sync::OnceLock;

use serde_json::{Map, Value};

use super::{CellClass, CytoplasmTexture, MODEL_VERSION, Model, Provenance};
use crate::error::{Error, ErrorKind};
use crate::recipe::section::within;

/// Class files of the built-in model.
const BUILTIN_CLASSES: [&str; 2] = [include_str!("../../model/cervix.toml"), include_str!("../../model/oral.toml")];

/// The learned part of the built-in model.
const BUILTIN: &str = include_str!("../../model/default.json");

/// The texture of cytoplasm of the built-in model.
const BUILTIN_TEXTURE: &str = include_str!("../../model/cytoplasm.json");

/// Returns the texture of cytoplasm of the built-in model.
fn builtin_texture() -> &'static CytoplasmTexture {
    static TEXTURE: OnceLock<CytoplasmTexture> = OnceLock::new();
    TEXTURE.get_or_init(|| serde_json::from_str(BUILTIN_TEXTURE).expect("the built-in texture is valid"))
}

impl CytoplasmTexture {
    /// Returns whether this is the texture of the built-in model.
    pub(crate) fn is_builtin(&self) -> bool {
        self == builtin_texture()
    }
}

impl Model {
    /// Returns the texture of cytoplasm.
    pub(crate) fn texture(&self) -> &CytoplasmTexture {
        self.cytoplasm_texture.as_ref().unwrap_or_else(|| builtin_texture())
    }

    /// Returns the built-in model. It contains only statistics, measured on real cells.
    ///
    /// # Panics
    /// Never: the files are part of the crate and tested.
    #[must_use]
    pub fn builtin() -> Self {
        let mut learned = Self::from_json(BUILTIN).expect("the built-in model is valid");
        learned.cytoplasm_texture = Some(builtin_texture().clone());
        // `Engine::new` checks the values.
        BUILTIN_CLASSES
            .iter()
            .fold(learned, |model, text| merged(&model, text).expect("the built-in classes are valid"))
    }

    /// Returns this model with the classes of `text` added; classes with the same name are replaced.
    ///
    /// `text` is a model written by `papsynth learn` (JSON), or a class file (TOML). A class of a class file may name a
    /// base class (`like`) and list only the values that differ.
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
    /// As [`from_json`](Self::from_json), or if the class named by `like` does not exist.
    pub fn with(&self, text: &str) -> Result<Self, Error> {
        merged(self, text).and_then(|model| model.checked().map(|()| model)).map_err(Error::Model)
    }
}

/// Returns a model with the classes of a text added.
fn merged(base: &Model, text: &str) -> Result<Model, ErrorKind> {
    let value: Value = if text.trim_start().starts_with('{') {
        serde_json::from_str(text).map_err(ErrorKind::NotAModel)?
    } else {
        let value = toml::from_str(text).map_err(ErrorKind::NotAClassFile)?;
        // JSON has no NaN and no infinity, and TOML no null.
        if let Some(path) = path_of_null(&value) {
            return Err(ErrorKind::NotFinite(path));
        }
        value
    };
    let Value::Object(mut file) = value else { return Err(ErrorKind::NotATable) };
    let version = file.remove("version");
    if version.as_ref().and_then(Value::as_u64) != Some(u64::from(MODEL_VERSION)) {
        let found = version.map_or_else(|| "missing".to_owned(), |v| v.to_string());
        return Err(ErrorKind::ModelVersion(found, MODEL_VERSION));
    }
    let mut model = base.clone();
    if let Some(provenance) = file.remove("provenance") {
        let entries: Vec<Provenance> = serde_json::from_value(provenance).map_err(ErrorKind::Provenance)?;
        model.provenance.retain(|old| !entries.contains(old));
        model.provenance.extend(entries);
    }
    let classes = match file.remove("classes") {
        Some(Value::Object(classes)) => classes,
        Some(_) => return Err(ErrorKind::ClassesNotATable),
        None => Map::new(),
    };
    if let Some(texture) = file.remove("cytoplasm_texture") {
        model.cytoplasm_texture = serde_json::from_value(texture)?;
    }
    if let Some(unknown) = file.keys().next() {
        return Err(ErrorKind::UnknownField(unknown.clone()));
    }
    let mut unresolved = classes;
    // `like` may name a class of the same file, before or after this one.
    while !unresolved.is_empty() {
        let ready: Vec<String> = unresolved
            .iter()
            .filter(|(name, class)| like(class).is_none_or(|of| of == name.as_str() || !unresolved.contains_key(of)))
            .map(|(name, _)| name.clone())
            .collect();
        if ready.is_empty() {
            return Err(ErrorKind::ClassCircle(unresolved.keys().cloned().collect()));
        }
        for name in ready {
            let Some(class) = unresolved.remove(&name) else { continue };
            let class = resolved(&model, class)
                .map_err(|cause| ErrorKind::Class { class: name.clone(), cause: Box::new(cause) })?;
            model.classes.insert(name, class);
        }
    }
    Ok(model)
}

/// Returns the base class of a class, if any.
fn like(class: &Value) -> Option<&str> {
    class.get("like").and_then(Value::as_str)
}

/// Keys of a class in a class file.
const KEYS: [&str; 4] = ["like", "bethesda", "cytoplasm", "nucleus"];

fn resolved(model: &Model, mut class: Value) -> Result<CellClass, ErrorKind> {
    let Some(fields) = class.as_object_mut() else { return Err(wrong_type("", "a table", &class)) };
    if let Some(unknown) = fields.keys().find(|key| !KEYS.contains(&key.as_str())) {
        return Err(ErrorKind::UnknownClassField(unknown.clone(), KEYS.join("`, `")));
    }
    let complete = match fields.remove("like") {
        None => match KEYS[1..].iter().find(|key| !fields.contains_key(**key)) {
            Some(missing) => return Err(ErrorKind::IncompleteClass(missing)),
            None => class,
        },
        Some(Value::String(of)) => {
            let mut base = serde_json::to_value(model.class(&of)?)?;
            merge(&mut base, class, "")?;
            base
        }
        Some(other) => return Err(wrong_type("like", "the name of a class", &other)),
    };
    Ok(serde_json::from_value(complete)?)
}

/// Replaces values of one object at `path` by those of another, recursively. Values keep their types.
fn merge(base: &mut Value, changes: Value, path: &str) -> Result<(), ErrorKind> {
    let expected = match (&*base, &changes) {
        (Value::Object(_), Value::Object(_)) | (Value::Null, _) | (_, Value::Null) => None,
        (Value::Object(_), _) => Some("a table"),
        (Value::Number(_), other) => (!other.is_number()).then_some("a number"),
        (Value::Array(_), other) => (!other.is_array()).then_some("a list"),
        (Value::String(_), other) => (!other.is_string()).then_some("a string"),
        (Value::Bool(_), other) => (!other.is_boolean()).then_some("true or false"),
    };
    if let Some(expected) = expected {
        return Err(wrong_type(path, expected, &changes));
    }
    match (base, changes) {
        (Value::Object(base), Value::Object(changes)) => changes.into_iter().try_for_each(|(key, value)| {
            let path = within(path, &key);
            merge(base.entry(key).or_insert(Value::Null), value, &path)
        }),
        (base, changes) => {
            *base = changes;
            Ok(())
        }
    }
}

fn wrong_type(path: &str, expected: &'static str, found: &Value) -> ErrorKind {
    let found = match found {
        Value::Object(_) => "a table".to_owned(),
        Value::Array(_) => "a list".to_owned(),
        other => other.to_string(),
    };
    let at = if path.is_empty() { String::new() } else { format!("{path}: ") };
    ErrorKind::WrongType { at, expected, found }
}

/// Returns the path of the first null in a value.
fn path_of_null(value: &Value) -> Option<String> {
    let inside = |(name, value): (String, &Value)| {
        path_of_null(value).map(|path| if path.is_empty() { name.clone() } else { within(&name, &path) })
    };
    match value {
        Value::Null => Some(String::new()),
        Value::Object(fields) => fields.iter().map(|(name, value)| (name.clone(), value)).find_map(inside),
        Value::Array(items) => items.iter().enumerate().map(|(index, item)| (index.to_string(), item)).find_map(inside),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(text: &str) -> Result<Model, String> {
        Model::builtin().with(text).map_err(|e| e.to_string())
    }

    #[test]
    fn the_builtin_model_is_valid() {
        Model::builtin().check().unwrap();
    }

    #[test]
    fn a_class_inherits_the_values_it_does_not_set() {
        let text = "version = 1\n[classes.b]\nlike = \"a\"\nbethesda = \"LSIL\"\n[classes.a]\nlike = \"intermediate\"\n\
                    cytoplasm.radius_um = { median = 9.5, log_sd = 0.1 }\n";
        let model = with(text).unwrap();
        let (a, b, base) = (&model.classes["a"], &model.classes["b"], &model.classes["intermediate"]);
        assert_eq!((a.cytoplasm.radius_um.median, b.cytoplasm.radius_um.median), (9.5, 9.5));
        assert_eq!((a.bethesda.as_str(), b.bethesda.as_str()), ("NILM", "LSIL"));
        assert_eq!(a.nucleus, base.nucleus);
        // The JSON of a model can be read back.
        assert_eq!(Model::builtin().with(&model.to_json()).unwrap(), model);
    }

    #[test]
    fn invalid_class_files_are_reported() {
        for (text, expected) in [
            ("[classes]", "version is missing"),
            ("version = 2", "version is 2"),
            ("version = 1\nclass = 3", "unknown key `class`"),
            ("version = 1\nclasses = 3", "expected a table"),
            ("version = 1\n[classes.a]\nlike = \"b\"\n[classes.b]\nlike = \"a\"", "form a cycle"),
            ("version = 1\n[classes.a]\nlike = \"missing\"", "no class `missing`"),
            ("version = 1\n[classes.\"../a\"]\nlike = \"intermediate\"", "invalid name `../a`"),
            ("version = 1\n[classes.\"\"]\nlike = \"intermediate\"", "invalid name ``"),
            ("version = 1\n[classes.a]\nlike = \"intermediate\"\ncytoplasm.form.taper = 4", "cytoplasm.form.taper: 4"),
            ("version = 1\n[classes.a]\nlike = \"intermediate\"\nnucleus.size = 4", "unknown field `size`"),
            ("version = 1\n[classes.a]\nbethesda = \"NILM\"", "add `like`, or the missing key `cytoplasm`"),
            ("version = 1\n[classes.a]", "add `like`, or the missing key `bethesda`"),
            ("version = 1\nclasses.a = 3", "classes.a: expected a table, found 3"),
            ("version = 1\n[classes.a]\nlike = 3", "like: expected the name of a class, found 3"),
            (
                "version = 1\n[classes.a]\nlikes = \"superficial\"",
                "unknown key `likes`: expected one of `like`, `bethesda`",
            ),
            ("version = 1\n[classes.a]\nlike = \"intermediate\"\nnucleus = 3", "nucleus: expected a table, found 3"),
            (
                "version = 1\n[classes.a]\nlike = \"intermediate\"\nnucleus.radius_um.log_sd = nan",
                "classes.a.nucleus.radius_um.log_sd: expected a finite number",
            ),
            (
                "version = 1\n[classes.a]\nlike = \"intermediate\"\nnucleus.radius_um = [3, 0.2]",
                "nucleus.radius_um: expected a table, found a list",
            ),
            (
                "version = 1\n[classes.a]\nlike = \"intermediate\"\nnucleus.radius_um.log_sd = \"wide\"",
                "nucleus.radius_um.log_sd: expected a number, found \"wide\"",
            ),
            (
                "version = 1\n[classes.a]\nlike = \"intermediate\"\ncytoplasm.radius_um.median = 500",
                "cytoplasm.radius_um.median: 500 is out of range: expected 0.5 to 100",
            ),
            (
                "version = 1\n[classes.a]\nlike = \"intermediate\"\nnucleus.radius_um.log_sd = 3",
                "nucleus.radius_um.log_sd: 3 is out of range: expected 0 to 1",
            ),
            ("{", "papsynth"),
        ] {
            let message = with(text).unwrap_err();
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }
}

//! The built-in model, and class files: TOML files that define classes by their differences from other classes.

use std::sync::OnceLock;

use serde_json::{Map, Value};

use super::{CellClass, CytoplasmTexture, MODEL_VERSION, Model, Provenance};
use crate::error::{Error, ErrorKind};

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
        toml::from_str(text).map_err(ErrorKind::NotAClassFile)?
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

fn resolved(model: &Model, mut class: Value) -> Result<CellClass, ErrorKind> {
    let complete = match like(&class).map(str::to_owned) {
        None => class,
        Some(of) => {
            let mut base = serde_json::to_value(model.class(&of)?)?;
            class.as_object_mut().map(|fields| fields.remove("like"));
            merge(&mut base, class);
            base
        }
    };
    Ok(serde_json::from_value(complete)?)
}

/// Replaces values of one object by those of another, recursively.
fn merge(base: &mut Value, changes: Value) {
    match (base, changes) {
        (Value::Object(base), Value::Object(changes)) => {
            for (key, value) in changes {
                merge(base.entry(key).or_insert(Value::Null), value);
            }
        }
        (base, changes) => *base = changes,
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
            ("version = 1\n[classes.a]\nbethesda = \"NILM\"", "missing field"),
            ("{", "papsynth"),
        ] {
            let message = with(text).unwrap_err();
            assert!(message.contains(expected), "{text:?}: {message}");
        }
    }
}

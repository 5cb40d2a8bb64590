//! Class files: classes told by the numbers in which they differ from others.

use serde_json::{Map, Value};

use super::{CellClass, MODEL_VERSION, Model, Provenance};

/// A model and the classes of a text.
pub(super) fn merged(base: &Model, text: &str) -> Result<Model, String> {
    let value: Value = if text.trim_start().starts_with('{') {
        serde_json::from_str(text).map_err(|e| format!("this is no model of papsynth: {e}"))?
    } else {
        toml::from_str(text).map_err(|e| format!("this is no class file of papsynth: {e}"))?
    };
    let Value::Object(mut file) = value else { return Err("this is no model of papsynth: it is no table".to_owned()) };
    let version = file.remove("version");
    if version.as_ref().and_then(Value::as_u64) != Some(u64::from(MODEL_VERSION)) {
        let found = version.map_or_else(|| "missing".to_owned(), |v| v.to_string());
        return Err(format!("its version is {found}; this program reads version {MODEL_VERSION}"));
    }
    let mut model = base.clone();
    if let Some(provenance) = file.remove("provenance") {
        let entries: Vec<Provenance> = serde_json::from_value(provenance).map_err(|e| format!("provenance: {e}"))?;
        model.provenance.retain(|old| !entries.contains(old));
        model.provenance.extend(entries);
    }
    let classes = match file.remove("classes") {
        Some(Value::Object(classes)) => classes,
        Some(_) => return Err("classes: expected a table of classes by name".to_owned()),
        None => Map::new(),
    };
    if let Some(unknown) = file.keys().next() {
        return Err(format!("`{unknown}` is not known here; expected version, provenance, classes"));
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
            let names: Vec<&str> = waiting.keys().map(String::as_str).collect();
            return Err(format!("classes {} are like each other in a circle", names.join(", ")));
        }
        for name in ready {
            let Some(class) = waiting.remove(&name) else { continue };
            let class = resolved(&model, class).map_err(|problem| format!("classes.{name}: {problem}"))?;
            model.classes.insert(name, class);
        }
    }
    Ok(model)
}

/// The name of the class that a class is like, if it says so.
fn like(class: &Value) -> Option<&str> {
    class.get("like").and_then(Value::as_str)
}

fn resolved(model: &Model, mut class: Value) -> Result<CellClass, String> {
    let whole = match like(&class).map(str::to_owned) {
        None => class,
        Some(of) => {
            let base = model.classes.get(&of).ok_or_else(|| crate::scene::unknown_class(&of, model))?;
            let mut whole = serde_json::to_value(base).map_err(|e| e.to_string())?;
            class.as_object_mut().map(|fields| fields.remove("like"));
            overlay(&mut whole, class);
            whole
        }
    };
    serde_json::from_value(whole).map_err(|e| e.to_string())
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

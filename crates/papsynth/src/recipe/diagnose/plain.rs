//! Messages of serde in the words of a user.

/// Returns a message of serde about a value of a wrong type, with names of values instead of types of Rust: "expected a
/// number, found null". Other messages stay.
#[must_use]
pub fn plain(message: &str) -> String {
    if let Some((message, place)) = message.rsplit_once(" at line ") {
        return format!("{} at line {place}", plain(message));
    }
    if message == "integer number overflowed" {
        return "the integer is too large".to_owned();
    }
    if let Some((value, _)) = message.strip_prefix("invalid type: integer `").and_then(|t| t.split_once("` as ")) {
        return format!("the integer {value} is too large");
    }
    if let Some(rest) = message.strip_prefix("unknown variant ") {
        return format!("unknown value {rest}");
    }
    let wrong = ["invalid type: ", "invalid value: ", "invalid length "];
    let Some((found, expected)) =
        wrong.iter().find_map(|start| message.strip_prefix(start)).and_then(|text| text.rsplit_once(", expected "))
    else {
        return message.to_owned();
    };
    let is_length = found.parse::<usize>().is_ok();
    let found = match found {
        length if is_length => format!("a list of {length}"),
        "sequence" => "a list".to_owned(),
        "map" => "a table".to_owned(),
        other => ["string ", "integer `", "floating point `", "boolean `"]
            .iter()
            .find_map(|kind| other.strip_prefix(kind))
            .map_or(other, |value| value.trim_end_matches('`'))
            .to_owned(),
    };
    format!("expected {}, found {found}", plain_type(expected, is_length))
}

/// Returns the name of a type that serde expects.
fn plain_type(expected: &str, is_length: bool) -> String {
    let first = expected.split(' ').next().unwrap_or_default();
    let length = expected.split(' ').find(|word| word.parse::<usize>().is_ok());
    match (expected, first) {
        ("fewer elements in array", _) => "a shorter list".to_owned(),
        ("variant identifier" | "string or map" | "map with a single key", _) => "a name".to_owned(),
        ("a sequence", _) => "a list".to_owned(),
        (_, "f32" | "f64") => "a number".to_owned(),
        (_, "u8" | "u16" | "u32" | "u64" | "usize") => "an integer of at least 0".to_owned(),
        (_, "i8" | "i16" | "i32" | "i64") => "an integer".to_owned(),
        (_, "an" | "tuple") if length.is_some() => format!("a list of {}", length.unwrap_or_default()),
        _ if is_length && length.is_some() => format!("a list of {}", length.unwrap_or_default()),
        (_, "struct" | "internally" | "adjacently" | "map") => "a table".to_owned(),
        (_, "enum") => "a name".to_owned(),
        _ => expected.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(tag = "kind")]
    #[expect(dead_code, reason = "only read")]
    enum Tagged {
        A { pair: [f64; 2] },
    }

    #[derive(Debug, serde::Deserialize)]
    enum Word {
        B,
    }

    #[derive(Debug, serde::Deserialize)]
    #[expect(dead_code, reason = "only read")]
    struct All {
        number: f64,
        count: usize,
        pair: [f64; 2],
        list: Vec<u32>,
        tagged: Tagged,
        word: Word,
    }

    #[test]
    fn no_message_has_a_type_of_rust() {
        let valid = serde_json::json!({
            "number": 1.5, "count": 3, "pair": [1, 2], "list": [1], "word": "B",
            "tagged": { "kind": "A", "pair": [1, 2] },
        });
        serde_json::from_value::<All>(valid.clone()).unwrap();
        for path in ["", "/number", "/count", "/pair", "/list", "/tagged", "/tagged/kind", "/tagged/pair", "/word"] {
            for wrong in ["null", "\"x\"", "-1.5", "true", "[]", "{}", "[1, 2, 3, 4, 5, 6, 7]"] {
                let mut value = valid.clone();
                *value.pointer_mut(path).unwrap() = serde_json::from_str(wrong).unwrap();
                let Err(error) = serde_json::from_value::<All>(value) else { continue };
                let message = plain(&error.to_string());
                let words =
                    ["struct", "enum", "variant", "f64", "usize", "u32", "sequence", "map", "invalid", "element"];
                assert!(!words.iter().any(|word| message.contains(word)), "{path} {wrong}: {message} ({error})");
            }
        }
    }

    #[test]
    fn messages_as_by_hand() {
        for (serde, expected) in [
            ("invalid type: null, expected f64", "expected a number, found null"),
            ("invalid type: string \"a, b\", expected usize", "expected an integer of at least 0, found \"a, b\""),
            ("invalid length 3, expected 2 elements in sequence", "expected a list of 2, found a list of 3"),
            ("invalid length 1, expected struct Key with 2 elements", "expected a list of 2, found a list of 1"),
            ("invalid type: integer `9` as i128, expected any valid TOML value", "the integer 9 is too large"),
            (
                "invalid type: map, expected u8 at line 1 column 2",
                "expected an integer of at least 0, found a table at line 1 column 2",
            ),
            ("missing field `id`", "missing field `id`"),
        ] {
            assert_eq!(plain(serde), expected);
        }
    }
}

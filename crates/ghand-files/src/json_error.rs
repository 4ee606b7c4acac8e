//! Explains errors in JSON to people who do not program.

use serde_json::Error;
use serde_json::error::Category;

/// The problem and its position, such as `is a list, must be a text (line 3, column 12)`.
///
/// The parser's own messages use Rust's types (`invalid type: map, expected a string`).
pub fn plain_json_error(error: &Error) -> String {
    let text = error.to_string();
    // A value that was read from another value has no position in a text.
    let (message, place) = match text.rsplit_once(" at line ") {
        Some((message, _)) if error.line() > 0 => {
            (message, format!(" (line {}, column {})", error.line(), error.column()))
        }
        _ => (text.as_str(), String::new()),
    };
    match error.classify() {
        Category::Data => format!("{}{place}", plain(message)),
        Category::Eof => format!("is not complete JSON: the text ends too early{place}"),
        // A list of a fixed length that goes on is the same to the parser as text behind the end.
        Category::Syntax if message == "trailing characters" => {
            format!("has trailing characters: a list has too many values, or text is behind the JSON{place}")
        }
        Category::Syntax | Category::Io => format!("is not JSON: {message}{place}"),
    }
}

fn plain(message: &str) -> String {
    for prefix in ["invalid type: ", "invalid value: "] {
        if let Some((found, wanted)) = message.strip_prefix(prefix).and_then(|m| m.split_once(", expected ")) {
            return format!("is {}, must be {}", kind_found(found), kind_wanted(wanted));
        }
    }
    if let Some((length, wanted)) = message.strip_prefix("invalid length ").and_then(|m| m.split_once(", expected ")) {
        return format!("is a list of {length}, must be {}", kind_wanted(wanted));
    }
    if let Some(field) = message.strip_prefix("missing field ") {
        return format!("the field {field} is missing");
    }
    if let Some((field, known)) = message.strip_prefix("unknown field ").and_then(|m| m.split_once(", expected ")) {
        return format!("the field {field} is unknown here; known fields are {}", known.trim_start_matches("one of "));
    }
    if let Some((name, known)) = message.strip_prefix("unknown variant ").and_then(|m| m.split_once(", expected ")) {
        return format!("is {name}, must be {}", known.replacen("one of ", "one of: ", 1));
    }
    message.to_owned()
}

/// A value as described by the parser.
fn kind_found(found: &str) -> String {
    let kinds = [("map", "an object {...}"), ("sequence", "a list [...]"), ("null", "null"), ("string ", "the text ")];
    let kinds = kinds.iter().find_map(|(kind, plain)| found.strip_prefix(kind).map(|rest| format!("{plain}{rest}")));
    kinds.unwrap_or_else(|| {
        let numbers = ["integer ", "floating point ", "boolean "].iter().find_map(|kind| found.strip_prefix(kind));
        numbers.map_or_else(|| found.to_owned(), |number| number.trim_matches('`').to_owned())
    })
}

/// What the parser expected.
fn kind_wanted(wanted: &str) -> String {
    let plain = match wanted {
        "a string" | "string" => "a text",
        "a sequence" => "a list [...]",
        "a map" => "an object {...}",
        "a boolean" => "true or false",
        "f64" | "f32" => "a number",
        "u64" | "u32" | "u16" | "u8" | "usize" => "a whole number, at least 0",
        "i64" | "i32" => "a whole number",
        other => {
            if let Some(length) = other.strip_prefix("an array of length ") {
                return format!("a list of {length}");
            }
            if other.starts_with("struct ") { "an object {...}" } else { other }
        }
    };
    plain.to_owned()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn problem<T: serde::de::DeserializeOwned>(text: &str) -> String {
        serde_json::from_str::<T>(text).map(drop).map_err(|error| plain_json_error(&error)).unwrap_err()
    }

    #[test]
    fn kinds_of_values_are_named_as_json_names_them() {
        assert_eq!(problem::<Vec<String>>("[{}]"), "is an object {...}, must be a text (line 1, column 1)");
        assert_eq!(problem::<u64>("\"7\""), "is the text \"7\", must be a whole number, at least 0 (line 1, column 3)");
        assert_eq!(problem::<u64>("-1"), "is -1, must be a whole number, at least 0 (line 1, column 2)");
        assert_eq!(
            problem::<BTreeMap<String, u8>>("[1]"),
            "is a list [...], must be an object {...} (line 1, column 0)"
        );
        assert_eq!(problem::<f64>("true"), "is true, must be a number (line 1, column 4)");
        assert_eq!(problem::<bool>("null"), "is null, must be true or false (line 1, column 4)");
        assert_eq!(problem::<[f64; 3]>("[1, 2]"), "is a list of 2, must be a list of 3 (line 1, column 6)");
    }

    #[test]
    fn text_that_is_not_json_is_distinguished_from_truncated_json() {
        assert!(problem::<Vec<u8>>("[1, 2").starts_with("is not complete JSON"));
        assert!(problem::<Vec<u8>>("[1 2]").starts_with("is not JSON"));
        assert!(problem::<Vec<u8>>("").starts_with("is not complete JSON"));
    }

    #[test]
    fn values_without_a_text_have_no_position() {
        let error = serde_json::from_value::<u64>(serde_json::json!("x")).unwrap_err();
        assert_eq!(plain_json_error(&error), "is the text \"x\", must be a whole number, at least 0");
    }
}

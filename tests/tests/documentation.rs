//! The tables of defaults in `docs/` are those of the code.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::path::Path;

use ghand_train::TrainSettings;
use serde_json::Value;

/// The second column of a table in a page, by the first, below a heading.
fn defaults(page: &str, heading: &str) -> BTreeMap<String, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(page);
    let text = std::fs::read_to_string(path).unwrap();
    let (_, section) = text.split_once(heading).unwrap();
    let section = section.split("\n#").next().unwrap();
    let cells = |row: &str| row.split('|').map(|cell| cell.trim().replace('`', "")).collect::<Vec<_>>();
    section
        .lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| {
            let row = cells(line);
            (row[1].clone(), row[2].clone())
        })
        .collect()
}

/// Whether a cell says a value: a number in any notation, a list of them, or a word.
fn says(cell: &str, value: &Value) -> bool {
    match value {
        Value::Number(number) => cell.parse::<f64>().ok() == number.as_f64(),
        Value::Array(values) => {
            let parts: Vec<&str> = cell.split(", ").collect();
            parts.len() == values.len() && parts.iter().zip(values).all(|(part, value)| says(part, value))
        }
        Value::String(text) => cell == text,
        Value::Bool(value) => cell.parse() == Ok(*value),
        Value::Null | Value::Object(_) => false,
    }
}

fn compare(documented: &BTreeMap<String, String>, defaults: &Value) {
    let defaults = defaults.as_object().unwrap();
    for (name, value) in defaults {
        let cell = documented.get(name).unwrap_or_else(|| panic!("{name} is not documented"));
        assert!(says(cell, value), "{name} is {value}, documented as {cell}");
    }
    let unknown: Vec<&String> = documented.keys().filter(|name| !defaults.contains_key(*name)).collect();
    assert!(unknown.is_empty(), "documented, but unknown: {unknown:?}");
}

#[test]
fn documented_defaults_of_settings_are_right() {
    let settings = serde_json::to_value(TrainSettings::default()).unwrap();
    compare(&defaults("settings.md", "## Settings"), &settings);
}

#[test]
fn a_wrong_default_is_found() {
    assert!(says("2e-4", &Value::from(2e-4)) && !says("2e-3", &Value::from(2e-4)));
    assert!(says("1, 2.5", &serde_json::json!([1.0, 2.5])) && !says("1", &serde_json::json!([1.0, 2.5])));
    assert!(says("false", &Value::from(false)) && !says("paper", &Value::from("zero_sum")));
}

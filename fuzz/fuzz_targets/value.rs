//! Any bytes, read as a data file, give a value whose arrays are of their shapes, or an error.
#![no_main]

use ghand_files::Value;
use libfuzzer_sys::fuzz_target;

fn check(value: &Value) {
    match value {
        Value::Numbers(array) => assert_eq!(array.values.len(), array.shape.iter().product::<usize>()),
        Value::List(items) => items.iter().for_each(check),
        Value::Map(entries) => entries.iter().for_each(|(_, value)| check(value)),
        Value::Nothing | Value::Text(_) | Value::Unreadable(_) => {}
    }
}

fuzz_target!(|bytes: &[u8]| {
    if let Ok(value) = Value::from_bytes(bytes) {
        check(&value);
    }
});

//! Damage to files and values, as caused by mistakes, broken disks and malice.

use rand::{Rng, RngExt};
use serde_json::{Value, json};

/// A random element of a list.
pub fn pick<'a, T: ?Sized>(random: &mut impl Rng, list: &[&'a T]) -> &'a T {
    list[random.random_range(0..list.len())]
}

/// The bytes with one to four changes.
pub fn bytes(original: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = original.to_vec();
    for _ in 0..random.random_range(1..=4) {
        let at = random.random_range(0..bytes.len().max(1));
        let end = (at + random.random_range(1..=64)).min(bytes.len());
        match random.random_range(0..7) {
            0 => bytes.truncate(at),
            1 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
            2 if at < bytes.len() => bytes[at] = random.random(),
            3 => drop(bytes.drain(at.min(end)..end)),
            4 if at < end => {
                let block = bytes[at..end].to_vec();
                bytes.splice(at..at, block);
            }
            // Four-byte numbers that are not finite, or the largest.
            5 if at + 4 <= bytes.len() => {
                let value: f32 = [f32::NAN, f32::INFINITY, f32::MAX, -1e30][random.random_range(0..4)];
                bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            }
            _ => {
                let fill = random.random();
                bytes.get_mut(at..end).unwrap_or_default().fill(fill);
            }
        }
    }
    bytes
}

/// The text of a JSON value with one to three changes anywhere in it; sometimes the text itself is damaged.
pub fn json(original: &Value, random: &mut impl Rng) -> Vec<u8> {
    let mut value = original.clone();
    for _ in 0..random.random_range(1..=3) {
        change(&mut value, random);
    }
    let text = value.to_string().into_bytes();
    if random.random_bool(0.1) { bytes(&text, random) } else { text }
}

/// Changes a value, or a value inside it.
fn change(value: &mut Value, random: &mut impl Rng) {
    // Most numbers are in the leaves, a few levels down: each level goes deeper with probability 1/2.
    let go_on = random.random_bool(0.8);
    match value {
        Value::Object(map) if !map.is_empty() && go_on => {
            let at = random.random_range(0..map.len());
            let Some(key) = map.keys().nth(at).cloned() else { return };
            match random.random_range(0..8) {
                0 => drop(map.remove(&key)),
                1 => {
                    let moved = map.remove(&key).unwrap_or_default();
                    map.insert(misspelt(&key, random), moved);
                }
                2 => drop(map.insert(pick(random, &["distortion", "comment", "scale", ""]).to_owned(), other(random))),
                _ => change(map.get_mut(&key).unwrap_or(&mut Value::Null), random),
            }
        }
        Value::Array(list) if !list.is_empty() && go_on => {
            let at = random.random_range(0..list.len());
            match random.random_range(0..10) {
                0 => drop(list.remove(at)),
                1 => list.push(list[at].clone()),
                2 => list.truncate(at),
                3 => list.iter_mut().for_each(|entry| *entry = other(random)),
                _ => change(&mut list[at], random),
            }
        }
        Value::Number(number) if go_on => {
            let x = number.as_f64().unwrap_or_default();
            *value = match random.random_range(0..8) {
                0 => json!(x * 1000.0),
                1 => json!(x.to_degrees()),
                2 => json!(-x),
                3 => json!(0),
                4 => json!(1e30),
                5 => json!(x + 0.5),
                6 => json!(u64::MAX),
                _ => json!(1e-300),
            }
        }
        _ => *value = other(random),
    }
}

/// A key with a typing error.
fn misspelt(key: &str, random: &mut impl Rng) -> String {
    let mut letters: Vec<char> = key.chars().collect();
    if letters.len() > 1 {
        let at = random.random_range(0..letters.len() - 1);
        letters.swap(at, at + 1);
    }
    letters.into_iter().collect()
}

/// A value that is probably wrong there.
fn other(random: &mut impl Rng) -> Value {
    match random.random_range(0..10) {
        0 => Value::Null,
        1 => json!(true),
        2 => json!(-1),
        3 => json!(1e30),
        4 => json!(""),
        5 => json!("NaN"),
        6 => json!([]),
        7 => json!({}),
        8 => json!([[1, 2], [3]]),
        _ => json!("../../../etc/passwd"),
    }
}

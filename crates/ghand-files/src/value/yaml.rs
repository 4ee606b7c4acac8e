//! YAML. Its scalars have no types that programs agree on: all of them are texts, also numbers.

use saphyr_parser::{Event, Parser, ScalarStyle};

use super::Value;
use super::budget::Budget;

/// Most levels of a tree; calibrations have six.
const DEEPEST: usize = 64;

/// A list or a map whose end has not been seen.
enum Open {
    List(Vec<Value>),
    /// With the name of the value that comes next.
    Map(Vec<(String, Value)>, Option<String>),
}

/// The first document of a text.
pub(super) fn from_yaml(text: &str) -> Result<Value, String> {
    let budget = Budget::new();
    let mut open: Vec<Open> = vec![];
    let mut parser = Parser::new_from_str(text);
    while let Some(event) = parser.next_event() {
        let (event, _) =
            event.map_err(|error| format!("is not YAML: {} (line {})", error.info(), error.marker().line()))?;
        let value = match event {
            Event::SequenceStart(..) => {
                open.push(Open::List(vec![]));
                None
            }
            Event::MappingStart(..) => {
                open.push(Open::Map(vec![], None));
                None
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(items)) => Some(Value::List(items)),
                Some(Open::Map(entries, _)) => Some(map(entries)?),
                None => None,
            },
            Event::Scalar(text, style, ..) => Some(match (style, text.as_ref()) {
                (ScalarStyle::Plain, "" | "~" | "null") => Value::Nothing,
                (_, text) => Value::Text(text.into()),
            }),
            Event::Alias(_) => {
                return Err("has an alias (*name), which is not read; write the value in its place".into());
            }
            Event::DocumentEnd | Event::StreamEnd => break,
            Event::Nothing | Event::StreamStart | Event::DocumentStart(_) => None,
        };
        if open.len() > DEEPEST {
            return Err(format!("has more than {DEEPEST} levels; keep only what is needed"));
        }
        let Some(value) = value else { continue };
        budget.values(1)?;
        match (open.last_mut(), value) {
            (None, value) => return Ok(value),
            (Some(Open::List(items)), value) => items.push(value),
            (Some(Open::Map(entries, name)), value) => match (name.take(), value) {
                (Some(name), value) => entries.push((name, value)),
                (None, Value::Text(text)) => *name = Some(text),
                (None, value) => return Err(format!("has {} as a name; names must be texts", value.kind())),
            },
        }
    }
    Ok(Value::Nothing)
}

fn map(entries: Vec<(String, Value)>) -> Result<Value, String> {
    let mut names: Vec<&str> = entries.iter().map(|(name, _)| name.as_str()).collect();
    names.sort_unstable();
    let twice = names.windows(2).find_map(|pair| match pair {
        [one, other] if one == other => Some(*one),
        _ => None,
    });
    match twice {
        Some(name) => Err(format!("has {:?} twice", name.chars().take(40).collect::<String>())),
        None => Ok(Value::Map(entries)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_and_flows_are_the_same_tree_of_texts() {
        let text = |text: &str| Value::Text(text.into());
        let list = Value::List(vec![text("1"), text("-2.5e-3"), Value::Nothing]);
        let expected = Value::Map(vec![("a b".into(), list), ("c".into(), Value::Map(vec![("d".into(), text("x"))]))]);
        for yaml in ["a b: [1, -2.5e-3, ~]\nc: {d: x}\n", "'a b':\n- 1\n- -2.5e-3\n-\nc:\n  d: \"x\"\n"] {
            assert_eq!(from_yaml(yaml), Ok(expected.clone()), "{yaml}");
        }
    }

    #[test]
    fn broken_and_deep_texts_are_errors() {
        for (yaml, says) in [("a: [1", "not YAML"), ("a: 1\na: 2", "\"a\" twice"), ("a: &x 1\nb: *x", "alias")] {
            let error = from_yaml(yaml).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
        assert!(from_yaml(&format!("a: {}", "[".repeat(10_000))).is_err());
    }
}

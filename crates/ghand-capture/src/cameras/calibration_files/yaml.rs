//! YAML, and what OpenCV writes under that name: its first line is no directive, its tags name no types.

use saphyr_parser::{Event, Parser, ScalarStyle};

use super::node::{DEEPEST, Node};

/// A list or a map whose end has not been seen.
enum Open {
    List(Vec<Node>),
    /// With the name of the value that comes next.
    Map(Vec<(String, Node)>, Option<String>),
}

/// The first document of a text. All scalars are texts.
pub(super) fn node(text: &str) -> Result<Node, String> {
    let mut open: Vec<Open> = vec![];
    let mut parser = Parser::new_from_str(without_opencv_header(text));
    while let Some(event) = parser.next_event() {
        let (event, _) =
            event.map_err(|error| format!("is not YAML: {} (line {})", error.info(), error.marker().line()))?;
        let node = match event {
            Event::SequenceStart(..) => {
                open.push(Open::List(vec![]));
                None
            }
            Event::MappingStart(..) => {
                open.push(Open::Map(vec![], None));
                None
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(items)) => Some(Node::List(items)),
                Some(Open::Map(entries, _)) => Some(Node::of_entries(entries)?),
                None => None,
            },
            Event::Scalar(text, style, ..) => Some(match (style, text.as_ref()) {
                (ScalarStyle::Plain, "" | "~" | "null") => Node::Nothing,
                (_, text) => Node::Text(text.into()),
            }),
            Event::Alias(_) => {
                return Err("has an alias (*name), which is not read; write the value in its place".into());
            }
            Event::DocumentEnd | Event::StreamEnd => break,
            Event::Nothing | Event::StreamStart | Event::DocumentStart(_) => None,
        };
        if open.len() > DEEPEST {
            return Err(format!("has more than {DEEPEST} levels; give the calibration alone"));
        }
        let Some(node) = node else { continue };
        match (open.last_mut(), node) {
            (None, node) => return Ok(node),
            (Some(Open::List(items)), node) => items.push(node),
            (Some(Open::Map(entries, name)), node) => match (name.take(), node) {
                (Some(name), node) => entries.push((name, node)),
                (None, Node::Text(text)) => *name = Some(text),
                (None, node) => return Err(format!("has {} as a name; names must be texts", node.kind())),
            },
        }
    }
    Ok(Node::Nothing)
}

/// OpenCV before version 5, and EasyMocap, begin with `%YAML:1.0`.
fn without_opencv_header(text: &str) -> &str {
    let rest = text.strip_prefix("%YAML:").or_else(|| text.strip_prefix("%YAML "));
    // The end of the line stays, so that lines have their numbers.
    rest.map_or(text, |rest| rest.trim_start_matches(|c: char| c != '\n'))
}

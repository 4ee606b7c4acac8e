//! YAML, and what OpenCV writes under that name: its first line is no directive, its tags name no types.

use ghand_files::Value;

use super::node::Node;

/// The first document of a text. All scalars are texts.
pub(super) fn node(text: &str) -> Result<Node, String> {
    Value::from_yaml(without_opencv_header(text)).map(Node::from)
}

impl From<Value> for Node {
    fn from(value: Value) -> Node {
        match value {
            Value::Text(text) => Node::Text(text),
            Value::List(items) => Node::List(items.into_iter().map(Node::from).collect()),
            Value::Map(entries) => {
                Node::Map(entries.into_iter().map(|(name, value)| (name, Node::from(value))).collect())
            }
            // YAML's values have no other kind.
            Value::Nothing | Value::Numbers(_) | Value::Unreadable(_) => Node::Nothing,
        }
    }
}

/// OpenCV before version 5, and EasyMocap, begin with `%YAML:1.0`.
fn without_opencv_header(text: &str) -> &str {
    let rest = text.strip_prefix("%YAML:").or_else(|| text.strip_prefix("%YAML "));
    // The end of the line stays, so that lines have their numbers.
    rest.map_or(text, |rest| rest.trim_start_matches(|c: char| c != '\n'))
}

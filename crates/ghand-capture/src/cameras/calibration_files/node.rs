//! The content of a text file in JSON, TOML, YAML or XML, as one tree.

use std::borrow::Cow;
use std::fmt;

use ghand_files::json_error::plain_json_error;
use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::{xml, yaml};

/// Largest text of another syntax than JSON, bytes: with all points of the board's images it has some hundred thousand.
/// Meshroom's JSON has all images' metadata.
const LARGEST_TEXT: usize = 1 << 22;
/// Most levels of a tree; calibrations have six.
pub(super) const DEEPEST: usize = 64;

/// A value of a file. YAML, XML and Meshroom's JSON tell no types: all of their values are texts, also numbers.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Node {
    Nothing,
    /// `true` is 1, `false` is 0.
    Number(f64),
    Text(String),
    List(Vec<Node>),
    /// In the order of the file; no name occurs twice.
    Map(Vec<(String, Node)>),
}

impl Node {
    /// The content of a text, whose kind its first characters decide.
    ///
    /// # Errors
    /// The problem, as the end of a sentence about the file.
    pub fn parse(text: &str) -> Result<Node, String> {
        let syntax = Syntax::of(text);
        if text.len() > LARGEST_TEXT && !matches!(syntax, Syntax::Json) {
            return Err(format!("is larger than {} MiB; give the calibration alone", LARGEST_TEXT >> 20));
        }
        match syntax {
            Syntax::Json => {
                let text = without_comments(text);
                let mut input = serde_json::Deserializer::from_str(&text);
                let node = Node::deserialize(&mut input).and_then(|node| input.end().map(|()| node));
                node.map_err(|error| plain_json_error(&error))
            }
            Syntax::Toml => toml::from_str(text).map_err(|error| {
                let line =
                    error.span().and_then(|span| text.get(..span.start)).map_or(1, |before| before.lines().count());
                format!("is not TOML: {} (line {line})", error.message().lines().next().unwrap_or_default())
            }),
            Syntax::Xml => xml::node(text),
            Syntax::Yaml => yaml::node(text),
        }
    }

    /// A list, or names and values.
    pub fn of_entries(entries: Vec<(String, Node)>) -> Result<Node, String> {
        let mut names: Vec<&str> = entries.iter().map(|(name, _)| name.as_str()).collect();
        names.sort_unstable();
        let twice = names.windows(2).find_map(|pair| match pair {
            [one, other] if one == other => Some(*one),
            _ => None,
        });
        match twice {
            Some(name) => Err(format!("has {:?} twice", name.chars().take(40).collect::<String>())),
            None => Ok(Node::Map(entries)),
        }
    }

    /// The value of that name.
    pub fn get(&self, name: &str) -> Option<&Node> {
        self.entries().iter().find(|(key, _)| key == name).map(|(_, value)| value)
    }

    /// Names and values; empty if it is not a map.
    pub fn entries(&self) -> &[(String, Node)] {
        match self {
            Node::Map(entries) => entries,
            _ => &[],
        }
    }

    /// For messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Node::Nothing => "empty",
            Node::Number(_) => "a number",
            Node::Text(_) => "a text",
            Node::List(_) => "a list",
            Node::Map(_) => "a group of named values",
        }
    }
}

/// OpenCV writes comments into JSON, on lines of their own.
fn without_comments(text: &str) -> Cow<'_, str> {
    let is_comment = |line: &str| line.trim_start().starts_with("//");
    if !text.lines().any(is_comment) {
        return Cow::Borrowed(text);
    }
    // Lines keep their numbers.
    text.split_inclusive('\n').map(|line| if is_comment(line) { "\n" } else { line }).collect()
}

enum Syntax {
    Json,
    Toml,
    Xml,
    Yaml,
}

impl Syntax {
    fn of(text: &str) -> Syntax {
        let first = text.lines().map(str::trim).find(|line| !(line.is_empty() || line.starts_with('#'))).unwrap_or("");
        let key = first.trim_start_matches('[').trim_start();
        let is_table = first.starts_with('[') && key.starts_with(|c: char| c.is_alphabetic() || c == '_' || c == '"');
        // `name = value`, where YAML has `name: value`.
        let is_assignment = first.split_once('=').is_some_and(|(name, _)| !name.contains([':', '{', '<']));
        if first.starts_with('<') {
            Syntax::Xml
        } else if first.starts_with('{') || (first.starts_with('[') && !is_table) {
            Syntax::Json
        } else if is_table || is_assignment {
            Syntax::Toml
        } else {
            Syntax::Yaml
        }
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Node, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

/// Of parsers that bound the depth themselves.
struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a value")
    }

    fn visit_unit<E: Error>(self) -> Result<Node, E> {
        Ok(Node::Nothing)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Node, E> {
        Ok(Node::Number(f64::from(u8::from(value))))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Number(value))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Node, E> {
        Ok(Node::Text(value.into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Node, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = sequence.next_element()? {
            items.push(item);
        }
        Ok(Node::List(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Node, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Node::of_entries(entries).map_err(A::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(value: f64) -> Node {
        Node::Number(value)
    }

    fn text(value: &str) -> Node {
        Node::Text(value.into())
    }

    #[test]
    fn the_same_tree_is_read_in_every_syntax() {
        let entries = |values: [Node; 3], b: Node| {
            Node::Map(vec![("a".into(), Node::List(values.into())), ("b".into(), Node::Map(vec![("c".into(), b)]))])
        };
        let typed = entries([1.0, -2.5, 3e-7].map(number), text("x y"));
        assert_eq!(Node::parse(r#"{"a": [1, -2.5, 3e-7], "b": {"c": "x y"}}"#), Ok(typed.clone()));
        assert_eq!(Node::parse("# comment\na = [1, -2.5, 3e-7]\n[b]\nc = \"x y\"\n"), Ok(typed.clone()));
        assert_eq!(
            Node::parse("{\n    // flags: +fix_k3\n    \"a\": [1, -2.5, 3e-7],\n// \"\n\"b\": {\"c\": \"x y\"}}"),
            Ok(typed.clone())
        );
        let texts = entries(["1", "-2.5", "3e-7"].map(text), text("x y"));
        let yaml = "a: [ 1, -2.5,\n    3e-7 ]\nb: !!some-tag\n   c: \"x y\"\n";
        for header in ["", "%YAML:1.0\n---\n", "%YAML 1.2\r\n---\r\n", "# comment\n"] {
            assert_eq!(Node::parse(&format!("{header}{yaml}")), Ok(texts.clone()), "{header}");
        }
        let block = "a:\n  - 1\n  - -2.5\n  - 3e-7\nb:\n  c: x y\n";
        assert_eq!(Node::parse(block), Ok(texts.clone()));
        let xml = "<?xml version=\"1.0\"?>\n<opencv_storage><a>\n 1 -2.5\n 3e-7</a>\
                   <b type_id=\"t\"><c>\"x y\"</c></b></opencv_storage>";
        assert_eq!(Node::parse(xml), Ok(texts.clone()));
        let items = "<opencv_storage><a><_>1</_><_>-2.5</_><_>3e-7</_></a><b><c>\"x y\"</c></b></opencv_storage>";
        assert_eq!(Node::parse(items), Ok(texts));
    }

    #[test]
    fn broken_and_hostile_texts_are_errors() {
        for (broken, says) in [
            ("{\"a\": [1, 2", "too early"),
            ("{\"a\": 1, \"a\": 2}", "twice"),
            ("a = [1, 2\n", "TOML"),
            ("a: [1, 2\n", "YAML"),
            ("a: 1\na: 2\n", "twice"),
            ("a: &x [1]\nb: *x\n", "alias"),
            ("? [1, 2]\n: 3\n", "name"),
            ("<a><b>1</b>", "XML"),
            ("<a><b>1</b><b>2</b></a>", "twice"),
            (&format!("<a {}>1</a>", "b=\"1\" ".repeat(10_000)), "tag"),
            ("<!DOCTYPE x [<!ENTITY y \"z\">]><a>&y;</a>", "XML"),
        ] {
            let error = Node::parse(broken).unwrap_err();
            assert!(error.contains(says), "{broken}: {error}");
        }
        let long = format!("a: 1\n{}", "# \n".repeat(LARGEST_TEXT / 3));
        assert!(Node::parse(&long).unwrap_err().contains("larger than 4 MiB"));
        for deep in [
            "[".repeat(100_000),
            format!("a: {}", "[".repeat(100_000)),
            format!("a: {}", "{b: ".repeat(100_000)),
            format!("a = {}", "[".repeat(100_000)),
            "<a>".repeat(100_000),
            format!("{}{}", "<a>".repeat(1000), "</a>".repeat(1000)),
            (0..2000).map(|k| format!("{}a:\n", " ".repeat(k))).collect(),
        ] {
            assert!(Node::parse(&deep).is_err());
        }
    }
}

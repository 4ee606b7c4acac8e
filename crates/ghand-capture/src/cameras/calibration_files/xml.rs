//! XML as OpenCV's `FileStorage` writes it: elements are names, items of a list are elements `_` or words.

use roxmltree::{Document, ParsingOptions};

use super::node::{DEEPEST, Node};

/// Most elements and texts; a calibration has some hundred.
const MOST_NODES: u32 = 1 << 20;
/// Longest tag, bytes: the parser compares each attribute with all others of its tag.
const LONGEST_TAG: usize = 1 << 12;

/// The content of the root element.
pub(super) fn node(text: &str) -> Result<Node, String> {
    if text.split('<').any(|tag| tag.find('>').unwrap_or(tag.len()) > LONGEST_TAG) {
        return Err("is not XML as of OpenCV: it has a tag that is longer than any of a calibration".into());
    }
    let options = ParsingOptions { nodes_limit: MOST_NODES, ..ParsingOptions::default() };
    let document =
        Document::parse_with_options(text, options).map_err(|error| format!("is not XML as of OpenCV: {error}"))?;
    content(document.root_element(), 0)
}

fn content(element: roxmltree::Node, depth: usize) -> Result<Node, String> {
    if depth > DEEPEST {
        return Err(format!("has more than {DEEPEST} levels; give the calibration alone"));
    }
    let mut children: Vec<(&str, Node)> = vec![];
    for child in element.children().filter(roxmltree::Node::is_element) {
        children.push((child.tag_name().name(), content(child, depth + 1)?));
    }
    if children.is_empty() {
        let mut words = words(element.text().unwrap_or_default());
        return Ok(match words.len() {
            0 => Node::Nothing,
            1 => words.swap_remove(0),
            _ => Node::List(words),
        });
    }
    if children.iter().all(|(name, _)| *name == "_") {
        return Ok(Node::List(children.into_iter().map(|(_, node)| node).collect()));
    }
    Node::of_entries(children.into_iter().map(|(name, node)| (name.into(), node)).collect())
}

/// Words between spaces; quotes hold them together.
fn words(text: &str) -> Vec<Node> {
    let mut words = vec![];
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let (word, behind) = match rest.strip_prefix('"') {
            Some(quoted) => quoted.split_once('"').unwrap_or((quoted, "")),
            None => rest.split_at(rest.find(char::is_whitespace).unwrap_or(rest.len())),
        };
        words.push(Node::Text(word.into()));
        rest = behind.trim_start();
    }
    words
}

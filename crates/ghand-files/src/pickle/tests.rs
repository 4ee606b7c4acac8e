use super::*;

/// The value of a pickle, written as in Python.
fn shown(bytes: &[u8]) -> String {
    let graph = Graph::read(bytes).unwrap();
    show(&graph, graph.root())
}

fn show(graph: &Graph, id: Id) -> String {
    let list = |ids: &[Id]| ids.iter().map(|id| show(graph, *id)).collect::<Vec<_>>().join(",");
    match graph.node(id) {
        Node::None => "None".into(),
        Node::Bool(value) => value.to_string(),
        Node::Int(value) => value.to_string(),
        Node::Float(value) => format!("{value:?}"),
        Node::Bytes(bytes) => format!("b{bytes:?}"),
        Node::Text(text) => format!("{text:?}"),
        Node::Tuple(items) => format!("({})", list(items)),
        Node::List(items) => format!("[{}]", list(items)),
        Node::Dict(entries) => {
            format!("{{{}}}", list(&entries.iter().flat_map(|(key, value)| [*key, *value]).collect::<Vec<_>>()))
        }
        Node::Class(class) => format!("{class:?}"),
        Node::Object(object) => {
            let state = object.state.map_or(String::new(), |state| format!(":{}", show(graph, state)));
            format!("{:?}({}){state}", object.class, list(&object.args))
        }
    }
}

#[test]
fn every_instruction_behaves_as_in_python() {
    let cases: [(&[u8], &str); 45] = [
        (b"N.", "None"),
        (b"\x88.", "true"),
        (b"\x89.", "false"),
        (b"I01\n.", "true"),
        (b"I00\n.", "false"),
        (b"I-12\n.", "-12"),
        (b"L4294967295L\n.", "4294967295"),
        (b"J\xff\xff\xff\xff.", "-1"),
        (b"K\xff.", "255"),
        (b"M\x01\x02.", "513"),
        (b"\x8a\x00.", "0"),
        (b"\x8a\x01\xff.", "-1"),
        (b"\x8a\x02\xff\x00.", "255"),
        (b"\x8b\x01\x00\x00\x00\x80.", "-128"),
        (b"F1e-3\n.", "0.001"),
        (b"Fnan\n.", "NaN"),
        (b"G\x3f\xf8\x00\x00\x00\x00\x00\x00.", "1.5"),
        (b"S'a\\n\\x00\\\\\\'\\101'\n.", "b[97, 10, 0, 92, 39, 65]"),
        (b"S\"it's\"\n.", "b[105, 116, 39, 115]"),
        (b"T\x02\x00\x00\x00ab.", "b[97, 98]"),
        (b"U\x01a.", "b[97]"),
        (b"B\x01\x00\x00\x00a.", "b[97]"),
        (b"C\x01a.", "b[97]"),
        (b"\x8e\x01\x00\x00\x00\x00\x00\x00\x00a.", "b[97]"),
        (b"\x96\x01\x00\x00\x00\x00\x00\x00\x00a.", "b[97]"),
        (b"Va\xe9\\u20ac\\U0001f590\\ud83d\\udd90\n.", "\"a\u{e9}\u{20ac}\u{1f590}\u{1f590}\""),
        (b"X\x02\x00\x00\x00\xc3\xa9.", "\"\u{e9}\""),
        (b"\x8c\x01a.", "\"a\""),
        (b"\x8d\x01\x00\x00\x00\x00\x00\x00\x00a.", "\"a\""),
        (b"(NN\x88t.", "(None,None,true)"),
        (b"NN\x86\x85.", "((None,None))"),
        (b"(K\x01K\x02l.", "[1,2]"),
        (b"](K\x01K\x02eK\x03a.", "[1,2,3]"),
        (b"\x8f(K\x01\x90.", "[1]"),
        (b"(K\x01\x91.", "[1]"),
        (b"(K\x01K\x02d.", "{1,2}"),
        (b"}K\x01K\x02s(K\x03K\x04u.", "{1,2,3,4}"),
        (b"K\x01K\x020.", "1"),
        (b"K\x01(K\x02K\x031.", "1"),
        (b"K\x012\x86.", "(1,1)"),
        (b"K\x01p300\n0g300\n.", "1"),
        (b"K\x01q\x07r\x08\x00\x00\x00\x940h\x07j\x08\x00\x00\x00h\x02\x87.", "(1,1,1)"),
        (
            b"ccopy_reg\n_reconstructor\n(cchumpy.ch\nCh\nc__builtin__\nobject\nNtR}b.",
            "ChumpyArray(ChumpyArray,Base,None):{}",
        ),
        (b"(ichumpy.ch\nCh\n.", "ChumpyArray()"),
        (b"(cchumpy.ch\nCh\nK\x01o.", "ChumpyArray(1)"),
    ];
    for (bytes, wanted) in cases {
        assert_eq!(shown(bytes), wanted, "{}", bytes.escape_ascii());
    }
    let by_name = b"\x80\x04\x95\x00\x00\x00\x00\x00\x00\x00\x00\x8c\x05numpy\x94\x8c\x05dtype\x93)}\x92.";
    assert_eq!(shown(by_name), "ElementType()");
}

#[test]
fn invalid_pickles_are_rejected() {
    let cases: [(&[u8], &str); 22] = [
        (b"", "truncated"),
        (b"N", "truncated"),
        (b".", "stack is empty"),
        (b"(.", "stack is empty"),
        (b"N(0\xff", "unknown instruction"),
        (b"N(\x85.", "stack is empty"),
        (b"Nt.", "mark is missing"),
        (b"h\x00.", "memo has no such key"),
        (b"NNa.", "not belong to a list"),
        (b"NNNs.", "not belong to a dictionary"),
        (b"}(Nu.", "no value"),
        (b"NNb.", "not belong to an object"),
        (b"NNR.", "not a class"),
        (b"cnumpy\ndtype\nNR.", "not a short tuple"),
        (b"NN\x93.", "not text"),
        (b"S'a\n.", "not quoted"),
        (b"T\xff\xff\xff\xff.", "negative"),
        (b"\x8a\x09\x00\x00\x00\x00\x00\x00\x00\x00\x01.", "too large"),
        (b"I1x\n.", "number"),
        (b"X\x01\x00\x00\x00\xff.", "UTF-8"),
        (b"\x80\x06N.", "protocol"),
        (b"N\x97.", "outside the file"),
    ];
    for (bytes, wanted) in cases {
        let message = Graph::read(bytes).unwrap_err().to_string();
        assert!(message.contains(wanted), "{}: wanted {wanted}, got {message}", bytes.escape_ascii());
    }
}

#[test]
fn the_last_of_equal_keys_counts_and_keys_may_be_text_or_bytes_of_any_python() {
    let graph = Graph::read(b"}(U\x01fK\x01X\x01\x00\x00\x00fK\x02u.").unwrap();
    assert_eq!(graph.node(graph.entry("f").unwrap()), &Node::Int(2));
    let wrapped = b"}c_codecs\nencode\nX\x01\x00\x00\x00fX\x06\x00\x00\x00latin1\x86RK\x03s.";
    let graph = Graph::read(wrapped).unwrap();
    assert_eq!(graph.node(graph.entry("f").unwrap()), &Node::Int(3));
    assert_eq!(graph.entry("g"), None);
}

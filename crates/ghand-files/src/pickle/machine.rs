//! The stack machine.

use std::borrow::Cow;
use std::collections::HashMap;

use super::{Class, Graph, Id, Node, Object, PickleError, joblib, text};

/// Runs the pickle at a byte of the input; returns its values, the index of the result, and the byte after it.
pub(super) fn run(input: &[u8], at: usize, most: usize) -> Result<(Vec<Node<'_>>, Id, usize), PickleError> {
    let mut machine = Machine { left: most, ..Machine::new(input, at, Vec::new()) };
    let root = machine.run()?;
    Ok((machine.nodes, root, machine.at))
}

pub(super) struct Machine<'a> {
    input: &'a [u8],
    /// Instructions that may still be executed.
    left: usize,
    /// Whether it runs inside another pickle.
    is_inner: bool,
    /// The next byte.
    at: usize,
    /// Start of the current instruction, for messages.
    instruction: usize,
    nodes: Vec<Node<'a>>,
    stack: Vec<Id>,
    /// Heights of the stack at which marks were set; nothing below the last one may be popped.
    marks: Vec<usize>,
    memo: HashMap<u32, Id>,
}

impl<'a> Machine<'a> {
    fn new(input: &'a [u8], at: usize, nodes: Vec<Node<'a>>) -> Machine<'a> {
        let stack = Vec::new();
        let marks = Vec::new();
        let memo = HashMap::new();
        Machine { input, left: 0, is_inner: false, at, instruction: at, nodes, stack, marks, memo }
    }

    fn run(&mut self) -> Result<Id, PickleError> {
        while let Some(left) = self.left.checked_sub(1) {
            self.left = left;
            self.instruction = self.at;
            let code = self.byte()?;
            if code == b'.' {
                return self.pop();
            }
            self.step(code)?;
        }
        Err(PickleError::TooLong)
    }

    /// Runs the whole pickle that follows an instruction, with a stack and a memo of its own.
    pub(super) fn inner(&mut self) -> Result<Id, PickleError> {
        if self.is_inner {
            return Err(PickleError::Unsupported("pickles in pickles in pickles", self.instruction));
        }
        let nodes = std::mem::take(&mut self.nodes);
        let mut inner = Machine { left: self.left, is_inner: true, ..Machine::new(self.input, self.at, nodes) };
        let root = inner.run()?;
        (self.left, self.at, self.nodes) = (inner.left, inner.at, inner.nodes);
        Ok(root)
    }

    /// Calls a function with all values so far.
    pub(super) fn with_graph<T>(&mut self, read: impl FnOnce(&Graph) -> T) -> T {
        let graph = Graph::of(std::mem::take(&mut self.nodes), Id(0));
        let found = read(&graph);
        self.nodes = graph.nodes;
        found
    }

    /// Executes every instruction except the end of the program. Codes have the names of Python's `pickletools`.
    fn step(&mut self, code: u8) -> Result<(), PickleError> {
        match code {
            0x80 => {
                // PROTO
                if self.byte()? > 5 {
                    return Err(PickleError::Unsupported("a protocol above 5", self.instruction));
                }
            }
            // FRAME
            0x95 => {
                self.take(8)?;
            }
            // MARK, POP, POP_MARK, DUP
            b'(' => self.marks.push(self.stack.len()),
            b'0' => {
                if self.marks.last() == Some(&self.stack.len()) {
                    self.marks.pop();
                } else {
                    self.pop()?;
                }
            }
            b'1' => {
                self.pop_to_mark()?;
            }
            b'2' => {
                let top = self.top()?;
                self.stack.push(top);
            }
            // PUT, BINPUT, LONG_BINPUT, MEMOIZE, GET, BINGET, LONG_BINGET
            b'p' => {
                let key = self.decimal()?;
                self.remember(key)?;
            }
            b'q' => {
                let key = u32::from(self.byte()?);
                self.remember(key)?;
            }
            b'r' => {
                let key = u32::from_le_bytes(self.array()?);
                self.remember(key)?;
            }
            0x94 => self.remember(self.memo.len() as u32)?,
            b'g' => {
                let key = self.decimal()?;
                self.recall(key)?;
            }
            b'h' => {
                let key = u32::from(self.byte()?);
                self.recall(key)?;
            }
            b'j' => {
                let key = u32::from_le_bytes(self.array()?);
                self.recall(key)?;
            }
            b'N' => self.push(Node::None),
            0x88 => self.push(Node::Bool(true)),
            0x89 => self.push(Node::Bool(false)),
            b'F' | b'G' | b'I' | b'J' | b'K' | b'M' | b'L' | 0x8a | 0x8b => {
                let number = self.number(code)?;
                self.push(number);
            }
            b'S' | b'T' | b'U' | b'B' | b'C' | 0x8e | 0x96 => {
                let bytes = self.bytes(code)?;
                self.push(Node::Bytes(bytes));
            }
            b'V' | b'X' | 0x8c | 0x8d => {
                let text = self.text(code)?;
                self.push(Node::Text(text));
            }
            // EMPTY_TUPLE, TUPLE1, TUPLE2, TUPLE3, TUPLE
            b')' => self.push(Node::Tuple(Vec::new())),
            0x85..=0x87 => {
                let items = self.pop_many(usize::from(code - 0x84))?;
                self.push(Node::Tuple(items));
            }
            b't' => {
                let items = self.pop_to_mark()?;
                self.push(Node::Tuple(items));
            }
            // EMPTY_LIST, EMPTY_SET, LIST, FROZENSET
            b']' | 0x8f => self.push(Node::List(Vec::new())),
            b'l' | 0x91 => {
                let items = self.pop_to_mark()?;
                self.push(Node::List(items));
            }
            // APPEND, APPENDS, ADDITEMS
            b'a' => {
                let items = self.pop_many(1)?;
                self.extend_list(items)?;
            }
            b'e' | 0x90 => {
                let items = self.pop_to_mark()?;
                self.extend_list(items)?;
            }
            // EMPTY_DICT, DICT, SETITEM, SETITEMS
            b'}' => self.push(Node::Dict(Vec::new())),
            b'd' => {
                let items = self.pop_to_mark()?;
                self.push(Node::Dict(Vec::new()));
                self.extend_dictionary(&items)?;
            }
            b's' => {
                let items = self.pop_many(2)?;
                self.extend_dictionary(&items)?;
            }
            b'u' => {
                let items = self.pop_to_mark()?;
                self.extend_dictionary(&items)?;
            }
            // GLOBAL, STACK_GLOBAL
            b'c' => {
                let class = self.global()?;
                self.push(Node::Class(class));
            }
            0x93 => {
                let names = self.pop_many(2)?;
                let class = match names.iter().map(|id| self.node(*id)).collect::<Result<Vec<_>, _>>()?.as_slice() {
                    [Node::Text(module), Node::Text(name)] => find(module, name)?,
                    _ => return Err(self.damaged("a name is not text")),
                };
                self.push(Node::Class(class));
            }
            // REDUCE, NEWOBJ
            b'R' | 0x81 => {
                let args = self.pop()?;
                let class = self.pop()?;
                let class = self.class(class)?;
                let args = self.arguments(args)?;
                self.make(class, args)?;
            }
            // NEWOBJ_EX
            0x92 => {
                let keywords = self.pop()?;
                if !matches!(self.node(keywords)?, Node::Dict(entries) if entries.is_empty()) {
                    return Err(PickleError::Unsupported("arguments by name", self.instruction));
                }
                let args = self.pop()?;
                let class = self.pop()?;
                let class = self.class(class)?;
                let args = self.arguments(args)?;
                self.make(class, args)?;
            }
            // INST, OBJ
            b'i' => {
                let class = self.global()?;
                let args = self.pop_to_mark()?;
                self.make(class, args)?;
            }
            b'o' => {
                let mut args = self.pop_to_mark()?.into_iter();
                let class = args.next().ok_or_else(|| self.damaged("an object has no class"))?;
                let class = self.class(class)?;
                self.make(class, args.collect())?;
            }
            // BUILD
            b'b' => {
                let state = self.pop()?;
                let object = self.top()?;
                match self.node_mut(object)? {
                    Node::Object(made) if made.class == Class::JoblibArray => {
                        let array = joblib::array(self, state)?;
                        *self.node_mut(object)? = array;
                    }
                    Node::Object(made) => made.state = Some(state),
                    // Attributes of an OrderedDict.
                    Node::Dict(_) => {}
                    _ => return Err(self.damaged("a state does not belong to an object")),
                }
            }
            // PERSID, BINPERSID
            b'P' => {
                let line = String::from_utf8_lossy(self.line()?).into_owned();
                self.push(Node::Text(line.into()));
                let id = self.pop()?;
                self.refer(id);
            }
            b'Q' => {
                let id = self.pop()?;
                self.refer(id);
            }
            0x82..=0x84 => return Err(PickleError::Unsupported("a registered extension", self.instruction)),
            0x97 | 0x98 => return Err(PickleError::Unsupported("data outside the file", self.instruction)),
            _ => return Err(self.damaged("unknown instruction")),
        }
        Ok(())
    }

    fn number(&mut self, code: u8) -> Result<Node<'a>, PickleError> {
        Ok(match code {
            // FLOAT, BINFLOAT
            b'F' => Node::Float(self.parse()?),
            b'G' => Node::Float(f64::from_be_bytes(self.array()?)),
            // INT, which protocol 0 also uses for booleans
            b'I' => match self.line()? {
                b"00" => Node::Bool(false),
                b"01" => Node::Bool(true),
                line => Node::Int(self.parse_line(line)?),
            },
            // BININT, BININT1, BININT2
            b'J' => Node::Int(i64::from(i32::from_le_bytes(self.array()?))),
            b'K' => Node::Int(i64::from(self.byte()?)),
            b'M' => Node::Int(i64::from(u16::from_le_bytes(self.array()?))),
            // LONG
            b'L' => {
                let line = self.line()?;
                Node::Int(self.parse_line(line.strip_suffix(b"L").unwrap_or(line))?)
            }
            // LONG1, LONG4
            _ => {
                let length = if code == 0x8a {
                    usize::from(self.byte()?)
                } else {
                    usize::try_from(i32::from_le_bytes(self.array()?))
                        .map_err(|_| self.damaged("a length is negative"))?
                };
                let bytes = self.take(length)?;
                let mut extended = [if bytes.last().is_some_and(|top| *top >= 0x80) { 0xff } else { 0 }; 8];
                let target = extended.get_mut(..length).ok_or_else(|| self.damaged("an integer is too large"))?;
                target.copy_from_slice(bytes);
                Node::Int(i64::from_le_bytes(extended))
            }
        })
    }

    fn bytes(&mut self, code: u8) -> Result<Cow<'a, [u8]>, PickleError> {
        Ok(match code {
            // STRING
            b'S' => {
                let line = self.line()?;
                text::quoted(line).ok_or_else(|| self.damaged("a string is not quoted"))?
            }
            // BINSTRING, whose length is signed
            b'T' => {
                let length = i32::from_le_bytes(self.array()?);
                let length = u64::try_from(length).map_err(|_| self.damaged("a length is negative"))?;
                self.take_long(length)?.into()
            }
            // SHORT_BINSTRING, SHORT_BINBYTES
            b'U' | b'C' => {
                let length = self.byte()?;
                self.take_long(u64::from(length))?.into()
            }
            // BINBYTES
            b'B' => {
                let length = u32::from_le_bytes(self.array()?);
                self.take_long(u64::from(length))?.into()
            }
            // BINBYTES8, BYTEARRAY8
            _ => {
                let length = u64::from_le_bytes(self.array()?);
                self.take_long(length)?.into()
            }
        })
    }

    fn text(&mut self, code: u8) -> Result<Cow<'a, str>, PickleError> {
        let length = match code {
            // UNICODE
            b'V' => {
                let line = self.line()?;
                return Ok(text::raw_unicode(line).ok_or_else(|| self.damaged("a text is invalid"))?.into());
            }
            // BINUNICODE, SHORT_BINUNICODE, BINUNICODE8
            b'X' => u64::from(u32::from_le_bytes(self.array()?)),
            0x8c => u64::from(self.byte()?),
            _ => u64::from_le_bytes(self.array()?),
        };
        let bytes = self.take_long(length)?;
        Ok(std::str::from_utf8(bytes).map_err(|_| self.damaged("a text is not UTF-8"))?.into())
    }

    /// The name that an instruction gives in two lines.
    fn global(&mut self) -> Result<Class, PickleError> {
        let module = self.line()?;
        let name = self.line()?;
        find(&String::from_utf8_lossy(module), &String::from_utf8_lossy(name))
    }

    fn refer(&mut self, id: Id) {
        self.push(Node::Object(Box::new(Object { class: Class::Reference, args: vec![id], state: None })));
    }

    /// Pushes an instance of `class`, or its result as a function, without creating or calling it.
    fn make(&mut self, class: Class, args: Vec<Id>) -> Result<(), PickleError> {
        let class = match (class, args.first()) {
            (Class::Reconstructor, Some(made)) => self.class(*made)?,
            (Class::Reconstructor, None) => return Err(self.damaged("an object has no class")),
            (Class::Dictionary, _) => {
                let entries = self.pairs(&args)?;
                self.push(Node::Dict(entries));
                return Ok(());
            }
            _ => class,
        };
        self.push(Node::Object(Box::new(Object { class, args, state: None })));
        Ok(())
    }

    /// The entries of a dictionary that is made of a list of pairs; of anything else, none.
    fn pairs(&self, args: &[Id]) -> Result<Vec<(Id, Id)>, PickleError> {
        let &[pairs] = args else { return Ok(vec![]) };
        let (Node::List(pairs) | Node::Tuple(pairs)) = self.node(pairs)? else { return Ok(vec![]) };
        let pair = |id: &Id| match self.node(*id)? {
            Node::List(pair) | Node::Tuple(pair) if pair.len() == 2 => Ok((pair[0], pair[1])),
            _ => Err(self.damaged("an entry of a dictionary is not a pair")),
        };
        pairs.iter().map(pair).collect()
    }

    fn class(&self, id: Id) -> Result<Class, PickleError> {
        match self.node(id)? {
            Node::Class(class) => Ok(*class),
            _ => Err(self.damaged("the called object is not a class or function")),
        }
    }

    fn arguments(&self, id: Id) -> Result<Vec<Id>, PickleError> {
        match self.node(id)? {
            // Calls have few arguments; without a limit, one long tuple could be copied many times.
            Node::Tuple(items) if items.len() <= 8 => Ok(items.clone()),
            _ => Err(self.damaged("arguments are not a short tuple")),
        }
    }

    fn extend_list(&mut self, items: Vec<Id>) -> Result<(), PickleError> {
        let list = self.top()?;
        match self.node_mut(list)? {
            Node::List(list) => list.extend(items),
            _ => return Err(self.damaged("an item does not belong to a list")),
        }
        Ok(())
    }

    fn extend_dictionary(&mut self, items: &[Id]) -> Result<(), PickleError> {
        let dictionary = self.top()?;
        let (pairs, odd) = items.as_chunks::<2>();
        if !odd.is_empty() {
            return Err(self.damaged("a key has no value"));
        }
        match self.node_mut(dictionary)? {
            Node::Dict(entries) => entries.extend(pairs.iter().map(|&[key, value]| (key, value))),
            _ => return Err(self.damaged("an entry does not belong to a dictionary")),
        }
        Ok(())
    }

    pub(super) fn push(&mut self, node: Node<'a>) {
        self.stack.push(Id(self.nodes.len() as u32));
        self.nodes.push(node);
    }

    fn top(&self) -> Result<Id, PickleError> {
        let floor = self.marks.last().copied().unwrap_or(0);
        self.stack.get(floor..).and_then(<[Id]>::last).copied().ok_or_else(|| self.damaged("the stack is empty"))
    }

    pub(super) fn pop(&mut self) -> Result<Id, PickleError> {
        let top = self.top()?;
        self.stack.pop();
        Ok(top)
    }

    fn pop_many(&mut self, count: usize) -> Result<Vec<Id>, PickleError> {
        let floor = self.marks.last().copied().unwrap_or(0);
        let from = self.stack.len().checked_sub(count).filter(|from| *from >= floor);
        let from = from.ok_or_else(|| self.damaged("the stack is empty"))?;
        Ok(self.stack.split_off(from))
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Id>, PickleError> {
        let mark = self.marks.pop().ok_or_else(|| self.damaged("a mark is missing"))?;
        Ok(self.stack.split_off(mark))
    }

    fn remember(&mut self, key: u32) -> Result<(), PickleError> {
        let top = self.top()?;
        self.memo.insert(key, top);
        Ok(())
    }

    fn recall(&mut self, key: u32) -> Result<(), PickleError> {
        let id = self.memo.get(&key).copied().ok_or_else(|| self.damaged("the memo has no such key"))?;
        self.stack.push(id);
        Ok(())
    }

    pub(super) fn node(&self, id: Id) -> Result<&Node<'a>, PickleError> {
        self.nodes.get(id.0 as usize).ok_or_else(|| self.damaged("a value is missing"))
    }

    fn node_mut(&mut self, id: Id) -> Result<&mut Node<'a>, PickleError> {
        let missing = self.damaged("a value is missing");
        self.nodes.get_mut(id.0 as usize).ok_or(missing)
    }

    pub(super) fn byte(&mut self) -> Result<u8, PickleError> {
        let [byte] = self.array()?;
        Ok(byte)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], PickleError> {
        let bytes = self.take(N)?;
        <[u8; N]>::try_from(bytes).map_err(|_| self.truncated())
    }

    fn take_long(&mut self, length: u64) -> Result<&'a [u8], PickleError> {
        let length = usize::try_from(length).map_err(|_| self.truncated())?;
        self.take(length)
    }

    /// The next bytes. Nothing is allocated for them, so their declared number need not be trusted.
    pub(super) fn take(&mut self, length: usize) -> Result<&'a [u8], PickleError> {
        let end = self.at.checked_add(length).ok_or_else(|| self.truncated())?;
        let bytes = self.input.get(self.at..end).ok_or_else(|| self.truncated())?;
        self.at = end;
        Ok(bytes)
    }

    /// The rest of a line, without its end.
    fn line(&mut self) -> Result<&'a [u8], PickleError> {
        let rest = self.input.get(self.at..).unwrap_or_default();
        let end = rest.iter().position(|byte| *byte == b'\n').ok_or_else(|| self.truncated())?;
        let line = self.take(end)?;
        self.take(1)?;
        Ok(line)
    }

    fn decimal(&mut self) -> Result<u32, PickleError> {
        self.parse()
    }

    fn parse<T: std::str::FromStr>(&mut self) -> Result<T, PickleError> {
        let line = self.line()?;
        self.parse_line(line)
    }

    fn parse_line<T: std::str::FromStr>(&self, line: &[u8]) -> Result<T, PickleError> {
        let number = std::str::from_utf8(line).ok().and_then(|line| line.trim().parse().ok());
        number.ok_or_else(|| self.damaged("a number is invalid or too large"))
    }

    fn truncated(&self) -> PickleError {
        self.damaged("it is truncated")
    }

    /// Start of the current instruction.
    pub(super) fn instruction(&self) -> usize {
        self.instruction
    }

    fn damaged(&self, problem: &'static str) -> PickleError {
        PickleError::Damaged { at: self.instruction, problem: problem.into() }
    }
}

fn find(module: &str, name: &str) -> Result<Class, PickleError> {
    Class::find(module, name).ok_or_else(|| {
        // A damaged file may contain anything here.
        let shown: String = format!("{module}.{name}").chars().take(80).flat_map(char::escape_debug).collect();
        PickleError::UnknownGlobal(shown)
    })
}

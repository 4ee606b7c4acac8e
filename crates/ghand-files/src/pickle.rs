//! Reads Python pickles without executing anything.
//!
//! A pickle is a program for a small stack machine. `machine` runs it on plain values only: a named class or function
//! becomes a marker (`Class`), never a call, and names outside a short list are an error.
//!
//! All values of a pickle are in one [`Graph`] and refer to each other by index. Therefore values that are shared,
//! contain themselves or are nested a million deep take no more memory than the bytes that describe them, and neither
//! reading nor dropping them recurses.

mod arrays;
mod joblib;
mod machine;
mod tensors;
mod text;
mod torch;

use std::borrow::Cow;
use std::collections::HashMap;

pub use arrays::SparseMatrix;

use crate::npz::ElementType;

/// The problem with a pickle, and its remedy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PickleError {
    /// It names something that no hand model needs.
    #[error("names {0}, and nothing in a file is executed; re-save the file as a plain .npz (numpy.savez)")]
    UnknownGlobal(String),
    /// It uses a feature that is not supported.
    #[error("uses {0} at byte {1}, which is not supported; re-save the file as a plain .npz (numpy.savez)")]
    Unsupported(&'static str, usize),
    /// It has an array that cannot be read, and whose length is therefore unknown.
    #[error("has an array at byte {at} that {problem}")]
    Array {
        /// Byte at which the instruction before it begins.
        at: usize,
        /// The problem, and its remedy.
        problem: String,
    },
    /// Its bytes are not valid.
    #[error("is damaged at byte {at}: {problem}; copy or download the file again")]
    Damaged {
        /// Byte at which the instruction begins.
        at: usize,
        /// The problem.
        problem: Cow<'static, str>,
    },
    /// It has more instructions than any hand model needs.
    #[error("has more than {MAX_INSTRUCTIONS} instructions; re-save the file as a plain .npz (numpy.savez)")]
    TooLong,
}

/// Most instructions of a pickle. Each makes at most one value, one stack entry and one memo entry, so that this limit
/// bounds all of them; a MANO file has a few hundred.
const MAX_INSTRUCTIONS: usize = 1 << 22;

/// A value of a [`Graph`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Id(u32);

/// A plain value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Node<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    /// Bytes, and the strings of Python 2.
    Bytes(Cow<'a, [u8]>),
    Text(Cow<'a, str>),
    Tuple(Vec<Id>),
    /// A list, or a set of protocol 4 in the order of the file.
    List(Vec<Id>),
    /// Keys and values in the order of the file; of equal keys, the last one counts.
    Dict(Vec<(Id, Id)>),
    Class(Class),
    Object(Box<Object>),
}

/// A value of a pickle, without its nested values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Plain {
    Nothing,
    Text(String),
    /// Items of a list, a tuple, or an array of objects.
    Items(Vec<Id>),
    /// Entries of a dictionary in the order of the file, keys as text.
    Entries(Vec<(String, Id)>),
    /// The value of an array without axes.
    Object(Id),
    /// Numbers, or an object that may be an array of them.
    Array,
}

/// A call or an instance, not executed.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Object {
    pub class: Class,
    pub args: Vec<Id>,
    pub state: Option<Id>,
}

/// Classes and functions that a pickle may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    /// Python's `object`.
    Base,
    /// `set`, `frozenset`.
    Set,
    /// `bytes`, `bytearray`.
    Bytes,
    /// `_codecs.encode`, which is how Python 3 writes bytes for Python 2.
    Encode,
    /// `copyreg._reconstructor`, which makes an instance of its first argument.
    Reconstructor,
    NdArray,
    /// Function that makes an empty array, which its state fills.
    EmptyArray,
    /// Function that makes an array from bytes, in protocol 5.
    ArrayFromBuffer,
    ArrayScalar,
    ElementType,
    /// A differentiable array of the chumpy library.
    ChumpyArray,
    /// A part of a [`Class::ChumpyArray`].
    ChumpySelect,
    SparseColumns,
    SparseRows,
    /// `collections.OrderedDict` and `defaultdict`, which are dictionaries.
    Dictionary,
    /// A type that a value refers to, without numbers of its own.
    Marker,
    /// What has numbers that cannot be read, with what it is and a remedy.
    Unreadable(&'static str),
    /// An array of the joblib library, whose bytes follow it in the file.
    JoblibArray,
    /// What a pickle says of data that its writer stored elsewhere.
    Reference,
    /// Function that makes a view of a storage.
    Tensor,
    /// Function that makes a parameter of its first argument, a tensor.
    Parameter,
    /// Function that calls its first argument with its third.
    TensorOfType,
    /// Numbers of one type that tensors view.
    Storage(ElementType),
    /// Function that reads a storage from the bytes of a file of PyTorch.
    StorageFromBytes,
    /// A type of numbers.
    Numbers(ElementType),
    /// A shape, whose first argument is a tuple.
    Size,
}

impl Class {
    /// The class or function of that name, under any of the names that releases of Python and the libraries have used.
    fn find(module: &str, name: &str) -> Option<Class> {
        let unreadable = || torch::without_numbers(module, name).or_else(|| joblib::without_numbers(module, name));
        unreadable()
            .map(Class::Unreadable)
            .or_else(|| Class::of_python(module, name))
            .or_else(|| torch::class(module, name))
    }

    fn of_python(module: &str, name: &str) -> Option<Class> {
        let module = module.strip_prefix("numpy._core").map_or(module.to_owned(), |rest| format!("numpy.core{rest}"));
        Some(match (module.as_str(), name) {
            ("__builtin__" | "builtins", "object") => Class::Base,
            ("__builtin__" | "builtins", "set" | "frozenset") => Class::Set,
            ("__builtin__" | "builtins", "bytes" | "bytearray") => Class::Bytes,
            ("__builtin__" | "builtins", "list" | "dict" | "int" | "float" | "str" | "tuple" | "bool") => Class::Marker,
            ("collections", "OrderedDict" | "defaultdict") => Class::Dictionary,
            ("joblib.numpy_pickle", "NumpyArrayWrapper") => Class::JoblibArray,
            ("_codecs", "encode") => Class::Encode,
            ("copy_reg" | "copyreg", "_reconstructor") => Class::Reconstructor,
            ("numpy", "ndarray") => Class::NdArray,
            ("numpy", "dtype") => Class::ElementType,
            ("numpy.core.multiarray", "_reconstruct") => Class::EmptyArray,
            ("numpy.core.multiarray", "scalar") => Class::ArrayScalar,
            ("numpy.core.numeric", "_frombuffer") => Class::ArrayFromBuffer,
            ("chumpy.ch", "Ch") => Class::ChumpyArray,
            ("chumpy.reordering", "Select") => Class::ChumpySelect,
            ("scipy.sparse.csc" | "scipy.sparse._csc", "csc_matrix" | "csc_array") => Class::SparseColumns,
            ("scipy.sparse.csr" | "scipy.sparse._csr", "csr_matrix" | "csr_array") => Class::SparseRows,
            _ => return None,
        })
    }
}

/// All values of one pickle.
#[derive(Debug)]
pub struct Graph<'a> {
    nodes: Vec<Node<'a>>,
    root: Id,
    /// Bytes that tensors view, by the key of their storage.
    storages: HashMap<String, Cow<'a, [u8]>>,
    /// Whether the numbers of the storages begin with their highest byte.
    big_endian: bool,
}

impl<'a> Graph<'a> {
    /// Whether the bytes begin like a pickle of a dictionary or an object, in any protocol.
    pub fn recognises_bytes(bytes: &[u8]) -> bool {
        match bytes.first() {
            Some(0x80 | b'(' | b'}') => true,
            // The name of a class, in two lines; other text may begin with the same letter.
            Some(b'c') => {
                let is_name = |line: &[u8]| {
                    !line.is_empty() && line.iter().all(|b| b.is_ascii_alphanumeric() || b"_.".contains(b))
                };
                let mut lines = bytes.split(|byte| *byte == b'\n');
                lines.next().is_some_and(is_name) && lines.next().is_some_and(is_name)
            }
            _ => false,
        }
    }

    /// Reads a pickle of protocol 0 to 5.
    ///
    /// # Errors
    /// [`PickleError`] gives the problem and its position.
    pub fn read(bytes: &'a [u8]) -> Result<Graph<'a>, PickleError> {
        let (nodes, root, _) = machine::run(bytes, 0, MAX_INSTRUCTIONS)?;
        Ok(Graph::of(nodes, root))
    }

    fn of(nodes: Vec<Node<'a>>, root: Id) -> Graph<'a> {
        Graph { nodes, root, storages: HashMap::new(), big_endian: false }
    }

    /// The value of the pickle.
    pub fn root(&self) -> Id {
        self.root
    }

    /// The entry of that name, if the whole value is a dictionary that has it.
    pub fn entry(&self, name: &str) -> Option<Id> {
        self.lookup(self.root, name)
    }

    /// Whether the whole value is a dictionary.
    pub fn is_dictionary(&self) -> bool {
        matches!(self.node(self.root), Node::Dict(_))
    }

    fn node(&self, id: Id) -> &Node<'a> {
        // Every Id is created together with its node.
        self.nodes.get(id.0 as usize).unwrap_or(&Node::None)
    }

    /// The value of a key of a dictionary.
    fn lookup(&self, dictionary: Id, name: &str) -> Option<Id> {
        let Node::Dict(entries) = self.node(dictionary) else { return None };
        let is_wanted = |key: Id| match self.node(key) {
            Node::Text(text) => text == name,
            _ => self.bytes(key, name.len()).is_some_and(|bytes| *bytes == *name.as_bytes()),
        };
        entries.iter().rev().find(|(key, _)| is_wanted(*key)).map(|(_, value)| *value)
    }

    /// Bytes or a Python 2 string of at most `limit` bytes, also if Python 3 wrapped them for Python 2.
    fn bytes(&self, id: Id, limit: usize) -> Option<Cow<'_, [u8]>> {
        let bytes = match self.node(id) {
            Node::Bytes(bytes) => Cow::Borrowed(&**bytes),
            Node::Object(object) if matches!(object.class, Class::Encode | Class::Bytes) => {
                match object.args.first().map(|arg| self.node(*arg)) {
                    None => Cow::Borrowed(&[][..]),
                    Some(Node::Bytes(bytes)) => Cow::Borrowed(&**bytes),
                    // Characters of Latin-1 take at most two bytes of UTF-8.
                    Some(Node::Text(text)) if text.len() / 2 <= limit => text::latin1(text)?.into(),
                    Some(_) => return None,
                }
            }
            _ => return None,
        };
        (bytes.len() <= limit).then_some(bytes)
    }

    /// A string of either kind.
    pub fn text(&self, id: Id) -> Option<String> {
        match self.node(id) {
            Node::Text(text) => Some(text.to_string()),
            _ => self.bytes(id, usize::MAX).map(|bytes| String::from_utf8_lossy(&bytes).into_owned()),
        }
    }
}

#[cfg(test)]
mod tests;

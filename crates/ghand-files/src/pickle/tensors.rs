//! PyTorch's tensors: views of storages, whose bytes are in the same file.

use std::borrow::Cow;
use std::collections::HashMap;

use super::arrays::SAVE_AGAIN;
use super::{Class, Graph, Id, MAX_INSTRUCTIONS, Node, PickleError, machine};
use crate::npz::{ArrayError, ElementType, NumericArray, element_count};

/// Largest nesting depth of functions around a tensor: a parameter of a type of a tensor.
const MAX_DEPTH: usize = 4;

/// The bytes with which every file of PyTorch before 1.6 begins: a pickle of 0x1950a86a20f9469cfc6c.
const MAGIC: &[u8] = b"\x80\x02\x8a\x0al\xfc\x9cF\xf9 j\xa8P\x19.";

/// Most instructions of a storage that is a file inside a pickle. PyTorch writes some 60. The same storage may be read
/// once for each tensor, so that a large one would take too much time.
const MAX_STORAGE_INSTRUCTIONS: usize = 256;

/// A view of a storage.
struct View {
    storage: Id,
    /// Type of the numbers, if the tensor and not the storage has it.
    elements: Option<ElementType>,
    /// Place of the first number, and numbers between neighbours along each axis.
    offset: usize,
    shape: Vec<usize>,
    strides: Vec<usize>,
}

/// A storage: the type of its numbers and their bytes.
struct Storage<'s> {
    elements: ElementType,
    bytes: Cow<'s, [u8]>,
}

impl<'a> Graph<'a> {
    /// Whether the bytes are a file of PyTorch before 1.6.
    pub(crate) fn recognises_old_torch(bytes: &[u8]) -> bool {
        bytes.starts_with(MAGIC)
    }

    /// Gives the bytes of storages to the tensors that view them.
    pub(crate) fn with_storages(self, storages: HashMap<String, Cow<'a, [u8]>>, big_endian: bool) -> Graph<'a> {
        Graph { storages, big_endian, ..self }
    }

    /// Reads a file of PyTorch before 1.6: pickles of a magic number, of a version, of the machine, of the values and of
    /// the keys of storages, then the storages, each after the number of its elements.
    pub(crate) fn read_old_torch(bytes: &'a [u8]) -> Result<Graph<'a>, PickleError> {
        old_torch(bytes, MAX_INSTRUCTIONS)
    }

    /// The numbers of a tensor, in the order of its axes.
    pub(super) fn tensor(&self, id: Id) -> Result<NumericArray, ArrayError> {
        let view = self.view(id, 0)?;
        let mut storage = self.storage(view.storage)?;
        let big_endian = storage.elements.big_endian;
        storage.elements = ElementType { big_endian, ..view.elements.unwrap_or(storage.elements) };
        gather(&storage, view.offset, &view.shape, &view.strides)
    }

    pub(super) fn tensor_shape(&self, id: Id) -> Result<Vec<usize>, ArrayError> {
        Ok(self.view(id, 0)?.shape)
    }

    fn view(&self, id: Id, depth: usize) -> Result<View, ArrayError> {
        let Node::Object(object) = self.node(id) else { return Err(damaged("is not a tensor")) };
        match (object.class, object.args.as_slice()) {
            _ if depth == MAX_DEPTH => Err(damaged("is a tensor wrapped in too many functions")),
            (Class::Parameter, &[tensor, ..]) => self.view(tensor, depth + 1),
            (Class::TensorOfType, &[function, _, args, ..]) => {
                let (Node::Class(Class::Tensor), Node::Tuple(args)) = (self.node(function), self.node(args)) else {
                    return Err(damaged("is a tensor of an unknown type"));
                };
                self.view_of(args)
            }
            (Class::Tensor, args) => self.view_of(args),
            _ => Err(damaged("is not a tensor")),
        }
    }

    /// The view that the arguments (storage, offset, shape, strides, .., type of numbers) describe.
    fn view_of(&self, args: &[Id]) -> Result<View, ArrayError> {
        let &[storage, offset, shape, strides, ref rest @ ..] = args else {
            return Err(damaged("is a tensor without a shape"));
        };
        let offset = self.integer(offset).ok_or_else(|| damaged("is a tensor with an invalid offset"))?;
        let shape = self.sizes(shape)?;
        let strides = self.sizes(strides)?;
        if shape.len() != strides.len() {
            return Err(damaged("is a tensor with more axes than strides"));
        }
        if let Some(problem) = rest.iter().find_map(|id| match self.node(*id) {
            Node::Class(Class::Unreadable(problem)) => Some(*problem),
            _ => None,
        }) {
            return Err(ArrayError(problem.into()));
        }
        let flags = rest.iter().any(|id| {
            matches!(self.node(*id), Node::Dict(_))
                && ["conj", "neg"].iter().any(|name| self.lookup(*id, name).is_some())
        });
        if flags {
            return Err(damaged("is a tensor that negates its numbers when it is read"));
        }
        let elements = rest.iter().find_map(|id| match self.node(*id) {
            Node::Class(Class::Numbers(elements)) => Some(*elements),
            _ => None,
        });
        Ok(View { storage, elements, offset, shape, strides })
    }

    /// A tuple of integers, or a shape of PyTorch.
    fn sizes(&self, id: Id) -> Result<Vec<usize>, ArrayError> {
        match self.node(id) {
            Node::Object(object) if object.class == Class::Size => match object.args.first() {
                Some(sizes) => self.integers(*sizes),
                None => Ok(vec![]),
            },
            _ => self.integers(id),
        }
    }

    fn storage(&self, id: Id) -> Result<Storage<'_>, ArrayError> {
        let Node::Object(object) = self.node(id) else { return Err(damaged("is a tensor without a storage")) };
        match (object.class, object.args.as_slice()) {
            (Class::StorageFromBytes, &[bytes]) => {
                let bytes = self.bytes(bytes, usize::MAX).ok_or_else(|| damaged("is a tensor without bytes"))?;
                let inner = old_torch(&bytes, MAX_STORAGE_INSTRUCTIONS)
                    .map_err(|error| ArrayError(format!("is a tensor whose storage {error}")))?;
                let Storage { elements, bytes } = inner.referred(inner.root)?;
                Ok(Storage { elements, bytes: bytes.into_owned().into() })
            }
            (Class::Reference, _) => self.referred(id),
            _ => Err(damaged("is a tensor without a storage")),
        }
    }

    /// The kind of numbers that cannot be read, if a reference is to a storage of them.
    fn unreadable_storage(&self, id: Id) -> Option<&'static str> {
        let Node::Object(object) = self.node(id) else { return None };
        let Node::Tuple(parts) = self.node(*object.args.first()?) else { return None };
        parts.iter().find_map(|part| match self.node(*part) {
            Node::Class(Class::Unreadable(problem)) => Some(*problem),
            _ => None,
        })
    }

    /// The storage that a reference `("storage", type, key, device, number of elements)` names.
    fn referred(&self, id: Id) -> Result<Storage<'_>, ArrayError> {
        if let Some(problem) = self.unreadable_storage(id) {
            return Err(ArrayError(problem.into()));
        }
        let (elements, key, count) =
            self.reference(id).ok_or_else(|| damaged("is a tensor whose numbers are outside the file"))?;
        let bytes = self.storages.get(&key).ok_or_else(|| damaged("is a tensor whose storage is not in the file"))?;
        let wanted = count.checked_mul(elements.size);
        let bytes = wanted
            .and_then(|wanted| bytes.get(..wanted))
            .ok_or_else(|| damaged("is a tensor whose storage is shorter than it says"))?;
        Ok(Storage { elements: ElementType { big_endian: self.big_endian, ..elements }, bytes: bytes.into() })
    }

    /// Type, key and number of elements of a reference to a storage.
    fn reference(&self, id: Id) -> Option<(ElementType, String, usize)> {
        let Node::Object(object) = self.node(id) else { return None };
        let (Class::Reference, &[tuple]) = (object.class, object.args.as_slice()) else { return None };
        let Node::Tuple(parts) = self.node(tuple) else { return None };
        let &[kind, class, key, _, count, ref view @ ..] = parts.as_slice() else { return None };
        let Node::Class(Class::Storage(elements)) = self.node(class) else { return None };
        // Old files may have a storage that is a part of another one.
        let is_whole = view.iter().all(|part| matches!(self.node(*part), Node::None));
        (self.text(kind)? == "storage" && is_whole).then_some((*elements, self.text(key)?, self.integer(count)?))
    }
}

fn old_torch(bytes: &[u8], most: usize) -> Result<Graph<'_>, PickleError> {
    let wrong = |at: usize, problem: &'static str| PickleError::Damaged { at, problem: problem.into() };
    if !bytes.starts_with(MAGIC) {
        return Err(wrong(0, "it does not begin like a file of PyTorch"));
    }
    let (_, _, version_end) = machine::run(bytes, MAGIC.len(), most)?;
    let (_, _, machine_end) = machine::run(bytes, version_end, most)?;
    let (nodes, root, values_end) = machine::run(bytes, machine_end, most)?;
    let (keys, list, mut at) = machine::run(bytes, values_end, most)?;
    let graph = Graph::of(nodes, root);
    let keys = Graph::of(keys, list);
    let Node::List(ids) = keys.node(list) else { return Err(wrong(values_end, "its storages are not listed")) };
    let sizes: HashMap<String, usize> = (0..graph.nodes.len() as u32)
        .filter_map(|id| graph.reference(Id(id)))
        .map(|(elements, key, _)| (key, elements.size))
        .collect();
    let mut storages = HashMap::new();
    for id in ids {
        let key = keys.text(*id).ok_or_else(|| wrong(at, "the key of a storage is not text"))?;
        let size = *sizes.get(&key).ok_or_else(|| wrong(at, "a storage belongs to nothing"))?;
        let truncated = || wrong(at, "it is truncated");
        let (count, rest) = bytes.get(at..).and_then(<[u8]>::split_first_chunk).ok_or_else(truncated)?;
        let length = usize::try_from(i64::from_le_bytes(*count)).ok().and_then(|count| count.checked_mul(size));
        let data = length.and_then(|length| rest.get(..length)).ok_or_else(truncated)?;
        at += count.len() + data.len();
        storages.insert(key, data.into());
    }
    // These files have the lowest byte first on any machine.
    Ok(graph.with_storages(storages, false))
}

/// The numbers at a view's places. Only these are decoded: a view may skip most of a large storage.
fn gather(storage: &Storage, offset: usize, shape: &[usize], strides: &[usize]) -> Result<NumericArray, ArrayError> {
    let count = element_count(shape)?;
    let size = storage.elements.size;
    let step = |last: usize, (n, stride): (&usize, &usize)| last.checked_add((n - 1).checked_mul(*stride)?);
    let last = if count == 0 { Some(0) } else { shape.iter().zip(strides).try_fold(offset, step) };
    let end = last.and_then(|last| last.checked_add(1)).and_then(|end| end.checked_mul(size));
    if count > 0 && end.is_none_or(|end| end > storage.bytes.len()) {
        return Err(damaged("is a tensor that reaches beyond its storage"));
    }
    let mut bytes = Vec::with_capacity(count * size);
    let mut index = vec![0; shape.len()];
    let mut at = offset;
    for _ in 0..count {
        bytes.extend_from_slice(storage.bytes.get(at * size..(at + 1) * size).unwrap_or_default());
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            // An axis of length 1 may have any stride.
            at = at.wrapping_add(strides[axis]);
            if index[axis] < shape[axis] {
                break;
            }
            at = at.wrapping_sub(strides[axis].wrapping_mul(shape[axis]));
            index[axis] = 0;
        }
    }
    storage.elements.numbers(&bytes, shape, false)
}

fn damaged(problem: &str) -> ArrayError {
    ArrayError(format!("{problem}; {SAVE_AGAIN}"))
}

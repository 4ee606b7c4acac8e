//! Arrays in a pickle: NumPy's in all protocols, chumpy's, and SciPy's sparse matrices.

use super::{Class, Graph, Id, Node, Object, Plain};
use crate::npz::{ArrayError, ElementKind, ElementType, NumericArray, element_count};

/// A sparse matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMatrix {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Row, column and value, in the order of the file; duplicates add up. All indices are in range.
    pub entries: Vec<(usize, usize, f64)>,
}

/// Largest nesting depth of wrapped arrays; MANO's shape directions are three deep (selection, chumpy, NumPy), and each
/// selection may double the work.
const MAX_DEPTH: usize = 4;

/// Most axes of a shape.
const MAX_AXES: usize = 32;

/// Largest integer that f64 distinguishes from its neighbours.
const MAX_EXACT: f64 = 9_007_199_254_740_992.0;

impl Graph<'_> {
    /// The numbers of an array of any kind except sparse, or a single number.
    ///
    /// # Errors
    /// [`ArrayError`] if it is neither, damaged or too large.
    pub fn numbers(&self, id: Id) -> Result<NumericArray, ArrayError> {
        self.numbers_at(id, 0)
    }

    /// The value as a sparse matrix; `None` if it is not one.
    ///
    /// # Errors
    /// [`ArrayError`] if it is a damaged or too large sparse matrix.
    pub fn sparse(&self, id: Id) -> Result<Option<SparseMatrix>, ArrayError> {
        let id = self.unwrap_objects(id)?;
        let (Class::SparseColumns | Class::SparseRows, Some(state)) = self.object(id) else { return Ok(None) };
        let part = |name: &str| {
            let id = self.lookup(state, name);
            id.ok_or_else(|| ArrayError(format!("is a sparse matrix without `{name}`; {SAVE_AGAIN}")))
        };
        let numbers = |name: &str| {
            let array = self.numbers(part(name)?)?;
            if array.shape.len() != 1 {
                return Err(ArrayError(format!("is a sparse matrix whose `{name}` is not flat; {SAVE_AGAIN}")));
            }
            Ok(array.values)
        };
        let shape = self.integers(part("_shape").or_else(|_| part("shape"))?)?;
        let &[rows, columns] = shape.as_slice() else {
            return Err(ArrayError(format!("is a sparse matrix of {} axes, expected 2; {SAVE_AGAIN}", shape.len())));
        };
        let by_column = self.object(id).0 == Class::SparseColumns;
        let (outer, inner) = if by_column { (columns, rows) } else { (rows, columns) };
        let data = numbers("data")?;
        let indices = numbers("indices")?;
        let starts = numbers("indptr")?;
        if Some(starts.len()) != outer.checked_add(1) || data.len() != indices.len() {
            let problem = format!(
                "is a {rows} x {columns} sparse matrix with {} values, {} indices and {} starts; {SAVE_AGAIN}",
                data.len(),
                indices.len(),
                starts.len()
            );
            return Err(ArrayError(problem));
        }
        let mut entries = Vec::with_capacity(data.len());
        for (major, ends) in starts.windows(2).enumerate() {
            let from_to = ends.iter().map(|end| index(*end, data.len() + 1)).collect::<Option<Vec<usize>>>();
            let run = match from_to.as_deref() {
                // Each run begins at the end of the previous one, so that together they are no longer than the data.
                Some(&[from, to]) if from == entries.len() && from <= to => from..to,
                _ => return Err(ArrayError(format!("is a sparse matrix whose starts are not in order; {SAVE_AGAIN}"))),
            };
            for (minor, value) in indices[run.clone()].iter().zip(&data[run]) {
                let minor = index(*minor, inner).ok_or_else(|| {
                    ArrayError(format!("is a {rows} x {columns} sparse matrix with the index {minor}; {SAVE_AGAIN}"))
                })?;
                entries.push(if by_column { (minor, major, *value) } else { (major, minor, *value) });
            }
        }
        Ok(Some(SparseMatrix { rows, columns, entries }))
    }

    fn numbers_at(&self, id: Id, depth: usize) -> Result<NumericArray, ArrayError> {
        if depth == MAX_DEPTH {
            return Err(ArrayError(format!("is wrapped in more than {MAX_DEPTH} others; {SAVE_AGAIN}")));
        }
        let single = |value: f64| Ok(NumericArray { shape: vec![], values: vec![value] });
        let object = match self.node(id) {
            Node::Int(value) => return single(*value as f64),
            Node::Float(value) => return single(*value),
            Node::Bool(value) => return single(f64::from(u8::from(*value))),
            Node::Object(object) => object,
            other => {
                let kind = kind(other);
                return Err(ArrayError(format!("is {kind}, not an array; {SAVE_AGAIN}")));
            }
        };
        match object.class {
            Class::EmptyArray | Class::ArrayFromBuffer | Class::ArrayScalar => {
                let stored = self.stored(object)?;
                if stored.elements.kind == ElementKind::Object {
                    return self.numbers_at(self.only_object(&stored)?, depth + 1);
                }
                let bytes = self.bytes(stored.data, usize::MAX);
                let bytes = bytes.ok_or_else(|| ArrayError(format!("is an array without bytes; {SAVE_AGAIN}")))?;
                stored.elements.numbers(&bytes, &stored.shape, stored.fortran)
            }
            Class::ChumpyArray => {
                let x = object.state.and_then(|state| self.lookup(state, "x"));
                let x = x.ok_or_else(|| ArrayError(format!("is a chumpy array without `x`; {SAVE_AGAIN}")))?;
                self.numbers_at(x, depth + 1)
            }
            Class::ChumpySelect => self.selection(object, depth),
            Class::Tensor | Class::Parameter | Class::TensorOfType => self.tensor(id),
            Class::SparseColumns | Class::SparseRows => {
                Err(ArrayError("is a sparse matrix; save it as an array (matrix.toarray())".into()))
            }
            Class::Unreadable(problem) => Err(ArrayError(problem.into())),
            _ => Err(ArrayError(format!("is an object, not an array; {SAVE_AGAIN}"))),
        }
    }

    /// `a.ravel()[idxs].reshape(preferred_shape)`, the meaning of chumpy's selections.
    fn selection(&self, object: &Object, depth: usize) -> Result<NumericArray, ArrayError> {
        let part = |name: &str| {
            let id = object.state.and_then(|state| self.lookup(state, name));
            id.ok_or_else(|| ArrayError(format!("is a chumpy selection without `{name}`; {SAVE_AGAIN}")))
        };
        let from = self.numbers_at(part("a")?, depth + 1)?.values;
        let picks = self.numbers_at(part("idxs")?, depth + 1)?.values;
        let shape = match part("preferred_shape") {
            Ok(shape) => self.integers(shape)?,
            Err(_) => vec![picks.len()],
        };
        if element_count(&shape).ok() != Some(picks.len()) {
            return Err(ArrayError(format!(
                "is a chumpy selection of {} numbers for the shape {shape:?}; {SAVE_AGAIN}",
                picks.len()
            )));
        }
        let pick = |at: &f64| {
            let value = index(*at, from.len()).and_then(|at| from.get(at).copied());
            value.ok_or_else(|| {
                ArrayError(format!("is a chumpy selection of number {at} of {}; {SAVE_AGAIN}", from.len()))
            })
        };
        Ok(NumericArray { shape, values: picks.iter().map(pick).collect::<Result<_, _>>()? })
    }

    /// The element of an array of objects with a single element; anything else is returned unchanged.
    fn unwrap_objects(&self, id: Id) -> Result<Id, ArrayError> {
        let mut id = id;
        for _ in 0..MAX_DEPTH {
            let Node::Object(object) = self.node(id) else { break };
            if object.class != Class::EmptyArray {
                break;
            }
            let stored = self.stored(object)?;
            if stored.elements.kind != ElementKind::Object {
                break;
            }
            id = self.only_object(&stored)?;
        }
        Ok(id)
    }

    fn only_object(&self, stored: &Stored) -> Result<Id, ArrayError> {
        match self.node(stored.data) {
            Node::List(items) if items.len() == 1 => Ok(items[0]),
            _ => Err(ArrayError("is an array of objects; store numbers in it (array.astype(float))".into())),
        }
    }

    /// A value, without its nested values.
    pub(crate) fn plain(&self, id: Id) -> Result<Plain, ArrayError> {
        Ok(match self.node(id) {
            Node::None => Plain::Nothing,
            Node::Text(_) | Node::Bytes(_) => Plain::Text(self.text(id).unwrap_or_default()),
            Node::Tuple(items) | Node::List(items) => Plain::Items(items.clone()),
            Node::Dict(entries) => {
                let key = |id: Id| {
                    let text = self.text(id).or_else(|| self.integer(id).map(|key| key.to_string()));
                    text.ok_or_else(|| ArrayError("has a key that is neither text nor a number".into()))
                };
                Plain::Entries(entries.iter().map(|(k, v)| Ok((key(*k)?, *v))).collect::<Result<_, ArrayError>>()?)
            }
            Node::Bool(_) | Node::Int(_) | Node::Float(_) => Plain::Array,
            Node::Object(object) => match object.class {
                Class::EmptyArray => {
                    let stored = self.stored(object)?;
                    match (stored.elements.kind, self.node(stored.data)) {
                        (ElementKind::Object, Node::List(items)) if stored.shape.is_empty() && items.len() == 1 => {
                            Plain::Object(items[0])
                        }
                        (ElementKind::Object, Node::List(items)) => Plain::Items(items.clone()),
                        _ => Plain::Array,
                    }
                }
                Class::Size => match object.args.first().map(|size| self.node(*size)) {
                    Some(Node::Tuple(items) | Node::List(items)) => Plain::Items(items.clone()),
                    _ => Plain::Items(vec![]),
                },
                Class::Encode | Class::Bytes => Plain::Text(self.text(id).unwrap_or_default()),
                _ => Plain::Array,
            },
            Node::Class(_) => return Err(ArrayError("is a class".into())),
        })
    }

    /// Most numbers that [`Graph::numbers`] returns, for arrays that store them directly.
    pub(crate) fn count(&self, id: Id) -> Result<usize, ArrayError> {
        match self.node(id) {
            Node::Object(object)
                if matches!(object.class, Class::EmptyArray | Class::ArrayFromBuffer | Class::ArrayScalar) =>
            {
                let shape = self.stored(object)?.shape;
                Ok(shape.iter().try_fold(1, |n: usize, axis| n.checked_mul(*axis)).unwrap_or(usize::MAX))
            }
            Node::Object(object) if matches!(object.class, Class::Tensor | Class::Parameter | Class::TensorOfType) => {
                element_count(&self.tensor_shape(id)?)
            }
            Node::Object(object) if matches!(object.class, Class::Unreadable(_)) => Ok(0),
            Node::Object(_) => Err(ArrayError(format!("is an object, not an array; {SAVE_AGAIN}"))),
            _ => Ok(1),
        }
    }

    /// A NumPy array, in any of its stored forms.
    fn stored(&self, object: &Object) -> Result<Stored, ArrayError> {
        let damaged = || ArrayError(format!("is not a valid array; {SAVE_AGAIN}"));
        let stored = |shape: Vec<usize>, elements: Id, fortran: bool, data: Id| {
            Ok(Stored { shape, elements: self.element_type(elements)?, fortran, data })
        };
        match (object.class, object.args.as_slice()) {
            (Class::ArrayFromBuffer, &[data, elements, shape, order]) => {
                let fortran = match self.text(order).as_deref() {
                    Some("C") => false,
                    Some("F") => true,
                    _ => return Err(damaged()),
                };
                stored(self.integers(shape)?, elements, fortran, data)
            }
            (Class::ArrayScalar, &[elements, data]) => stored(vec![], elements, false, data),
            (Class::EmptyArray, _) => {
                let Some(Node::Tuple(state)) = object.state.map(|state| self.node(state)) else {
                    return Err(damaged());
                };
                // The oldest files do not have a version.
                let &[shape, elements, fortran, data] = state.last_chunk::<4>().ok_or_else(damaged)?;
                let fortran = match self.node(fortran) {
                    Node::Bool(fortran) => *fortran,
                    Node::Int(fortran) => *fortran != 0,
                    _ => return Err(damaged()),
                };
                stored(self.integers(shape)?, elements, fortran, data)
            }
            _ => Err(damaged()),
        }
    }

    pub(super) fn element_type(&self, id: Id) -> Result<ElementType, ArrayError> {
        let damaged = || ArrayError(format!("is an array with elements of an unknown type; {SAVE_AGAIN}"));
        let Node::Object(object) = self.node(id) else { return Err(damaged()) };
        let code = object.args.first().filter(|_| object.class == Class::ElementType);
        let mut elements = ElementType::parse(&code.and_then(|code| self.text(*code)).ok_or_else(damaged)?)?;
        // The state is (version, byte order, ...).
        if let Some(Node::Tuple(state)) = object.state.map(|state| self.node(state))
            && let Some(order) = state.get(1).and_then(|order| self.text(*order))
        {
            elements.big_endian = order == ">";
        }
        Ok(elements)
    }

    /// A tuple or list of integers that are at least 0, such as a shape.
    pub(super) fn integers(&self, id: Id) -> Result<Vec<usize>, ArrayError> {
        let unusable = || ArrayError(format!("has an invalid shape; {SAVE_AGAIN}"));
        match self.node(id) {
            Node::Tuple(items) | Node::List(items) if items.len() <= MAX_AXES => {
                items.iter().map(|item| self.integer(*item).ok_or_else(unusable)).collect()
            }
            _ => Err(unusable()),
        }
    }

    /// An integer of Python or NumPy. Does not follow arrays: they have shapes, which have integers.
    pub(super) fn integer(&self, id: Id) -> Option<usize> {
        match self.node(id) {
            Node::Int(value) => usize::try_from(*value).ok(),
            Node::Object(object) if object.class == Class::ArrayScalar => {
                let stored = self.stored(object).ok()?;
                let number = stored.elements.numbers(&self.bytes(stored.data, 8)?, &[], false).ok()?;
                index(*number.values.first()?, usize::MAX)
            }
            _ => None,
        }
    }

    /// Class and state of an object.
    fn object(&self, id: Id) -> (Class, Option<Id>) {
        match self.node(id) {
            Node::Object(object) => (object.class, object.state),
            _ => (Class::Base, None),
        }
    }
}

/// A stored array.
struct Stored {
    shape: Vec<usize>,
    elements: ElementType,
    /// Whether the first index runs fastest.
    fortran: bool,
    /// Bytes, or a list of objects.
    data: Id,
}

pub(super) const SAVE_AGAIN: &str = "save it again as a plain NumPy array";

/// A number that counts something below `limit`.
fn index(value: f64, limit: usize) -> Option<usize> {
    let counts = (0.0..MAX_EXACT).contains(&value) && value.fract() == 0.0;
    (counts && (value as usize) < limit).then_some(value as usize)
}

fn kind(node: &Node) -> &'static str {
    match node {
        Node::None => "None",
        Node::Bytes(_) | Node::Text(_) => "text",
        Node::Tuple(_) => "a tuple",
        Node::List(_) => "a list",
        Node::Dict(_) => "a dictionary",
        Node::Class(_) => "a class",
        Node::Bool(_) | Node::Int(_) | Node::Float(_) | Node::Object(_) => "an object",
    }
}

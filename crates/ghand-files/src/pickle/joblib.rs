//! Arrays that the joblib library writes between the instructions of a pickle: an object that describes the array, and
//! its bytes after it.

use super::machine::Machine;
use super::{Class, Graph, Id, Node, Object, PickleError};
use crate::npz::{ArrayError, ElementKind};

/// What follows the description of an array.
enum Follows {
    /// Its bytes, after a number of bytes of padding if `is_padded`.
    Bytes { count: usize, is_padded: bool, elements: Id, shape: Id, order: Id },
    /// A pickle of an array of objects.
    Pickle,
}

/// The array that the state of its description announces; its bytes are at the machine's position.
pub(super) fn array<'a>(machine: &mut Machine<'a>, state: Id) -> Result<Node<'a>, PickleError> {
    let follows = machine.with_graph(|graph| announced(graph, state));
    let follows = follows.map_err(|ArrayError(problem)| PickleError::Array { at: machine.instruction(), problem })?;
    let Follows::Bytes { count, is_padded, elements, shape, order } = follows else {
        let root = machine.inner()?;
        return machine.node(root).cloned();
    };
    if is_padded {
        let padding = usize::from(machine.byte()?);
        machine.take(padding)?;
    }
    let bytes = machine.take(count)?;
    machine.push(Node::Bytes(bytes.into()));
    let data = machine.pop()?;
    let args = vec![data, elements, shape, order];
    Ok(Node::Object(Box::new(Object { class: Class::ArrayFromBuffer, args, state: None })))
}

fn announced(graph: &Graph, state: Id) -> Result<Follows, ArrayError> {
    let part = |name: &str| graph.lookup(state, name).ok_or_else(|| ArrayError(format!("has no {name}")));
    let shape = part("shape")?;
    let elements = part("dtype")?;
    let order = part("order")?;
    let kind = graph.element_type(elements)?;
    if kind.kind == ElementKind::Object {
        return Ok(Follows::Pickle);
    }
    let count = kind.byte_count(&graph.integers(shape)?)?;
    // Written by joblib 1.1 and later.
    let alignment = graph.lookup(state, "numpy_array_alignment_bytes");
    let is_padded = alignment.is_some_and(|id| !matches!(graph.node(id), Node::None));
    Ok(Follows::Bytes { count, is_padded, elements, shape, order })
}

/// What old releases write in place of an array, with a remedy.
pub(super) fn without_numbers(module: &str, name: &str) -> Option<&'static str> {
    match (module, name) {
        (
            "joblib.numpy_pickle" | "joblib.numpy_pickle_compat" | "sklearn.externals.joblib.numpy_pickle",
            "NDArrayWrapper" | "ZNDArrayWrapper",
        ) => Some(
            "is an array that joblib before 0.10 wrote into a file beside this one; write it again \
             (joblib.dump(joblib.load(\"IN\"), \"OUT.joblib\"))",
        ),
        _ => None,
    }
}

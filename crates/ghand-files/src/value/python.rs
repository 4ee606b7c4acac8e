//! Pickles, `.npz` archives and `.npy` arrays.

use super::Value;
use super::budget::Budget;
use super::collect::Items;
use crate::npz::{ElementKind, Npz, StoredArray, read_npy};
use crate::pickle::{Graph, Id, Plain};

/// Largest nesting depth of values; files of trackers are five deep.
const MAX_DEPTH: usize = 32;

pub(super) fn from_pickle(bytes: &[u8]) -> Result<Value, String> {
    pickled(bytes, &Budget::new())
}

pub(super) fn from_npy(bytes: &[u8]) -> Result<Value, String> {
    array(read_npy(bytes.to_vec()).map_err(|error| error.to_string())?, &Budget::new())
}

/// All arrays of an archive by name. Unreadable ones are [`Value`]s that say so.
pub(super) fn from_npz(bytes: &[u8]) -> Result<Value, String> {
    let mut npz = Npz::open(bytes).map_err(|error| error.to_string())?;
    if let (true, Some(file)) = (npz.names().is_empty(), npz.files().first()) {
        return Err(format!(
            "is a zip archive with {file:?} and without NumPy's arrays (.npy); unpack it and give the file with the poses"
        ));
    }
    let budget = Budget::new();
    let mut entries: Vec<(String, Value)> = Vec::new();
    for name in npz.names() {
        if entries.iter().any(|(known, _)| *known == name) {
            return Err(format!("{name:?} occurs twice; write the .npz again"));
        }
        let stored = npz.stored(&name).map_err(|error| error.to_string());
        entries.push((name, stored.and_then(|stored| array(stored, &budget)).unwrap_or_else(Value::Unreadable)));
    }
    Ok(Value::Map(entries))
}

fn pickled(bytes: &[u8], budget: &Budget) -> Result<Value, String> {
    from_graph(&Graph::read(bytes).map_err(|error| error.to_string())?, budget)
}

/// The whole value of a pickle.
pub(super) fn from_graph(graph: &Graph, budget: &Budget) -> Result<Value, String> {
    value(graph, graph.root(), budget, 0)
}

fn array(stored: StoredArray, budget: &Budget) -> Result<Value, String> {
    let StoredArray { elements, fortran, shape, data } = stored;
    match elements.kind {
        // An object in an archive is stored as a pickle of an array.
        ElementKind::Object => pickled(&data, budget),
        ElementKind::Bytes | ElementKind::Unicode => match shape[..] {
            [] => elements.text(&data).map(Value::Text).ok_or_else(|| "has invalid text".into()),
            [count] if elements.size > 0 => {
                budget.values(count)?;
                let texts = data.chunks(elements.size).take(count).map(|text| elements.text(text).map(Value::Text));
                let texts: Option<Vec<Value>> = texts.collect();
                texts.map(Value::List).ok_or_else(|| "has invalid text".into())
            }
            _ => Err("has text in more than one axis".into()),
        },
        _ => {
            budget.numbers(shape.iter().try_fold(1, |n: usize, axis| n.checked_mul(*axis)).unwrap_or(usize::MAX))?;
            let numbers = elements.numbers(&data, &shape, fortran).map_err(|error| error.to_string())?;
            Ok(Value::Numbers(numbers))
        }
    }
}

/// A value of a pickle. Values may be shared there, or contain themselves: every copy counts against the budget.
fn value(graph: &Graph, id: Id, budget: &Budget, depth: usize) -> Result<Value, String> {
    if depth > MAX_DEPTH {
        return Err(format!("has values nested more than {MAX_DEPTH} deep; store plain arrays"));
    }
    budget.values(1)?;
    let plain = match graph.plain(id) {
        Ok(plain) => plain,
        Err(error) => return Ok(Value::Unreadable(error.to_string())),
    };
    Ok(match plain {
        Plain::Nothing => Value::Nothing,
        Plain::Text(text) => Value::Text(text),
        Plain::Items(ids) => {
            let mut items = Items::Nothing(0);
            for id in ids {
                items.push(value(graph, id, budget, depth + 1)?, budget)?;
            }
            items.finish()
        }
        Plain::Entries(pairs) => {
            let mut entries: Vec<(String, Value)> = Vec::new();
            for (key, id) in pairs {
                let value = value(graph, id, budget, depth + 1)?;
                // Of equal keys of a Python dictionary, the last one counts.
                entries.push((key, value));
            }
            let mut seen = std::collections::HashSet::new();
            let mut kept: Vec<(String, Value)> = Vec::new();
            for (key, value) in entries.into_iter().rev() {
                if seen.insert(key.clone()) {
                    kept.push((key, value));
                }
            }
            kept.reverse();
            Value::Map(kept)
        }
        Plain::Object(object) => value(graph, object, budget, depth + 1)?,
        Plain::Array => match graph.count(id).and_then(|count| Ok((budget.numbers(count), graph.numbers(id)?))) {
            Ok((paid, numbers)) => {
                paid?;
                Value::Numbers(numbers)
            }
            Err(error) => Value::Unreadable(error.to_string()),
        },
    })
}

//! Files of `torch.save`: since PyTorch 1.6 a zip archive of a pickle and of the storages of its tensors, before that
//! pickles and storages one after the other.

use std::borrow::Cow;
use std::collections::HashMap;

use super::Value;
use super::budget::Budget;
use super::python::from_graph;
use crate::npz::Npz;
use crate::pickle::Graph;

/// The archive's pickle, in the only folder of the archive.
const PICKLE: &str = "data.pkl";

/// Whether the bytes are such a file.
pub(super) fn recognises_bytes(bytes: &[u8]) -> bool {
    Graph::recognises_old_torch(bytes)
        || (Npz::recognises_bytes(bytes) && Npz::open(bytes).is_ok_and(|archive| folder(&archive.files()).is_some()))
}

/// The folder of the archive, with its last slash; `None` if there is no pickle.
fn folder(files: &[String]) -> Option<&str> {
    let folder = |name: &&String| matches!(name.strip_suffix(PICKLE), Some(folder) if folder.ends_with('/') || folder.is_empty());
    files.iter().find(folder)?.strip_suffix(PICKLE)
}

pub(super) fn from_torch(bytes: &[u8]) -> Result<Value, String> {
    let budget = Budget::new();
    if Graph::recognises_old_torch(bytes) {
        return from_graph(&Graph::read_old_torch(bytes).map_err(|error| error.to_string())?, &budget);
    }
    let mut archive = Npz::open(bytes).map_err(|error| error.to_string())?;
    let files = archive.files();
    let folder = folder(&files).unwrap_or_default();
    if files.iter().any(|name| *name == format!("{folder}constants.pkl")) {
        return Err(
            "is a program (torch.jit.save), not values; save a dictionary of its tensors with torch.save".into()
        );
    }
    let mut storages = HashMap::new();
    for name in &files {
        let key = name.strip_prefix(folder).and_then(|name| name.strip_prefix("data/"));
        if let Some(key) = key {
            let data = archive.file(name).map_err(|error| format!("{name:?} {error}"))?;
            storages.insert(key.to_owned(), Cow::Owned(data));
        }
    }
    let pickle = archive.file(&format!("{folder}{PICKLE}")).map_err(|error| format!("{PICKLE:?} {error}"))?;
    // Absent before PyTorch 2.1.
    let order = archive.file(&format!("{folder}byteorder")).unwrap_or_default();
    let graph = Graph::read(&pickle).map_err(|error| error.to_string())?;
    from_graph(&graph.with_storages(storages, order.trim_ascii() == b"big"), &budget)
}

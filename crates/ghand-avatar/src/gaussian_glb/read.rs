//! Finds the avatar in a glTF file.

use std::io::Read;

use serde_json::Value;

use super::{EXTENSION, VERSION};

/// How a binary glTF file begins.
const MAGIC: &[u8] = b"glTF";
/// Bytes of the header, and of a chunk's.
const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;
/// Longest JSON that is searched, bytes; that of an avatar with a hundred motions is smaller.
const LONGEST_JSON: u64 = 64 << 20;

/// Whether a binary glTF file has an avatar. What cannot be read has none.
pub fn holds_avatar(file: impl Read) -> bool {
    let mut file = file.take((HEADER + CHUNK_HEADER) as u64 + LONGEST_JSON);
    let mut header = [0; HEADER + CHUNK_HEADER];
    if file.read_exact(&mut header).is_err() || !header.starts_with(MAGIC) {
        return false;
    }
    let length = word(&header, HEADER).unwrap_or_default();
    let mut json = vec![];
    let read = file.take(length.into()).read_to_end(&mut json);
    read.is_ok() && document(&json).is_some_and(|document| document["extensions"].get(EXTENSION).is_some())
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk::<4>().map(|word| u32::from_le_bytes(*word))
}

fn document(json: &[u8]) -> Option<Value> {
    serde_json::from_slice(json).ok()
}

/// The avatar's own bytes in a binary glTF file; `None` if the bytes are of another format.
///
/// # Errors
/// The field, and what is wrong with it.
pub(crate) fn avatar_in(bytes: &[u8]) -> Option<Result<&[u8], (String, String)>> {
    bytes.starts_with(MAGIC).then(|| find(bytes).map_err(|(field, problem)| (field.to_owned(), problem)))
}

fn find(bytes: &[u8]) -> Result<&[u8], (&'static str, String)> {
    let truncated = || ("glTF", "is truncated or damaged; copy the file again".to_owned());
    let chunk = |at: usize| -> Option<&[u8]> {
        let length = word(bytes, at)? as usize;
        bytes.get(at + CHUNK_HEADER..)?.get(..length)
    };
    let json = chunk(HEADER).ok_or_else(truncated)?;
    let document = document(json).ok_or_else(truncated)?;
    let extension = document["extensions"].get(EXTENSION);
    let extension = extension.ok_or_else(|| {
        (EXTENSION, "is missing; export the avatar with --gaussians, or give its .ghand file".to_owned())
    })?;
    let version = extension["version"].as_u64();
    if version != Some(VERSION.into()) {
        let found = version.map_or("missing".into(), |version| version.to_string());
        return Err((EXTENSION, format!("its version is {found}, not {VERSION}; export the avatar again")));
    }
    let view = extension["avatar"].as_u64().and_then(|k| document["bufferViews"].get(usize::try_from(k).ok()?));
    let number = |name: &str| view.and_then(|view| view.get(name)).and_then(Value::as_u64);
    let in_file = view.is_some_and(|view| view["buffer"] == 0 && document["buffers"][0].get("uri").is_none());
    let [begin, length] = [number("byteOffset").unwrap_or_default(), number("byteLength").unwrap_or_default()];
    let binary = chunk(HEADER + CHUNK_HEADER + json.len()).unwrap_or_default();
    let range = usize::try_from(begin).ok().zip(usize::try_from(length).ok()).filter(|_| in_file);
    let avatar = range.and_then(|(begin, length)| binary.get(begin..)?.get(..length));
    avatar.filter(|avatar| !avatar.is_empty()).ok_or_else(|| {
        (EXTENSION, "its avatar is not in the file, which is truncated or damaged; export it again".to_owned())
    })
}

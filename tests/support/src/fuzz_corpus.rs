//! The inputs of `fuzz/corpus`, and changes of them as from damage or a fuzzer, for tests that run the readers of
//! `fuzz/fuzz_targets` with any toolchain.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};

use rand::{Rng, RngExt};

/// What the bytes of a file mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// Numbers, lengths, tags.
    Binary,
    /// Numbers and lists as text.
    Text,
}

/// The inputs of a target that are kept in git, by name; those that libFuzzer adds have hashes as names.
///
/// # Panics
/// If there are none.
pub fn inputs(target: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(target);
    let entries = std::fs::read_dir(&folder).expect("the corpus is part of the repository");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some());
    paths.sort();
    assert!(!paths.is_empty(), "{} has no input", folder.display());
    paths.into_iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

/// The bytes after one to four changes.
pub fn changed(bytes: &[u8], content: Content, random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..=4) {
        if bytes.is_empty() {
            break;
        }
        let at = random.random_range(0..bytes.len());
        let length = random.random_range(1..=8).min(bytes.len() - at);
        match random.random_range(0..6) {
            0 => bytes[at] ^= 1 << random.random_range(0..8),
            1 => {
                bytes[at] = match content {
                    Content::Binary => random.random(),
                    Content::Text => b"0123456789-.,[]{}eN\""[random.random_range(0..20)],
                }
            }
            2 => {
                let middle = if content == Content::Binary { 0x7f } else { b'9' };
                bytes[at..at + length].fill([0, middle, 0xff][random.random_range(0..3)]);
            }
            3 => drop(bytes.drain(at..at + length)),
            4 => {
                let copy = bytes[at..at + length].to_vec();
                let to = random.random_range(0..=bytes.len());
                bytes.splice(to..to, copy);
            }
            _ => bytes.truncate(at),
        }
    }
    bytes
}

//! Temporary files and folders that must not be left behind when a signal ends the program.
//!
//! Rust runs no destructors then. What a program registers here, [`remove_all`] removes.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, RwLock, RwLockReadGuard};

/// What exists at present.
static PRESENT: Mutex<Vec<Temporary>> = Mutex::new(vec![]);
/// Held while files are written.
static WRITING: RwLock<()> = RwLock::new(());

/// What is temporary.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Temporary {
    /// A file.
    File(PathBuf),
    /// A folder with all that is in it.
    Folder(PathBuf),
    /// A folder, if it is empty.
    EmptyFolder(PathBuf),
}

impl Temporary {
    fn remove(&self) {
        // What cannot be removed does no harm.
        let _ = match self {
            Temporary::File(path) => std::fs::remove_file(path),
            Temporary::Folder(path) => std::fs::remove_dir_all(path),
            Temporary::EmptyFolder(path) => std::fs::remove_dir(path),
        };
    }
}

/// A temporary file or folder that is known until this is dropped. Dropping it removes nothing.
#[derive(Debug)]
#[must_use]
pub struct Registered(Temporary);

impl Registered {
    /// Makes it known.
    pub fn new(temporary: Temporary) -> Registered {
        present(|all| all.push(temporary.clone()));
        Registered(temporary)
    }

    /// Removes it before it is forgotten.
    pub fn remove(self) {
        self.0.remove();
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        match &self.0 {
            Temporary::File(path) | Temporary::Folder(path) | Temporary::EmptyFolder(path) => path,
        }
    }
}

impl Drop for Registered {
    fn drop(&mut self) {
        present(|all| {
            if let Some(at) = all.iter().position(|other| *other == self.0) {
                all.remove(at);
            }
        });
    }
}

/// Removes all that is known, once no file is being written, and lets no further one be written: only for a program that
/// ends now.
pub fn remove_all() {
    std::mem::forget(WRITING.write().unwrap_or_else(PoisonError::into_inner));
    // The last one first: it may be inside of an earlier one.
    let all = present(std::mem::take);
    all.iter().rev().for_each(Temporary::remove);
}

/// No program ends by [`remove_all`] while this is held.
pub(crate) fn writing() -> RwLockReadGuard<'static, ()> {
    WRITING.read().unwrap_or_else(PoisonError::into_inner)
}

fn present<T>(change: impl FnOnce(&mut Vec<Temporary>) -> T) -> T {
    // Every change is one operation.
    change(&mut PRESENT.lock().unwrap_or_else(PoisonError::into_inner))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_dropped_is_forgotten_and_what_is_removed_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        let inside = folder.path().join("a/b");
        std::fs::create_dir_all(&inside).unwrap();
        std::fs::write(&file, "x").unwrap();
        std::fs::write(inside.join("kept"), "x").unwrap();
        let known = Registered::new(Temporary::File(file.clone()));
        assert_eq!(known.path(), file);
        known.remove();
        assert!(!file.exists() && present(|all| !all.contains(&Temporary::File(file.clone()))));
        Registered::new(Temporary::EmptyFolder(inside.clone())).remove();
        assert!(inside.exists());
        Registered::new(Temporary::Folder(folder.path().join("a"))).remove();
        assert!(!inside.exists());
        drop(Registered::new(Temporary::Folder(folder.path().into())));
        assert!(folder.path().exists());
    }
}

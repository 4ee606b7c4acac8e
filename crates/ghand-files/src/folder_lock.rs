//! A lock on a folder, so that one process at a time writes into it.

use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// Name of the file that is locked. The system releases the lock however the process ends; a leftover file does not
/// lock anything.
pub const LOCK_FILE: &str = ".train.lock";

/// The lock's file cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct LockError {
    path: PathBuf,
    problem: &'static str,
    source: io::Error,
}

/// The right to write into a folder, until it is dropped.
#[derive(Debug)]
pub struct FolderLock {
    /// Holds the lock while it is open.
    _file: File,
}

/// Result of an attempt to lock a folder.
#[derive(Debug)]
pub enum Attempt {
    /// It is locked.
    Locked(FolderLock),
    /// Another process holds it, with its identity if known.
    Taken(String),
}

impl FolderLock {
    /// The file that is locked in a folder.
    pub fn file(folder: &Path) -> PathBuf {
        folder.join(LOCK_FILE)
    }

    /// Locks a folder without waiting. If the file system does not support locks, there is a warning and the folder
    /// counts as locked.
    ///
    /// # Errors
    /// An error that names the file, if it cannot be opened.
    pub fn attempt(folder: &Path) -> Result<Attempt, LockError> {
        FolderLock::attempt_file(&FolderLock::file(folder))
    }

    /// As [`FolderLock::attempt`], by a file of any name.
    ///
    /// # Errors
    /// As there.
    pub fn attempt_file(path: &Path) -> Result<Attempt, LockError> {
        let error = |problem| move |source| LockError { path: path.into(), problem, source };
        loop {
            let opened = File::options().create(true).truncate(false).read(true).write(true).open(path);
            let mut file = opened.map_err(error("cannot be opened"))?;
            match file.try_lock() {
                Ok(()) if !is_at(&file, path) => {
                    // Its holder removed it after it was opened here: another process may have made and locked a new
                    // one.
                }
                Ok(()) => {
                    // Only for the message of other processes, which then has less detail.
                    let _ = file.set_len(0).and_then(|()| write!(file, "{}", std::process::id()));
                    return Ok(Attempt::Locked(FolderLock { _file: file }));
                }
                Err(TryLockError::WouldBlock) => {
                    let mut holder = String::new();
                    let _ = file.take(20).read_to_string(&mut holder);
                    let number = holder.trim().parse::<u32>();
                    return Ok(Attempt::Taken(number.map_or("another process".into(), |id| format!("process {id}"))));
                }
                Err(TryLockError::Error(source)) if source.kind() == ErrorKind::Unsupported => {
                    log::warn!(
                        "{}: this file system does not support locks; let only one program write here",
                        path.display()
                    );
                    return Ok(Attempt::Locked(FolderLock { _file: file }));
                }
                Err(TryLockError::Error(source)) => return Err(error("cannot be locked")(source)),
            }
        }
    }
}

/// Whether a path still refers to an open file.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
        _ => false,
    }
}

/// For systems on which open files cannot be removed and recreated.
#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_locked_once_and_free_again_afterwards() {
        let folder = tempfile::tempdir().unwrap();
        let Attempt::Locked(lock) = FolderLock::attempt(folder.path()).unwrap() else { panic!("it is free") };
        let Attempt::Taken(holder) = FolderLock::attempt(folder.path()).unwrap() else { panic!("it is taken") };
        assert_eq!(holder, format!("process {}", std::process::id()));
        drop(lock);
        // The leftover file does not lock anything.
        assert!(FolderLock::file(folder.path()).exists());
        assert!(matches!(FolderLock::attempt(folder.path()).unwrap(), Attempt::Locked(_)));
    }

    #[test]
    fn a_lock_on_a_file_that_was_removed_meanwhile_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = FolderLock::file(folder.path());
        let file = File::create(&path).unwrap();
        assert!(is_at(&file, &path));
        #[cfg(unix)]
        {
            std::fs::remove_file(&path).unwrap();
            assert!(!is_at(&file, &path));
            File::create(&path).unwrap();
            assert!(!is_at(&file, &path));
        }
    }
}

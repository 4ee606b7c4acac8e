//! The right to write a folder or a file, so that one process at a time does.

use std::io;
use std::path::{Path, PathBuf};

use crate::folder_lock::{Attempt, FolderLock, LOCK_FILE, LockError};
use crate::temporary::{Registered, Temporary};

/// Why something could not be claimed.
#[derive(Debug, thiserror::Error)]
pub enum ClaimError {
    /// It has no name, such as `/`.
    #[error("{}: has no name", .0.display())]
    NoName(PathBuf),
    /// Its folder cannot be made.
    #[error("{}: cannot create the folder", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The error of the file system.
        source: io::Error,
    },
    /// The lock's file cannot be used.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// Another process writes there.
    #[error("{}: another command is writing there ({holder}); wait until it ends, or choose another --out", path.display())]
    Taken {
        /// The folder or file.
        path: PathBuf,
        /// The other process.
        holder: String,
    },
}

/// A folder, or a file, that only this process writes. When dropped or ended by a signal, the lock's file goes, and the
/// folders that were made and are still empty.
#[derive(Debug)]
pub struct Claim {
    /// Folders that did not exist before, the outermost first, and the lock's file.
    made: Vec<Registered>,
    lock: Option<FolderLock>,
}

impl Claim {
    /// Claims a folder, which is made.
    ///
    /// # Errors
    /// An error that names the folder, if it cannot be made or another process writes into it.
    pub fn folder(path: &Path) -> Result<Claim, ClaimError> {
        Claim::of(path, path, LOCK_FILE.into())
    }

    /// Claims a file or folder that need not exist yet, by a hidden file beside it.
    ///
    /// # Errors
    /// An error that names it, if its folder cannot be made or another process writes it.
    pub fn beside(path: &Path) -> Result<Claim, ClaimError> {
        let name = path.file_name().ok_or_else(|| ClaimError::NoName(path.into()))?;
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Claim::of(path, parent, PathBuf::from(format!(".{}.lock", name.to_string_lossy())))
    }

    fn of(path: &Path, folder: &Path, lock: PathBuf) -> Result<Claim, ClaimError> {
        let missing: Vec<&Path> =
            folder.ancestors().filter(|a| !a.as_os_str().is_empty()).take_while(|a| !a.exists()).collect();
        let known = |folder: &&Path| Registered::new(Temporary::EmptyFolder(folder.to_path_buf()));
        let mut made: Vec<Registered> = missing.iter().rev().map(known).collect();
        std::fs::create_dir_all(folder).map_err(|source| ClaimError::Folder { path: folder.into(), source })?;
        let lock = folder.join(lock);
        match FolderLock::attempt_file(&lock)? {
            Attempt::Locked(held) => {
                made.push(Registered::new(Temporary::File(lock)));
                Ok(Claim { made, lock: Some(held) })
            }
            Attempt::Taken(holder) => Err(ClaimError::Taken { path: path.into(), holder }),
        }
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Before the lock is released, so that the lock of another process is not removed.
        while let Some(made) = self.made.pop() {
            made.remove();
        }
        self.lock = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_and_a_file_are_claimed_once_and_nothing_is_left() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("a/b");
        let file = place.path().join("c/x.ghand");
        let claims = [Claim::folder(&folder).unwrap(), Claim::beside(&file).unwrap()];
        for again in [Claim::folder(&folder), Claim::beside(&file)] {
            let error = again.unwrap_err().to_string();
            assert!(error.contains("another command is writing") && error.contains("process"), "{error}");
        }
        // Another file of the same folder is free.
        drop(Claim::beside(&place.path().join("c/y.ghand")).unwrap());
        drop(claims);
        assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 0);
    }

    #[test]
    fn what_was_written_stays() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("a");
        let claim = Claim::folder(&folder).unwrap();
        std::fs::write(folder.join("result"), "x").unwrap();
        drop(claim);
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
    }
}

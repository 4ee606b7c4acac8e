//! The right to write a folder or a file, so that one process at a time does.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use ghand_files::temporary::{Registered, Temporary};

use crate::train_run::folder_lock::{Attempt, FolderLock, LOCK_FILE};

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
    pub fn folder(path: &Path) -> anyhow::Result<Claim> {
        Claim::of(path, path, LOCK_FILE.into())
    }

    /// Claims a file or folder that need not exist yet, by a hidden file beside it.
    ///
    /// # Errors
    /// An error that names it, if its folder cannot be made or another process writes it.
    pub fn beside(path: &Path) -> anyhow::Result<Claim> {
        let name = path.file_name().with_context(|| format!("{}: has no name", path.display()))?;
        let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Claim::of(path, parent, PathBuf::from(format!(".{}.lock", name.to_string_lossy())))
    }

    fn of(path: &Path, folder: &Path, lock: PathBuf) -> anyhow::Result<Claim> {
        let missing: Vec<&Path> =
            folder.ancestors().filter(|a| !a.as_os_str().is_empty()).take_while(|a| !a.exists()).collect();
        let known = |folder: &&Path| Registered::new(Temporary::EmptyFolder(folder.to_path_buf()));
        let mut made: Vec<Registered> = missing.iter().rev().map(known).collect();
        std::fs::create_dir_all(folder).with_context(|| format!("{}: cannot create the folder", folder.display()))?;
        let lock = folder.join(lock);
        match FolderLock::attempt_file(&lock)? {
            Attempt::Locked(held) => {
                made.push(Registered::new(Temporary::File(lock)));
                Ok(Claim { made, lock: Some(held) })
            }
            Attempt::Taken(holder) => bail!(
                "{}: another command is writing there ({holder}); wait until it ends, or choose another --out",
                path.display()
            ),
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
        let (folder, file) = (place.path().join("a/b"), place.path().join("c/x.ghand"));
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

//! The folder of a run: chooses it, protects earlier results, and ensures that only one run writes into it.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use ghand_files::atomic_file::remove_unfinished;
use ghand_files::folder_lock::{Attempt, FolderLock};
use ghand_train::checkpoints::{has_checkpoints, remove_checkpoints};

use crate::run_files::{
    AVATAR_FILE, CHECKPOINTS, CURVES_PLOT, CURVES_TABLE, METRICS_FILE, PREVIEW, PREVIEW_AVATAR, RECORD_FILE, RESULTS,
};
use crate::say;

/// The default folder of `train`, relative to the current folder. Later runs go to `out/train-2` and so on.
pub const DEFAULT_FOLDER: &str = "out/train";
/// Number of folders that are tried after the default one.
const MOST_FOLDERS: usize = 100_000;

/// The folder of a run, locked. When dropped, removes the folders that it made and that are still empty.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    leftovers: Leftovers,
    _lock: FolderLock,
}

/// What a run makes besides its results.
#[derive(Debug, Clone)]
pub struct Leftovers {
    folder: PathBuf,
    lock: PathBuf,
    /// Folders that did not exist before, the innermost first.
    made: Vec<PathBuf>,
}

impl Leftovers {
    /// How to go on with the run, if it has a checkpoint.
    pub fn how_to_resume(&self) -> Option<String> {
        is_interrupted(&self.folder).then(|| format!("go on with `train --resume --out {}`", self.folder.display()))
    }

    /// Removes the lock's file, the record of a run without checkpoints, and the folders that were made for this run if
    /// they are empty.
    pub fn remove(&self) {
        // Anything that cannot be removed does no harm.
        if !is_interrupted(&self.folder) {
            clear(&self.folder.join(CHECKPOINTS), true);
        }
        let _ = std::fs::remove_file(&self.lock);
        self.made.iter().for_each(|folder| {
            let _ = std::fs::remove_dir(folder);
        });
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        // Before the lock is released, so that the lock of another process is not removed.
        self.leftovers.remove();
    }
}

impl RunFolder {
    /// The folder that a user named. With `force` the results of an earlier run may be replaced.
    ///
    /// # Errors
    /// An error that names the file if there are results and no `force`, or the folder if another run writes into it or
    /// it cannot be made.
    pub fn named(path: &Path, force: bool) -> anyhow::Result<RunFolder> {
        let refuse = || match result_in(path).filter(|_| !force) {
            _ if is_interrupted(path) && !force => bail!(
                "{}: has an interrupted run; go on with it with --resume, choose another --out, or replace it with --force",
                path.display()
            ),
            Some(file) => bail!(
                "{}: belongs to an earlier run; choose another --out, or replace its results with --force",
                file.display()
            ),
            None => Ok(()),
        };
        refuse()?;
        match RunFolder::claim(path)? {
            Ok(folder) => {
                // The run that held the lock until now may have written results.
                refuse()?;
                Ok(folder)
            }
            Err(holder) => bail!(
                "{}: another run is writing into this folder ({holder}); wait until it ends, or choose another --out",
                path.display()
            ),
        }
    }

    /// The folder of a run to go on with: the one that a user named, else the newest interrupted one of `base`, `base-2`
    /// and so on, else `base`.
    ///
    /// # Errors
    /// As [`RunFolder::named`], but results may be there.
    pub fn resumed(named: Option<&Path>, base: &Path) -> anyhow::Result<RunFolder> {
        let numbered = |number: usize| if number == 1 { base.to_owned() } else { numbered(base, number) };
        let interrupted =
            (1..=MOST_FOLDERS).map(numbered).take_while(|path| path.exists()).filter(|path| is_interrupted(path));
        let path = named.map(Path::to_owned).or_else(|| interrupted.last()).unwrap_or_else(|| base.to_owned());
        RunFolder::claim(&path)?.map_err(|holder| {
            anyhow!("{}: another run is writing into this folder ({holder}); wait until it ends", path.display())
        })
    }

    /// The first of `base`, `base-2`, `base-3`, ... without results of an earlier run and without a run in progress.
    ///
    /// # Errors
    /// An error that names a folder that cannot be made.
    pub fn next(base: &Path) -> anyhow::Result<RunFolder> {
        for number in 1..=MOST_FOLDERS {
            let path = if number == 1 { base.to_owned() } else { numbered(base, number) };
            if result_in(&path).is_some() || is_interrupted(&path) {
                continue;
            }
            match RunFolder::claim(&path)? {
                Ok(folder) if result_in(&path).is_none() => {
                    if number > 1 {
                        say!("earlier runs are kept; results go to {}", path.display());
                    }
                    return Ok(folder);
                }
                _ => {}
            }
        }
        bail!(
            "{}: there are {MOST_FOLDERS} earlier runs; remove some, or choose another folder with --out",
            base.display()
        )
    }

    /// Makes and locks a folder; if another process holds it, returns which one.
    fn claim(path: &Path) -> anyhow::Result<Result<RunFolder, String>> {
        let missing = path.ancestors().filter(|a| !a.as_os_str().is_empty()).take_while(|a| !a.exists());
        let made = missing.map(Path::to_owned).collect();
        std::fs::create_dir_all(path)
            .with_context(|| format!("{}: cannot create the output folder", path.display()))?;
        let leftovers = Leftovers { folder: path.into(), lock: FolderLock::file(path), made };
        Ok(match FolderLock::attempt(path) {
            Ok(Attempt::Locked(lock)) => {
                // A killed run may have been writing, even before it had a record or a checkpoint.
                remove_unfinished(path);
                remove_unfinished(&path.join(CHECKPOINTS));
                Ok(RunFolder { path: path.into(), leftovers, _lock: lock })
            }
            Ok(Attempt::Taken(holder)) => Err(holder),
            Err(error) => {
                leftovers.remove();
                return Err(error.into());
            }
        })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Files and folders to remove if the program ends without dropping this.
    pub fn leftovers(&self) -> Leftovers {
        self.leftovers.clone()
    }

    /// The path of a file in the folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The folder of the run's checkpoints, and of all else that shows an unfinished run.
    pub fn checkpoints(&self) -> PathBuf {
        self.path.join(CHECKPOINTS)
    }

    /// The file that says how the run was started.
    pub fn record(&self) -> PathBuf {
        self.checkpoints().join(RECORD_FILE)
    }

    /// Removes checkpoints and record: there is nothing to go on with. With `keep` the checkpoints stay.
    pub fn end(&self, keep: bool) {
        clear(&self.checkpoints(), keep);
    }

    /// Whether a run has ended here.
    pub fn is_finished(&self) -> bool {
        self.file(METRICS_FILE).exists() && !self.record().exists()
    }

    /// How to go on with the run, if it has a checkpoint.
    pub fn how_to_resume(&self) -> Option<String> {
        self.leftovers.how_to_resume()
    }

    /// Removes all results except the avatar, because those of an earlier run would look like this one's.
    ///
    /// # Errors
    /// An error that names the file that cannot be removed.
    pub fn remove_other_results(&self) -> anyhow::Result<()> {
        for name in RESULTS.into_iter().filter(|name| *name != AVATAR_FILE) {
            let path = self.file(name);
            match std::fs::remove_file(&path) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(error).with_context(|| format!("{}: cannot be removed", path.display()));
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Removes what a run that has ended leaves in its folder of checkpoints, and the folder if it is then empty. With
/// `keep_checkpoints` these stay.
fn clear(checkpoints: &Path, keep_checkpoints: bool) {
    // What cannot be removed does no harm.
    for name in [RECORD_FILE, CURVES_TABLE, CURVES_PLOT, PREVIEW, PREVIEW_AVATAR] {
        let _ = std::fs::remove_file(checkpoints.join(name));
    }
    if !keep_checkpoints {
        remove_checkpoints(checkpoints);
    }
    let _ = std::fs::remove_dir(checkpoints);
}

/// The first result of a run that is in a folder.
fn result_in(folder: &Path) -> Option<PathBuf> {
    RESULTS.iter().map(|name| folder.join(name)).find(|file| file.symlink_metadata().is_ok())
}

/// Whether a folder has a run that can go on.
fn is_interrupted(folder: &Path) -> bool {
    let checkpoints = folder.join(CHECKPOINTS);
    checkpoints.join(RECORD_FILE).exists() && has_checkpoints(&checkpoints)
}

/// `out/train` with `2` is `out/train-2`.
fn numbered(base: &Path, number: usize) -> PathBuf {
    let mut name = base.as_os_str().to_owned();
    name.push(format!("-{number}"));
    name.into()
}

/// The avatar that was trained last: the newest of those in [`DEFAULT_FOLDER`] and the folders beside it whose names
/// begin alike. `None` if there is none.
pub fn last_avatar() -> Option<PathBuf> {
    last_avatar_beside(Path::new(DEFAULT_FOLDER))
}

fn last_avatar_beside(base: &Path) -> Option<PathBuf> {
    let parent = base.parent()?;
    let start = base.file_name()?.to_str()?;
    let folders = std::fs::read_dir(parent).ok()?.flatten();
    let runs = folders.filter(|folder| folder.file_name().to_str().is_some_and(|name| name.starts_with(start)));
    let avatars = runs.map(|folder| folder.path().join(AVATAR_FILE)).filter_map(|file| {
        let modified = file.metadata().and_then(|m| m.modified()).ok()?;
        Some((modified, file))
    });
    avatars.max().map(|(_, file)| file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::{Duration, SystemTime};

    fn fill(folder: &RunFolder) {
        std::fs::write(folder.file(AVATAR_FILE), "an avatar").unwrap();
    }

    #[test]
    fn runs_without_a_named_folder_use_separate_folders() {
        let place = tempfile::tempdir().unwrap();
        let base = place.path().join("out/train");
        let first = RunFolder::next(&base).unwrap();
        assert_eq!(first.path(), base);
        // The first is still in progress, and then has a result.
        let second = RunFolder::next(&base).unwrap();
        assert_eq!(second.path(), place.path().join("out/train-2"));
        fill(&first);
        drop(first);
        assert_eq!(RunFolder::next(&base).unwrap().path(), place.path().join("out/train-3"));
        // The second ends without a result: its folder is unlocked and removed.
        drop(second);
        assert!(!place.path().join("out/train-2").exists());
        assert_eq!(RunFolder::next(&base).unwrap().path(), place.path().join("out/train-2"));
    }

    #[test]
    fn a_named_folder_keeps_what_is_there_unless_forced() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("run");
        std::fs::create_dir(&path).unwrap();
        std::fs::write(path.join("notes.txt"), "mine").unwrap();
        fill(&RunFolder::named(&path, false).unwrap());
        let error = RunFolder::named(&path, false).unwrap_err().to_string();
        assert!(error.contains("avatar.ghand") && error.contains("--force"), "{error}");
        let forced = RunFolder::named(&path, true).unwrap();
        std::fs::write(forced.file(METRICS_FILE), "{}").unwrap();
        forced.remove_other_results().unwrap();
        let busy = RunFolder::named(&path, true).unwrap_err().to_string();
        assert!(busy.contains("another run is writing"), "{busy}");
        drop(forced);
        let mut left: Vec<_> = std::fs::read_dir(&path).unwrap().map(|e| e.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["avatar.ghand", "notes.txt"]);
    }

    #[test]
    fn what_a_killed_run_was_writing_is_removed() {
        let place = tempfile::tempdir().unwrap();
        std::fs::create_dir(place.path().join(CHECKPOINTS)).unwrap();
        let half = [place.path().join(".writing-abc"), place.path().join(CHECKPOINTS).join(".writing-def")];
        for path in &half {
            std::fs::write(path, "half").unwrap();
        }
        let folder = RunFolder::resumed(Some(place.path()), Path::new(DEFAULT_FOLDER)).unwrap();
        assert!(!half.iter().any(|path| path.exists()));
        folder.end(false);
        drop(folder);
        assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_run_without_results_removes_the_folders_it_made() {
        let place = tempfile::tempdir().unwrap();
        drop(RunFolder::named(&place.path().join("a/b/c"), false).unwrap());
        assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 0);
    }

    #[test]
    fn the_last_avatar_is_the_newest_not_the_highest_number() {
        let place = tempfile::tempdir().unwrap();
        let base = place.path().join("out/train");
        assert_eq!(last_avatar_beside(&base), None);
        for (name, age) in [("train", 20), ("train-2", 5), ("train-10", 10), ("other", 0)] {
            let folder = place.path().join("out").join(name);
            std::fs::create_dir_all(&folder).unwrap();
            let file = std::fs::File::create(folder.join(AVATAR_FILE)).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(age)).unwrap();
        }
        std::fs::create_dir_all(place.path().join("out/train-11")).unwrap();
        assert_eq!(last_avatar_beside(&base), Some(place.path().join("out/train-2/avatar.ghand")));
    }
}

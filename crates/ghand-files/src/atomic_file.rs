//! Output files: complete or absent, and never in place of anything but a file.

use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::temporary;

/// How the name of a file begins until it is complete.
const UNFINISHED: &str = ".writing-";

/// Writes a file atomically: to a temporary file in the same folder, synced, then renamed to `path`.
///
/// Missing parent folders are created. A symbolic link is followed: its target is replaced, the link stays. A replaced
/// file keeps its permissions; a new one gets those that the user's umask allows.
///
/// # Errors
/// As for [`check_writable`], and any error of the file system; the file at `path` is then unchanged.
pub fn write_atomically(path: &Path, contents: &[u8]) -> io::Result<()> {
    let _writing = temporary::writing();
    let target = replaceable(path)?;
    let folder = folder_of(&target);
    std::fs::create_dir_all(folder)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(UNFINISHED);
    // Temporary files are private to their owner by default; an output file should not be.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(contents)?;
    if let Ok(before) = std::fs::metadata(&target) {
        file.as_file().set_permissions(before.permissions())?;
    }
    file.as_file().sync_all()?;
    file.persist(&target).map_err(|e| e.error)?;
    Ok(())
}

/// Checks that [`write_atomically`] may write to `path`, without changing anything; for programs that work long before
/// they write.
///
/// # Errors
/// An error that names the obstacle: `path` is a folder, a pipe, a device, a read-only file or a cycle of symbolic
/// links, one of its parents is a file, or nothing can be written to its folder.
pub fn check_writable(path: &Path) -> io::Result<()> {
    let target = replaceable(path)?;
    match folder_of(&target).ancestors().find(|folder| folder.exists()) {
        // A file without a name, so that nothing changes, shows what permissions do not: whether the disk takes one.
        Some(folder) => tempfile::tempfile_in(folder).map(|_| ()),
        None => Ok(()),
    }
}

/// Removes what programs that were killed within [`write_atomically`] have left in a folder; for who alone writes there.
pub fn remove_unfinished(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(UNFINISHED) {
            // What cannot be removed does no harm.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Number of links that are followed before a chain counts as a cycle; the same limit as in Linux.
const MOST_LINKS: usize = 40;

/// The file that a path refers to through links, if it does not exist or may be replaced.
fn replaceable(path: &Path) -> io::Result<PathBuf> {
    let target = follow(path)?;
    match std::fs::metadata(&target) {
        Ok(metadata) if metadata.is_dir() => Err(io::Error::other("it is a folder, not a file")),
        Ok(metadata) if !metadata.is_file() => {
            Err(io::Error::other("it is a pipe or a device, not a file; choose another name"))
        }
        // A rename would replace even a protected file, and the superuser may write to any.
        Ok(metadata) if metadata.permissions().readonly() => {
            Err(io::Error::new(ErrorKind::PermissionDenied, "the file is read-only; choose another name"))
        }
        Ok(_) => std::fs::File::options().append(true).open(&target).map(|_| target),
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            match folder_of(&target).ancestors().find(|folder| folder.exists()) {
                Some(folder) if !folder.is_dir() => {
                    Err(io::Error::new(ErrorKind::NotADirectory, format!("{} is not a folder", folder.display())))
                }
                _ => Ok(target),
            }
        }
        Err(error) => Err(error),
    }
}

/// The target of a path through symbolic links; it need not exist.
fn follow(path: &Path) -> io::Result<PathBuf> {
    let mut target = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match std::fs::symlink_metadata(&target) {
            Ok(metadata) if metadata.is_symlink() => {
                let next = std::fs::read_link(&target)?;
                // A relative link is relative to its own folder.
                target = folder_of(&target).join(next);
            }
            _ => return Ok(target),
        }
    }
    Err(io::Error::other("its symbolic links form a cycle"))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entries(folder: &Path) -> usize {
        std::fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_no_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.json");
        write_atomically(&file, b"old").unwrap();
        write_atomically(&file, b"new").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"new");
        let blocked = folder.path().join("blocked");
        std::fs::create_dir_all(blocked.join("inside")).unwrap();
        assert!(write_atomically(&blocked, b"x").unwrap_err().to_string().contains("folder"));
        assert_eq!(entries(folder.path()), 2);
    }

    #[test]
    fn what_killed_programs_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        for name in [".writing-abc", "writing-abc", ".hidden"] {
            std::fs::write(folder.path().join(name), "half").unwrap();
        }
        remove_unfinished(folder.path());
        remove_unfinished(&folder.path().join("missing"));
        assert!(!folder.path().join(".writing-abc").exists());
        assert_eq!(entries(folder.path()), 2);
    }

    #[test]
    fn parent_folders_are_created_but_not_below_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a/b/c.json");
        check_writable(&file).unwrap();
        assert_eq!(entries(folder.path()), 0);
        write_atomically(&file, b"x").unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"x");
        let through = file.join("d/e.json");
        assert!(check_writable(&through).is_err());
        assert!(write_atomically(&through, b"x").is_err());
        assert_eq!(std::fs::read(&file).unwrap(), b"x");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_in_which_no_file_can_be_is_found_before_anything_is_written() {
        // Even the superuser makes no files among the processes.
        assert!(check_writable(Path::new("/proc/ghand.json")).is_err());
        assert!(write_atomically(Path::new("/proc/ghand.json"), b"x").is_err());
    }

    #[cfg(unix)]
    mod unix {
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};

        use super::*;

        #[test]
        fn devices_and_pipes_are_never_replaced() {
            let folder = tempfile::tempdir().unwrap();
            let pipe = folder.path().join("pipe");
            assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
            let link = folder.path().join("link");
            symlink(&pipe, &link).unwrap();
            for path in [pipe.as_path(), link.as_path(), Path::new("/dev/null")] {
                let error = write_atomically(path, b"x").unwrap_err().to_string();
                assert!(error.contains("pipe or a device"), "{}: {error}", path.display());
                assert!(check_writable(path).is_err());
            }
            assert!(std::fs::metadata(&pipe).unwrap().file_type().is_fifo());
            assert!(std::fs::metadata("/dev/null").unwrap().file_type().is_char_device());
            assert_eq!(entries(folder.path()), 2);
        }

        #[test]
        fn read_only_files_are_kept_even_for_the_superuser() {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("kept");
            std::fs::write(&file, b"old").unwrap();
            std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o444)).unwrap();
            let error = write_atomically(&file, b"new").unwrap_err();
            assert_eq!(error.kind(), ErrorKind::PermissionDenied);
            assert_eq!(std::fs::read(&file).unwrap(), b"old");
        }

        #[test]
        fn links_are_kept_and_their_targets_are_written() {
            let folder = tempfile::tempdir().unwrap();
            std::fs::create_dir(folder.path().join("real")).unwrap();
            let (first, second) = (folder.path().join("first"), folder.path().join("second"));
            symlink("second", &first).unwrap();
            symlink("real/file", &second).unwrap();
            for contents in [b"new".as_slice(), b"newer"] {
                write_atomically(&first, contents).unwrap();
                assert_eq!(std::fs::read(folder.path().join("real/file")).unwrap(), contents);
            }
            assert!([&first, &second].iter().all(|link| std::fs::symlink_metadata(link).unwrap().is_symlink()));
            let here = folder.path().join("here");
            let there = folder.path().join("there");
            symlink(&there, &here).unwrap();
            symlink(&here, &there).unwrap();
            assert!(write_atomically(&here, b"x").unwrap_err().to_string().contains("cycle"));
        }

        #[test]
        fn permissions_are_kept() {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("a");
            write_atomically(&file, b"x").unwrap();
            let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
            let plain = folder.path().join("plain");
            std::fs::write(&plain, b"x").unwrap();
            assert_eq!(mode(&file), mode(&plain));
            std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o640)).unwrap();
            write_atomically(&file, b"y").unwrap();
            assert_eq!(mode(&file), 0o640);
        }
    }
}

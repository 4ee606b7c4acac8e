//! Notices when a file changes on disk.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Seconds between two looks at the file.
const INTERVAL_SECS: f64 = 1.0;

/// What changes when a file is written.
type Stamp = (SystemTime, u64);

/// A file whose changes matter.
#[derive(Debug, Clone)]
pub struct WatchedFile {
    path: PathBuf,
    /// Of the contents that were read.
    read: Option<Stamp>,
    /// At the last look.
    seen: Option<Stamp>,
    /// When the next look is due, in the user interface's seconds.
    next_look: f64,
}

impl WatchedFile {
    /// A file that has just been read.
    pub fn new(path: &Path) -> WatchedFile {
        let stamp = stamp(path);
        WatchedFile { path: path.into(), read: stamp, seen: stamp, next_look: 0.0 }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file has changed and should be read again; true once for each change. A file that is still being
    /// written has not changed yet: it must look the same twice.
    pub fn has_changed(&mut self, now: f64) -> bool {
        if now < self.next_look {
            return false;
        }
        self.next_look = now + INTERVAL_SECS;
        let stamp = stamp(&self.path);
        let rests = std::mem::replace(&mut self.seen, stamp) == stamp;
        let changed = rests && stamp.is_some() && stamp != self.read;
        if changed {
            self.read = stamp;
        }
        changed
    }
}

fn stamp(path: &Path) -> Option<Stamp> {
    let metadata = std::fs::metadata(path).ok()?;
    Some((metadata.modified().ok()?, metadata.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_noticed_once_when_the_file_rests() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "1").unwrap();
        let mut file = WatchedFile::new(&path);
        let looks = |file: &mut WatchedFile, from: u32| [0, 1, 2].map(|k| file.has_changed(f64::from(from + k)));
        assert_eq!(looks(&mut file, 0), [false; 3]);
        std::fs::write(&path, "22").unwrap();
        assert!(!file.has_changed(2.5), "it looks once a second");
        assert_eq!(looks(&mut file, 10), [false, true, false]);
        // It is deleted and comes back.
        std::fs::remove_file(&path).unwrap();
        assert_eq!(looks(&mut file, 20), [false; 3]);
        std::fs::write(&path, "333").unwrap();
        assert_eq!(looks(&mut file, 30), [false, true, false]);
    }
}

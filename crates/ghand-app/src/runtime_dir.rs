//! A private runtime folder, if the system does not provide one.
//!
//! Vulkan's loader and Mesa look for a display server under `XDG_RUNTIME_DIR` and complain on stderr if it is missing,
//! as in containers, jobs and logins without a desktop. A user cannot do much about it, so the programs make one.

use ghand_files::temporary::{Registered, Temporary};

/// A runtime folder of this process; removed with the value.
pub struct RuntimeDir {
    _folder: Option<(Registered, tempfile::TempDir)>,
}

const VARIABLE: &str = "XDG_RUNTIME_DIR";

impl RuntimeDir {
    /// Points `XDG_RUNTIME_DIR` to a new private folder if it is missing or does not name a folder. If none can be
    /// made, nothing changes.
    ///
    /// Must be called first in `main`, before any other thread exists.
    pub fn ensure() -> RuntimeDir {
        let is_there = std::env::var_os(VARIABLE).is_some_and(|folder| std::path::Path::new(&folder).is_dir());
        if is_there || !cfg!(target_os = "linux") {
            return RuntimeDir { _folder: None };
        }
        // Private to its owner, as the specification of XDG_RUNTIME_DIR requires and tempfile provides.
        let folder = tempfile::Builder::new().prefix("ghand-runtime-").tempdir().ok();
        if let Some(folder) = &folder {
            set(folder.path());
        }
        let known = folder.map(|folder| (Registered::new(Temporary::Folder(folder.path().into())), folder));
        RuntimeDir { _folder: known }
    }
}

#[allow(unsafe_code, reason = "the environment is what the driver, a C library, reads")]
fn set(folder: &std::path::Path) {
    // SAFETY: no other thread exists yet that could read the environment meanwhile; see `RuntimeDir::ensure`.
    unsafe { std::env::set_var(VARIABLE, folder) }
}

//! A private runtime folder where the system provides none.
//!
//! Vulkan's loader and Mesa look for a display server under `XDG_RUNTIME_DIR` and complain on stderr where it is missing, as in
//! containers, in jobs and on bare logins. There is nothing that a user could do about it, so the programs make one.

/// A runtime folder of this process; removed with the value.
pub struct RuntimeDir {
    _folder: Option<tempfile::TempDir>,
}

const VARIABLE: &str = "XDG_RUNTIME_DIR";

impl RuntimeDir {
    /// Points `XDG_RUNTIME_DIR` to a new private folder if it is missing or does not name a folder. Where none can be made,
    /// nothing changes.
    ///
    /// Must be called first thing in `main`, before any other thread exists.
    pub fn ensure() -> RuntimeDir {
        let is_there = std::env::var_os(VARIABLE).is_some_and(|folder| std::path::Path::new(&folder).is_dir());
        if is_there || !cfg!(target_os = "linux") {
            return RuntimeDir { _folder: None };
        }
        // Private to its owner, as the specification of XDG_RUNTIME_DIR demands and tempfile makes it.
        let folder = tempfile::Builder::new().prefix("ghand-runtime-").tempdir().ok();
        if let Some(folder) = &folder {
            set(folder.path());
        }
        RuntimeDir { _folder: folder }
    }
}

#[allow(unsafe_code, reason = "the environment is what the driver, a C library, reads")]
fn set(folder: &std::path::Path) {
    // SAFETY: no other thread exists yet that could read the environment meanwhile; see `RuntimeDir::ensure`.
    unsafe { std::env::set_var(VARIABLE, folder) }
}

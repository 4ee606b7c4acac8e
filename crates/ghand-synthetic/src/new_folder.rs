//! A folder that appears complete or not at all.

use std::path::Path;

use ghand_capture::CaptureError;
use ghand_files::temporary::{Registered, Temporary};

/// Fails if the folder exists and is not empty. Other errors appear when it is made.
///
/// # Errors
/// [`CaptureError::Invalid`].
pub(crate) fn check_is_new(folder: &Path) -> Result<(), CaptureError> {
    if std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some()) {
        let problem = "is not empty; give another or remove it first".into();
        return Err(CaptureError::Invalid { path: folder.into(), field: "folder".into(), problem });
    }
    Ok(())
}

/// Makes a folder: `fill` gets an empty one beside it, which is renamed at the end.
///
/// # Errors
/// That of `fill`, or [`CaptureError::Io`] if the folder cannot be made.
pub(crate) fn make_folder<E: From<CaptureError>>(
    folder: &Path,
    fill: impl FnOnce(&Path) -> Result<(), E>,
) -> Result<(), E> {
    let io = |action: &'static str| {
        move |source| CaptureError::Io {
            path: folder.into(),
            action,
            source,
            remedy: "check that its parent folder is writable and has free space",
        }
    };
    let parent = match folder.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(parent).map_err(io("create the folder"))?;
    let workshop =
        tempfile::Builder::new().prefix(".synthetic-").tempdir_in(parent).map_err(io("create the folder"))?;
    let _known = Registered::new(Temporary::Folder(workshop.path().into()));
    fill(workshop.path())?;
    // A rename replaces an empty folder on Unix only.
    if folder.exists() {
        std::fs::remove_dir(folder).map_err(io("replace the empty folder"))?;
    }
    // Temporary folders are private; this one should not be.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        std::fs::set_permissions(workshop.path(), std::fs::Permissions::from_mode(0o755))
            .map_err(io("create the folder"))?;
    }
    std::fs::rename(workshop.path(), folder).map_err(io("move the capture to its folder"))?;
    Ok(())
}

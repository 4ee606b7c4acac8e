//! Locations of the parts of the data set.

use std::path::{Path, PathBuf};

use crate::error::CaptureError;
use crate::reading::validation::FileValidator;

/// Folders of the images, below the root: as documented, and as unpacked from the archive.
const IMAGE_FOLDERS: [&str; 2] = ["images", "InterHand2.6M_5fps_batch1/images"];
const SUBSETS: [&str; 3] = ["train", "val", "test"];
/// HandAvatar's captures, subset and number.
const PROTOCOL: [(&str, &str); 3] = [("test", "0"), ("test", "1"), ("val", "0")];

/// One capture of one subset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Location {
    /// The folder with `annotations`.
    pub root: PathBuf,
    /// The folder of the images, below the root.
    pub images: &'static str,
    /// `train`, `val` or `test`.
    pub subset: String,
    /// The capture's number.
    pub capture: String,
}

impl Location {
    /// One of the annotation files.
    pub fn annotation(&self, kind: &str) -> PathBuf {
        let subset = &self.subset;
        self.root.join("annotations").join(subset).join(format!("InterHand2.6M_{subset}_{kind}.json"))
    }

    fn folder(&self) -> PathBuf {
        self.root.join(self.images).join(&self.subset).join(format!("Capture{}", self.capture))
    }
}

/// The capture that a path means: the root of the data set means the first existing one of HandAvatar's captures, and a
/// folder such as `Capture0` among the images means that one. `None` if the path is neither.
pub(crate) fn locate(path: &Path) -> Option<Result<Location, CaptureError>> {
    let path = std::path::absolute(path).ok()?;
    if let Some(images) = image_folder(&path) {
        let location = |(subset, capture): (&str, &str)| Location {
            root: path.clone(),
            images,
            subset: subset.into(),
            capture: capture.into(),
        };
        let found = PROTOCOL.into_iter().map(location).find(|l| l.folder().is_dir());
        return Some(found.ok_or_else(|| {
            let problem = "does not contain test/Capture0, test/Capture1 or val/Capture0; give the folder of another \
                           capture, such as images/train/Capture3";
            FileValidator { path: &path }.invalid(images, problem)
        }));
    }
    let capture = path.file_name()?.to_str()?.strip_prefix("Capture")?;
    let subset = path.parent()?.file_name()?.to_str()?;
    if capture.is_empty() || !capture.bytes().all(|b| b.is_ascii_digit()) || !SUBSETS.contains(&subset) {
        return None;
    }
    let root = path.ancestors().find(|root| image_folder(root).is_some())?;
    let location = Location {
        root: root.to_path_buf(),
        images: image_folder(root)?,
        subset: subset.into(),
        capture: capture.into(),
    };
    (location.folder() == path).then_some(Ok(location))
}

fn image_folder(root: &Path) -> Option<&'static str> {
    let there = root.join("annotations").is_dir();
    IMAGE_FOLDERS.into_iter().find(|images| there && root.join(images).is_dir())
}

//! Which tool wrote a file or a folder, by its contents.

use std::path::{Path, PathBuf};

use ghand_files::input_file;

use super::found::{CalibrationFormat, FoundCalibration, FoundCamera, LengthUnit, Projection};
use super::node::Node;
use super::{anipose, colmap, dat_files, easymocap, gltf, kalibr, meshroom, opencv};
use crate::cameras::rigid::Rigid;
use crate::error::CaptureError;
use crate::reading::text_file::text_of;
use crate::reading::validation::FileValidator;

/// Largest text file: a tree of it takes up to thirty times as much memory.
const LARGEST_FILE: u64 = 1 << 24;
/// Most entries of a folder that are looked at, and most files of it that are read.
const MOST_ENTRIES: usize = 10_000;
const MOST_FILES: usize = 256;
/// Endings of the files of a folder that are read.
const ENDINGS: [&str; 8] = ["toml", "yml", "yaml", "xml", "json", "sfm", "glb", "gltf"];
/// What a user may give.
const KNOWN: &str = "OpenCV, ROS, handpose3d, COLMAP, anipose, FreeMoCap, Caliscope, Kalibr, EasyMocap, Meshroom, glTF \
                     or a capture.json";

/// What the content of a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Ghand,
    Gltf,
    Meshroom,
    Kalibr,
    Toml,
    /// Perhaps one of two files.
    EasyMocap,
    /// Perhaps one of several files.
    OpenCv,
}

/// A file whose content is recognised.
struct File {
    path: PathBuf,
    node: Node,
    kind: Kind,
}

fn kind(path: &Path, node: &Node) -> Option<Kind> {
    let has_cameras = matches!(node.get("cameras"), Some(Node::List(_)));
    if gltf::recognises(node) {
        Some(Kind::Gltf)
    } else if has_cameras {
        Some(Kind::Ghand)
    } else if meshroom::recognises(node) {
        Some(Kind::Meshroom)
    } else if kalibr::recognises(path, node) {
        Some(Kind::Kalibr)
    } else if anipose::recognises(path, node) {
        Some(Kind::Toml)
    } else if easymocap::recognises(node) {
        Some(Kind::EasyMocap)
    } else if opencv::recognises(node) {
        Some(Kind::OpenCv)
    } else {
        None
    }
}

/// Reads the calibration that a file is, or is part of.
pub(super) fn file(path: &Path) -> Result<FoundCalibration, CaptureError> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if colmap::is_part(&name) && colmap::model_in(folder).is_some_and(|model| model == folder.join("")) {
        return colmap::read(folder);
    }
    let content = content(path)?;
    if let Content::DatFile = content {
        return dat_files::read(folder, &names(folder)?);
    }
    let file = recognised(path, content)?.ok_or_else(|| {
        FileValidator { path }.invalid("file", format!("is not a calibration that is read; give one of {KNOWN}"))
    })?;
    match (file.kind, sibling(path)) {
        (Kind::EasyMocap | Kind::OpenCv, Some(other)) => {
            let other = self::content(&other).and_then(|content| recognised(&other, content))?;
            let kind = file.kind;
            calibration(path, [file].into_iter().chain(other.filter(|other| other.kind == kind)).collect())
        }
        _ => calibration(path, vec![file]),
    }
}

/// Reads the calibration in a folder.
pub(super) fn folder(folder: &Path) -> Result<FoundCalibration, CaptureError> {
    if let Some(model) = colmap::model_in(folder) {
        return colmap::read(&model);
    }
    let names = names(folder)?;
    if dat_files::is_folder(&names) {
        return dat_files::read(folder, &names);
    }
    let has_ending = |name: &&String| {
        name.rsplit_once('.').is_some_and(|(_, end)| ENDINGS.contains(&end.to_ascii_lowercase().as_str()))
    };
    let mut files: Vec<File> = vec![];
    let mut broken = vec![];
    for name in names.iter().filter(has_ending).take(MOST_FILES) {
        let path = folder.join(name);
        match content(&path).and_then(|content| recognised(&path, content)) {
            Ok(file) => files.extend(file),
            // Not every file of a folder is of a calibration.
            Err(error) => broken.push(error),
        }
    }
    if files.is_empty() {
        let nothing = format!("has no calibration that is read; give one of {KNOWN}");
        return Err(broken
            .into_iter()
            .next()
            .unwrap_or_else(|| FileValidator { path: folder }.invalid("folder", nothing)));
    }
    let mut found = calibration(folder, files)?;
    found.remarks.extend(broken.iter().map(|error| format!("a file of the folder is not read: {error}")));
    Ok(found)
}

/// The calibration of some files, which must be of one kind.
fn calibration(path: &Path, files: Vec<File>) -> Result<FoundCalibration, CaptureError> {
    let is_one_kind = |kind: Kind| files.iter().all(|file| file.kind == kind);
    match files.as_slice() {
        [only] if !matches!(only.kind, Kind::EasyMocap | Kind::OpenCv) => whole(only),
        files if is_one_kind(Kind::OpenCv) => {
            let contents: Vec<Vec<opencv::Content>> =
                files.iter().map(|file| opencv::contents(&file.path, &file.node)).collect::<Result<_, _>>()?;
            opencv::read(path, contents.into_iter().flatten().collect())
        }
        [one] if one.kind == Kind::EasyMocap => easymocap::read(path, (&one.path, &one.node), None),
        [one, other] if is_one_kind(Kind::EasyMocap) => {
            let has_lenses = |file: &File| file.node.entries().iter().any(|(name, _)| name.starts_with("K_"));
            let (intri, extri) = if has_lenses(one) { (one, other) } else { (other, one) };
            easymocap::read(path, (&intri.path, &intri.node), Some((&extri.path, &extri.node)))
        }
        several => {
            let names = several.iter().take(10).filter_map(|file| file.path.file_name());
            let names: Vec<String> = names.map(|name| name.to_string_lossy().into_owned()).collect();
            let problem = format!("has several calibrations: {}; give the one that is meant", names.join(", "));
            Err(FileValidator { path }.invalid("folder", problem))
        }
    }
}

/// A calibration that is one file.
fn whole(file: &File) -> Result<FoundCalibration, CaptureError> {
    let File { path, node, kind } = file;
    match kind {
        Kind::Ghand => own(path),
        Kind::Gltf => gltf::read(path, node),
        Kind::Meshroom => meshroom::read(path, node),
        Kind::Kalibr => kalibr::read(path, node),
        Kind::Toml => anipose::read(path, node),
        Kind::EasyMocap => easymocap::read(path, (path, node), None),
        Kind::OpenCv => opencv::read(path, opencv::contents(path, node)?),
    }
}

/// ghand's own cameras.
fn own(path: &Path) -> Result<FoundCalibration, CaptureError> {
    let found = |lens: super::super::list::LensCamera| FoundCamera {
        id: lens.camera.id,
        size: Some([lens.camera.width, lens.camera.height]),
        projection: Projection::Pixels { focal: lens.camera.focal, principal: lens.camera.principal },
        distortion: lens.distortion,
        extrinsics: Some(Rigid { rotation: lens.camera.rotation, translation: lens.camera.translation }),
    };
    let cameras = super::super::list::read_own_cameras(path)?.into_iter().map(found).collect();
    FoundCalibration::checked(path, CalibrationFormat::Ghand, LengthUnit::Metre, cameras, vec![])
}

/// What a file holds before its meaning is known.
enum Content {
    DatFile,
    Tree(Node),
    /// Other text, with the parser's problem.
    Unreadable(String),
}

fn content(path: &Path) -> Result<Content, CaptureError> {
    let io = |source| CaptureError::Io {
        path: path.into(),
        action: "read the cameras",
        source,
        remedy: "give a calibration of another tool, or a capture.json",
    };
    let mut head = [0; 4];
    let mut file = input_file::open(path).map_err(io)?;
    if std::io::Read::read_exact(&mut file, &mut head).is_ok() && gltf::recognises_bytes(&head) {
        return gltf::node_of_glb(path).map(Content::Tree);
    }
    let bytes = input_file::read(path, LARGEST_FILE).map_err(io)?.ok_or_else(|| {
        let problem = format!("is larger than {} MiB; give the calibration alone", LARGEST_FILE >> 20);
        FileValidator { path }.invalid("file", problem)
    })?;
    let text = text_of(path, bytes)?;
    if dat_files::recognises(&text) {
        return Ok(Content::DatFile);
    }
    Ok(Node::parse(&text).map_or_else(Content::Unreadable, Content::Tree))
}

fn recognised(path: &Path, content: Content) -> Result<Option<File>, CaptureError> {
    match content {
        Content::Tree(node) => Ok(kind(path, &node).map(|kind| File { path: path.into(), node, kind })),
        Content::Unreadable(problem) => Err(FileValidator { path }.invalid("file", problem)),
        Content::DatFile => Ok(None),
    }
}

/// The file that has the places of a file's lenses, or the other way round, by their names.
fn sibling(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let swapped = [("intri", "extri"), ("extri", "intri")].iter().find(|(own, _)| name.contains(own));
    let other = path.with_file_name(swapped.map(|(own, other)| name.replacen(own, other, 1))?);
    other.is_file().then_some(other)
}

/// Names of the files of a folder, sorted.
fn names(folder: &Path) -> Result<Vec<String>, CaptureError> {
    let io = |source| CaptureError::Io {
        path: folder.into(),
        action: "read the cameras",
        source,
        remedy: "give the folder of a calibration",
    };
    let entries = std::fs::read_dir(folder).map_err(io)?;
    let names = entries.take(MOST_ENTRIES).flatten().filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.collect();
    names.sort_by(|one, other| (one.len(), one).cmp(&(other.len(), other)));
    Ok(names)
}

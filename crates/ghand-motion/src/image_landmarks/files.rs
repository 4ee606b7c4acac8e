//! Files and folders of trackers: recognised from their contents, one for all cameras or one for each.

use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use ghand_core::Side;
use ghand_files::input_file;
use ghand_files::value::{Value, ValueError};
use glam::DVec3;

use super::view::{Content, Problem, View, Views};
use super::{ImageFrame, MEDIAPIPE_BESIDE, MEDIAPIPE_TIP_INSET, arrays, mediapipe, openpose, tables};
use crate::PoseError;
use crate::pose_sequence::formats::image_landmarks as own;

/// Most bytes of a table.
const LARGEST_TABLE: u64 = 1 << 29;
/// Most bytes of a table's first line that are looked at.
const LONGEST_HEADER: u64 = 1 << 16;
/// Most files of a folder.
const MOST_FILES: usize = 1_000_000;
/// Endings of files of landmarks in a folder.
const ENDINGS: [&str; 9] = ["json", "jsonl", "csv", "tsv", "npy", "npz", "pkl", "pt", "joblib"];
/// No landmark in pixels is as near to the corner; metres and fractions are.
const LEAST_PIXEL: f64 = 3.0;

/// Landmarks of one hand in images, from files.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageLandmarks {
    /// The frames, those without a hand, too; their ids are numbers, unless the file has names.
    pub frames: Vec<ImageFrame>,
    /// Frames per second, if a file says.
    pub fps: Option<f64>,
    /// How far landmarks of fingertips lie before the ends of the fingers, metres: for [`super::fit_hand`].
    pub tip_inset: f64,
    /// Landmarks of the palm that lie beside their joints, as in [`super::FitOptions`]: MediaPipe's, if the files are surely
    /// from it.
    pub beside: &'static [(usize, DVec3)],
    /// What the user should know, one sentence each.
    pub remarks: Vec<String>,
}

/// Reads the landmarks of a hand in images that trackers wrote; `docs/poses.md` lists the layouts. `paths` are one file or
/// folder for all cameras, or one for each: those whose names have the cameras' ids, else in the order of the cameras.
///
/// # Errors
/// [`PoseError`] names the file, the field and a remedy: a file is not of a known layout or is damaged, its cameras are not
/// those of `camera_ids`, or it has no such hand.
pub fn read_image_landmarks(paths: &[PathBuf], camera_ids: &[String], side: Side) -> Result<ImageLandmarks, PoseError> {
    let mut parts = vec![];
    for path in paths {
        for path in expanded(path)? {
            let content = content(&path, camera_ids.len(), side)?;
            parts.push((path, content));
        }
    }
    combined(parts, camera_ids)
}

/// The landmarks of a path that is surely of images, for readers of poses; `None` for others, and for ghand's own files.
pub(crate) fn surely_of_images(
    path: &Path,
    camera_ids: &[String],
    side: Side,
) -> Option<Result<ImageLandmarks, PoseError>> {
    let is_of_images = if path.is_dir() {
        expanded(path).is_ok_and(|paths| paths.iter().any(|path| !openpose_files(path).is_empty()))
    } else if let Ok(Some(bytes)) = input_file::read(path, LARGEST_TABLE) {
        tables::recognises(&bytes)
            || Value::from_bytes(&bytes).is_ok_and(|value| {
                let is_own = own::frames(&path.display().to_string(), &value).is_some();
                !is_own && of_value(&value, side, camera_ids.len()).is_some_and(|found| is_in_pixels(&value, &found))
            })
    } else {
        false
    };
    is_of_images.then(|| read_image_landmarks(&[path.to_path_buf()], camera_ids, side))
}

/// Whether a path is a table of such landmarks, which need cameras.
pub(crate) fn is_table(path: &Path) -> bool {
    let mut head = vec![];
    let read = input_file::open(path).and_then(|file| file.take(LONGEST_HEADER).read_to_end(&mut head));
    read.is_ok() && tables::recognises(&head)
}

/// Arrays of three numbers may be places in metres.
fn is_in_pixels(value: &Value, found: &Result<Content, Problem>) -> bool {
    let is_named = value.numbers().is_none() && value.entries().iter().all(|(_, value)| value.numbers().is_none());
    let Ok(content) = found else { return true };
    let views = match &content.views {
        Views::One(view) => std::slice::from_ref(view),
        Views::All(_) => return true,
        Views::Named(_) => return false,
    };
    let mut points = views.iter().flat_map(View::values).flatten().flatten();
    is_named || points.any(|point| point.at.abs().max_element() > LEAST_PIXEL)
}

/// A path, or the parts of a folder: one for each camera.
fn expanded(path: &Path) -> Result<Vec<PathBuf>, PoseError> {
    if !path.is_dir() || !openpose_files(path).is_empty() {
        return Ok(vec![path.into()]);
    }
    let entries = listing(path);
    let folders: Vec<PathBuf> = entries.iter().filter(|path| path.is_dir()).cloned().collect();
    let of_openpose: Vec<PathBuf> = folders.into_iter().filter(|folder| !openpose_files(folder).is_empty()).collect();
    if !of_openpose.is_empty() {
        return Ok(of_openpose);
    }
    let is_landmarks = |path: &&PathBuf| {
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
        path.is_file() && ENDINGS.contains(&ending.as_str())
    };
    let files: Vec<PathBuf> = entries.iter().filter(is_landmarks).cloned().collect();
    if files.is_empty() {
        let text =
            "has neither files of landmarks (JSON, CSV, .npy, .npz) nor OpenPose's *_keypoints.json; give the files";
        return Err(invalid(path, "folder", text));
    }
    Ok(files)
}

/// What is in a folder, in the order of the names.
fn listing(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().take(MOST_FILES);
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    paths
}

/// The files of OpenPose in a folder.
fn openpose_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = if folder.is_dir() { listing(folder) } else { vec![] };
    files.retain(|path| path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(openpose::FILE_ENDING)));
    files
}

fn invalid(path: &Path, field: &str, problem: impl Into<String>) -> PoseError {
    PoseError::Invalid { origin: path.display().to_string(), field: field.into(), problem: problem.into() }
}

fn content(path: &Path, cameras: usize, side: Side) -> Result<Content, PoseError> {
    let named = |(field, problem): Problem| invalid(path, &field, problem);
    let failed = |path: &Path| {
        let path = path.to_path_buf();
        move |source: ValueError| PoseError::File { path, source }
    };
    if path.is_dir() {
        let mut view = View::new();
        for (row, file) in (0..).zip(openpose_files(path)) {
            let value = Value::read(&file).map_err(failed(&file))?;
            let points =
                openpose::landmarks(&value, side).map_err(|(field, problem)| invalid(&file, &field, problem))?;
            view.insert(frame_number(&file).unwrap_or(row), points);
        }
        return Ok(Content::new(Views::One(view), 0.0));
    }
    let bytes = input_file::read(path, LARGEST_TABLE).map_err(|error| failed(path)(ValueError::Io(error)))?;
    let Some(bytes) = bytes else {
        return Err(invalid(path, "file", format!("is larger than {} MiB; cut it into parts", LARGEST_TABLE >> 20)));
    };
    if tables::recognises(&bytes) {
        return tables::read(&bytes, side).map_err(named);
    }
    let value = Value::from_bytes(&bytes).map_err(failed(path))?;
    if let Some(found) = own::frames(&path.display().to_string(), &value) {
        let found = found?;
        if found.side.is_some_and(|own| own != side) {
            return Err(invalid(path, "side", format!("is of the other hand; give landmarks of the {side} hand")));
        }
        let fps = value.get("fps").and_then(Value::number);
        let is_mediapipe = found.is_mediapipe;
        return Ok(Content { fps, is_mediapipe, ..Content::new(Views::Named(found.frames), found.tip_inset) });
    }
    let text = format!(
        "is {}, which is not a known layout of landmarks in images; docs/poses.md lists them: MediaPipe's, OpenPose's, \
         InterHand2.6M's, tables of DeepLabCut and anipose, arrays (T, cameras, 21, 2 or 3)",
        value.kind()
    );
    of_value(&value, side, cameras).unwrap_or(Err(("content".into(), text))).map_err(named)
}

fn of_value(value: &Value, side: Side, cameras: usize) -> Option<Result<Content, Problem>> {
    openpose::read(value, side)
        .or_else(|| mediapipe::read(value, side))
        .or_else(|| arrays::read(value, side, cameras))
        .map(|content| {
            content.map(|content| Content { fps: content.fps.or(value.get("fps").and_then(Value::number)), ..content })
        })
}

/// The number in the name of a file of OpenPose.
fn frame_number(path: &Path) -> Option<u64> {
    let name = path.file_name()?.to_string_lossy().into_owned();
    let stem = name.strip_suffix(openpose::FILE_ENDING)?;
    let start = stem.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| at + 1);
    stem.get(start..)?.parse().ok()
}

/// The parts as frames of all cameras.
fn combined(parts: Vec<(PathBuf, Content)>, camera_ids: &[String]) -> Result<ImageLandmarks, PoseError> {
    let Some((first, _)) = parts.first() else {
        return Err(invalid(Path::new("landmarks"), "files", "there are none; give at least one"));
    };
    let first = first.clone();
    let ids = ids_of_parts(&parts, camera_ids)?;
    let mut all = Frames::default();
    let mut result =
        ImageLandmarks { frames: vec![], fps: None, tip_inset: MEDIAPIPE_TIP_INSET, beside: &[], remarks: vec![] };
    for (number, ((path, content), id)) in parts.into_iter().zip(ids).enumerate() {
        let beside: &[(usize, DVec3)] = if content.is_mediapipe { &MEDIAPIPE_BESIDE } else { &[] };
        if number > 0 && (content.tip_inset != result.tip_inset || beside != result.beside) {
            return Err(invalid(
                &path,
                "content",
                "is of another kind of tracker than the files before it; give one kind",
            ));
        }
        result.tip_inset = content.tip_inset;
        result.beside = beside;
        result.fps = result.fps.or(content.fps);
        result.remarks.extend(content.remarks.into_iter().map(|remark| format!("{}: {remark}", path.display())));
        match content.views {
            Views::One(view) => all.add(&id.unwrap_or_default(), view),
            Views::All(views) => camera_ids.iter().zip(views).for_each(|(id, view)| all.add(id, view)),
            Views::Named(frames) => frames.into_iter().for_each(|frame| all.add_frame(frame)),
        }
    }
    result.frames = all.sorted();
    if result.frames.iter().flat_map(|frame| &frame.cameras).all(|(_, points)| points.iter().all(Option::is_none)) {
        return Err(invalid(
            &first,
            "landmarks",
            "there are none of this hand; give the other side, or track it again",
        ));
    }
    Ok(result)
}

/// The camera of each part that is of one camera.
fn ids_of_parts(parts: &[(PathBuf, Content)], camera_ids: &[String]) -> Result<Vec<Option<String>>, PoseError> {
    let single: Vec<&PathBuf> =
        parts.iter().filter(|(_, content)| matches!(content.views, Views::One(_))).map(|(path, _)| path).collect();
    let by_name: Vec<Option<&String>> = single.iter().map(|path| id_in_name(path, camera_ids)).collect();
    let is_unique = by_name.iter().all(|id| id.is_some() && by_name.iter().filter(|other| *other == id).count() == 1);
    let mut ids: Vec<String> = match &single[..] {
        _ if is_unique => by_name.into_iter().flatten().cloned().collect(),
        paths if paths.len() == camera_ids.len() => camera_ids.to_vec(),
        [path, ..] => {
            let cameras = camera_ids.join(", ");
            let text = format!(
                "is of one camera, and there are {} such files for {} cameras ({cameras}); give one for each, in this order, \
                 or with the camera's id in its name",
                single.len(),
                camera_ids.len()
            );
            return Err(invalid(path, "cameras", text));
        }
        [] => vec![],
    };
    ids.reverse();
    let mut next = |content: &Content| matches!(content.views, Views::One(_)).then(|| ids.pop()).flatten();
    Ok(parts.iter().map(|(_, content)| next(content)).collect())
}

/// The longest id of a camera that is a word, or several, of a file's name.
fn id_in_name<'a>(path: &Path, camera_ids: &'a [String]) -> Option<&'a String> {
    let name = path.file_name()?.to_string_lossy().into_owned();
    let is_word = |id: &&String| {
        name.match_indices(id.as_str()).any(|(at, found)| {
            let before = name[..at].chars().next_back();
            let after = name[at + found.len()..].chars().next();
            // A number goes on with a digit, a word with a letter: DeepLabCut writes `cam1DLC_resnet50`.
            let goes_on = |a: Option<char>, b: Option<char>| {
                a.zip(b).is_some_and(|(a, b)| {
                    [a, b].iter().all(char::is_ascii_digit) || [a, b].iter().all(|c| c.is_alphabetic())
                })
            };
            !id.is_empty() && !goes_on(before, found.chars().next()) && !goes_on(found.chars().next_back(), after)
        })
    };
    camera_ids.iter().filter(is_word).max_by_key(|id| id.len())
}

/// Frames by their ids.
#[derive(Default)]
struct Frames {
    frames: Vec<ImageFrame>,
    places: HashMap<String, usize>,
}

impl Frames {
    fn add(&mut self, camera: &str, view: View) {
        for (number, points) in view {
            let cameras = match points.iter().all(Option::is_none) {
                true => vec![],
                false => vec![(camera.to_owned(), points)],
            };
            self.add_frame(ImageFrame { id: format!("{number:04}"), cameras });
        }
    }

    fn add_frame(&mut self, frame: ImageFrame) {
        match self.places.get(&frame.id).and_then(|place| self.frames.get_mut(*place)) {
            Some(known) => known.cameras.extend(frame.cameras),
            None => {
                self.places.insert(frame.id.clone(), self.frames.len());
                self.frames.push(frame);
            }
        }
    }

    /// In the order of their numbers, if all have one.
    fn sorted(mut self) -> Vec<ImageFrame> {
        let number = |frame: &ImageFrame| frame.id.parse::<u64>().ok();
        if self.frames.iter().all(|frame| number(frame).is_some()) {
            self.frames.sort_by_key(number);
        }
        self.frames
    }
}

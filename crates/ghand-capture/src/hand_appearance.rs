//! Subjects of the Hand Appearance dataset (Karunratanakul et al., HARP, CVPR 2023): one phone camera, one right hand.
//!
//! `{subject}/{1..9}/unscreen_cropped/%04d.jpg` over white with `mask/%04d_mask.jpg` and
//! `metro_mano_smooth/%04d_mano.pkl`, or `metro_mano/` for poses that were not smoothed. Sequences 1 to 5 train, 6 to 9
//! test. Images have 448 x 448 pixels and a focal length of 2000.
//!
//! A frame's pickle holds MANO's `rot` (3), `pose` (45, without its mean), `shape` (10) and `trans` (m), `joints` (mm),
//! and the weak-perspective `cam` (scale, x, y), which moves the hand by (x, y, 2 f / (448 scale)) in camera axes. Here
//! the camera is fixed and the hand's translation includes both. The fits used MANO alone or with an arm, whose `trans`
//! refers to another point. `joints` has the wrist's position in both cases and is used if present.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use ghand_core::pose::{PoseRangeError, check_shape_range};
use ghand_core::posing::shape_hand;
use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_files::input_file;
use ghand_hand_model::HandModelError;
use ghand_hand_model::files::mano::{NamedArrays, PARENTS};
use glam::{DMat3, DVec2, DVec3};

use crate::capture::{Capture, Frame, HandModelSource, ImagePaths, Split, mean_shaped};
use crate::error::CaptureError;
use crate::images::skipped::{SkipReason, SkippedImages};
use crate::reading::validation::FileValidator;

/// Sequences of a subject, and the last that trains.
const SEQUENCES: std::ops::RangeInclusive<u32> = 1..=9;
const LAST_TRAINING: u32 = 5;
/// Width and height of the images, pixels.
const SIZE: u32 = 448;
/// Focal length, pixels.
const FOCAL: f64 = 2000.0;
/// Folders of poses, in order of preference.
const POSE_FOLDERS: [&str; 2] = ["metro_mano_smooth", "metro_mano"];
const POSE_SUFFIX: &str = "_mano.pkl";
/// Largest pickle of a frame: 778 vertices and a few more numbers take about 30 kB.
const LARGEST_POSE: u64 = 1 << 24;
/// Most frames of a subject; there are about 3000.
const MOST_FRAMES: usize = 1 << 18;
const REMEDY: &str = "download the subject again";

/// Whether a folder is a subject.
pub(crate) fn is_subject(path: &Path) -> bool {
    SEQUENCES.into_iter().any(|s| pose_folder(&path.join(s.to_string())).is_some())
}

fn pose_folder(sequence: &Path) -> Option<PathBuf> {
    POSE_FOLDERS.iter().map(|name| sequence.join(name)).find(|folder| folder.is_dir())
}

/// Reads a subject. No image is read. `principal` is the principal point, by default the middle of the image.
///
/// # Errors
/// [`CaptureError`] names the file, the field and what to do.
pub(crate) fn read_hand_appearance(
    root: &Path,
    mano: Option<&HandModel>,
    principal: Option<DVec2>,
) -> Result<(Capture, SkippedImages), CaptureError> {
    let validator = FileValidator { path: root };
    let model = check_model(&validator, mano)?;
    let principal = principal.unwrap_or(DVec2::splat(f64::from(SIZE) / 2.0));
    if !principal.is_finite() {
        return Err(validator.invalid("principal point", "is not finite; give pixels, such as 224,224"));
    }
    let camera = Camera {
        id: "phone".into(),
        width: SIZE,
        height: SIZE,
        focal: DVec2::splat(FOCAL),
        principal,
        rotation: DMat3::IDENTITY,
        translation: DVec3::ZERO,
    };
    let mut capture = Capture {
        root: root.into(),
        side: Side::Right,
        background: [1.0; 3],
        hand_model: model.clone(),
        hand_model_source: HandModelSource::Mano,
        template: model.clone(),
        cameras: vec![camera],
        frames: vec![],
        images: ImagePaths::plain(
            "{sequence}/unscreen_cropped/{number}.jpg",
            Some("{sequence}/mask/{number}_mask.jpg"),
        ),
        distortion: vec![],
        color_correction: Default::default(),
        splits: BTreeMap::new(),
        truth: None,
    };
    let mut counts = SkippedImages::default();
    let mut of_use = [vec![], vec![]];
    for sequence in SEQUENCES {
        let Some(folder) = pose_folder(&root.join(sequence.to_string())) else { continue };
        for (number, file) in pose_files(&folder)? {
            let index = capture.frames.len();
            if index >= MOST_FRAMES {
                return Err(validator.invalid("frames", format!("are more than {MOST_FRAMES}; {REMEDY}")));
            }
            capture.frames.push(read_frame(&file, format!("{sequence}/{number}"), model)?);
            let mask = capture.mask_file(0, index)?;
            let there = capture.image_file(0, index)?.is_file() && mask.is_some_and(|mask| mask.is_file());
            counts.add((!there).then_some(SkipReason::Missing));
            if there {
                of_use[usize::from(sequence > LAST_TRAINING)].push((0, index));
            }
        }
    }
    capture.template =
        mean_shaped(model, &capture.frames).map_err(|source| CaptureError::HandModel { path: root.into(), source })?;
    for (name, pairs, sequences) in [("train", &of_use[0], "1 to 5"), ("test", &of_use[1], "6 to 9")] {
        if pairs.is_empty() {
            let problem = format!("sequences {sequences} have no images with masks and poses ({counts}); {REMEDY}");
            return Err(validator.invalid(name, problem));
        }
        capture.splits.insert(name.into(), Split::of_pairs(pairs.iter().copied()));
    }
    Ok((capture, counts))
}

fn check_model<'a>(validator: &FileValidator, mano: Option<&'a HandModel>) -> Result<&'a HandModel, CaptureError> {
    let Some(model) = mano else {
        let problem = "the poses are MANO's: give your own MANO_RIGHT.pkl with --hand-model";
        return Err(validator.invalid("hand_model", problem));
    };
    if model.parents != PARENTS || model.pose_space.is_none() || model.side != Side::Right {
        let problem = format!("{} is not a MANO model of a right hand; give MANO_RIGHT.pkl as downloaded", model.name);
        return Err(validator.invalid("hand_model", problem));
    }
    Ok(model)
}

/// Files of poses with their numbers as text, in numerical order.
fn pose_files(folder: &Path) -> Result<Vec<(String, PathBuf)>, CaptureError> {
    let io = |source| CaptureError::Io { path: folder.into(), action: "list the poses", source, remedy: REMEDY };
    let mut files = vec![];
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let number = path.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_suffix(POSE_SUFFIX));
        if let Some(number) = number.filter(|n| !n.is_empty() && n.bytes().all(|b| b.is_ascii_digit())) {
            files.push((number.to_owned(), path));
        }
    }
    files.sort_by(|(a, _), (b, _)| (a.len(), a).cmp(&(b.len(), b)));
    Ok(files)
}

fn read_frame(file: &Path, id: String, model: &HandModel) -> Result<Frame, CaptureError> {
    let io = |source| CaptureError::Io { path: file.into(), action: "read the pose", source, remedy: REMEDY };
    let bytes = input_file::read(file, LARGEST_POSE).map_err(io)?.ok_or_else(|| {
        FileValidator { path: file }.invalid("file", format!("is larger than {LARGEST_POSE} bytes; {REMEDY}"))
    })?;
    let (pose, shape) = read_pose(&file.display().to_string(), &bytes, model).map_err(CaptureError::Parameters)?;
    Ok(Frame { id, pose, shape })
}

/// Pose (in camera axes) and shape of a pickle. `model` is MANO's, `origin` the file's name.
///
/// # Errors
/// [`HandModelError::Invalid`] names the array that is missing or wrong.
pub fn read_pose(origin: &str, bytes: &[u8], model: &HandModel) -> Result<(Pose, Vec<f64>), HandModelError> {
    let mut arrays = NamedArrays::open(origin, bytes, REMEDY)?;
    let invalid = |field: &str, problem: String| HandModelError::invalid(origin, field, problem);
    // An array of one row is that row.
    let mut numbers = |name: &str, count: usize| {
        let array = arrays.numbers(name)?;
        let shape: Vec<usize> = array.shape.iter().copied().skip_while(|n| *n == 1).collect();
        if shape != [count] {
            let problem = format!("has the shape {:?}, expected {count} numbers; {REMEDY}", array.shape);
            return Err(invalid(name, problem));
        }
        Ok(array.values)
    };
    let vectors =
        |values: Vec<f64>| -> Vec<DVec3> { values.as_chunks().0.iter().map(|v| DVec3::from_array(*v)).collect() };
    let mut rotations = vectors(numbers("rot", 3)?);
    rotations.extend(vectors(numbers("pose", 45)?));
    let mean = model.pose_space.as_ref().map_or(&[][..], |space| &space.mean);
    rotations.iter_mut().skip(1).zip(mean).for_each(|(r, mean)| *r += *mean);
    let shape = numbers("shape", 10)?;
    let trans = DVec3::from_slice(&numbers("trans", 3)?);
    let cam = numbers("cam", 3)?;
    let hand_from_wrist = shape_hand(model, &shape)?.joints.first().copied().unwrap_or(DVec3::ZERO);
    let translation = match first_joint(&mut arrays, origin)? {
        Some(wrist) => wrist / 1000.0 - hand_from_wrist,
        None => trans,
    };
    let [scale, x, y] = cam[..] else { return Err(invalid("cam", format!("has too few numbers; {REMEDY}"))) };
    // Numbers of arrays are finite.
    if scale <= 0.0 {
        return Err(invalid("cam", format!("has the scale {scale}, which must be positive; {REMEDY}")));
    }
    let moved = DVec3::new(x, y, 2.0 * FOCAL / (f64::from(SIZE) * scale + 1e-9));
    let pose = Pose { rotations, translation: translation + moved };
    pose.check_range(&model.joint_names).and_then(|()| check_shape_range(&shape)).map_err(|error| {
        let field = match error {
            PoseRangeError::Rotation { .. } => "pose",
            PoseRangeError::Translation { .. } => "joints, trans or cam",
            PoseRangeError::Shape { .. } => "shape",
        };
        invalid(field, error.to_string())
    })?;
    Ok((pose, shape))
}

/// The wrist of `joints`, millimetres, if present.
fn first_joint(arrays: &mut NamedArrays, origin: &str) -> Result<Option<DVec3>, HandModelError> {
    if !arrays.contains("joints") {
        return Ok(None);
    }
    let joints = arrays.numbers("joints")?;
    match (joints.shape.as_slice(), joints.values.first_chunk::<3>()) {
        ([.., _, 3], Some(wrist)) => Ok(Some(DVec3::from_array(*wrist))),
        _ => Err(HandModelError::invalid(
            origin,
            "joints",
            format!("has the shape {:?}, expected (21, 3); {REMEDY}", joints.shape),
        )),
    }
}

//! InterHand2.6M (Moon et al., ECCV 2020), v1.0, 5 frames per second, as downloaded, with HandAvatar's choice of
//! images.
//!
//! `images/{subset}/Capture{c}/{sequence}/cam{camera}/image{frame}.jpg` beside
//! `annotations/{subset}/InterHand2.6M_{subset}_{data,camera,MANO_NeuralAnnot,joint_3d}.json`; the images may also be
//! in `InterHand2.6M_5fps_batch1/`, as they do after unpacking. The annotations of a subset have several hundred
//! megabytes: they are streamed but for the cameras, and only entries of the wanted sequences are kept.
//!
//! Lengths become metres. A camera has `x_camera = R (x_world - position)`. A pose is MANO's with the model's mean pose
//! added: the root turns about the wrist's joint, and `trans` is added last, as in [`ghand_core::posing::pose_hand`].

mod annotations;
mod images;
mod joints;
mod location;
mod poses;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use ghand_core::{Camera, HandModel, Pose, Side};
use ghand_hand_model::files::mano::PARENTS;
use glam::{DMat3, DVec2, DVec3};

use crate::cameras::sampling::farthest_point_sampling;
use crate::capture::{Capture, Frame, HandModelSource, ImagePaths, Split, mean_shaped};
use crate::error::CaptureError;
use crate::images::skipped::{SkipReason, SkippedImages};
use crate::mask::{MadeMasks, MaskMethod};
use crate::reading::opened::{CaptureKind, Opened};
use crate::reading::validation::{CameraEntry, FileValidator, JointRows, Position};
use crate::truth::{TRUTH_FILE, read_truth};
use annotations::CameraTables;
use images::{Image, Images};
pub(crate) use location::{Location, locate};

/// Stride of the images in the split `test`, as in HandAvatar; `test_all` has all of them.
const TEST_STRIDE: usize = 200;
/// Numbers of cameras of the sparse training splits, chosen by farthest-point sampling.
const SPARSE: [usize; 2] = [5, 20];
/// Least distance of the hand's box from the border, pixels.
const BORDER: f64 = 10.0;
/// Least length of the longer side of the hand's box, pixels.
const LEAST_SIDE: f64 = 80.0;

/// The sequences to read; by default those of the hand model's side.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Sequences {
    pub train: Vec<String>,
    pub test: Vec<String>,
}

impl Sequences {
    /// HandAvatar's choice if nothing is chosen.
    fn or_default(&self, side: Side) -> Sequences {
        let word = if side == Side::Right { "RT" } else { "LT" };
        let or = |given: &[String], name: String| if given.is_empty() { vec![name] } else { given.to_vec() };
        Sequences {
            train: or(&self.train, format!("ROM04_{word}_Occlusion")),
            test: or(&self.test, format!("ROM03_{word}_No_Occlusion")),
        }
    }
}

/// Reads one capture of one subset. No image is read: [`Capture::skip_unusable_images`] finds images with unusable
/// content.
///
/// # Errors
/// [`CaptureError`] names the file, the field or position, and what to do.
pub(crate) fn read_interhand(
    location: &Location,
    mano: Option<&HandModel>,
    sequences: &Sequences,
) -> Result<Opened, CaptureError> {
    let model = check_model(location, mano)?;
    let sequences = sequences.or_default(model.side);
    let names: Vec<String> = sequences.train.iter().chain(&sequences.test).cloned().collect();
    let tables = annotations::read_cameras(&location.annotation("camera"), &location.capture)?;
    let data_file = location.annotation("data");
    let images = images::read_images(&data_file, &location.capture, &names)?;
    let validator = FileValidator { path: &data_file };
    for wanted in &names {
        validator.id("sequences", wanted)?;
        if !images.sequences.contains(wanted) {
            let known: Vec<&str> = images.sequences.iter().map(String::as_str).collect();
            let problem = format!(
                "Capture{} has no sequence {wanted:?}; choose with --train-sequences and --test-sequences among: {}",
                location.capture,
                known.join(", ")
            );
            return Err(validator.invalid("images", problem));
        }
    }
    let poses =
        poses::read_poses(&location.annotation("MANO_NeuralAnnot"), &location.capture, model, &images.frame_numbers())?;
    let warning = joints::warning(&location.annotation("joint_3d"), &location.capture, model, &poses)?;

    let cameras = cameras(&location.annotation("camera"), &tables, &images)?;
    let paths = paths(location);
    // Frames in the order of their sequences and numbers.
    let mut frames: Vec<Frame> = vec![];
    let mut frame_index: BTreeMap<(usize, u64), usize> = BTreeMap::new();
    for key in images.all.iter().map(Image::frame).collect::<BTreeSet<_>>() {
        if let (Some(posed), Some(name)) = (poses.get(&key.1), names.get(key.0)) {
            frame_index.insert(key, frames.len());
            frames.push(Frame { id: format!("{name}/{}", key.1), ..posed.clone() });
        }
    }
    let template = mean_shaped(model, &frames)
        .map_err(|source| CaptureError::HandModel { path: location.root.clone(), source })?;
    let mut capture = Capture {
        root: location.root.clone(),
        side: model.side,
        background: [0.0; 3],
        hand_model: model.clone(),
        hand_model_source: HandModelSource::Mano,
        template,
        cameras,
        images: paths,
        splits: BTreeMap::new(),
        distortion: vec![],
        color_correction: Default::default(),
        truth: truth(&location.root.join(TRUTH_FILE), &frames, &model.joint_names)?,
        frames,
    };
    let camera_index: Vec<Option<usize>> = images.cameras.iter().map(|id| capture.camera_index(id)).collect();
    let mut counts = SkippedImages::default();
    let mut of_use: [Vec<(usize, usize)>; 2] = [vec![], vec![]];
    for image in &images.all {
        let camera = camera_index.get(image.camera).copied().flatten();
        let pair = choose(&capture, image, camera, frame_index.get(&image.frame()).copied())?;
        counts.add(pair.err());
        if let Ok(pair) = pair {
            of_use[usize::from(image.sequence >= sequences.train.len())].push(pair);
        }
    }
    let [train, test] = of_use;
    capture.splits = splits(&capture.cameras, train, test);
    for needed in ["train", "test"] {
        if capture.split(needed)?.views.is_empty() {
            let problem =
                format!("no images are left in split {needed:?}: {counts}; check that images and annotations match");
            return Err(validator.invalid("images", problem));
        }
    }
    Ok(Opened {
        kind: CaptureKind::InterHand,
        capture,
        skipped_images: counts,
        warnings: warning.into_iter().collect(),
    })
}

/// Exact poses of the frames, if they are known; the file may have more frames.
fn truth(path: &Path, frames: &[Frame], joints: &[String]) -> Result<Option<Vec<Option<Pose>>>, CaptureError> {
    let order: Vec<usize> = (0..PARENTS.len()).collect();
    let joints = JointRows { order: &order, names: joints };
    let Some(poses) = read_truth(path, joints)? else { return Ok(None) };
    let mut poses: HashMap<String, Pose> = poses.into_iter().collect();
    Ok(Some(frames.iter().map(|frame| poses.remove(&frame.id)).collect()))
}

/// A MANO model with the data that the annotations need.
fn check_model<'a>(location: &Location, mano: Option<&'a HandModel>) -> Result<&'a HandModel, CaptureError> {
    let validator = FileValidator { path: &location.root };
    let Some(model) = mano else {
        let problem = "the poses are MANO's: give your own MANO_RIGHT.pkl (or MANO_LEFT.pkl, for the left hand) with \
                       --hand-model";
        return Err(validator.invalid("hand_model", problem));
    };
    if model.parents != PARENTS || model.shape_count() < poses::SHAPES || model.pose_space.is_none() {
        let problem = format!(
            "{} is not a MANO model of 16 joints, 10 shapes and a mean pose; give MANO_RIGHT.pkl or MANO_LEFT.pkl as \
             downloaded",
            model.name
        );
        return Err(validator.invalid("hand_model", problem));
    }
    Ok(model)
}

fn paths(location: &Location) -> ImagePaths {
    let below = format!("{}/Capture{}/{{sequence}}/cam{{camera}}/image{{number}}", location.subset, location.capture);
    let masks = location.images.replace("images", "masks_removeblack");
    let place = Path::new(&location.subset).join(format!("Capture{}", location.capture));
    ImagePaths {
        image: format!("{}/{below}.jpg", location.images),
        mask: Some(format!("{masks}/{below}.png")),
        other_hands: None,
        made_masks: Some(MadeMasks::new(MaskMethod::Outline, location.root.clone(), place)),
        aligned: None,
    }
}

/// The cameras that have images, by id.
fn cameras(file: &Path, tables: &CameraTables, images: &Images) -> Result<Vec<Camera>, CaptureError> {
    let validator = FileValidator { path: file };
    let mut cameras = vec![];
    for (id, size) in images.cameras.iter().zip(&images.camera_sizes) {
        let entries = (tables.campos.get(id), tables.camrot.get(id), tables.focal.get(id), tables.princpt.get(id));
        let (Some(Some(position)), Some(Some(rotation)), Some(Some(focal)), Some(Some(principal))) = entries else {
            continue;
        };
        validator.id("campos", id)?;
        // The file holds rows, glam columns; millimetres become metres.
        let rotation = DMat3::from_cols_array_2d(&rotation.map(|row| row.0)).transpose();
        cameras.push(validator.camera(&CameraEntry {
            id,
            field: format!("cameras[{id:?}]"),
            size: *size,
            focal: DVec2::from(focal.0),
            principal: DVec2::from(principal.0),
            rotation,
            position: Position::Center(DVec3::from(position.0) / 1000.0),
        })?);
    }
    cameras.sort_by(|a, b| a.id.cmp(&b.id));
    Ok(cameras)
}

/// Camera and frame of an image, or why its annotations make it unusable.
fn choose(
    capture: &Capture,
    image: &Image,
    camera: Option<usize>,
    frame: Option<usize>,
) -> Result<Result<(usize, usize), SkipReason>, CaptureError> {
    if image.side != Some(capture.side) {
        return Ok(Err(SkipReason::OtherHand));
    }
    let Some(frame) = frame else { return Ok(Err(SkipReason::NoPose)) };
    let Some(camera) = camera else { return Ok(Err(SkipReason::NoCamera)) };
    let Some([x, y, width, height]) = image.bounds else { return Ok(Err(SkipReason::Small)) };
    let right = f64::from(image.size[0]) - BORDER;
    let bottom = f64::from(image.size[1]) - BORDER;
    if !(x >= BORDER && y >= BORDER && x + width <= right && y + height <= bottom) {
        return Ok(Err(SkipReason::AtBorder));
    }
    if width.max(height) < LEAST_SIDE {
        return Ok(Err(SkipReason::Small));
    }
    if capture.cameras.get(camera).is_none_or(|c| [c.width, c.height] != image.size) {
        return Ok(Err(SkipReason::Broken));
    }
    let there = capture.image_file(camera, frame)?.is_file();
    Ok(if there { Ok((camera, frame)) } else { Err(SkipReason::Missing) })
}

fn splits(cameras: &[Camera], train: Vec<(usize, usize)>, test: Vec<(usize, usize)>) -> BTreeMap<String, Split> {
    let train = Split::of_pairs(train);
    let test = Split::of_pairs(test);
    let mut splits = BTreeMap::new();
    for count in SPARSE {
        let chosen = farthest_point_sampling(cameras, &train.cameras, count);
        splits.insert(format!("train{count}"), train.filtered(|v| chosen.contains(&v.camera)));
    }
    splits.insert("train".into(), train);
    splits.insert("test".into(), test.every(TEST_STRIDE));
    splits.insert("test_all".into(), test);
    splits
}

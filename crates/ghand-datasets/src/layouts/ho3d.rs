//! HO-3D, versions 2 and 3: a sequence is `train/ABF10` with `rgb/0000.jpg` (version 2: png), `meta/0000.pkl` and, in
//! version 3, `seg/0000.png`, where the hand is blue and the object green.
//!
//! - meta: `camMat` (3, 3); `handJoints3D` (21, 3), MANO's joints and then the tips of thumb, index, middle, ring and little
//!   finger, vertices of the skin; `handPose` (48), axis-angle from the flat hand; `handTrans` (3), added to the hand;
//!   `handBeta` (10). Metres, in the axes of OpenGL's camera (y up, looking along -z). `None` where nothing is annotated; in
//!   the evaluation split `handJoints3D` is only the wrist.
//! - All hands are right hands.
//! - The last digit of some sequences is the number of a camera. For these, `calibration/ABF1/calibration` has
//!   `cam_orders.txt`, the cameras' numbers in the order of the other files, and `trans_0.txt`, from the camera (OpenCV's
//!   axes) to a common world, metres. The other cameras' folders then belong to the same capture. Each of them has its own
//!   annotation, which must put the hand where that of the given folder has it, and its own `camMat`.
//!
//! The world is the camera of the given folder.

use std::path::Path;

use ghand_capture::cameras::list::LensCamera;
use ghand_core::Side;
use ghand_files::input_file;
use ghand_hand_model::files::mano::LeftShapes;
use ghand_motion::ik::LANDMARK_COUNT;
use ghand_motion::space_landmarks::MANO_ORDER;
use glam::{DMat3, DVec3};

use super::{IMAGES, above, name, no_images, stems, with_extension};
use crate::DatasetError;
use crate::dataset::Layout;
use crate::fields::{DataFile, Field};
use crate::sequence::{
    Annotated, Fingers, ManoPose, Mask, OPENGL, Place, Rigid, Sequence, View, choose_side, pinhole_of_matrix, points,
};

pub(crate) const LAYOUT: Layout = Layout {
    name: "HO-3D",
    example: "train/ABF10",
    is_sequence: |folder| folder.join("rgb").is_dir() && !stems(&folder.join("meta"), &["pkl"]).is_empty(),
    is_whole: |folder| folder.join("train").is_dir() && folder.join("evaluation").is_dir(),
    read,
};

/// Largest text of a calibration, bytes.
const LARGEST_TEXT: u64 = 1 << 16;
/// A camera whose own annotation puts the hand further from the given folder's is not calibrated with it, metres.
const SAME_HAND: f64 = 0.02;
/// Frames that are compared for this.
const COMPARED: usize = 5;

/// A camera beside the given folder's.
struct Sibling {
    folder: std::path::PathBuf,
    lens: LensCamera,
}

fn read(folder: &Path, side: Option<Side>) -> Result<Sequence, DatasetError> {
    let side = choose_side(side, [true, false], folder)?;
    let mut frames = vec![];
    let mut lens = None;
    let mut without = 0;
    for stem in stems(&folder.join("meta"), &["pkl"]) {
        let Some(view) = view(folder, &stem) else { continue };
        let meta = DataFile::read(&folder.join("meta").join(format!("{stem}.pkl")))?;
        let (Some(joints), Some(k)) = (joints(&meta.root())?, meta.root().find("camMat")) else {
            without += 1;
            continue;
        };
        if lens.is_none() {
            lens = Some(pinhole_of_matrix(&name(folder), view.picture.size()?, &k.numbers(9)?, &Rigid::IDENTITY));
        }
        let mano = mano_pose(&meta.root())?;
        frames.push(Annotated { id: stem, joints: Some(joints), mano, views: vec![Some(view)] });
    }
    let Some(lens) = lens else {
        return Err(if without > 0 {
            let problem =
                "has no joints of the hand; the evaluation split has only the wrist: give a sequence of train";
            DatasetError::file(folder, problem)
        } else {
            no_images(&folder.join("rgb"))
        });
    };
    let mut cameras = vec![lens];
    let mut remarks = vec![];
    for sibling in siblings(folder)? {
        let id = &sibling.lens.camera.id;
        match disagreement(&sibling, &frames)? {
            Some(distance) if distance <= SAME_HAND => {
                for frame in &mut frames {
                    frame.views.push(view(&sibling.folder, &frame.id));
                }
                cameras.push(sibling.lens);
            }
            Some(distance) => remarks.push(format!(
                "{id} is left out: its annotation has the hand {:.0} mm elsewhere than that of {}",
                1e3 * distance,
                name(folder)
            )),
            None => remarks.push(format!("{id} is left out: it has no frame that {} has, too", name(folder))),
        }
    }
    Ok(Sequence { side, cameras, frames, tip_inset: 0.0, left_shapes: LeftShapes::Fixed, remarks })
}

fn view(folder: &Path, stem: &str) -> Option<View> {
    let picture = with_extension(&folder.join("rgb"), stem, &IMAGES)?;
    Some(View::file(picture, with_extension(&folder.join("seg"), stem, &IMAGES).map(Mask::Blue)))
}

/// The joints of a frame in OpenCV's axes of its camera; `None` without any, or with the wrist alone.
fn joints(meta: &Field) -> Result<Option<[DVec3; LANDMARK_COUNT]>, DatasetError> {
    let Some(field) = meta.find("handJoints3D") else { return Ok(None) };
    if field.rows(3)?.len() == 1 {
        return Ok(None);
    }
    let all = points(&field.numbers(63)?);
    Ok(Some(MANO_ORDER.map(|joint| OPENGL.apply(all[joint]))))
}

fn mano_pose(meta: &Field) -> Result<Option<ManoPose>, DatasetError> {
    let (Some(pose), Some(shape), Some(place)) = (meta.find("handPose"), meta.find("handBeta"), meta.find("handTrans"))
    else {
        return Ok(None);
    };
    let pose = pose.numbers(48)?;
    let (root, fingers) = pose.split_at(3);
    Ok(Some(ManoPose {
        root: DVec3::from_slice(root),
        fingers: Fingers::Rotations(fingers.to_vec()),
        from_mean: false,
        shape: shape.numbers(10)?,
        place: Place::Added(place.point()?),
        world_from_mano: OPENGL,
    }))
}

/// The other cameras of a sequence, in the world of its own one.
fn siblings(folder: &Path) -> Result<Vec<Sibling>, DatasetError> {
    let own = name(folder);
    let Some((scene, own_number)) =
        own.char_indices().next_back().and_then(|(at, c)| Some((&own[..at], c.to_digit(10)?)))
    else {
        return Ok(vec![]);
    };
    let calibration = above(folder, 2).join("calibration").join(scene).join("calibration");
    let orders = calibration.join("cam_orders.txt");
    if !orders.is_file() {
        return Ok(vec![]);
    }
    let orders = numbers_of(&orders)?;
    let world_from = |place: usize| rigid(&calibration.join(format!("trans_{place}.txt")));
    let Some(own_place) = orders.iter().position(|number| *number == f64::from(own_number)) else { return Ok(vec![]) };
    let common_from_own = world_from(own_place)?;
    let mut found = vec![];
    for (place, number) in orders.iter().enumerate().filter(|(place, _)| *place != own_place) {
        let folder = above(folder, 1).join(format!("{scene}{number}"));
        let camera_from_world = world_from(place)?.inverse().after(&common_from_own);
        let Some(lens) = own_lens(&folder, &camera_from_world)? else { continue };
        found.push(Sibling { folder, lens });
    }
    Ok(found)
}

/// A camera with the intrinsics of its own annotation: those of the first frame that has an image.
fn own_lens(folder: &Path, camera_from_world: &Rigid) -> Result<Option<LensCamera>, DatasetError> {
    for stem in stems(&folder.join("meta"), &["pkl"]) {
        let Some(view) = view(folder, &stem) else { continue };
        let meta = DataFile::read(&folder.join("meta").join(format!("{stem}.pkl")))?;
        if let Some(k) = meta.root().find("camMat") {
            let size = view.picture.size()?;
            return Ok(Some(pinhole_of_matrix(&name(folder), size, &k.numbers(9)?, camera_from_world)));
        }
    }
    Ok(None)
}

/// How far the joints of a camera's own annotation are from those of the frames, metres: the median of some frames.
fn disagreement(sibling: &Sibling, frames: &[Annotated]) -> Result<Option<f64>, DatasetError> {
    let camera = &sibling.lens.camera;
    let mut distances = vec![];
    for frame in frames {
        let path = sibling.folder.join("meta").join(format!("{}.pkl", frame.id));
        if !path.is_file() || distances.len() == COMPARED {
            continue;
        }
        if let (Some(theirs), Some(ours)) = (joints(&DataFile::read(&path)?.root())?, frame.joints) {
            let off = |(theirs, ours): (&DVec3, &DVec3)| theirs.distance(camera.camera_from_world(*ours));
            distances.push(theirs.iter().zip(&ours).map(off).sum::<f64>() / LANDMARK_COUNT as f64);
        }
    }
    distances.sort_by(f64::total_cmp);
    Ok(distances.get(distances.len() / 2).copied())
}

fn text_of(path: &Path) -> Result<String, DatasetError> {
    let fail = |problem: String| DatasetError::file(path, problem);
    let bytes = input_file::read(path, LARGEST_TEXT).map_err(|error| fail(format!("cannot be read: {error}")))?;
    let text = bytes.and_then(|bytes| String::from_utf8(bytes).ok());
    text.ok_or_else(|| fail("is not a short text; download it again".into()))
}

/// All numbers of a text.
fn numbers_of(path: &Path) -> Result<Vec<f64>, DatasetError> {
    let text = text_of(path)?;
    let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    numbers.map_err(|_| DatasetError::file(path, "must have numbers only; download it again"))
}

/// Four rows of four numbers.
fn rigid(path: &Path) -> Result<Rigid, DatasetError> {
    let numbers = numbers_of(path)?;
    let [a, b, c, x, d, e, f, y, g, h, i, z, ..] = numbers[..] else {
        return Err(DatasetError::file(path, "must have four rows of four numbers; download it again"));
    };
    let rotation = DMat3::from_cols_array(&[a, b, c, d, e, f, g, h, i]).transpose();
    Ok(Rigid { rotation, translation: DVec3::new(x, y, z) })
}

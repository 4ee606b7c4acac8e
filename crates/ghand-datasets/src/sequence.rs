//! A sequence of a data set: what all layouts are read into.

use std::path::{Path, PathBuf};

use ghand_capture::cameras::list::LensCamera;
pub(crate) use ghand_capture::cameras::rigid::Rigid;
use ghand_core::{Camera, Side};
use ghand_hand_model::files::mano::LeftShapes;
use ghand_motion::ik::LANDMARK_COUNT;
use glam::{DMat3, DVec2, DVec3};

use crate::DatasetError;
use crate::warp::Warp;

/// One hand in images of calibrated cameras.
pub(crate) struct Sequence {
    pub side: Side,
    /// OpenCV's axes, metres, centres of pixels at halves.
    pub cameras: Vec<LensCamera>,
    /// Only frames in which the hand is annotated, in order.
    pub frames: Vec<Annotated>,
    /// How far joints of fingertips lie before the ends of the fingers, metres.
    pub tip_inset: f64,
    /// What the shapes of left hands were fitted with.
    pub left_shapes: LeftShapes,
    /// What the user should know, one sentence each.
    pub remarks: Vec<String>,
}

/// One moment.
pub(crate) struct Annotated {
    /// Letters, digits, `-` and `_`.
    pub id: String,
    /// In the world of the cameras, metres, in MediaPipe's order.
    pub joints: Option<[DVec3; LANDMARK_COUNT]>,
    pub mano: Option<ManoPose>,
    /// One for each camera; `None` without an image.
    pub views: Vec<Option<View>>,
}

/// The image of a camera.
#[derive(Clone)]
pub(crate) struct View {
    pub picture: Picture,
    pub mask: Option<Mask>,
    /// How picture and mask become those of the sequence's camera.
    pub warp: Option<Warp>,
}

impl View {
    pub fn file(path: PathBuf, mask: Option<Mask>) -> View {
        View { picture: Picture::File(path), mask, warp: None }
    }
}

/// Where pixels are.
#[derive(Debug, Clone)]
pub(crate) enum Picture {
    File(PathBuf),
    /// A frame of a video, by its number.
    Video(PathBuf, usize),
    /// Bytes of a tar archive.
    Entry {
        archive: PathBuf,
        /// Its name in the archive.
        name: String,
        start: u64,
        length: u64,
    },
}

impl Picture {
    /// The file, for messages.
    pub fn path(&self) -> PathBuf {
        match self {
            Picture::File(path) | Picture::Video(path, _) => path.clone(),
            Picture::Entry { archive, name, .. } => archive.join(name),
        }
    }
}

/// Which pixels are the hand.
#[derive(Debug, Clone)]
pub(crate) enum Mask {
    /// Those that are brighter than half.
    Bright(PathBuf),
    /// Those that are rather blue than red or green.
    Blue(PathBuf),
    /// Those with a label in an array of an `.npz`.
    Label { file: PathBuf, array: &'static str, label: f64 },
}

/// MANO's parameters.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ManoPose {
    /// Of the wrist, axis-angle.
    pub root: DVec3,
    pub fingers: Fingers,
    /// Whether fingers are measured from MANO's mean pose, or from the flat hand.
    pub from_mean: bool,
    pub shape: Vec<f64>,
    pub place: Place,
    /// From MANO's space to the world of the cameras.
    pub world_from_mano: Rigid,
}

/// Rotations of the fingers.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Fingers {
    /// 15 axis-angle vectors, 45 numbers.
    Rotations(Vec<f64>),
    /// Principal components.
    Components(Vec<f64>),
}

/// Where the hand is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Place {
    /// This is added to the hand, whose wrist is where the model has it at rest, not at the origin.
    Added(DVec3),
    /// The joint of this number, in MANO's order, is here.
    Joint(usize, DVec3),
}

/// From OpenGL's camera axes (y up, looking along -z) to OpenCV's, and back.
pub(crate) const OPENGL: Rigid =
    Rigid { rotation: DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)), translation: DVec3::ZERO };

/// A camera without distortion, of intrinsics whose first pixel's centre is at (0, 0), as OpenCV has it.
pub(crate) fn pinhole(
    id: &str,
    size: (u32, u32),
    focal: DVec2,
    opencv_principal: DVec2,
    camera_from_world: &Rigid,
) -> LensCamera {
    let camera = Camera {
        id: id.into(),
        width: size.0,
        height: size.1,
        focal,
        principal: opencv_principal + 0.5,
        rotation: camera_from_world.rotation,
        translation: camera_from_world.translation,
    };
    LensCamera { camera, distortion: None }
}

/// The same of a matrix K of nine numbers, row by row.
pub(crate) fn pinhole_of_matrix(id: &str, size: (u32, u32), k: &[f64], camera_from_world: &Rigid) -> LensCamera {
    let at = |index: usize| k.get(index).copied().unwrap_or_default();
    pinhole(id, size, DVec2::new(at(0), at(4)), DVec2::new(at(2), at(5)), camera_from_world)
}

/// The 21 points of 63 numbers.
pub(crate) fn points(numbers: &[f64]) -> [DVec3; LANDMARK_COUNT] {
    let mut points = [DVec3::ZERO; LANDMARK_COUNT];
    points.iter_mut().zip(numbers.chunks_exact(3)).for_each(|(point, values)| *point = DVec3::from_slice(values));
    points
}

/// The side to read, of those that a sequence has.
pub(crate) fn choose_side(wanted: Option<Side>, has: [bool; 2], folder: &Path) -> Result<Side, DatasetError> {
    let [right, left] = has;
    let has = |side: Side| if side == Side::Right { right } else { left };
    let side = wanted.unwrap_or(if right { Side::Right } else { Side::Left });
    if has(side) {
        return Ok(side);
    }
    let problem = if has(side.other()) {
        format!("shows only a {} hand; give --side {}, or omit it", side.other(), side.other())
    } else {
        "has no frame in which a hand is annotated; choose another sequence".into()
    };
    Err(DatasetError::file(folder, problem))
}

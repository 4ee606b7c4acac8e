//! The truth about made footage, `truth.json`.

use std::path::Path;

use ghand_capture::CaptureError;
use ghand_core::Side;
use ghand_core::rotation::axis_angle_from_rotation;
use ghand_files::atomic_file::write_atomically;
use ghand_files::json_error::plain_json_error;
use glam::DVec3;
use serde::Serialize;

use super::board::Board;
use super::exposure::FilmCamera;
use super::lens::pixel;
use super::subject::Subject;

/// Times are seconds on the clock of the first camera, lengths metres, rotations radians; pixels as filmed, the centre
/// of the first one at (0.5, 0.5). Landmarks are MediaPipe's 21.
#[derive(Serialize)]
pub(crate) struct Truth {
    units: &'static str,
    side: String,
    /// From the wrist along the bones to the tip of the middle finger.
    hand_length: f64,
    hand_model: TrueModel,
    /// At all frames of the first camera that show it, also lost ones.
    hand: Vec<TruePose>,
    cameras: Vec<TrueCamera>,
    /// The board that is shown before the hand.
    #[serde(skip_serializing_if = "Option::is_none")]
    board: Option<TrueBoard>,
}

#[derive(Serialize)]
struct TrueBoard {
    kind: String,
    /// Until then it is shown, and the hand is not.
    until: f64,
    /// At the first camera's frames, also lost ones.
    poses: Vec<BoardPose>,
}

/// Axis-angle and translation `world_from_board`.
#[derive(Serialize)]
struct BoardPose {
    time: f64,
    rotation: [f64; 3],
    translation: [f64; 3],
}

/// The skeleton at rest.
#[derive(Serialize)]
struct TrueModel {
    joints: Vec<String>,
    /// -1 for the root.
    parents: Vec<i64>,
    rest: Vec<[f64; 3]>,
}

#[derive(Serialize)]
struct TruePose {
    time: f64,
    /// Axis-angle of each joint.
    pose: Vec<[f64; 3]>,
    translation: [f64; 3],
    landmarks: Vec<[f64; 3]>,
}

#[derive(Serialize)]
struct TrueCamera {
    id: String,
    video: String,
    /// When its clock starts.
    start: f64,
    /// Frames per second of its clock.
    rate: f64,
    /// The part by which its seconds are longer than the first camera's.
    drift: f64,
    /// How long its shutter is open.
    shutter: f64,
    /// The frames of the video.
    frames: Vec<TrueFrame>,
}

#[derive(Serialize)]
struct TrueFrame {
    /// The middle of the exposure.
    time: f64,
    /// Where the landmarks are in the image, perhaps beyond its edges; nothing for those behind the camera, and
    /// while a board is shown.
    landmarks: Vec<Option<[f64; 2]>>,
}

/// A number with at most so many digits behind the point: files are read by people, too.
fn rounded(value: f64, digits: i32) -> f64 {
    let scale = 10f64.powi(digits);
    (value * scale).round() / scale
}

fn micrometres(point: DVec3) -> [f64; 3] {
    point.to_array().map(|value| rounded(value, 6))
}

fn board_pose(board: &Board, time: f64) -> BoardPose {
    let (rotation, translation) = board.pose(time);
    let rotation = micrometres(axis_angle_from_rotation(&rotation));
    BoardPose { time: rounded(time, 6), rotation, translation: micrometres(translation) }
}

impl Truth {
    pub(crate) fn of(subject: &Subject, cameras: &[FilmCamera], side: Side, board: Option<&Board>) -> Truth {
        let shows_hand = |time: f64| board.is_none_or(|board| !board.is_shown(time));
        let model = &subject.model;
        let parent = |parent: &Option<usize>| parent.map_or(-1, |parent| parent as i64);
        let pose_at = |time: f64| {
            let pose = subject.pose(time);
            TruePose {
                time: rounded(time, 6),
                pose: pose.rotations.iter().map(|rotation| micrometres(*rotation)).collect(),
                translation: micrometres(pose.translation),
                landmarks: subject.landmarks(&pose).into_iter().map(micrometres).collect(),
            }
        };
        let frame = |camera: &FilmCamera, time: f64| {
            let lens = camera.at(time);
            let seen = |point: DVec3| pixel(&lens, point).map(|pixel| pixel.to_array().map(|value| rounded(value, 3)));
            let seen = |point: DVec3| if shows_hand(time) { seen(point) } else { None };
            let landmarks = subject.landmarks(&subject.pose(time)).into_iter().map(seen).collect();
            TrueFrame { time: rounded(time, 6), landmarks }
        };
        let of_camera = |camera: &FilmCamera| TrueCamera {
            id: camera.id.clone(),
            video: format!("{}.mp4", camera.id),
            start: rounded(camera.clock.start, 6),
            rate: camera.clock.rate,
            drift: rounded(camera.clock.drift, 9),
            shutter: rounded(camera.shutter, 6),
            frames: (0..camera.clock.frames()).map(|k| frame(camera, camera.clock.time(k))).collect(),
        };
        let times = || cameras.iter().take(1).flat_map(|first| first.clock.all_times());
        Truth {
            units: "metre",
            side: side.to_string(),
            hand_length: rounded(subject.length(), 6),
            hand_model: TrueModel {
                joints: model.joint_names.clone(),
                parents: model.parents.iter().map(parent).collect(),
                rest: model.joints.iter().map(|joint| micrometres(*joint)).collect(),
            },
            hand: times().filter(|time| shows_hand(*time)).map(pose_at).collect(),
            cameras: cameras.iter().map(of_camera).collect(),
            board: board.map(|board| TrueBoard {
                kind: board.kind.to_string(),
                until: board.until,
                poses: times().filter(|time| board.is_shown(*time)).map(|time| board_pose(board, time)).collect(),
            }),
        }
    }

    pub(crate) fn write(&self, path: &Path) -> Result<(), CaptureError> {
        let text = serde_json::to_vec(self)
            .map_err(|error| CaptureError::Json { path: path.into(), problem: plain_json_error(&error) })?;
        write_atomically(path, &text).map_err(|source| CaptureError::Io {
            path: path.into(),
            action: "write the truth",
            source,
            remedy: "check that the folder is writable and has free space",
        })
    }
}

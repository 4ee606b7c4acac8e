//! HO-3D's annotations: `meta/0000.pkl` of a sequence, or the folder of them.
//!
//! A frame has `handPose` (48 axis-angle numbers of MANO's joints, the wrist first, from the flat hand), `handTrans`
//! (3, metres), `handBeta` (10) and `handJoints3D` (21, 3; metres). The camera is OpenGL's: x right, y up, looking
//! along -z; it is converted to ghand's. All hands are right hands, at 30 frames per second. Frames without a
//! `handPose` are skipped; if no frame has one, the joints are fitted as landmarks. Their order is MANO's with the tips
//! of thumb, index, middle, ring and little finger after it.

use ghand_core::Side;
use ghand_files::value::Value;
use glam::DVec3;

use super::landmarks::points_of;
use super::mano;
use crate::ik::LANDMARK_COUNT;
use crate::pose_sequence::reading::recording::{LandmarkFrame, LeftRotations, ManoRows};
use crate::pose_sequence::reading::source::{OPENGL_AXES, frames_of, id_of, side_of};
use crate::pose_sequence::transfer::proportions::MANO_ORDER;
use crate::pose_sequence::{Motion, PoseError, Recording, Skipped, Source};

const FPS: f64 = 30.0;
const POSE: &str = "handPose";
const JOINTS: &str = "handJoints3D";
/// The parts of a frame that are read.
pub(crate) const FIELDS: [&str; 4] = [POSE, "handTrans", "handBeta", JOINTS];
pub(crate) fn is_frame(value: &Value) -> bool {
    value.get(POSE).is_some() || value.get(JOINTS).is_some()
}

pub(crate) fn read(_: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let frames = if is_frame(value) { std::slice::from_ref(value) } else { frames_of(value)? };
    frames.iter().any(is_frame).then(|| Ok(recording(value, frames)))
}

fn recording(value: &Value, frames: &[Value]) -> Recording {
    let numbers = |frame: &Value, name: &str| -> Vec<f64> {
        frame.get(name).and_then(Value::numbers).map(|array| array.values.clone()).unwrap_or_default()
    };
    let has_poses = frames.iter().any(|frame| frame.get(POSE).and_then(Value::numbers).is_some());
    let mut posed = Vec::new();
    let mut seen = Vec::new();
    let mut skipped = Skipped::default();
    for (number, frame) in frames.iter().enumerate() {
        let id = id_of(frame, number);
        let problem = if has_poses {
            let pose = numbers(frame, POSE);
            let found = match pose.split_at_checked(3) {
                Some((root, fingers)) if pose.len() == 48 => {
                    mano::frame(&id, root, fingers, &numbers(frame, "handBeta"), &numbers(frame, "handTrans"))
                }
                _ => Err(format!("{POSE} has {} numbers, expected 48", pose.len())),
            };
            found.map(|found| posed.push(found))
        } else {
            joints(&numbers(frame, JOINTS)).map(|points| seen.push(LandmarkFrame { id: id.clone(), points }))
        };
        if let Err(problem) = problem {
            skipped.add(&id, problem);
        }
    }
    let side = ["handedness", "side"].iter().find_map(|name| value.get(name)).and_then(side_of).unwrap_or(Side::Right);
    let motion = if has_poses {
        Motion::Mano(ManoRows { frames: posed, from_mean: false, opengl: true, left: LeftRotations::Own })
    } else {
        Motion::Landmarks { frames: seen, tip_inset: 0.0 }
    };
    Recording { side: Some(side), usual_fps: Some(FPS), motion, skipped, warnings: vec![] }
}

fn joints(numbers: &[f64]) -> Result<[DVec3; LANDMARK_COUNT], String> {
    let points = points_of(numbers).map_err(|problem| format!("{JOINTS}: {problem}"))?;
    Ok(MANO_ORDER.map(|joint| OPENGL_AXES * points[joint]))
}

//! What fuzz targets feed that no reader takes as it is. The corpus tests of `tests/` run it with any toolchain.

use ghand_core::HandModel;
use ghand_files::Value;
use ghand_motion::live::{LiveOptions, LivePoses};
use ghand_motion::pose_sequence::poses_and_fit;
use ghand_motion::{PoseError, PoseOptions, PoseSequence};

/// Names of arrays that readers of poses ask for.
const ARRAY_NAMES: [&str; 42] = [
    "pose",
    "translation",
    "shape",
    "fps",
    "flat_hand_mean",
    "ids",
    "joints",
    "rot",
    "trans",
    "poses",
    "pose_hand",
    "right_hand_pose",
    "left_hand_pose",
    "pose_r",
    "rot_r",
    "trans_r",
    "shape_r",
    "pred_rot",
    "pred_hand_pose",
    "pred_trans",
    "pred_betas",
    "pred_valid",
    "global_orient",
    "hand_pose",
    "betas",
    "is_right",
    "cam_t",
    "positions",
    "orientations",
    "world_landmarks",
    "handedness",
    "mocap_framerate",
    "handPose",
    "handTrans",
    "handBeta",
    "handJoints3D",
    "mano_pose",
    "xyz",
    "side",
    "parents",
    "rest_joints",
    "tips",
];

/// Reads poses from arrays as an `.npz` archive would hold them, whose checksums would keep changes of them out. Each array is a
/// byte that chooses its name, two bytes with a length (the low one first), and so many bytes of an `.npy` file.
///
/// # Errors
/// As of [`ghand_motion::read_poses`].
pub fn read_pose_arrays(mut bytes: &[u8], model: &HandModel) -> Result<PoseSequence, PoseError> {
    let mut arrays: Vec<(String, Value)> = Vec::new();
    while let [choice, low, high, rest @ ..] = bytes {
        let (npy, rest) = rest.split_at(usize::from(u16::from_le_bytes([*low, *high])).min(rest.len()));
        let name = ARRAY_NAMES[usize::from(*choice) % ARRAY_NAMES.len()];
        if arrays.iter().all(|(known, _)| known != name) {
            arrays.push((name.into(), Value::from_bytes(npy).unwrap_or_else(|e| Value::Unreadable(e.to_string()))));
        }
        bytes = rest;
    }
    Ok(poses_and_fit("file", &Value::Map(arrays), model, &PoseOptions::default())?.0)
}

/// Reads lines as the packets of a stream, 30 per second. Returns the number of usable ones.
///
/// # Panics
/// If a pose is not one of the model, or if an error does not name the packet.
pub fn read_live_packets(bytes: &[u8], model: &HandModel) -> usize {
    let mut live = LivePoses::default();
    let mut usable = 0;
    for (number, packet) in bytes.split(|byte| *byte == b'\n').enumerate() {
        match live.read(packet, model, number as f64 / 30.0, &LiveOptions::default()) {
            Ok(live) => {
                assert!(live.pose.rotations.len() == model.joint_count());
                assert!(live.pose.check_range(&model.joint_names).is_ok());
                usable += 1;
            }
            Err(error) => assert!(error.to_string().starts_with("packet: "), "{error}"),
        }
    }
    usable
}

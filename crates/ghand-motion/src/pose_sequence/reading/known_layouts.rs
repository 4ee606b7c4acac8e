//! Layouts that are known and not read, each with the line that converts it.

use ghand_files::value::Value;

/// Largest depth at which a layout is looked for.
const MAX_DEPTH: usize = 4;

/// What a file is and what to do, if its layout is known.
pub(crate) fn problem(value: &Value) -> Option<&'static str> {
    find(value, 0, &|map| body(map).or_else(|| of_map(map)))
}

/// The same if a file has the pose of a body, whose numbers are as many as those of landmarks.
pub(crate) fn body_without_hands(value: &Value) -> Option<&'static str> {
    find(value, 0, &body)
}

type Recognise = dyn Fn(&Value) -> Option<&'static str>;

/// The first layout at any place of the first items of a value.
fn find(value: &Value, depth: usize, recognise: &Recognise) -> Option<&'static str> {
    let here = recognise(value);
    if here.is_some() || depth == MAX_DEPTH {
        return here;
    }
    match value {
        Value::List(items) => items.iter().take(3).find_map(|item| find(item, depth + 1, recognise)),
        Value::Map(entries) => entries.iter().take(16).find_map(|(_, child)| find(child, depth + 1, recognise)),
        _ => None,
    }
}

/// The arrays of a map with one of these names.
fn shapes<'a>(value: &'a Value, names: &[&str]) -> Vec<&'a [usize]> {
    names.iter().filter_map(|name| Some(value.get(name)?.numbers()?.shape.as_slice())).collect()
}

fn body(value: &Value) -> Option<&'static str> {
    let is_of_joints = |shape: &&[usize]| {
        matches!(shape, [.., 63 | 69 | 189 | 207] | [.., 21 | 23, 3] | [.., 21 | 23, 3, 3] | [.., 21 | 23, 6])
    };
    let named = shapes(value, &["body_pose", "pose_body", "smpl_pose", "pred_body_pose", "smplx_body_pose"]);
    let whole =
        shapes(value, &["poses", "pose", "full_pose", "fullpose", "theta", "thetas", "smpl_poses", "smpl_thetas"]);
    let is_whole = |shape: &&[usize]| matches!(shape, [.., 66 | 72]);
    (named.iter().any(is_of_joints) || whole.iter().any(is_whole)).then_some(BODY)
}

fn of_map(value: &Value) -> Option<&'static str> {
    let has = |name: &str| value.get(name).is_some();
    let any = |names: &[&str]| names.iter().any(|name| has(name));
    if any(&["hand_right_keypoints_2d", "hand_left_keypoints_2d", "pose_keypoints_2d"]) {
        return Some(OPENPOSE);
    }
    // An image without people.
    if has("version") && matches!(value.get("people"), Some(Value::List(people)) if people.is_empty()) {
        return Some(OPENPOSE);
    }
    let keypoints = ["keypoints", "keypoints_3d", "keypoint", "kpts", "pred_keypoints", "keypoints_2d"];
    if any(&["lefthand_kpts", "righthand_kpts"])
        || shapes(value, &keypoints).iter().any(|shape| matches!(shape, [.., 399] | [.., 133, _]))
        || is_list_of(value, &keypoints, 133)
    {
        return Some(WHOLE_BODY);
    }
    if any(&[
        "palmPosition",
        "palm_position",
        "palmNormal",
        "pointables",
        "stabilizedPalmPosition",
        "tracking_frame_id",
        "digits",
    ]) {
        return Some(LEAP);
    }
    if has("wrist_xform") {
        return Some(HOT3D);
    }
    if any(&["body_pose_params", "hand_pose_params"]) && !has("pred_keypoints_3d") {
        return Some(MHR);
    }
    None
}

/// Whether one of these names has a list of so many items, or of lists of them.
fn is_list_of(value: &Value, names: &[&str], count: usize) -> bool {
    let lists = names.iter().filter_map(|name| value.get(name));
    lists.into_iter().any(|list| matches!(list, Value::List(items) if items.len() == count))
}

const OPENPOSE: &str = "is OpenPose's, keypoints in the pixels of images, which have no depth; give their calibrated cameras \
                        with --cameras, and the folder of its *_keypoints.json, or one folder for each camera in one folder";
const WHOLE_BODY: &str = "has the 133 keypoints of COCO-WholeBody, whose hands are keypoints 91 to 111 (left) and 112 to 132 \
                          (right); if they are metres, write `{\"side\": \"right\", \"world_landmarks\": keypoints[112:133]}` \
                          for each frame, if they are pixels of calibrated cameras, `image_landmarks`";
const LEAP: &str = "is Leap Motion's, whose JSON is in millimetres and has its own names; write `{\"handedness\": \"right\", \
                    \"world_landmarks\": points}` for each frame, with 21 points in metres: the wrist, then four joints of \
                    each finger from the palm to the tip";
const BODY: &str = "has the pose of a body without hands (SMPL, SLAHMR, 63 to 72 numbers), and a body's joints say nothing of \
                    fingers; use a tracker of hands such as HaMeR, WiLoR, HaWoR or Dyn-HaMR, or SMPL-X's right_hand_pose and \
                    left_hand_pose";
const HOT3D: &str = "is HOT3D's, principal components beside a quaternion of the wrist; write for each hand `{\"is_right\": 1, \
                     \"hand_pose\": hand[\"pose\"], \"use_pca\": True, \"global_orient\": \
                     Rotation.from_quat(hand[\"wrist_xform\"][\"q_wxyz\"], scalar_first=True).as_rotvec().tolist(), \
                     \"transl\": hand[\"wrist_xform\"][\"t_xyz\"]}` (scipy.spatial.transform), and give the MANO file \
                     with --pose-model";
const MHR: &str = "has the parameters of SAM 3D Body's own rig (MHR), which only its program turns into joints; also save its \
                   pred_keypoints_3d (70, 3), from which both hands are read";

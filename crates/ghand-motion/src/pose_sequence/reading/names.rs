//! What the name of an array says about it. A name decides; a shape alone never does.

/// What a name says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Named {
    /// Rotations of a hand's joints.
    Rotations,
    /// Positions of a hand's joints or landmarks.
    Positions,
    /// Something of a hand.
    Hand,
    /// Nothing, as `arr_0` or `data`.
    Nothing,
    /// Something that is not the pose: a body, a face, a shape, a camera.
    Other,
}

/// Words of things that are not a hand's pose.
const OTHER: [&str; 76] = [
    "body",
    "face",
    "facial",
    "jaw",
    "eye",
    "eyes",
    "leye",
    "reye",
    "head",
    "neck",
    "foot",
    "feet",
    "leg",
    "hip",
    "hips",
    "spine",
    "torso",
    "smpl",
    "smplh",
    "smplx",
    "flame",
    "shape",
    "shapes",
    "beta",
    "betas",
    "expression",
    "expressions",
    "expr",
    "exp",
    "vertices",
    "verts",
    "vertex",
    "faces",
    "triangles",
    "normals",
    "mesh",
    "camera",
    "cameras",
    "cam",
    "intrinsics",
    "extrinsics",
    "intrinsic",
    "extrinsic",
    "k",
    "bbox",
    "bboxes",
    "box",
    "boxes",
    "confidence",
    "conf",
    "score",
    "scores",
    "valid",
    "visibility",
    "velocity",
    "velocities",
    "vel",
    "acceleration",
    "object",
    "obj",
    "offset",
    "offsets",
    "mean",
    "std",
    "variance",
    "sigma",
    "template",
    "weights",
    "components",
    "pca",
    "latent",
    "feature",
    "features",
    "image",
    "2d",
    "uv",
];
const ROTATIONS: [&str; 15] = [
    "pose",
    "poses",
    "rotation",
    "rotations",
    "rot",
    "rots",
    "theta",
    "thetas",
    "fullpose",
    "angles",
    "aa",
    "axisangle",
    "rotvec",
    "rotvecs",
    "rotmat",
];
const POSITIONS: [&str; 19] = [
    "xyz",
    "joints",
    "joint",
    "keypoints",
    "keypoint",
    "kp",
    "kps",
    "kp3d",
    "kpts",
    "landmarks",
    "landmark",
    "positions",
    "position",
    "points",
    "coords",
    "coordinates",
    "j3d",
    "skeleton",
    "markers",
];
const HAND: [&str; 9] = ["hand", "hands", "mano", "finger", "fingers", "rhand", "lhand", "right", "left"];

/// What this name says.
pub(crate) fn named(name: &str) -> Named {
    let words = words(name);
    let has = |list: &[&str]| words.iter().any(|word| list.contains(&word.as_str()));
    if has(&OTHER) {
        Named::Other
    } else if has(&ROTATIONS) {
        Named::Rotations
    } else if has(&POSITIONS) {
        Named::Positions
    } else if has(&HAND) {
        Named::Hand
    } else {
        Named::Nothing
    }
}

/// The words of a name, in small letters: parts between signs, before capitals and before numbers.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut before = ' ';
    for letter in name.chars() {
        let begins =
            (letter.is_uppercase() && before.is_lowercase()) || (letter.is_numeric() && before.is_alphabetic());
        if !letter.is_alphanumeric() || begins {
            words.push(String::new());
        }
        before = letter;
        if let (true, Some(word)) = (letter.is_alphanumeric(), words.last_mut()) {
            word.extend(letter.to_lowercase());
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_decide_and_not_their_parts() {
        for (name, expected) in [
            ("body_pose", Named::Other),
            ("pose_body", Named::Other),
            ("bodyPose", Named::Other),
            ("shape_params", Named::Other),
            ("leye_pose", Named::Other),
            ("mano_pose", Named::Rotations),
            ("handPoses", Named::Rotations),
            ("keypoints_3d", Named::Positions),
            ("joints3D", Named::Positions),
            ("kp-3d", Named::Positions),
            ("embodied", Named::Nothing),
            ("composer", Named::Nothing),
            ("arr_0", Named::Nothing),
            ("right_hand", Named::Hand),
        ] {
            assert_eq!(named(name), expected, "{name}");
        }
    }
}

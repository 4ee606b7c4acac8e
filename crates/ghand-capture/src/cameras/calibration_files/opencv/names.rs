//! Names of fields, as OpenCV's samples, ROS and users write them.

use super::super::node::Node;

/// What a field is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    Matrix,
    Distortion,
    Rotation,
    Translation,
    Width,
    Height,
    Size,
    Name,
    LensModel,
    Fisheye,
    Rectification,
    BoardPoses,
}

/// Names in lower case, without `_` and the like.
const NAMES: [(Quantity, &[&str]); 12] = [
    (
        Quantity::Matrix,
        &["cameramatrix", "k", "m", "mtx", "intrinsicmatrix", "intrinsics", "intrinsic", "cameraintrinsics"],
    ),
    (
        Quantity::Distortion,
        &[
            "distortioncoefficients",
            "distortioncoeffs",
            "distcoeffs",
            "distcoeff",
            "distortion",
            "distortions",
            "dist",
            "d",
        ],
    ),
    (Quantity::Rotation, &["r", "rotation", "rotationmatrix", "rmat", "rvec", "rotationvector", "rot"]),
    (Quantity::Translation, &["t", "translation", "translationvector", "tvec", "trans"]),
    (Quantity::Width, &["imagewidth", "width"]),
    (Quantity::Height, &["imageheight", "height"]),
    (Quantity::Size, &["imagesize", "imgsize", "framesize", "resolution", "size"]),
    (Quantity::Name, &["cameraname"]),
    (Quantity::LensModel, &["distortionmodel"]),
    (Quantity::Fisheye, &["fisheyemodel", "fisheye", "isfisheye"]),
    (Quantity::Rectification, &["rectificationmatrix"]),
    (Quantity::BoardPoses, &["extrinsicparameters"]),
];

/// Words of files' names that do not name a camera.
const WORDS: [&str; 14] = [
    "intrinsics",
    "intrinsic",
    "intri",
    "extrinsics",
    "extrinsic",
    "extri",
    "calibration",
    "calib",
    "info",
    "params",
    "parameters",
    "result",
    "results",
    "opencv",
];

/// A known field of a group.
pub(super) struct Part<'a> {
    pub quantity: Quantity,
    /// `1` of `M1`, `left` of `camera_matrix_left`; empty for most.
    pub suffix: String,
    /// As in the file.
    pub name: &'a str,
    pub node: &'a Node,
}

/// The known fields of a group, in the order of their suffixes.
pub(super) fn parts(group: &Node) -> Vec<Part<'_>> {
    let part = |(name, node): &'_ (String, Node)| -> Option<(Quantity, String)> {
        // Longer names are not known, and not worth a copy.
        if name.len() > 64 || *node == Node::Nothing {
            return None;
        }
        let plain: String = name.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_lowercase();
        let digits = plain.trim_end_matches(|c: char| c.is_ascii_digit());
        let splits = [
            (digits, plain.get(digits.len()..)),
            (plain.strip_suffix("left").unwrap_or_default(), Some("left")),
            (plain.strip_suffix("right").unwrap_or_default(), Some("right")),
            (plain.strip_prefix("left").unwrap_or_default(), Some("left")),
            (plain.strip_prefix("right").unwrap_or_default(), Some("right")),
        ];
        splits.iter().find_map(|(base, suffix)| {
            let known = NAMES.iter().find(|(_, names)| names.contains(base));
            known.map(|(quantity, _)| (*quantity, suffix.unwrap_or_default().to_owned()))
        })
    };
    let found = group.entries().iter().filter_map(|entry| {
        let (quantity, suffix) = part(entry)?;
        Some(Part { quantity, suffix, name: &entry.0, node: &entry.1 })
    });
    let mut parts: Vec<Part> = found.collect();
    parts.sort_by(|one, other| (one.suffix.len(), &one.suffix).cmp(&(other.suffix.len(), &other.suffix)));
    parts
}

/// What a file's name says of the camera.
pub(super) fn key(stem: &str) -> String {
    let words: Vec<&str> = stem.split(['_', '-', '.', ' ']).filter(|word| !word.is_empty()).collect();
    let kept: Vec<&str> = words.iter().copied().filter(|word| !WORDS.contains(&word.to_lowercase().as_str())).collect();
    if kept.is_empty() || kept.len() == words.len() { stem.into() } else { kept.join("_") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_known_in_many_spellings() {
        for (name, quantity, suffix) in [
            ("camera_matrix", Quantity::Matrix, ""),
            ("Camera_Matrix", Quantity::Matrix, ""),
            ("cameraMatrix2", Quantity::Matrix, "2"),
            ("K", Quantity::Matrix, ""),
            ("M1", Quantity::Matrix, "1"),
            ("camera_matrix_left", Quantity::Matrix, "left"),
            ("Distortion_Coefficients", Quantity::Distortion, ""),
            ("distCoeffs", Quantity::Distortion, ""),
            ("D2", Quantity::Distortion, "2"),
            ("R", Quantity::Rotation, ""),
            ("rvec", Quantity::Rotation, ""),
            ("T", Quantity::Translation, ""),
            ("image_Width", Quantity::Width, ""),
        ] {
            let group = Node::Map(vec![(name.into(), Node::Number(1.0))]);
            let parts = parts(&group);
            assert_eq!(
                parts.iter().map(|p| (p.quantity, p.suffix.as_str())).collect::<Vec<_>>(),
                [(quantity, suffix)],
                "{name}"
            );
        }
        for unknown in ["P1", "Q", "frame", "square_size", "", "left", "1"] {
            assert!(parts(&Node::Map(vec![(unknown.into(), Node::Number(1.0))])).is_empty(), "{unknown}");
        }
    }

    #[test]
    fn a_files_name_is_its_cameras_without_what_is_in_it() {
        for (stem, expected) in [
            ("cam0", "cam0"),
            ("cam0_intrinsics", "cam0"),
            ("left-camera_calib", "left_camera"),
            ("intrinsics", "intrinsics"),
            ("GoPro 3", "GoPro 3"),
        ] {
            assert_eq!(key(stem), expected);
        }
    }
}

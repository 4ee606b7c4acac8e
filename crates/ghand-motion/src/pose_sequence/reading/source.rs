//! The file being read, and what all readers share.

use ghand_core::pose::{LARGEST_TRANSLATION, PoseRangeError, check_shape_range};
use ghand_core::{HandModel, Pose, Side};
use ghand_files::value::Value;
use glam::{DMat3, DVec3};

use crate::pose_sequence::PoseError;

/// Most numbers that are copied to the frames that share them: as many as a file may have.
const MOST_COPIES: usize = 1 << 25;

/// ghand's world (y down, looking along z) from OpenGL's, WebXR's and OpenXR's (y up, looking along -z).
pub(crate) const OPENGL_AXES: DMat3 = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));

/// The file being read, and what to take from it.
#[derive(Clone, Copy)]
pub(crate) struct Source<'a> {
    /// Its name, for messages.
    pub origin: &'a str,
    /// Which hand to take if there are two.
    pub wanted: Side,
    /// Which capture to take if there are several.
    pub take: Option<&'a str>,
    /// Number of joints of the model that the poses are for.
    pub joint_count: usize,
    /// The model that the poses are for, whose shapes a file may name.
    pub model: &'a HandModel,
    /// The model of the file's poses, if the user gave it.
    pub pose_model: Option<&'a HandModel>,
}

impl Source<'_> {
    pub fn invalid(&self, field: &str, problem: String) -> PoseError {
        PoseError::Invalid { origin: self.origin.into(), field: field.into(), problem }
    }

    /// Rejects numbers shared by all frames if the copies for each frame would take too much memory.
    pub fn copied(&self, field: &str, numbers: usize, frames: usize) -> Result<(), PoseError> {
        if numbers.checked_mul(frames).is_some_and(|copies| copies <= MOST_COPIES) {
            return Ok(());
        }
        let problem = format!("has {numbers} numbers for each of {frames} frames, which is too many; give about ten");
        Err(self.invalid(field, problem))
    }
}

/// Checks that pose and shape are possible; otherwise returns the field that is out of range and its problem.
pub(crate) fn in_range(pose: &Pose, shape: &[f64], names: &[String]) -> Result<(), (&'static str, String)> {
    pose.check_range(names).and_then(|()| check_shape_range(shape)).map_err(|error| {
        let field = match error {
            PoseRangeError::Rotation { .. } => "pose",
            PoseRangeError::Translation { .. } => "translation",
            PoseRangeError::Shape { .. } => "shape",
        };
        (field, error.to_string())
    })
}

/// Checks whether a tracked point is near enough; otherwise returns its problem.
pub(crate) fn point_in_range(point: DVec3) -> Result<(), String> {
    let distance = point.length();
    match distance.partial_cmp(&LARGEST_TRANSLATION) {
        Some(order) if order.is_le() => Ok(()),
        _ if !point.is_finite() => Err("is not finite".into()),
        _ => Err(format!("is {distance:?} m away, at most {LARGEST_TRANSLATION} is allowed; give metres")),
    }
}

/// A value in a message: a number itself, otherwise the kind of value.
pub(crate) fn shown(value: &Value) -> String {
    value.number().map_or_else(|| value.kind(), |number| number.to_string())
}

/// The frames that cannot be used.
#[derive(Debug, Default)]
pub(crate) struct Skipped {
    /// Their ids.
    pub ids: Vec<String>,
    /// What is wrong with the first.
    problem: String,
}

impl Skipped {
    pub fn add(&mut self, id: &str, problem: impl Into<String>) {
        if self.ids.is_empty() {
            self.problem = problem.into();
        }
        self.ids.push(id.into());
    }

    /// One warning for all of them; an error if no frame is left.
    pub fn finish(&self, source: &Source, usable: usize) -> Result<Option<String>, PoseError> {
        let count = self.ids.len();
        let total = self.ids.len() + usable;
        let Some(id) = self.ids.first() else { return Ok(None) };
        if usable == 0 {
            let problem = format!("none of the {total} can be used; frame {id:?}: {}", self.problem);
            return Err(source.invalid("frames", problem));
        }
        let are = if count == 1 { "is" } else { "are" };
        Ok(Some(format!("{count} of {total} frames {are} skipped; the first, frame {id:?}: {}", self.problem)))
    }
}

/// Three numbers as a list, or by the names x, y and z.
pub(crate) fn vector(value: &Value) -> Option<DVec3> {
    if let Some(array) = value.numbers() {
        return match array.values[..] {
            [x, y, z, ..] if array.shape.len() == 1 && array.values.len() <= 5 => Some(DVec3::new(x, y, z)),
            _ => None,
        };
    }
    let part = |name: &str| value.get(name)?.number();
    Some(DVec3::new(part("x")?, part("y")?, part("z")?))
}

/// The side that a text or a number (1 is right) names.
pub(crate) fn side_of(value: &Value) -> Option<Side> {
    if let Some(number) = value.number() {
        return match number {
            0.0 => Some(Side::Left),
            1.0 => Some(Side::Right),
            _ => None,
        };
    }
    match value.text()?.to_lowercase().as_str() {
        "left" | "l" | "left_hand" => Some(Side::Left),
        "right" | "r" | "right_hand" => Some(Side::Right),
        _ => None,
    }
}

/// The frames of a file: its "frames", or itself if it is a list.
pub(crate) fn frames_of(value: &Value) -> Option<&[Value]> {
    match value.get("frames").unwrap_or(value) {
        Value::List(frames) => Some(frames),
        _ => None,
    }
}

/// Names of a frame's id.
pub(crate) const ID_NAMES: [&str; 11] = [
    "id",
    "frame",
    "frame_id",
    "frame_index",
    "frame_idx",
    "frameIndex",
    "frame_number",
    "frameNumber",
    "img_name",
    "image_name",
    "img_path",
];

/// The id that a frame has.
pub(crate) fn own_id(frame: &Value) -> Option<String> {
    match ID_NAMES.iter().find_map(|name| frame.get(name))? {
        Value::Text(id) => Some(id.clone()),
        value => value.number().map(|id| id.to_string()),
    }
}

/// The id of a frame, else its number.
pub(crate) fn id_of(frame: &Value, number: usize) -> String {
    own_id(frame).unwrap_or_else(|| format!("{number:04}"))
}

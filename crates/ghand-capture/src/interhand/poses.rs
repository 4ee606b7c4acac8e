//! The poses of a capture, from `InterHand2.6M_{subset}_MANO_NeuralAnnot.json`.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use ghand_core::{HandModel, Pose, Side};
use glam::DVec3;
use serde::Deserialize;
use serde::de::{Error, MapAccess};

use super::annotations::REMEDY;
use crate::capture::Frame;
use crate::error::CaptureError;
use crate::reading::json_stream::{Keys, Numbers, Object, read_streaming, skip};
use crate::reading::validation::FileValidator;

/// Shape parameters of a frame.
pub(super) const SHAPES: usize = 10;
/// Number of axis-angle numbers in a pose: 16 joints.
const POSE: usize = 48;

/// MANO's parameters in the world's frame, as annotated: the pose without its mean.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub(crate) struct Parameters {
    pub pose: Numbers<POSE>,
    pub shape: Numbers<SHAPES>,
    /// Metres.
    pub trans: Numbers<3>,
}

/// Poses of the wanted frames by their number; frames whose annotation is null or missing have none. Their ids are
/// empty.
pub(super) fn read_poses(
    path: &Path,
    capture: &str,
    model: &HandModel,
    wanted: &HashSet<u64>,
) -> Result<HashMap<u64, Frame>, CaptureError> {
    let mut reader = OfCapture { capture, frames: Frames { wanted, side: model.side, found: HashMap::new() } };
    read_streaming(path, Object(&mut reader), REMEDY)?;
    let mean = model.pose_space.as_ref().map_or(&[][..], |space| &space.mean);
    let mut frames = HashMap::new();
    for (number, parameters) in reader.frames.found {
        let frame = frame(&parameters, mean);
        FileValidator { path }.pose_range(&number.to_string(), &frame.pose, &frame.shape, &model.joint_names)?;
        frames.insert(number, frame);
    }
    Ok(frames)
}

/// The frame without its id. `mean` is the mean rotation of each joint except the root.
fn frame(parameters: &Parameters, mean: &[DVec3]) -> Frame {
    let given = parameters.pose.0.as_chunks::<3>().0.iter().map(|r| DVec3::from_array(*r));
    let added = std::iter::once(&DVec3::ZERO).chain(mean);
    let rotations = given.zip(added).map(|(r, mean)| r + *mean).collect();
    let translation = DVec3::from_array(parameters.trans.0);
    Frame { id: String::new(), pose: Pose { rotations, translation }, shape: parameters.shape.0.to_vec() }
}

struct OfCapture<'a> {
    capture: &'a str,
    frames: Frames<'a>,
}

impl Keys for OfCapture<'_> {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        if key == self.capture { map.next_value_seed(Object(&mut self.frames)) } else { skip(map) }
    }
}

struct Frames<'a> {
    wanted: &'a HashSet<u64>,
    side: Side,
    found: HashMap<u64, Parameters>,
}

impl Keys for Frames<'_> {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        let number = key.parse().ok().filter(|n| self.wanted.contains(n));
        let Some(number) = number else { return skip(map) };
        let Some(hands) = map.next_value::<Option<Hands>>()? else { return Ok(()) };
        let hand = match self.side {
            Side::Right => hands.right,
            Side::Left => hands.left,
        };
        match hand.and_then(|hand| self.found.insert(number, hand)) {
            Some(_) => Err(A::Error::custom(format!("frame {number} occurs twice"))),
            None => Ok(()),
        }
    }
}

#[derive(Deserialize)]
struct Hands {
    right: Option<Parameters>,
    left: Option<Parameters>,
}

//! Checks whether poses and hand model match: compares annotated joints, from
//! `InterHand2.6M_{subset}_joint_3d.json`, with those of the posed model.

use std::collections::HashMap;
use std::path::Path;

use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Side};
use glam::DVec3;
use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, MapAccess};

use super::annotations::REMEDY;
use crate::capture::Frame;
use crate::error::CaptureError;
use crate::reading::json_stream::{ForEach, Keys, Numbers, Object, read_streaming, skip};

/// The annotation's joint for each of MANO's: right hand first, every finger from its tip to its base, thumb to little
/// finger, then the wrist.
const OF_MANO: [usize; 16] = [20, 7, 6, 5, 11, 10, 9, 19, 18, 17, 15, 14, 13, 3, 2, 1];
/// Joints of one hand.
const JOINTS: usize = 21;
/// Frames that are compared: enough for a mean.
const COMPARED: usize = 32;
/// Mean distance above which model and poses do not match, metres: the fits are published with about 5 mm,
/// the joints of the two skeletons differ by about as much, and a wrong mean pose moves fingers by centimetres.
const FAR: f64 = 0.03;

/// A warning if the posed model's joints are far from the annotated ones. `frames` are indexed by number. Without the
/// file, or without any annotated frame, nothing is compared.
pub(super) fn warning(
    path: &Path,
    capture: &str,
    model: &HandModel,
    frames: &HashMap<u64, Frame>,
) -> Result<Option<String>, CaptureError> {
    if !path.exists() {
        return Ok(None);
    }
    let mut numbers: Vec<u64> = frames.keys().copied().collect();
    numbers.sort_unstable();
    let step = numbers.len().div_ceil(COMPARED).max(1);
    let wanted = numbers.into_iter().step_by(step).map(|n| (n, None)).collect();
    let mut reader = OfCapture { capture, frames: Frames(wanted) };
    read_streaming(path, Object(&mut reader), REMEDY)?;
    let first = if model.side == Side::Right { 0 } else { JOINTS };
    let (mut sum, mut count) = (0.0, 0);
    for (number, joints) in &reader.frames.0 {
        let (Some(joints), Some(frame)) = (joints, frames.get(number)) else { continue };
        let posed = pose_hand(model, &frame.shape, &frame.pose)
            .map_err(|source| CaptureError::HandModel { path: path.into(), source: source.into() })?;
        for (joint, annotated) in posed.joints.iter().zip(OF_MANO) {
            let Some(annotated) = joints.get(first + annotated) else { continue };
            sum += joint.distance(DVec3::from(annotated.0) / 1000.0);
            count += 1;
        }
    }
    let mean = sum / f64::from(count.max(1));
    Ok((mean > FAR).then(|| {
        format!(
            "{}: the joints of {} are {:.0} mm from the annotated ones on average; check that it is the MANO model of \
             this hand",
            path.display(),
            model.name,
            1000.0 * mean
        )
    }))
}

struct OfCapture<'a> {
    capture: &'a str,
    frames: Frames,
}

impl Keys for OfCapture<'_> {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        if key == self.capture { map.next_value_seed(Object(&mut self.frames)) } else { skip(map) }
    }
}

/// World coordinates of the joints of both hands by frame, millimetres.
struct Frames(HashMap<u64, Option<Vec<Numbers<3>>>>);

impl Keys for Frames {
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error> {
        match key.parse().ok().and_then(|number: u64| self.0.get_mut(&number)) {
            Some(slot) => {
                let record = map.next_value::<Option<JointRecord>>()?;
                *slot = record.and_then(|record| record.world_coord?.0);
                Ok(())
            }
            None => skip(map),
        }
    }
}

#[derive(Deserialize)]
struct JointRecord {
    world_coord: Option<BothHands>,
}

/// The joints of both hands; `None` if there are more or fewer.
struct BothHands(Option<Vec<Numbers<3>>>);

impl<'de> Deserialize<'de> for BothHands {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut joints = Vec::with_capacity(2 * JOINTS);
        let mut count = 0;
        let each = |joint: Numbers<3>| {
            count += 1;
            if count <= 2 * JOINTS {
                joints.push(joint);
            }
            Ok(())
        };
        ForEach::new(each).deserialize(deserializer)?;
        Ok(BothHands((count == 2 * JOINTS).then_some(joints)))
    }
}

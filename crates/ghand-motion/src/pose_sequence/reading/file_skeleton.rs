//! The skeleton of the rows in a file of poses, as described by ghand's own files.
//!
//! `hand_model` of the JSON (in an `.npz` the arrays themselves) may contain:
//!
//! | | |
//! |---|---|
//! | `joints` | names of the `n_b` joints, in the order of the rows |
//! | `side` | `"right"` or `"left"` |
//! | `parents` | row of each joint's parent, which precedes it; -1 for the root |
//! | `rest_joints` | rest positions `[n_b][3]`, metres, in the axes that the rotations are in |
//! | `tips` | fingertips at rest `[5][3]`, thumb to little finger; default: a tip joint, else beyond the last bone |
//! | `vertices`, `triangles` | their numbers in the mesh: skeletons of the same mesh share its rest pose |
//! | `name` | for messages |
//!
//! Names alone are enough for a model that has these names. Transferring poses to another skeleton needs `side`,
//! `parents` and `rest_joints`.

use ghand_core::rotation::axis_angle_from_rotation;
use ghand_core::{HandModel, Side};
use ghand_files::value::Value;
use ghand_hand_model::joints::names::{Finger, JointRole};
use glam::{DMat3, DVec3};
use serde_json::json;

use super::source::{Source, shown, side_of};
use crate::pose_sequence::PoseError;
use crate::rest_skeleton::RestSkeleton;

/// Rest positions this near to each other are the same, metres.
const SAME_PLACE: f64 = 1e-6;
/// Bones of one mesh whose rest frames differ by less than this have the same rest pose, radians: far more than the
/// effect of proportions, half the effect of other axes.
const SAME_REST_POSE: f64 = std::f64::consts::FRAC_PI_4;
/// Larger coordinates at rest are not metres.
const LARGEST_COORDINATE: f64 = 1000.0;
/// Default distance of a fingertip from the last joint, in lengths of the preceding bone.
const TIP_LENGTH: f64 = 0.9;

/// A skeleton described by a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FileSkeleton {
    pub name: String,
    pub joint_names: Vec<String>,
    pub side: Option<Side>,
    pub parents: Option<Vec<Option<usize>>>,
    pub rest_joints: Option<Vec<DVec3>>,
    pub tips: Option<[DVec3; 5]>,
    /// Numbers of vertices and triangles.
    pub mesh: Option<[usize; 2]>,
}

impl FileSkeleton {
    /// Reads the description in `map`, whose members are called `prefix` and the name in messages. `None` when it names
    /// no joints.
    pub fn read(source: &Source, map: &Value, prefix: &str) -> Result<Option<FileSkeleton>, PoseError> {
        let field = |name: &str| format!("{prefix}{name}");
        let Some(names) = map.get("joints") else { return Ok(None) };
        let joint_names = texts(source, &field("joints"), names)?;
        let count = joint_names.len();
        if let Some((k, name)) = joint_names.iter().enumerate().find(|(k, name)| joint_names[..*k].contains(name)) {
            return Err(source.invalid(&field("joints"), format!("{name:?} occurs twice (again at index {k})")));
        }
        let side = match map.get("side") {
            None => None,
            Some(value) => Some(side_of(value).ok_or_else(|| {
                source.invalid(&field("side"), format!("is {}, must be \"right\" or \"left\"", shown(value)))
            })?),
        };
        let parents = match map.get("parents") {
            None => None,
            Some(value) => Some(parents(value, count).map_err(|problem| source.invalid(&field("parents"), problem))?),
        };
        let points = |name: &str, count: usize| match map.get(name) {
            None => Ok(None),
            Some(value) => points(value, count).map(Some).map_err(|problem| source.invalid(&field(name), problem)),
        };
        let rest_joints = points("rest_joints", count)?;
        let tips = points("tips", Finger::ALL.len())?.and_then(|tips| <[DVec3; 5]>::try_from(tips).ok());
        let number = |name: &str| map.get(name).and_then(Value::number).filter(|n| *n >= 0.0 && n.fract() == 0.0);
        let mesh = number("vertices").zip(number("triangles")).map(|(v, t)| [v as usize, t as usize]);
        let name = map.get("name").and_then(Value::text).unwrap_or(source.origin).to_owned();
        Ok(Some(FileSkeleton { name, joint_names, side, parents, rest_joints, tips, mesh }))
    }

    /// The description of a hand model.
    pub fn of(model: &HandModel) -> FileSkeleton {
        FileSkeleton {
            name: model.name.clone(),
            joint_names: model.joint_names.clone(),
            side: Some(model.side),
            parents: Some(model.parents.clone()),
            rest_joints: Some(model.joints.clone()),
            // Joints with unknown names have no fingers.
            tips: RestSkeleton::of(model).ok().map(|rig| rig.tips),
            mesh: Some([model.vertices.len(), model.faces.len()]),
        }
    }

    /// In the form that [`FileSkeleton::read`] reads.
    pub fn to_json(&self) -> serde_json::Value {
        let rows = |points: &[DVec3]| points.iter().map(DVec3::to_array).collect::<Vec<_>>();
        let mut map = json!({"name": self.name, "joints": self.joint_names});
        if let Some(side) = self.side {
            map["side"] = json!(side.to_string());
        }
        if let Some(parents) = &self.parents {
            map["parents"] = parents.iter().map(|parent| parent.map_or(json!(-1), |parent| json!(parent))).collect();
        }
        if let Some(joints) = &self.rest_joints {
            map["rest_joints"] = json!(rows(joints));
        }
        if let Some(tips) = &self.tips {
            map["tips"] = json!(rows(tips));
        }
        if let Some([vertices, triangles]) = self.mesh {
            map["vertices"] = json!(vertices);
            map["triangles"] = json!(triangles);
        }
        map
    }

    /// The data for a transfer that is missing in the description.
    pub fn missing(&self) -> Vec<&'static str> {
        let parts = [
            ("side", self.side.is_none()),
            ("parents", self.parents.is_none()),
            ("rest_joints", self.rest_joints.is_none()),
        ];
        parts.into_iter().filter_map(|(name, missing)| missing.then_some(name)).collect()
    }

    /// The skeleton with its frames.
    ///
    /// # Errors
    /// [`PoseError::Invalid`] if something is missing, or the joints' names do not identify their parts.
    pub fn rig(&self, source: &Source) -> Result<RestSkeleton, PoseError> {
        let (Some(side), Some(parents), Some(joints)) = (self.side, &self.parents, &self.rest_joints) else {
            return Err(source.invalid("hand_model", format!("lacks {}", self.missing().join(", "))));
        };
        let tips = self.tips.unwrap_or_else(|| tips(&self.joint_names, joints));
        RestSkeleton::from_rest_pose(&self.name, side, &self.joint_names, parents, joints, tips)
    }

    /// Whether rotations of this skeleton apply to a model unchanged: it has the model's joints, and either the same
    /// joints at rest, or the same mesh at rest in about the same pose. The latter is a hand of other proportions, such
    /// as an avatar with learned joints: there, copied rotations move the skin in the same way.
    pub fn is_of(&self, model: &HandModel, source: &Source) -> bool {
        let Some(rows) = self.rows_of(&model.joint_names) else { return false };
        let same_mesh = || {
            self.mesh == Some([model.vertices.len(), model.faces.len()])
                && match (self.rig(source), RestSkeleton::of(model)) {
                    (Ok(own), Ok(other)) => rows.iter().zip(&other.frames).all(|(row, frame)| {
                        own.frames.get(*row).is_some_and(|own| angle_between(own, frame) <= SAME_REST_POSE)
                    }),
                    // Joints with unknown names have no frames.
                    _ => true,
                }
        };
        let same_joints = self.rest_joints.as_ref().is_some_and(|joints| {
            rows.iter()
                .zip(&model.joints)
                .all(|(row, own)| joints.get(*row).is_some_and(|joint| joint.distance(*own) <= SAME_PLACE))
        });
        self.side == Some(model.side) && (same_joints || same_mesh())
    }

    /// The row of each of these joints, if all exist.
    pub fn rows_of(&self, names: &[String]) -> Option<Vec<usize>> {
        names.iter().map(|name| self.joint_names.iter().position(|own| own == name)).collect()
    }
}

fn angle_between(a: &DMat3, b: &DMat3) -> f64 {
    axis_angle_from_rotation(&(a.transpose() * *b)).length()
}

/// An array of names.
pub(crate) fn texts(source: &Source, field: &str, value: &Value) -> Result<Vec<String>, PoseError> {
    let texts = match value {
        Value::List(items) => items.iter().map(|item| item.text().map(str::to_owned)).collect(),
        _ => None,
    };
    texts.ok_or_else(|| source.invalid(field, format!("is {}, must be a list of names", value.kind())))
}

fn parents(value: &Value, count: usize) -> Result<Vec<Option<usize>>, String> {
    let numbers = match value.numbers() {
        Some(array) if array.shape == [count] => &array.values,
        _ => return Err(format!("is {}, must be {count} numbers, one for each joint", value.kind())),
    };
    let parent = |(k, number): (usize, &f64)| match (k, *number) {
        (0, -1.0) => Ok(None),
        (_, number) if number >= 0.0 && number < k as f64 && number.fract() == 0.0 => Ok(Some(number as usize)),
        (_, number) => {
            Err(format!("joint {k} has parent {number}; the root comes first with -1, and parents before children"))
        }
    };
    numbers.iter().enumerate().map(parent).collect()
}

fn points(value: &Value, count: usize) -> Result<Vec<DVec3>, String> {
    let array = match value.numbers() {
        Some(array) if array.shape == [count, 3] => array,
        _ => return Err(format!("is {}, must be {count} rows of 3 numbers, metres", value.kind())),
    };
    let within = |value: &f64| value.abs() <= LARGEST_COORDINATE;
    match array.values.iter().position(|value| !within(value)) {
        Some(k) => Err(format!("row {} has {}; give metres, at most {LARGEST_COORDINATE}", k / 3, array.values[k])),
        None => Ok(array.values.chunks_exact(3).map(DVec3::from_slice).collect()),
    }
}

/// Fingertips for a file without them: a joint at the tip, else a point beyond the last bone.
fn tips(names: &[String], joints: &[DVec3]) -> [DVec3; 5] {
    let roles = JointRole::of_joints(names);
    let at = |role: JointRole| joints.get(roles.iter().position(|known| *known == Some(role))?).copied();
    Finger::ALL.map(|finger| {
        let beyond = || {
            let [before, last] = [at(JointRole::Bend(finger, 2))?, at(JointRole::Bend(finger, 3))?];
            Some(last + TIP_LENGTH * (last - before))
        };
        at(JointRole::Tip(finger)).or_else(beyond).unwrap_or(DVec3::NAN)
    })
}

//! Checks of cameras, poses, ids and paths, shared by all readers. Every error carries the file's name.

use std::collections::HashMap;
use std::path::{Component, Path};

use ghand_core::pose::{LARGEST_TRANSLATION, PoseRangeError, check_shape_range};
use ghand_core::{Camera, Pose};
use glam::{DMat3, DVec2, DVec3};

use crate::error::CaptureError;

/// Rotations further than this from orthonormal (largest entry of R R^T - I) are rejected: rounding to four digits, the
/// coarsest in exported files, stays below it.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Larger images are probably a mistake; 16384 is also the largest texture of common devices.
const LARGEST_IMAGE: u32 = 16384;
/// Focal lengths and principal points beyond this are probably a mistake, pixels: a lens of two metres over pixels of
/// one micrometre has 2e6.
const LARGEST_FOCAL: f64 = 1e7;

/// Checks the content of one file.
#[derive(Clone, Copy)]
pub(crate) struct FileValidator<'a> {
    pub path: &'a Path,
}

/// A camera as stored in files: `camera_from_world`, metres, pixels.
pub(crate) struct CameraEntry<'a> {
    pub id: &'a str,
    /// The field that holds it; empty if the file holds nothing else.
    pub field: String,
    pub size: [u32; 2],
    pub focal: DVec2,
    pub principal: DVec2,
    /// `camera_from_world`, possibly rounded.
    pub rotation: DMat3,
    pub position: Position,
}

/// The position of a camera.
pub(crate) enum Position {
    /// The translation of `camera_from_world`.
    Translation(DVec3),
    /// The centre of projection.
    Center(DVec3),
}

/// The rows of a hand model's joints in a file's poses.
#[derive(Clone, Copy)]
pub(crate) struct JointRows<'a> {
    /// The row of each joint.
    pub order: &'a [usize],
    /// The joints' names, for messages.
    pub names: &'a [String],
}

/// The name of a field's member; an empty field means the whole file.
pub(crate) fn member(field: &str, name: &str) -> String {
    if field.is_empty() { name.into() } else { format!("{field}.{name}") }
}

impl FileValidator<'_> {
    pub fn invalid(&self, field: impl Into<String>, problem: impl Into<String>) -> CaptureError {
        CaptureError::Invalid { path: self.path.into(), field: field.into(), problem: problem.into() }
    }

    pub fn camera(&self, entry: &CameraEntry) -> Result<Camera, CaptureError> {
        let field = |name: &str| member(&entry.field, name);
        let [width, height] = entry.size;
        for (name, size) in [("width", width), ("height", height)] {
            if !(1..=LARGEST_IMAGE).contains(&size) {
                let problem = format!("is {size}; must be 1 to {LARGEST_IMAGE} pixels");
                return Err(self.invalid(field(name), problem));
            }
        }
        let (focal, principal) = (entry.focal, entry.principal);
        if !(focal.min_element() > 0.0 && focal.is_finite() && principal.is_finite()) {
            let problem = format!(
                "singular: focal lengths {} and {} must be positive, the principal point finite",
                focal.x, focal.y
            );
            return Err(self.invalid(field("intrinsics"), problem));
        }
        if focal.max(principal.abs()).max_element() > LARGEST_FOCAL {
            let problem = format!("has a number beyond {LARGEST_FOCAL:.0e}; give pixels");
            return Err(self.invalid(field("intrinsics"), problem));
        }
        let rotation = self.rotation(field("rotation"), entry.rotation)?;
        let translation = match entry.position {
            Position::Translation(translation) => translation,
            Position::Center(center) => -(rotation * center),
        };
        let distance = translation.length();
        // Not `>`: NaN is out of range, too.
        let in_range = distance <= LARGEST_TRANSLATION;
        if !in_range {
            let problem = PoseRangeError::Translation { distance };
            return Err(self.invalid(field("translation"), problem.to_string()));
        }
        Ok(Camera { id: entry.id.into(), width, height, focal, principal, rotation, translation })
    }

    /// The rotation nearest to a matrix that is a rotation up to rounding.
    pub fn rotation(&self, field: String, matrix: DMat3) -> Result<DMat3, CaptureError> {
        let entries = (matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
        let error =
            entries.iter().fold(0.0, |worst: f64, e| if worst >= e.abs() || worst.is_nan() { worst } else { e.abs() });
        if !(matrix.is_finite() && error <= ROTATION_TOLERANCE && matrix.determinant() > 0.0) {
            let problem = format!(
                "is not a rotation: R R^T differs from 1 by {error:.1e} (at most {ROTATION_TOLERANCE:.0e}), \
                 determinant {:.3}; give the rows of camera_from_world without scale or mirror",
                matrix.determinant()
            );
            return Err(self.invalid(field, problem));
        }
        // Newton's iteration for the polar factor converges quadratically: 1e-3, 1e-6, 1e-12, rounding.
        let mut rotation = matrix;
        for _ in 0..4 {
            rotation = (rotation + rotation.inverse().transpose()) * 0.5;
        }
        Ok(rotation)
    }

    /// A pose from rows of axis-angle numbers, one per joint. `id` is the frame's.
    pub fn pose(
        &self,
        id: &str,
        rows: &[Vec<f64>],
        translation: [f64; 3],
        joints: JointRows,
    ) -> Result<Pose, CaptureError> {
        let JointRows { order, names } = joints;
        if rows.len() != order.len() {
            let problem = format!("has {} rows, expected {}: one per joint", rows.len(), order.len());
            return Err(self.invalid(format!("frames[{id:?}].pose"), problem));
        }
        let rotations = (rows.iter().enumerate())
            .map(|(row, values)| match values[..] {
                [x, y, z] => Ok(DVec3::new(x, y, z)),
                _ => {
                    let problem = format!("row {row} has {} numbers, expected 3 (axis-angle)", values.len());
                    Err(self.invalid(format!("frames[{id:?}].pose"), problem))
                }
            })
            .collect::<Result<Vec<_>, _>>()?;
        let rotations = order.iter().filter_map(|&row| rotations.get(row).copied()).collect();
        let pose = Pose { rotations, translation: DVec3::from(translation) };
        self.pose_range(id, &pose, &[], names)?;
        Ok(pose)
    }

    /// Rejects poses and shapes that are impossible for a hand. `id` is the frame's.
    pub fn pose_range(&self, id: &str, pose: &Pose, shape: &[f64], joints: &[String]) -> Result<(), CaptureError> {
        pose.check_range(joints).and_then(|()| check_shape_range(shape)).map_err(|error| {
            let part = match error {
                PoseRangeError::Rotation { .. } => "pose",
                PoseRangeError::Translation { .. } => "translation",
                PoseRangeError::Shape { .. } => "shape",
            };
            self.invalid(format!("frames[{id:?}].{part}"), error.to_string())
        })
    }

    /// Index by id; each id must occur once.
    pub fn index<'b>(
        &self,
        field: &str,
        ids: impl Iterator<Item = &'b str>,
    ) -> Result<HashMap<&'b str, usize>, CaptureError> {
        let mut index = HashMap::new();
        for (i, id) in ids.enumerate() {
            if let Some(first) = index.insert(id, i) {
                let problem = format!("{id:?} occurs twice (numbers {first} and {i}); ids must be unique");
                return Err(self.invalid(field, problem));
            }
        }
        Ok(index)
    }

    /// An id becomes part of a path and must not redirect it.
    pub fn id(&self, field: &str, id: &str) -> Result<(), CaptureError> {
        if is_plain_id(id) {
            return Ok(());
        }
        let problem = format!("id {id:?} cannot be part of a path; use letters, digits, - and _");
        Err(self.invalid(field, problem))
    }

    /// Rejects paths that could leave the capture's folder on any system. Links inside the folder are the user's
    /// responsibility.
    pub fn is_inside_capture(&self, field: &str, path: &str) -> Result<(), CaptureError> {
        let normal = Path::new(path).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        if normal && !path.is_empty() && !path.contains(['\\', ':', '\0']) {
            return Ok(());
        }
        let problem = format!("{path:?} leaves the capture's folder; give a path inside it, with / as separator");
        Err(self.invalid(field, problem))
    }
}

/// Whether an id can be part of a path without redirecting it.
pub(crate) fn is_plain_id(id: &str) -> bool {
    !(id.is_empty() || id.starts_with('.') || id.contains(['/', '\\', ':', '\0']))
}

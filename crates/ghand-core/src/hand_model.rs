//! A hand model: a skinned surface with a UV atlas, a skeleton and blend shapes.

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Which hand a model is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Side {
    /// A right hand.
    Right,
    /// A left hand.
    Left,
}

impl Side {
    /// The other hand.
    #[must_use]
    pub fn other(self) -> Side {
        match self {
            Side::Right => Side::Left,
            Side::Left => Side::Right,
        }
    }
}

impl std::fmt::Display for Side {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            Side::Right => "right",
            Side::Left => "left",
        })
    }
}

/// An unusable part of a hand model, or an unusable request to one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{origin}: {field}: {problem}")]
pub struct InvalidHandModel {
    /// Name or file of the model.
    pub origin: String,
    /// The invalid part.
    pub field: String,
    /// The problem, and what to do about it.
    pub problem: String,
}

/// Mean and principal components of hand poses, as in MANO.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseSpace {
    /// Mean rotation of each joint except the root, axis-angle, radians, `n_b - 1`.
    pub mean: Vec<DVec3>,
    /// Principal components, `[c][n_b - 1]`, radians per unit; empty if there are none.
    pub components: Vec<DVec3>,
}

/// A rigged hand at rest.
///
/// Invariants, kept by [`HandModel::validate`]: `V` vertices, `n_b` joints, `n_s` shape directions; every parent
/// precedes its children and joint 0 is the root; weights are finite, not negative, and sum to 1 at every vertex; blend
/// shapes, joint directions and regressor are finite; all indices are in range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HandModel {
    /// Name for messages and files.
    pub name: String,
    /// Which hand it is.
    pub side: Side,
    /// Names of the `n_b` joints.
    pub joint_names: Vec<String>,
    /// Parent of each joint; `None` for the root, which is joint 0.
    pub parents: Vec<Option<usize>>,
    /// Rest positions of the joints, metres, model axes.
    pub joints: Vec<DVec3>,
    /// Rest positions of the `V` vertices, metres, model axes.
    pub vertices: Vec<DVec3>,
    /// Triangles as vertex indices, counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Points of the UV atlas, in `[0, 1]^2`, (0, 0) at the first row and column of a texture.
    pub uvs: Vec<DVec2>,
    /// Triangles as indices into `uvs`, one for each face.
    pub face_uvs: Vec<[u32; 3]>,
    /// Skinning weights, row-major `[V][n_b]`.
    pub weights: Vec<f64>,
    /// Shape blend shapes `[n_s][V]`: displacements of the vertices per unit of each shape parameter, metres. May be
    /// empty.
    pub shape_directions: Vec<DVec3>,
    /// Names of the `n_s` shape directions; empty if they have none.
    pub shape_names: Vec<String>,
    /// Pose blend shapes `[9 (n_b - 1)][V]`, metres: displacements of the vertices per entry of `R_k - I`, row by row,
    /// of all joints except the root. May be empty.
    pub pose_directions: Vec<DVec3>,
    /// Rows `[n_b]` of `(vertex, weight)`: each joint's rest position as a sum over the shaped vertices. Empty if the
    /// joints do not depend on the shape, or do as `joint_directions` say.
    pub joint_regressor: Vec<Vec<(u32, f64)>>,
    /// Displacements `[n_s][n_b]` of the rest joints per unit of each shape parameter, metres. Empty if the joints do
    /// not depend on the shape, or are regressed.
    pub joint_directions: Vec<DVec3>,
    /// The mean that poses of this model are measured from, if any.
    pub pose_space: Option<PoseSpace>,
    /// The vertex of this model for each vertex of its file: seams split in a file are welded here. Empty if the file's
    /// vertices are the model's.
    pub source_vertices: Vec<u32>,
}

/// Area-weighted unit normals of the vertices of triangles, outwards. A vertex without any area gets the zero vector.
pub fn vertex_normals(faces: &[[u32; 3]], positions: &[DVec3]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for face in faces {
        let [a, b, c] = face.map(|i| positions[i as usize]);
        let n = (b - a).cross(c - a);
        for &i in face {
            normals[i as usize] += n;
        }
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}

impl HandModel {
    /// Number of joints, `n_b`.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// The skinning weights (`n_b` of them) of one vertex.
    pub fn vertex_weights(&self, vertex: usize) -> &[f64] {
        let n = self.joint_count();
        &self.weights[vertex * n..(vertex + 1) * n]
    }

    /// Number of shape directions, `n_s`.
    pub fn shape_count(&self) -> usize {
        self.shape_directions.len() / self.vertices.len().max(1)
    }

    /// The hand of the other side: the mirror image in x, with the winding of the triangles reversed. The names of the
    /// model and its joints, the weights, the UV atlas and the pose space stay.
    #[must_use]
    pub fn mirrored(&self) -> HandModel {
        let mut model = HandModel { side: self.side.other(), ..self.clone() };
        let points = model.vertices.iter_mut().chain(&mut model.joints);
        for p in points.chain(&mut model.shape_directions).chain(&mut model.joint_directions) {
            p.x = -p.x;
        }
        // The mirrored rotation is M R M with M = diag(-1, 1, 1): entries with one index x change sign.
        for (feature, directions) in model.pose_directions.chunks_exact_mut(self.vertices.len().max(1)).enumerate() {
            let (row, column) = (feature % 9 / 3, feature % 3);
            let sign = if (row == 0) != (column == 0) { -1.0 } else { 1.0 };
            directions.iter_mut().for_each(|d| *d *= DVec3::new(-sign, sign, sign));
        }
        for t in model.faces.iter_mut().chain(&mut model.face_uvs) {
            t.swap(1, 2);
        }
        model
    }

    /// The model reduced to what skinning needs: no blend shapes, joints that do not depend on a shape, no
    /// pose space, no file order.
    pub fn without_blend_shapes(&self) -> HandModel {
        HandModel {
            name: self.name.clone(),
            side: self.side,
            joint_names: self.joint_names.clone(),
            parents: self.parents.clone(),
            joints: self.joints.clone(),
            vertices: self.vertices.clone(),
            faces: self.faces.clone(),
            uvs: self.uvs.clone(),
            face_uvs: self.face_uvs.clone(),
            weights: self.weights.clone(),
            shape_directions: vec![],
            shape_names: vec![],
            pose_directions: vec![],
            joint_regressor: vec![],
            joint_directions: vec![],
            pose_space: None,
            source_vertices: vec![],
        }
    }

    /// Index of the joint of that name.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joint_names.iter().position(|n| n == name)
    }

    /// Area-weighted unit normals of the vertices for the given vertex positions (rest or posed), outwards.
    /// A vertex without any area gets the zero vector.
    pub fn vertex_normals(&self, positions: &[DVec3]) -> Vec<DVec3> {
        vertex_normals(&self.faces, positions)
    }

    /// Checks the invariants above.
    ///
    /// # Errors
    /// [`InvalidHandModel`] names the first field that breaks one.
    pub fn validate(&self) -> Result<(), InvalidHandModel> {
        let fail = |field: &str, problem: String| {
            Err(InvalidHandModel { origin: self.name.clone(), field: field.into(), problem })
        };
        let (v, n) = (self.vertices.len(), self.joints.len());
        if n == 0 || v == 0 || self.faces.is_empty() {
            return fail(
                "mesh",
                format!("has {v} vertices, {} faces and {n} joints; all must be present", self.faces.len()),
            );
        }
        if self.joint_names.len() != n || self.parents.len() != n {
            return fail(
                "joints",
                format!("{n} positions, {} names, {} parents", self.joint_names.len(), self.parents.len()),
            );
        }
        for (k, parent) in self.parents.iter().enumerate() {
            let good = match parent {
                None => k == 0,
                Some(p) => k > 0 && *p < k,
            };
            if !good {
                return fail("parents", format!("joint {k} must come after its parent, and only joint 0 is a root"));
            }
        }
        if let Some(k) = self.joints.iter().position(|j| !j.is_finite()) {
            return fail("joints", format!("joint {k} is not finite"));
        }
        if let Some(k) = self.vertices.iter().position(|j| !j.is_finite()) {
            return fail("vertices", format!("vertex {k} is not finite"));
        }
        if self.faces.iter().flatten().any(|&i| i as usize >= v) {
            return fail("faces", format!("an index is out of range ({v} vertices)"));
        }
        if self.face_uvs.len() != self.faces.len() {
            return fail(
                "uv",
                format!(
                    "{} UV triangles for {} faces; export the model with one UV atlas",
                    self.face_uvs.len(),
                    self.faces.len()
                ),
            );
        }
        if self.face_uvs.iter().flatten().any(|&i| i as usize >= self.uvs.len()) {
            return fail("uv", format!("an index is out of range ({} UV points)", self.uvs.len()));
        }
        if self.uvs.iter().any(|t| !t.is_finite()) {
            return fail("uv", "a UV point is not finite".into());
        }
        if self.weights.len() != v * n {
            return fail("weights", format!("{} numbers, expected {v} vertices x {n} joints", self.weights.len()));
        }
        for i in 0..v {
            let row = self.vertex_weights(i);
            let sum: f64 = row.iter().sum();
            if !(row.iter().all(|w| *w >= 0.0) && (sum - 1.0).abs() <= 1e-6) {
                return fail(
                    "weights",
                    format!("vertex {i}: weights must be at least 0 and sum to 1, but they sum to {sum}"),
                );
            }
        }
        if !self.shape_directions.len().is_multiple_of(v) {
            return fail(
                "shape directions",
                format!("{} vectors are not a multiple of {v}", self.shape_directions.len()),
            );
        }
        let shapes = self.shape_count();
        if !self.shape_names.is_empty() && self.shape_names.len() != shapes {
            return fail("shape names", format!("{} of them for {shapes} directions", self.shape_names.len()));
        }
        let corrective_count = 9 * (n - 1) * v;
        if !self.pose_directions.is_empty() && self.pose_directions.len() != corrective_count {
            let found = self.pose_directions.len();
            return fail("pose directions", format!("{found} vectors, expected none or {corrective_count}"));
        }
        if self.shape_directions.iter().chain(&self.pose_directions).any(|d| !d.is_finite()) {
            return fail("blend shapes", "have a number that is not finite".into());
        }
        if !self.joint_regressor.is_empty() && self.joint_regressor.len() != n {
            return fail("joint regressor", format!("{} rows, expected none or {n}", self.joint_regressor.len()));
        }
        if self.joint_regressor.iter().flatten().any(|(i, w)| *i as usize >= v || !w.is_finite()) {
            return fail(
                "joint regressor",
                format!("refers to a vertex beyond {v}, or has a weight that is not finite"),
            );
        }
        if !self.joint_directions.is_empty() && self.joint_directions.len() != shapes * n {
            let found = self.joint_directions.len();
            return fail("joint directions", format!("{found} vectors, expected none or {shapes} x {n} joints"));
        }
        if self.joint_directions.iter().any(|d| !d.is_finite()) {
            return fail("joint directions", "have a number that is not finite".into());
        }
        if !self.joint_directions.is_empty() && !self.joint_regressor.is_empty() {
            let problem = "beside a joint regressor: a shape would move the joints twice; keep one of the two";
            return fail("joint directions", problem.into());
        }
        if let Some(space) = &self.pose_space {
            if space.mean.len() != n - 1 || space.components.len().checked_rem(n - 1).unwrap_or(0) != 0 {
                return fail("pose space", format!("does not match {n} joints"));
            }
            if space.mean.iter().chain(&space.components).any(|r| !r.is_finite()) {
                return fail("pose space", "has a number that is not finite".into());
            }
        }
        if self.source_vertices.iter().any(|&i| i as usize >= v) {
            return fail("file vertices", format!("an index is out of range ({v} vertices)"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle with two joints and two shape directions.
    fn triangle() -> HandModel {
        HandModel {
            name: "triangle".into(),
            side: Side::Right,
            joint_names: vec!["a".into(), "b".into()],
            parents: vec![None, Some(0)],
            joints: vec![DVec3::ZERO, DVec3::X],
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            faces: vec![[0, 1, 2]],
            uvs: vec![DVec2::ZERO, DVec2::X, DVec2::Y],
            face_uvs: vec![[0, 1, 2]],
            weights: vec![1.0, 0.0, 0.0, 1.0, 0.5, 0.5],
            shape_directions: vec![DVec3::Z; 6],
            shape_names: vec!["size".into(), "width".into()],
            pose_directions: vec![],
            joint_regressor: vec![],
            joint_directions: vec![DVec3::Z; 4],
            pose_space: None,
            source_vertices: vec![],
        }
    }

    #[test]
    fn names_and_joint_directions_that_do_not_match_the_shapes_are_rejected() {
        triangle().validate().unwrap();
        let rejected = |change: fn(&mut HandModel), expected: &str| {
            let mut model = triangle();
            change(&mut model);
            let message = model.validate().unwrap_err().to_string();
            assert!(message.contains(expected), "wanted {expected:?}, got {message:?}");
        };
        rejected(|m| m.shape_names.truncate(1), "shape names: 1 of them for 2 directions");
        rejected(|m| m.joint_directions.truncate(3), "joint directions: 3 vectors, expected none or 2 x 2 joints");
        rejected(|m| m.joint_directions[1].y = f64::NAN, "joint directions: have a number that is not finite");
        rejected(|m| m.joint_regressor = vec![vec![(0, 1.0)], vec![]], "joint directions: beside a joint regressor");
    }
}

//! The normal equations of one frame: how its contours change with its pose and with the shape.

use ghand_core::posing::PosedModel;
use ghand_core::skeleton::Affine;
use ghand_core::{Camera, InvalidHandModel, Pose};
use glam::{DMat3, DVec3};
use nalgebra::{DMatrix, DVector};

use super::cameras::unknowns::CameraUnknowns;
use super::correctives::FEATURES;
use super::outlines::contour::{ContourPoint, Edges};
use super::outlines::distance_field::DistanceField;
use super::proportions::Shaped;

/// Neighbouring points of a contour err alike: so many pixels of it count as one measurement.
const CORRELATION: f64 = 8.0;
/// Standard deviation of such a measurement in the only image of a frame, pixels. The template's surface is not quite the
/// hand's, in all images alike: more images do not say more about that, so the variance grows with their number.
const DEVIATION: f64 = 1.0;

/// What does not change from frame to frame.
pub struct Rig<'a> {
    pub shaped: &'a Shaped,
    pub edges: &'a Edges,
    /// Joints whose rotations are unknown.
    pub moving: &'a [usize],
    /// Whether joint `[k]` carries joint `[j]`, or is it.
    pub carries: &'a [Vec<bool>],
    /// Distance beyond which a residual counts linearly, pixels.
    pub huber: f64,
}

/// Second-order expansion of half the squared, weighted residuals of a frame: about its pose, with a step (rotation
/// vectors of the moving joints in their parents' axes, radians; translation, metres), and about what all frames share:
/// the shape, then what is unknown of the cameras.
pub struct FrameEquations {
    pub pose_pose: DMatrix<f64>,
    pub pose_shared: DMatrix<f64>,
    pub shared_shared: DMatrix<f64>,
    pub d_pose: DVector<f64>,
    pub d_shared: DVector<f64>,
    /// Distances of the contour points from the masks' outlines, pixels.
    pub distances: Vec<f64>,
    /// Half the squared, weighted residuals; linear beyond the Huber distance.
    pub cost: f64,
}

impl Rig<'_> {
    /// The equations of a frame in a pose, from all its images, with known cameras.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the template.
    pub fn equations(
        &self,
        pose: &Pose,
        images: &[(&Camera, &DistanceField)],
    ) -> Result<FrameEquations, InvalidHandModel> {
        self.equations_with(pose, images, None)
    }

    /// The same; some of the cameras may be unknown.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the template.
    pub fn equations_with(
        &self,
        pose: &Pose,
        images: &[(&Camera, &DistanceField)],
        unknowns: Option<&CameraUnknowns>,
    ) -> Result<FrameEquations, InvalidHandModel> {
        let model = &self.shaped.model;
        let posed = self.shaped.pose(pose)?;
        let normals = model.vertex_normals(&posed.vertices);
        let pose_count = 3 * self.moving.len() + 3;
        let first_of_cameras = pose_count + self.shaped.d_joints.len();
        let count = first_of_cameras + unknowns.map_or(0, CameraUnknowns::count);
        let mut motion = VertexMotion::new(self, &posed);
        let mut matrix = DMatrix::zeros(count, count);
        let mut gradient = DVector::zeros(count);
        let mut distances = vec![];
        let mut cost = 0.0;
        let mut row: Vec<(usize, f64)> = vec![];
        for (camera, field) in images {
            let shifted = unknowns.and_then(|unknowns| unknowns.at_time_of(camera, &posed.vertices));
            let vertices = shifted.as_ref().unwrap_or(&posed.vertices);
            for point in self.edges.contour(vertices, &normals, camera, field) {
                distances.push(point.residual.abs());
                motion.row(&point, &mut row);
                if let Some(unknowns) = unknowns {
                    unknowns.row(camera, &point, first_of_cameras, &mut row);
                }
                let robust = (self.huber / point.residual.abs().max(1e-9)).min(1.0);
                let weight = robust * point.length / (CORRELATION * (DEVIATION.powi(2) * images.len() as f64));
                // Of Huber's function r (d - r / 2) from the distance r on, divided by its weight r / d.
                cost += weight * point.residual.powi(2) * (1.0 - 0.5 * robust);
                for (k, (i, a)) in row.iter().enumerate() {
                    gradient[*i] += weight * a * point.residual;
                    // The upper triangle, whose columns are contiguous.
                    row.iter().take(k + 1).for_each(|(j, b)| matrix[(*j, *i)] += weight * a * b);
                }
            }
        }
        for column in 0..count {
            for line in column + 1..count {
                matrix[(line, column)] = matrix[(column, line)];
            }
        }
        let shared_count = count - pose_count;
        Ok(FrameEquations {
            pose_pose: matrix.view((0, 0), (pose_count, pose_count)).into(),
            pose_shared: matrix.view((0, pose_count), (pose_count, shared_count)).into(),
            shared_shared: matrix.view((pose_count, pose_count), (shared_count, shared_count)).into(),
            d_pose: gradient.rows(0, pose_count).into(),
            d_shared: gradient.rows(pose_count, shared_count).into(),
            distances,
            cost,
        })
    }
}

/// How the vertices of a frame move with its pose, its correctives included, and with the shape.
pub struct VertexMotion<'a> {
    rig: &'a Rig<'a>,
    posed: &'a PosedModel,
    /// By the shape's parameters: how a point at the origin at rest moves if one joint alone carries it, `[parameters][n_b]`.
    d_carried: Vec<Vec<DVec3>>,
    /// By vertex, once it is needed: how it moves with each moving joint's rotation about its parent's three axes, then with
    /// the shape's parameters.
    known: Vec<Option<Vec<DVec3>>>,
}

impl<'a> VertexMotion<'a> {
    /// Of a posed hand.
    pub fn new(rig: &'a Rig<'a>, posed: &'a PosedModel) -> VertexMotion<'a> {
        let model = &rig.shaped.model;
        let world = &posed.chain.world;
        let d_carried = |d_joints: &Vec<DVec3>| {
            let mut moved = d_joints.clone();
            for (k, parent) in model.parents.iter().enumerate() {
                if let Some(p) = *parent {
                    moved[k] = moved[p] + world[p].linear * (d_joints[k] - d_joints[p]);
                }
            }
            let of_joint = |((moved, world), d): ((&DVec3, &Affine), &DVec3)| *moved - world.linear * *d;
            moved.iter().zip(world).zip(d_joints).map(of_joint).collect()
        };
        let d_carried = rig.shaped.d_joints.iter().map(d_carried).collect();
        VertexMotion { rig, posed, d_carried, known: vec![None; model.vertices.len()] }
    }

    /// The non-zero derivatives of a contour point's residual, by ascending parameter.
    fn row(&mut self, point: &ContourPoint, row: &mut Vec<(usize, f64)>) {
        row.clear();
        for vertex in point.edge {
            if self.known[vertex as usize].is_none() {
                self.known[vertex as usize] = Some(self.of_vertex(vertex as usize));
            }
        }
        let [Some(a), Some(b)] = point.edge.map(|vertex| self.known[vertex as usize].as_ref()) else { return };
        let mut push = |parameter: usize, value: f64| {
            if value != 0.0 {
                row.push((parameter, value));
            }
        };
        let translation = 3 * self.rig.moving.len();
        let mean = |k: usize| point.gradient.dot(0.5 * (a[k] + b[k]));
        (0..translation).for_each(|k| push(k, mean(k)));
        let gradient = point.gradient.to_array();
        gradient.into_iter().enumerate().for_each(|(axis, value)| push(translation + axis, value));
        (translation..a.len()).for_each(|k| push(k + 3, mean(k)));
    }

    /// The non-zero derivatives of a face point's position by the pose, by ascending parameter. The point is the mean of
    /// the corners with these weights.
    pub fn of_face_point(&mut self, corners: [u32; 3], weights: [f64; 3], row: &mut Vec<(usize, DVec3)>) {
        row.clear();
        for vertex in corners {
            if self.known[vertex as usize].is_none() {
                self.known[vertex as usize] = Some(self.of_vertex(vertex as usize));
            }
        }
        let [Some(a), Some(b), Some(c)] = corners.map(|vertex| self.known[vertex as usize].as_ref()) else { return };
        let translation = 3 * self.rig.moving.len();
        for first in (0..translation).step_by(3) {
            let axes = first..first + 3;
            if [a, b, c].iter().all(|by| by[axes.clone()].iter().all(|d| *d == DVec3::ZERO)) {
                continue;
            }
            row.extend(axes.map(|k| (k, weights[0] * a[k] + weights[1] * b[k] + weights[2] * c[k])));
        }
        row.extend((0..3).map(|axis| (translation + axis, DVec3::AXES[axis])));
    }

    fn of_vertex(&self, vertex: usize) -> Vec<DVec3> {
        let model = &self.rig.shaped.model;
        let chain = &self.posed.chain;
        let bound = self.rig.shaped.bound.of_vertex(vertex);
        let mut correctives = self.rig.shaped.correctives.of_vertex(vertex).iter().peekable();
        let carried: Vec<DVec3> =
            bound.iter().map(|(j, _)| chain.posed_from_rest[*j].apply(self.posed.corrected[vertex])).collect();
        let blended: DMat3 = bound.iter().map(|(j, weight)| chain.world[*j].linear * *weight).sum();
        let mut by_joint = |joint: &usize| -> [DVec3; 3] {
            let origin = chain.world[*joint].translation;
            let moved = bound.iter().zip(&carried).filter(|((j, _), _)| self.rig.carries[*joint][*j]);
            let arm: DVec3 = moved.map(|((_, weight), at)| *weight * (*at - origin)).sum();
            let axes = model.parents[*joint].map_or(DMat3::IDENTITY, |parent| chain.world[parent].linear);
            let turned = [0, 1, 2].map(|axis| axes.col(axis).cross(arm));
            // Both ascend; correctives of joints that do not move are passed over.
            while correctives.next_if(|(own, _)| own < joint).is_some() {}
            let Some((_, directions)) = correctives.next_if(|(own, _)| own == joint) else { return turned };
            let corrected = self.by_corrective(directions, *joint);
            std::array::from_fn(|axis| turned[axis] + blended * corrected[axis])
        };
        let count = self.d_carried.len();
        let d_vertices = &self.rig.shaped.d_vertices[vertex * count..][..count];
        let by_shape = |(d_vertex, d_carried): (&DVec3, &Vec<DVec3>)| -> DVec3 {
            let moved: DVec3 = bound.iter().map(|(j, weight)| *weight * d_carried[*j]).sum();
            blended * *d_vertex + moved
        };
        let mut motion = Vec::with_capacity(3 * self.rig.moving.len() + count);
        motion.extend(self.rig.moving.iter().flat_map(&mut by_joint));
        motion.extend(d_vertices.iter().zip(&self.d_carried).map(by_shape));
        motion
    }

    /// How a vertex's pose corrective at rest, with these directions of a joint, changes with that joint's rotation about its
    /// parent's axes.
    fn by_corrective(&self, directions: &[DVec3; FEATURES], joint: usize) -> [DVec3; 3] {
        let columns = self.posed.chain.local[joint].to_cols_array_2d();
        DVec3::AXES.map(|axis| {
            // A step turns the rotation's columns; the directions are by its rows.
            let d_columns = columns.map(|column| axis.cross(column.into()));
            (0..FEATURES).map(|f| directions[f] * d_columns[f % 3][f / 3]).sum()
        })
    }
}

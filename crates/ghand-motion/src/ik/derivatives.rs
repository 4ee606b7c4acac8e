//! How the landmarks of a posed hand move with its unknowns.

use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::skeleton::{Chain, pose_skeleton};
use glam::{DMat3, DVec3};

use super::{HandIk, LANDMARK_COUNT, UNKNOWNS, read, write};

/// The matrix of normal equations.
pub(super) type Square = Box<[[f64; UNKNOWNS]; UNKNOWNS]>;

/// Derivatives of one landmark: unknowns with what they move it by. Those that are missing do not move it.
pub(super) type Row = Vec<(usize, DVec3)>;

impl HandIk {
    pub(super) fn chain(&self, x: &[f64; UNKNOWNS]) -> Chain {
        pose_skeleton(&self.parents, &self.joints, &self.rotations(x))
    }

    /// The landmarks of a chain, metres, world.
    pub(super) fn places(&self, chain: &Chain, x: &[f64; UNKNOWNS]) -> [DVec3; LANDMARK_COUNT] {
        let translation = read(x, 3);
        self.landmarks.map(|joint| chain.world[joint].translation + translation)
    }

    /// Derivatives of all landmarks.
    pub(super) fn landmark_derivatives(&self, chain: &Chain, x: &[f64; UNKNOWNS]) -> Vec<Row> {
        // A joint's unknowns turn all that follows about axes through the joint.
        let turn = |joint: usize, rotation: DVec3| {
            let parent = self.parents[joint].map_or(DMat3::IDENTITY, |p| chain.world[p].linear);
            parent * left_jacobian(rotation)
        };
        let root = turn(0, read(x, 0));
        let hinges: Vec<[DVec3; 3]> = (self.hinges.iter().enumerate())
            .map(|(k, (joint, axes))| {
                let turn = turn(*joint, axes.rotation(read(x, 6 + 3 * k)));
                DVec3::AXES.map(|angle| turn * axes.rotation(angle))
            })
            .collect();
        (0..LANDMARK_COUNT)
            .map(|i| {
                let place = chain.world[self.landmarks[i]].translation;
                let arm = |joint: usize| place - chain.world[joint].translation;
                let mut row: Row = (0..3).map(|k| (k, root.col(k).cross(arm(0)))).collect();
                row.extend((0..3).map(|k| (3 + k, DVec3::AXES[k])));
                for k in self.moving_hinges(i) {
                    let arm = arm(self.hinges[k].0);
                    row.extend((0..3).map(|c| (6 + 3 * k + c, hinges[k][c].cross(arm))));
                }
                row
            })
            .collect()
    }
}

/// Adds a landmark to `J^T A J` and `J^T a`, where A is its `information` and a its `pull`.
pub(super) fn add(row: &Row, information: &DMat3, pull: DVec3, matrix: &mut Square, vector: &mut [f64; UNKNOWNS]) {
    for &(a, moved) in row {
        vector[a] += moved.dot(pull);
        let felt = *information * moved;
        for &(b, other) in row {
            matrix[a][b] += felt.dot(other);
        }
    }
}

/// The rotation vector of the root with at most half a turn: longer ones come near a whole turn, where the derivative
/// vanishes.
pub(super) fn settle_root(x: &mut [f64; UNKNOWNS]) {
    let root = read(x, 0);
    if root.length() > std::f64::consts::PI {
        write(x, 0, axis_angle_from_rotation(&rotation_from_axis_angle(root)));
    }
}

/// The small rotation, applied after that of `v`, by which a change of the rotation vector turns.
pub(super) fn left_jacobian(v: DVec3) -> DMat3 {
    let cross = DMat3::from_cols(v.cross(DVec3::X), v.cross(DVec3::Y), v.cross(DVec3::Z));
    let squared = v.length_squared();
    let (first, second) = if squared < 1e-6 {
        (0.5 - squared / 24.0, 1.0 / 6.0 - squared / 120.0)
    } else {
        let angle = squared.sqrt();
        ((1.0 - angle.cos()) / squared, (angle - angle.sin()) / (squared * angle))
    };
    DMat3::IDENTITY + first * cross + second * (cross * cross)
}

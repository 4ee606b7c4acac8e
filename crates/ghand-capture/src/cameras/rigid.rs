//! Rigid motions: where cameras, boards and hands stand.

use glam::{DMat3, DVec3};

/// A turn, then a shift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rigid {
    /// The turn.
    pub rotation: DMat3,
    /// The shift, in the unit of the points.
    pub translation: DVec3,
}

impl Rigid {
    /// Moves nothing.
    pub const IDENTITY: Rigid = Rigid { rotation: DMat3::IDENTITY, translation: DVec3::ZERO };

    /// Where a point goes.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// The way back. Of a camera's motion from the world, its translation is the centre of projection.
    #[must_use]
    pub fn inverse(&self) -> Rigid {
        let rotation = self.rotation.transpose();
        Rigid { rotation, translation: -(rotation * self.translation) }
    }

    /// First `other`, then this.
    #[must_use]
    pub fn after(&self, other: &Rigid) -> Rigid {
        Rigid { rotation: self.rotation * other.rotation, translation: self.apply(other.translation) }
    }

    /// The angle between both turns, radians.
    pub fn angle(&self, other: &Rigid) -> f64 {
        let turn = self.rotation * other.rotation.transpose();
        (0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0)).clamp(-1.0, 1.0).acos()
    }
}

//! Rotations from the numbers that files hold.

use glam::{DMat3, DQuat, DVec3};

/// OpenCV's rotation vector: axis times angle.
pub(super) fn from_rotation_vector(vector: DVec3) -> DMat3 {
    let angle = vector.length();
    // So small an angle turns a point at the horizon by less than any pixel.
    if angle < 1e-12 { DMat3::IDENTITY } else { DMat3::from_axis_angle(vector / angle, angle) }
}

/// A quaternion with the real part first, of any length but 0; `None` otherwise.
pub(super) fn from_wxyz([w, x, y, z]: [f64; 4]) -> Option<DMat3> {
    let quaternion = DQuat::from_xyzw(x, y, z, w);
    let length = quaternion.length();
    (length > 1e-6 && length.is_finite()).then(|| DMat3::from_quat(quaternion / length))
}

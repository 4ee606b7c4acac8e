//! Limits of an avatar's pose response: its range over the training poses, with a margin.

use ghand_core::Pose;
use ghand_core::pose_response::{PoseResponse, pose_features};

use super::tables::DirectTables;
use crate::avatar::Avatar;
use crate::properties::PropertyTables;

/// Margin of the response beyond its range in training, at either end, as a fraction of the range's width.
pub const RESPONSE_MARGIN: f64 = 0.2;

impl DirectTables {
    /// The pose response of these tables, in f64.
    pub fn pose_response(&self, channels: usize) -> PoseResponse {
        let mut bias: Vec<f64> = self.response.iter().map(|v| f64::from(*v)).collect();
        let gain = bias.split_off(channels);
        let limits = self.response_limits.as_chunks::<2>().0.iter().map(|limit| limit.map(f64::from)).collect();
        PoseResponse { bias, gain, limits }
    }
}

impl Avatar {
    /// Limits the pose response to its range over the training poses, with a margin of [`RESPONSE_MARGIN`]. Beyond it
    /// the response would be an extrapolation that grows with the angle.
    ///
    /// Each joint's term in each channel is limited separately, since Gaussians depend on single joints: a new
    /// combination of joint rotations from training is not limited. Without poses there are no limits. Networks have none
    /// either: they see posed points, which stay within the hand's reach. How they do beyond training is not measured.
    pub fn limit_response(&mut self, poses: &[Pose]) {
        let channels = self.config.channels();
        let features: Vec<_> = poses.iter().map(pose_features).collect();
        let PropertyTables::Direct(tables) = &mut self.tables else { return };
        let limits = tables.pose_response(channels).limits_over(&features, RESPONSE_MARGIN);
        let finite = |limit: &f64| (*limit as f32).clamp(f32::MIN, f32::MAX);
        tables.response_limits = limits.as_flattened().iter().map(finite).collect();
    }
}

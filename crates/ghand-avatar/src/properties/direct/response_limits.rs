//! How far an avatar's pose response may go: over the poses it was trained on, and a little further.

use ghand_core::Pose;
use ghand_core::pose_response::{PoseResponse, pose_features};

use super::tables::DirectTables;
use crate::avatar::Avatar;
use crate::properties::PropertyTables;

/// How far the response may go beyond its range in training, as a part of the width of that range, at either end.
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
    /// Limits the pose response to its range over the poses that the avatar was trained on, with a margin of
    /// [`RESPONSE_MARGIN`]. Beyond it the response would be a guess that grows with the angle.
    ///
    /// Each joint's part in each channel is limited by itself, since Gaussians feel single joints: a pose of which every
    /// joint was seen, but not all at once, is not held back. Without poses there are no limits.
    pub fn limit_response(&mut self, poses: &[Pose]) {
        let channels = self.config.channels();
        let features: Vec<_> = poses.iter().map(pose_features).collect();
        let PropertyTables::Direct(tables) = &mut self.tables;
        let limits = tables.pose_response(channels).limits_over(&features, RESPONSE_MARGIN);
        let finite = |limit: &f64| (*limit as f32).clamp(f32::MIN, f32::MAX);
        tables.response_limits = limits.as_flattened().iter().map(finite).collect();
    }
}

//! What can be chosen about a training run.

use ghand_avatar::AvatarConfig;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use serde::{Deserialize, Serialize};

/// Settings of a training run. Every field can be set as `--set field=value`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainSettings {
    /// Iterations of both stages together; one view each.
    pub iterations: u64,
    /// Part of the iterations that belongs to stage 1, where poses are refined.
    pub pose_stage: f64,
    /// How often, evenly over stage 1 and first at its start, the poses are drawn to a prior fitted to themselves.
    pub pose_prior_rounds: u64,
    /// Resolution of the UV raster in stage 1.
    pub pose_uv_resolution: u32,
    /// How many times smaller the images of stage 1 are.
    pub pose_image_reduction: u32,
    /// Seed of everything random.
    pub seed: u64,
    /// Resolution of the UV raster whose texels are the Gaussians.
    pub uv_resolution: u32,
    /// Number of shape bases, n.
    pub shape_bases: usize,
    /// Number of pose-dependent colour components.
    pub color_components: usize,
    /// How far inside of the template's surface the Gaussians start, in their standard deviations.
    pub start_inset: f64,
    /// What the residual skinning weights mean.
    pub residual_weights: ResidualWeights,
    /// Where the residual skeleton stands.
    pub residual_skeleton: ResidualSkeleton,
    /// Weight of the mean absolute colour difference.
    pub l1_weight: f64,
    /// Weight of 1 - SSIM.
    pub ssim_weight: f64,
    /// Weight of the mean squared offset (metres^2).
    pub offset_weight: f64,
    /// Weight of the mean squared scale (metres^2) in stage 1; 0 in stage 2.
    pub scale_weight: f64,
    /// Pixels kept around the mask when a view is cropped to the hand.
    pub crop_margin: u32,
    /// All rates fall exponentially to this part of themselves at the end.
    pub final_rate: f64,
    /// Rate of the shape bases, metres.
    pub rate_shape_basis: f64,
    /// Rate of the residual skinning weights.
    pub rate_residual_weights: f64,
    /// Rate of the skeleton regressor.
    pub rate_regressor: f64,
    /// Rate of the scale logits.
    pub rate_scale: f64,
    /// Rate of the base colour logits.
    pub rate_color: f64,
    /// Rate of the colour components.
    pub rate_components: f64,
    /// Rate of the pose response.
    pub rate_response: f64,
    /// Rate of the rest joints, metres; 0 keeps the template's skeleton, as in the paper.
    pub rate_joints: f64,
    /// Rate of the joint rotations in stage 1, radians.
    pub rate_pose: f64,
    /// Rate of the translation in stage 1, metres.
    pub rate_translation: f64,
}

impl Default for TrainSettings {
    fn default() -> Self {
        TrainSettings {
            iterations: 3400,
            pose_stage: 0.62,
            pose_prior_rounds: 3,
            pose_uv_resolution: 96,
            pose_image_reduction: 2,
            seed: 1,
            uv_resolution: 160,
            shape_bases: 8,
            color_components: 4,
            // A little too thin at first does better than a little too fat: nothing outside of the hand needs unlearning.
            start_inset: 3.0,
            residual_weights: ResidualWeights::default(),
            residual_skeleton: ResidualSkeleton::default(),
            l1_weight: 0.8,
            ssim_weight: 0.2,
            offset_weight: 10.0,
            scale_weight: 1.0,
            crop_margin: 16,
            final_rate: 0.05,
            rate_shape_basis: 1e-4,
            rate_residual_weights: 2e-4,
            rate_regressor: 1e-6,
            rate_scale: 1e-2,
            rate_color: 2e-2,
            rate_components: 5e-3,
            rate_response: 5e-3,
            rate_joints: 1e-4,
            rate_pose: 1e-2,
            rate_translation: 1e-3,
        }
    }
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("setting `{setting}`: {problem}")]
pub struct SettingsError {
    /// The setting.
    pub setting: String,
    /// What is wrong and what would be right.
    pub problem: String,
}

impl TrainSettings {
    /// Applies `key=value`.
    ///
    /// # Errors
    /// [`SettingsError`] if there is no such key or the value does not fit.
    pub fn set(&mut self, assignment: &str) -> Result<(), SettingsError> {
        let fail = |problem: String| SettingsError { setting: assignment.into(), problem };
        let (key, value) = assignment.split_once('=').ok_or_else(|| fail("expected the form key=value".into()))?;
        let mut fields = serde_json::to_value(&*self).map_err(|e| fail(e.to_string()))?;
        let known = fields.as_object().map(|o| o.keys().cloned().collect::<Vec<_>>().join(", ")).unwrap_or_default();
        let Some(slot) = fields.get_mut(key.trim()) else {
            return Err(fail(format!("there is no such setting; there are: {known}")));
        };
        // Words such as `paper` are not JSON; they are taken as text.
        let value = value.trim();
        *slot = serde_json::from_str(value).unwrap_or_else(|_| serde_json::Value::String(value.into()));
        *self = serde_json::from_value(fields).map_err(|e| fail(e.to_string()))?;
        self.check()
    }

    /// Checks ranges.
    ///
    /// # Errors
    /// [`SettingsError`] names the first setting that is out of range.
    pub fn check(&self) -> Result<(), SettingsError> {
        let fail =
            |setting: &str, problem: &str| Err(SettingsError { setting: setting.into(), problem: problem.into() });
        if !(0.0..=1.0).contains(&self.pose_stage) {
            return fail("pose_stage", "must lie between 0 and 1");
        }
        for (name, value) in [("uv_resolution", self.uv_resolution), ("pose_uv_resolution", self.pose_uv_resolution)] {
            if !(8..=2048).contains(&value) {
                return fail(name, "must lie between 8 and 2048");
            }
        }
        if !(1..=16).contains(&self.pose_image_reduction) {
            return fail("pose_image_reduction", "must lie between 1 and 16");
        }
        if !(1..=32).contains(&self.shape_bases) || self.color_components > 32 {
            return fail("shape_bases, color_components", "must lie between 1 and 32, and 0 and 32");
        }
        if !(self.final_rate > 0.0 && self.final_rate <= 1.0) {
            return fail("final_rate", "must be above 0 and at most 1");
        }
        let numbers = [
            ("start_inset", self.start_inset),
            ("l1_weight", self.l1_weight),
            ("ssim_weight", self.ssim_weight),
            ("offset_weight", self.offset_weight),
            ("scale_weight", self.scale_weight),
            ("rate_shape_basis", self.rate_shape_basis),
            ("rate_residual_weights", self.rate_residual_weights),
            ("rate_regressor", self.rate_regressor),
            ("rate_scale", self.rate_scale),
            ("rate_color", self.rate_color),
            ("rate_components", self.rate_components),
            ("rate_response", self.rate_response),
            ("rate_joints", self.rate_joints),
            ("rate_pose", self.rate_pose),
            ("rate_translation", self.rate_translation),
        ];
        match numbers.iter().find(|(_, v)| !(*v >= 0.0 && v.is_finite())) {
            Some((name, _)) => fail(name, "must be a finite number, at least 0"),
            None => Ok(()),
        }
    }

    /// The part of the settings that the avatar keeps.
    pub fn avatar(&self) -> AvatarConfig {
        AvatarConfig {
            uv_resolution: self.uv_resolution,
            shape_bases: self.shape_bases,
            color_components: self.color_components,
            residual_weights: self.residual_weights,
            residual_skeleton: self.residual_skeleton,
        }
    }

    /// The settings of stage 1: one constant basis and constant colours, and no residual weights or skeleton, so that
    /// the poses alone explain how frames differ.
    pub fn pose_stage_settings(&self) -> TrainSettings {
        TrainSettings {
            uv_resolution: self.pose_uv_resolution,
            shape_bases: 1,
            color_components: 0,
            rate_residual_weights: 0.0,
            rate_regressor: 0.0,
            rate_response: 0.0,
            ..self.clone()
        }
    }

    /// Iterations of stage 1.
    pub fn pose_iterations(&self) -> u64 {
        (self.iterations as f64 * self.pose_stage).round() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_set_by_name_and_refused_by_name() {
        let mut s = TrainSettings::default();
        s.set("iterations=7").unwrap();
        s.set("residual_weights = paper").unwrap();
        s.set("rate_pose=1e-4").unwrap();
        assert_eq!((s.iterations, s.residual_weights, s.rate_pose), (7, ResidualWeights::Paper, 1e-4));
        for bad in ["iterations=-1", "nonsense=1", "iterations", "uv_resolution=1", "rate_pose=NaN", "pose_stage=2"] {
            let before = s.clone();
            let message = s.clone().set(bad).unwrap_err().to_string();
            assert!(!message.contains('\n'), "{message}");
            assert_eq!(s, before);
        }
    }
}

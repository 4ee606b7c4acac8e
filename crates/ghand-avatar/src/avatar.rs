//! An avatar: a sampled template, its configuration, and the learned tables.

use ghand_core::HandModel;
use ghand_core::pose_offsets::TrackerOffsets;
use ghand_hand_model::{HandModelError, SurfaceSamples, surface};
use serde::{Deserialize, Serialize};

use crate::light::AvatarLight;
use crate::local_thickness::local_thickness;
use crate::properties::network::NetworkSizes;
use crate::properties::{PropertyStart, PropertyTables};
use crate::template::{AvatarConfig, Template};

/// The origin of an avatar.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Provenance {
    /// Name of the capture.
    pub capture: String,
    /// Split that it was trained on.
    pub split: String,
    /// Training iterations.
    pub iterations: u64,
    /// Seed.
    pub seed: u64,
    /// Version of ghand.
    pub version: String,
}

/// A hand avatar.
#[derive(Debug, Clone, PartialEq)]
pub struct Avatar {
    /// The sampled hand model.
    pub template: Template,
    /// The hand model's mesh, for overlays and for picking named poses.
    pub model: HandModel,
    /// Configuration that fixes the shape and interpretation of the tables.
    pub config: AvatarConfig,
    /// The learned tables of the property model.
    pub tables: PropertyTables,
    /// The light of the capture, if it is apart from the colours in the tables.
    pub light: Option<AvatarLight>,
    /// How much training saw each Gaussian: the sum of its blend weights over the pixels of a view, as a mean over an even
    /// selection of the training views; N numbers of at least 0. Unknown for untrained avatars and for those from
    /// elsewhere.
    pub seen: Option<Vec<f32>>,
    /// How the tracker that gave the capture's poses is constantly off; unknown where training did not refine them.
    pub tracker: Option<TrackerOffsets>,
    /// Its origin.
    pub provenance: Provenance,
}

/// Initial depth of the Gaussians below the surface, in standard deviations. At the silhouette a line of sight grazes
/// about ten Gaussians in a row; ten together reach an opacity of a half where each has 7 %: at 2.3 standard
/// deviations.
pub const DEFAULT_INSET: f64 = 2.0;
/// Largest initial depth of a Gaussian, as a fraction of the hand's thickness there. The bone's axis is at one half;
/// beyond it a Gaussian would be closer to the opposite side.
const DEEPEST_INSET: f64 = 1.0 / 3.0;

impl Avatar {
    /// An untrained avatar: the template's plain surface in one colour (display values 0..1). `seed` fixes the small
    /// random numbers that break symmetry in training; the Gaussians start [`DEFAULT_INSET`] below the surface.
    ///
    /// # Errors
    /// [`HandModelError`] if the model cannot be sampled, or networks cannot be made in the sizes of the configuration.
    pub fn untrained(
        model: &HandModel,
        config: &AvatarConfig,
        color: [f64; 3],
        seed: u64,
    ) -> Result<Avatar, HandModelError> {
        let samples = surface::sample_surface(model, config.uv_resolution)?;
        Avatar::untrained_at(model, &samples, config, color, DEFAULT_INSET, seed)
    }

    /// As [`Avatar::untrained`], with Gaussians at some points of the surface, `inset` times their size below it, but at
    /// most a third of the hand's thickness. Networks need all texels.
    ///
    /// # Errors
    /// [`HandModelError`] if networks cannot be made in the sizes of the configuration.
    pub fn untrained_at(
        model: &HandModel,
        samples: &SurfaceSamples,
        config: &AvatarConfig,
        color: [f64; 3],
        inset: f64,
        seed: u64,
    ) -> Result<Avatar, HandModelError> {
        let invalid = |problem| HandModelError::invalid(model.name.clone(), "network", problem);
        config.network.as_ref().map_or(Ok(()), NetworkSizes::check).map_err(invalid)?;
        let template = Template::from_samples(model, samples, config.gaussians);
        let thickness = local_thickness(model, samples);
        let insets: Vec<f64> = (template.spacings.iter().zip(&thickness))
            .map(|(spacing, thickness)| {
                (inset * f64::from(PropertyTables::START_SCALE * spacing)).min(DEEPEST_INSET * thickness)
            })
            .collect();
        let start = PropertyStart { normals: &samples.normals, insets: &insets, color, seed };
        let tables = PropertyTables::untrained(&template, config, &start);
        Ok(Avatar {
            template,
            model: model.without_blend_shapes(),
            config: config.clone(),
            tables,
            light: None,
            seen: None,
            tracker: None,
            provenance: Provenance::default(),
        })
    }

    /// Largest standard deviation of a Gaussian, metres.
    pub fn max_scale(&self) -> f32 {
        self.template.max_scale()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use ghand_test_support::procedural_hand::ProceduralHand;
    use glam::DVec3;

    use super::*;

    /// Depth of each Gaussian of an untrained avatar, metres.
    fn depths(avatar: &Avatar) -> Vec<f64> {
        let PropertyTables::Direct(tables) = &avatar.tables else { unreachable!() };
        let n = avatar.template.len();
        let at = |c: usize, p: usize| f64::from(tables.shape_basis[c * n + p]);
        (0..n).map(|p| DVec3::new(at(0, p), at(1, p), at(2, p)).length()).collect()
    }

    #[test]
    fn gaussians_start_no_deeper_than_a_third_of_the_hand() {
        let model = ProceduralHand::default().build().unwrap();
        let config = AvatarConfig { uv_resolution: 96, ..Default::default() };
        let samples = surface::sample_surface(&model, 96).unwrap();
        let thickness = local_thickness(&model, &samples);
        let avatar = Avatar::untrained_at(&model, &samples, &config, [0.5; 3], 3.0, 0).unwrap();
        let mut bounded = 0;
        let mut free = 0;
        for ((depth, thickness), spacing) in depths(&avatar).iter().zip(&thickness).zip(&avatar.template.spacings) {
            assert!(*depth <= thickness / 3.0 + 1e-7, "{depth} m of {thickness} m");
            let wanted = 3.0 * f64::from(PropertyTables::START_SCALE * spacing);
            if (depth - wanted).abs() < 1e-7 { free += 1 } else { bounded += 1 }
        }
        // Fingers are thin for such large Gaussians, palm and wrist are not.
        assert!(bounded > 100 && free > 100, "{bounded} bounded, {free} free");
    }
}

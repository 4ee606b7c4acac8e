//! The settings of a training run.

use documented::DocumentedFields;
use ghand_avatar::{AvatarConfig, GaussianShape, NetworkSizes, Offsets};
use ghand_core::blend_shapes::CoefficientLayout;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
pub use ghand_fit::exposure::ExposureChoice;
pub use ghand_fit::light_fit::{GlossChoice, LightChoice};
use serde::de::{Deserializer, Error};
use serde::{Deserialize, Serialize};

use crate::setting_rules::{is_former_off, is_removed_default, removed, rule, unknown};

/// How poses are refined before the avatar is trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Align {
    /// Together with the template's proportions, from the masks' contours: [`ghand_fit::alignment`].
    #[default]
    Contours,
    /// As in the paper: a first stage of training refines them with a simple avatar.
    Paper,
    /// They stay as given.
    Off,
}

/// What Gaussians get that training hardly saw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unseen {
    /// The properties of their neighbours on the surface.
    #[default]
    Fill,
    /// What they have learned.
    Off,
}

/// Whether the projection is antialiased: a Gaussian smaller than a pixel becomes fainter instead of larger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Antialias {
    /// It is, in training and wherever the avatar is shown.
    #[default]
    On,
    /// It is not.
    Off,
}

/// Whether the avatar is as set, or as simple as its images allow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Simplify {
    /// As set.
    #[default]
    Off,
    /// Short trainings choose the resolution, the shape bases, the colour components and the other parts:
    /// [`crate::trainer::simplification`].
    Auto,
}

/// The property model of the avatar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// Free tables.
    #[default]
    Direct,
    /// The paper's networks.
    Network,
}

/// The parts of the method that an avatar has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Components {
    /// The pose gives each Gaussian its own offset; plain skinning.
    Baseline,
    /// Hand Gaussian Blend Shapes: bases for all poses, and coefficients from the pose; plain skinning.
    #[default]
    Hgbs,
    /// Blend shapes, and skinning corrected by the residual skeleton with its residual weights.
    Full,
}

/// Sizes of the networks, with `model=network`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Network {
    /// [`NetworkSizes::quick`].
    #[default]
    Quick,
    /// [`NetworkSizes::paper`].
    Paper,
}

/// Settings of a training run. Every field can be set as `--set field=value`. The fields' documentation is that of
/// `docs/settings.md` and of `train --print-config`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, DocumentedFields)]
#[serde(default, deny_unknown_fields)]
pub struct TrainSettings {
    /// Iterations of training; each uses one image.
    pub iterations: u64,
    /// Seconds after which the run ends if it has not done its iterations, as `--max-time`; 0 for no limit.
    pub max_seconds: f64,
    /// What gives the Gaussians their properties in a pose. `direct`: free tables with a local, linear response to the
    /// pose. `network`: the paper's networks, on the processor; several times slower in each iteration.
    pub model: Model,
    /// With `model=network`: `quick`: small networks. `paper`: the paper's sizes, far too slow for a processor; with
    /// `coefficients=per_component` and `gaussians=round` they are the paper's model.
    pub network: Network,
    /// The parts of the method. `baseline`: the pose gives each Gaussian its own offset, and plain skinning. `hgbs`:
    /// blend shapes instead. `full`: also the residual skeleton with its residual skinning weights.
    pub components: Components,
    /// `auto`, or `train --model auto`: the avatar is as simple as its images allow (see Training). `off`: it is as
    /// set.
    pub simplify: Simplify,
    /// Images of a frame in each iteration, with `model=network`: they share one pass of the networks.
    pub images_per_step: usize,
    /// How the poses are refined first. `contours`: together with the template's proportions, from the masks' outlines.
    /// `paper`: by a first stage of training; with `model=network` in the paper's form (a third of the iterations),
    /// else with 62 % of the iterations, images of half the size, a `uv_resolution` of at most 96 and a prior on
    /// hinges. `off`: they stay as given.
    pub align: Align,
    /// How light is taken apart from skin. `transfer`: 64 directions of light, with the hand's shadows on itself; only
    /// few lamps in an even sky, unless all directions reduce the squared error in held-out frames by a twentieth.
    /// `off`: colours are as the images show them. `auto`: `transfer`, if it reduces that error by a tenth.
    pub light: LightChoice,
    /// What skin mirrors of light from directions: one roughness, and a strength at each joint. `always`: modelled.
    /// `off`: not modelled. `auto`: if it explains a fiftieth of how much the images of held-out frames differ.
    pub gloss: GlossChoice,
    /// Exposure and white balance of the training cameras. `per_camera`: an affine map of its colours for each, so that
    /// all cameras of a frame agree. `off`: cameras are alike. `auto`: maps, if in held-out frames cameras then
    /// disagree a tenth less, and light and gloss leave a tenth less unexplained.
    pub exposure: ExposureChoice,
    /// Gaussians that training hardly saw. `fill`: they get the properties of their neighbours on the surface, the more
    /// the less they were seen; offsets of all are smoothed a little. `off`: they stay as they were trained.
    pub unseen: Unseen,
    /// Seed of all random numbers; `--seed N` sets it, too.
    pub seed: u64,
    /// Resolution of the UV raster; each texel on the hand is one Gaussian. 0: as the images show the hand, so that Gaussians
    /// are some 1.75 pixels wide, beyond 512 some 2.6; from 96 to 768, with `model=network` to 160.
    pub uv_resolution: u32,
    /// Blocks of 2x2 texels become one Gaussian where no training image shows texels with edges of this length or more,
    /// pixels, also where none shows them at all; 0: none. With `model=direct`.
    pub merge_below: f64,
    /// Number of shape bases.
    pub shape_bases: usize,
    /// Number of pose-dependent colour components.
    pub color_components: usize,
    /// Shape of the Gaussians. `flat`: discs along the surface, 0.2 times as thick as wide. `round`: balls, as in the
    /// paper.
    pub gaussians: GaussianShape,
    /// `per_basis`: one blend coefficient per shape basis. `per_component`: one for each of its three components, as in
    /// the paper.
    pub coefficients: CoefficientLayout,
    /// `zero_sum`: the mean over the joints is subtracted, so that the rest pose stays. `paper`: used as they are.
    pub residual_weights: ResidualWeights,
    /// `anchored`: the residual joints start at the rest joints. `paper`: at the model's origin.
    pub residual_skeleton: ResidualSkeleton,
    /// `on`: Gaussians smaller than a pixel become fainter, not larger. The avatar's file says so, and it is shown as
    /// it was trained; one scene cannot show avatars of both kinds.
    pub antialias: Antialias,
    /// Weight of LPIPS of windows on the hand, after a fifth of the iterations; 0: no such term.
    pub lpips_weight: f64,
    /// Weight of differences between the unlit colours of neighbours; above 0.03 they count linearly, so that nails and
    /// creases keep their edges.
    pub color_roughness: f64,
    /// All learning rates fall exponentially to this fraction.
    pub final_rate: f64,
    /// Learning rate of the shape bases, metres.
    pub rate_shape_basis: f64,
    /// Learning rate of the residual skinning weights; with `model=network`, of the weights of the network that gives them.
    pub rate_residual_weights: f64,
    /// Learning rate of the networks' other weights; a gradient more than ten times as long as usual is shortened. A rate of 0 of a
    /// property, such as `rate_residual_weights`, also keeps the part of the networks that gives it.
    pub rate_networks: f64,
    /// Learning rate of the networks' feature tensor.
    pub rate_feature_tensor: f64,
    /// Learning rate of the rest joints, metres; 0 keeps the template's skeleton.
    pub rate_joints: f64,
}

impl Default for TrainSettings {
    fn default() -> Self {
        TrainSettings {
            iterations: 2000,
            max_seconds: 0.0,
            model: Model::default(),
            network: Network::default(),
            components: Components::default(),
            simplify: Simplify::default(),
            images_per_step: 1,
            align: Align::default(),
            light: LightChoice::default(),
            gloss: GlossChoice::default(),
            exposure: ExposureChoice::default(),
            unseen: Unseen::default(),
            seed: 1,
            uv_resolution: 0,
            merge_below: 0.0,
            shape_bases: 8,
            color_components: 4,
            gaussians: GaussianShape::Flat,
            coefficients: CoefficientLayout::default(),
            residual_weights: ResidualWeights::default(),
            residual_skeleton: ResidualSkeleton::default(),
            antialias: Antialias::default(),
            lpips_weight: 0.2,
            color_roughness: 0.1,
            final_rate: 0.05,
            rate_shape_basis: 1e-4,
            rate_residual_weights: 5e-5,
            rate_networks: 3e-3,
            rate_feature_tensor: 1e-2,
            rate_joints: 1e-4,
        }
    }
}

/// Rate of the skeleton regressor: a fiftieth of that of the residual weights, as each of its weights moves a whole joint.
const RATE_REGRESSOR: f64 = 1e-6;

/// How `align=paper` refines poses in stage 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoseStage {
    /// Its part of the iterations.
    pub part: f64,
    /// How often the poses are pulled towards a prior fitted to them: evenly over the stage, first at its start.
    pub prior_rounds: u64,
    /// Most of the UV raster's resolution.
    pub most_uv_resolution: u32,
    /// How many times smaller its images are.
    pub image_reduction: u32,
    /// Rate of the joint rotations, radians.
    pub rate: f64,
}

impl PoseStage {
    /// The paper's: 41,600 of 124,800 iterations at full resolution.
    const OF_NETWORKS: PoseStage =
        PoseStage { part: 1.0 / 3.0, prior_rounds: 0, most_uv_resolution: u32::MAX, image_reduction: 1, rate: 5e-3 };
    /// For runs of minutes: quicker iterations, more of them, faster, with a prior against what few images leave open.
    const OF_TABLES: PoseStage =
        PoseStage { part: 0.62, prior_rounds: 3, most_uv_resolution: 96, image_reduction: 2, rate: 1e-2 };
}

/// A setting that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("setting `{setting}`: {problem}")]
pub struct SettingsError {
    /// The setting.
    pub setting: String,
    /// What is wrong, and what is allowed.
    pub problem: String,
}

/// A setting's default as `key=value`.
fn default_assignment(key: &str) -> String {
    let fields = serde_json::to_value(TrainSettings::default()).unwrap_or_default();
    let value = fields.get(key).cloned().unwrap_or_default();
    format!("{key}={}", value.as_str().map_or_else(|| value.to_string(), str::to_owned))
}

impl TrainSettings {
    /// Applies `key=value`. If that fails, the settings are unchanged.
    ///
    /// # Errors
    /// [`SettingsError`] if the key is unknown or the value is not allowed.
    pub fn set(&mut self, assignment: &str) -> Result<(), SettingsError> {
        let fail = |setting: &str, problem: String| SettingsError { setting: setting.into(), problem };
        let (key, text) = assignment
            .split_once('=')
            .ok_or_else(|| fail(assignment, "must have the form key=value, as in iterations=3000".into()))?;
        let key = key.trim();
        let text = text.trim();
        let mut fields = serde_json::to_value(&*self).map_err(|e| fail(key, e.to_string()))?;
        let names: Vec<String> = fields.as_object().map(|o| o.keys().cloned().collect()).unwrap_or_default();
        let Some((rule, slot)) = rule(key).zip(fields.get_mut(key)) else {
            return Err(fail(key, removed(key).unwrap_or_else(|| unknown(key, &names))));
        };
        *slot = rule.parse(text).ok_or_else(|| {
            let given = if text.is_empty() { "no value was given; it".into() } else { format!("`{text}`") };
            fail(key, format!("{given} {}", rule.wanted(&default_assignment(key))))
        })?;
        *self = serde_json::from_value(fields).map_err(|e| fail(key, e.to_string()))?;
        Ok(())
    }

    /// Applies a setting from a file, which may come from an earlier version: a setting that was removed may have the default
    /// that it had, and `off` its former word.
    ///
    /// # Errors
    /// As [`set`](Self::set).
    pub(crate) fn set_from_file(&mut self, key: &str, text: &str) -> Result<(), SettingsError> {
        if is_removed_default(key, text) {
            return Ok(());
        }
        self.set(&format!("{key}={}", if is_former_off(key, text) { "off" } else { text }))
    }

    /// Reads the settings of a run that an earlier version may have begun; `#[serde(deserialize_with)]` takes it.
    ///
    /// # Errors
    /// As [`set`](Self::set).
    pub fn of_run<'de, D: Deserializer<'de>>(fields: D) -> Result<TrainSettings, D::Error> {
        let mut settings = TrainSettings::default();
        for (key, value) in serde_json::Map::deserialize(fields)? {
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            settings.set_from_file(&key, &text).map_err(D::Error::custom)?;
        }
        Ok(settings)
    }

    /// The rates of residual weights, of the regressor and of shape bases: a part that the avatar does not have stays as it
    /// starts.
    pub fn component_rates(&self) -> [f64; 3] {
        let [weights, regressor, bases] = [self.rate_residual_weights, RATE_REGRESSOR, self.rate_shape_basis];
        match self.components {
            // The bases of free tables are the offsets of each Gaussian.
            Components::Baseline if self.model == Model::Direct => [0.0, 0.0, bases],
            Components::Baseline => [0.0, 0.0, 0.0],
            Components::Hgbs => [0.0, 0.0, bases],
            Components::Full => [weights, regressor, bases],
        }
    }

    /// Whether this program was built with what the settings need.
    ///
    /// # Errors
    /// [`SettingsError`] names the setting, and the feature that the program lacks.
    pub fn check_build(&self) -> Result<(), SettingsError> {
        if self.model == Model::Network && cfg!(not(feature = "networks")) {
            let problem = "network is not in this program; build it with networks, for example `cargo run \
                           --features networks --bin train`, or set model=direct";
            return Err(SettingsError { setting: "model".into(), problem: problem.into() });
        }
        Ok(())
    }

    /// Checks ranges.
    ///
    /// # Errors
    /// [`SettingsError`] names the first setting that is out of range, or that another one excludes.
    pub fn check(&self) -> Result<(), SettingsError> {
        let fail = |setting: &str, problem: String| SettingsError { setting: setting.into(), problem };
        let fields = serde_json::to_value(self).map_err(|e| fail("all", e.to_string()))?;
        for (key, value) in fields.as_object().into_iter().flatten() {
            let rule = rule(key).ok_or_else(|| fail(key, "has no range".into()))?;
            if !rule.allows(value) {
                // A number that is not finite is `null` here.
                let given = if value.is_null() { "the value".into() } else { format!("`{value}`") };
                return Err(fail(key, format!("{given} {}", rule.wanted(&default_assignment(key)))));
            }
        }
        if self.images_per_step > 1 && self.model != Model::Network {
            return Err(fail(
                "images_per_step",
                "must be 1 unless model=network: other models gain nothing by more".into(),
            ));
        }
        if self.merge_below > 0.0 && self.model == Model::Network {
            return Err(fail("merge_below", "must be 0 with model=network, whose Gaussians are all texels".into()));
        }
        Ok(())
    }

    /// The first setting that differs: its name, its value here and its value there.
    pub fn first_difference(&self, other: &TrainSettings) -> Option<(String, String, String)> {
        let fields = |settings| serde_json::to_value(settings).ok();
        let here = fields(self)?;
        let there = fields(other)?;
        let differs = |(key, value): (&String, &serde_json::Value)| {
            let other = there.get(key).filter(|other| *other != value)?;
            Some((key.clone(), value.to_string(), other.to_string()))
        };
        here.as_object()?.iter().find_map(differs)
    }

    /// The settings that are stored in the avatar.
    pub fn avatar(&self) -> AvatarConfig {
        let offsets = if self.components == Components::Baseline { Offsets::Free } else { Offsets::Bases };
        let (shape_bases, coefficients) = match offsets {
            Offsets::Free => Offsets::free_layout(self.model == Model::Network),
            Offsets::Bases => (self.shape_bases, self.coefficients),
        };
        let plain_skinning = self.model == Model::Direct && self.components != Components::Full;
        AvatarConfig {
            plain_skinning,
            uv_resolution: self.uv_resolution,
            shape_bases,
            coefficients,
            color_components: self.color_components,
            residual_weights: self.residual_weights,
            residual_skeleton: self.residual_skeleton,
            offsets,
            gaussians: self.gaussians,
            antialias: self.antialias == Antialias::On,
            narrow_blur: self.antialias == Antialias::On,
            network: (self.model == Model::Network).then(|| match self.network {
                Network::Quick => NetworkSizes::quick(),
                Network::Paper => NetworkSizes::paper(),
            }),
        }
    }

    /// The form of stage 1.
    pub(crate) fn pose_stage(&self) -> PoseStage {
        if self.model == Model::Network { PoseStage::OF_NETWORKS } else { PoseStage::OF_TABLES }
    }

    /// The settings of stage 1: one constant basis, constant colours, and no residual weights or skeleton, so that only
    /// the poses can explain the differences between frames.
    pub fn pose_stage_settings(&self) -> TrainSettings {
        TrainSettings {
            model: Model::Direct,
            components: Components::Hgbs,
            simplify: Simplify::Off,
            images_per_step: 1,
            uv_resolution: self.pose_stage().most_uv_resolution.min(self.uv_resolution),
            merge_below: 0.0,
            shape_bases: 1,
            coefficients: CoefficientLayout::PerBasis,
            color_components: 0,
            // The normals of flat ones have no gradient; round ones stand out from the surface.
            gaussians: GaussianShape::Round,
            antialias: Antialias::Off,
            color_roughness: 0.0,
            ..self.clone()
        }
    }

    /// Iterations of stage 1; 0 without it. At least one remains for stage 2, which makes the avatar.
    pub fn pose_iterations(&self) -> u64 {
        if self.align != Align::Paper {
            return 0;
        }
        let rounded = (self.iterations as f64 * self.pose_stage().part).round() as u64;
        rounded.min(self.iterations.saturating_sub(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(assignment: &str) -> String {
        let mut settings = TrainSettings::default();
        let message = settings.set(assignment).unwrap_err().to_string();
        assert!(!message.contains('\n'), "{message}");
        assert_eq!(settings, TrainSettings::default(), "{assignment} changed the settings");
        message
    }

    #[test]
    fn settings_are_set_by_name_and_errors_name_them() {
        let mut s = TrainSettings::default();
        s.set("iterations=7").unwrap();
        s.set("residual_weights = paper").unwrap();
        s.set("rate_joints=2e-4").unwrap();
        s.set("residual_skeleton=anchored").unwrap();
        s.set("residual_skeleton=paper").unwrap();
        s.set("residual_weights=zero_sum").unwrap();
        s.set("residual_weights=paper").unwrap();
        assert_eq!((s.iterations, s.residual_weights, s.rate_joints), (7, ResidualWeights::Paper, 2e-4));
        for bad in ["iterations=-1", "nonsense=1", "iterations", "uv_resolution=1", "rate_joints=NaN"] {
            let name = bad.split('=').next().unwrap();
            assert!(refusal(bad).contains(&format!("`{name}`")), "{bad}");
        }
    }

    #[test]
    fn whole_numbers_can_be_written_with_exponent_or_fraction() {
        let mut s = TrainSettings::default();
        for (text, value) in [("1e2", 100), ("100.0", 100), (" 100 ", 100), ("+3", 3), ("1.5e1", 15)] {
            s.set(&format!("iterations={text}")).unwrap();
            assert_eq!(s.iterations, value, "{text}");
        }
        // Above 2^53 an f64 is not exact: the digits are read directly.
        s.set("seed=18446744073709551615").unwrap();
        assert_eq!(s.seed, u64::MAX);
    }

    #[test]
    fn an_error_describes_the_allowed_values_in_plain_words() {
        for (bad, wanted) in [
            ("iterations=1.5", "`1.5` must be a whole number, from 1 to 1000000000, as in iterations=2000"),
            ("iterations=0", "must be a whole number, from 1"),
            ("iterations=1e30", "must be a whole number, from 1"),
            ("iterations=many", "must be a whole number, from 1"),
            ("iterations=", "no value was given; it must be a whole number"),
            ("iterations=[3]", "must be a whole number"),
            ("uv_resolution=4", "must be 0 or a whole number, from 8 to 2048, as in uv_resolution=0"),
            ("uv_resolution=-8", "must be 0 or a whole number, from 8 to 2048"),
            ("seed=-1", "must be a whole number, at least 0, as in seed=1"),
            ("seed=1e300", "must be a whole number, at least 0"),
            ("shape_bases=0", "must be a whole number, from 1 to 32"),
            ("final_rate=0", "must be a number, above 0 and at most 1"),
            // Beyond the range of the device's f32.
            ("rate_joints=1e39", "must be a number, from 0 to 1e38, as in rate_joints=0.0001"),
            ("rate_joints=-1", "must be a number, from 0 to 1e38"),
            ("rate_joints=inf", "must be a number"),
            ("rate_joints=fast", "must be a number"),
            ("residual_weights=papers", "must be `paper` or `zero_sum`"),
            ("residual_skeleton=1", "must be `paper` or `anchored`"),
            ("align=none", "`none` must be `contours` or `paper` or `off`"),
            ("antialias=true", "must be `on` or `off`, as in antialias=on"),
            ("residual_skeleton=1", "as in residual_skeleton=anchored"),
            ("uv_resolutoin=64", "did you mean `uv_resolution`?"),
            ("Iterations=3", "did you mean `iterations`?"),
            ("rate-joints=3", "did you mean `rate_joints`?"),
        ] {
            let message = refusal(bad);
            assert!(message.contains(wanted), "{bad}: {message}");
            assert!(!message.contains("u64") && !message.contains("expected"), "{message}");
        }
        assert_eq!(
            refusal("rate_light=0"),
            "setting `rate_light`: was removed in 0.2: training the light on brought less than 0.1 dB on every capture; \
             leave it out"
        );
        let far = refusal("nonsense=1");
        assert!(!far.contains("did you mean") && far.contains("iterations, ") && far.contains("rate_joints"), "{far}");
    }

    #[test]
    fn every_setting_has_a_range_that_contains_its_default() {
        TrainSettings::default().check().unwrap();
        let fields = serde_json::to_value(TrainSettings::default()).unwrap();
        for (key, value) in fields.as_object().unwrap() {
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            let mut s = TrainSettings::default();
            s.set(&format!("{key}={text}")).unwrap();
            assert_eq!(s, TrainSettings::default(), "{key}");
        }
        let bad = TrainSettings { rate_joints: f64::NAN, ..Default::default() };
        assert!(bad.check().unwrap_err().to_string().contains("`rate_joints`"));
        let bad = TrainSettings { color_components: 33, ..Default::default() };
        assert!(bad.check().unwrap_err().to_string().contains("`33` must be a whole number, from 0 to 32"));
    }

    #[test]
    fn stage_2_always_has_an_iteration() {
        let cases =
            [(1, Model::Direct, 0), (2, Model::Direct, 1), (100, Model::Direct, 62), (124_800, Model::Network, 41_600)];
        for (iterations, model, expected) in cases {
            let settings = TrainSettings { iterations, model, align: Align::Paper, ..Default::default() };
            assert_eq!(settings.pose_iterations(), expected);
            assert_eq!(TrainSettings { align: Align::Contours, ..settings }.pose_iterations(), 0);
        }
    }
}

//! Layers: what the colours of an avatar's Gaussians show instead of skin.

use clap::ValueEnum;
use ghand_avatar::Avatar;
use ghand_avatar::pose_properties::{PoseProperties, centred};
use ghand_avatar::properties::PropertyTables;
use ghand_core::skeleton::pose_skeleton;
use ghand_core::skinning::{ResidualWeights, Skinning, skin};
use ghand_core::statistics::quantile;
use ghand_core::{Camera, Pose};
use ghand_pictures::color_scale::round_up;
use glam::DVec3;

use crate::viewer::stage::legend::{ColorMap, Legend};

/// What the colours show.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, ValueEnum)]
pub enum Layer {
    /// The hand as it was trained, in its light
    #[default]
    Skin,
    /// The colours of the skin without light
    Albedo,
    /// How much the training views saw of each place
    Views,
    /// Skinning weight of a joint, 0 to 1
    Weights,
    /// How far what was learned moves each Gaussian from plain linear blend skinning in this pose, mm
    Offset,
    /// Distance along the camera's axis, m
    Depth,
    /// How much of what is behind the hand each pixel hides, 0 to 1
    Alpha,
    /// The Gaussians as dots at their centres
    #[value(name = "centres")]
    Centers,
    /// Residual skinning weight of a joint
    Residual,
    /// Length of a shape basis, mm
    Basis,
    /// Blend coefficient of a shape basis in this pose
    Coefficient,
}

/// The part of the Gaussians that the colours of offsets tell apart. The largest, often single Gaussians, share the last
/// colour.
const SHOWN: f64 = 0.995;
/// Limits of colours, as multiples of a power of ten: their halves are round numbers.
const STEPS: [f64; 5] = [1.0, 2.0, 4.0, 6.0, 8.0];

/// The colours of all Gaussians.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerColors {
    /// Display values, `[3][N]`.
    pub colors: Vec<f32>,
    /// What they mean.
    pub legend: Legend,
}

/// What the colours of a layer depend on, beside the avatar.
pub struct LayerInputs<'a> {
    /// The pose.
    pub pose: &'a Pose,
    /// The camera.
    pub camera: &'a Camera,
    /// Depth of the plane from which depths are counted, metres: see [`ghand_avatar::orbit_camera::OrbitCamera::apparent_depth`].
    pub depth_from: f64,
    /// The posed Gaussians, metres, world, N.
    pub posed: &'a [DVec3],
    /// The joint whose weights are shown.
    pub joint: usize,
    /// The shape basis that is shown, from 0.
    pub basis: usize,
    /// What was learned, in this pose, if the layer needs it.
    pub properties: Option<&'a PoseProperties>,
}

impl Layer {
    /// What it shows, one sentence.
    pub const fn summary(self) -> &'static str {
        match self {
            Layer::Skin => "Shows the hand as it was trained, in its light.",
            Layer::Albedo => "Shows the colours of the skin without light.",
            Layer::Views => "Shows how much the training views saw of each place, in multiples of the median.",
            Layer::Weights => "Shows the skinning weights of a joint, 0 to 1.",
            Layer::Offset => {
                "Shows how far what was learned moves each Gaussian from plain linear blend skinning in this pose, mm."
            }
            Layer::Depth => "Shows the distance of each Gaussian along the camera's axis, m.",
            Layer::Alpha => "Shows how much of what is behind the hand each pixel hides, 0 to 1.",
            Layer::Centers => "Shows the Gaussians as dots at their centres.",
            Layer::Residual => "Shows the residual skinning weights of a joint.",
            Layer::Basis => "Shows the length of a shape basis, mm.",
            Layer::Coefficient => "Shows the blend coefficients of a shape basis in this pose.",
        }
    }

    /// Why an avatar cannot show it; `None` if it can.
    pub fn missing(self, avatar: &Avatar) -> Option<&'static str> {
        let baked = matches!(avatar.tables, PropertyTables::Baked(_));
        let missing = |is_missing: bool, reason| is_missing.then_some(reason);
        match self {
            Layer::Albedo => missing(avatar.light.is_none(), "its light is part of its colours"),
            Layer::Views if baked => {
                missing(avatar.seen.is_none(), "its file does not say what training saw; bake it again")
            }
            Layer::Views => missing(avatar.seen.is_none(), "its file does not say what training saw; train it again"),
            Layer::Residual if baked => {
                Some("a baked avatar has no residual skinning weights; show the one it was made of")
            }
            Layer::Residual => missing(avatar.config.plain_skinning, "it has no residual skinning weights"),
            Layer::Basis | Layer::Coefficient if baked => {
                Some("a baked avatar has no shape bases; show the one it was made of")
            }
            Layer::Basis | Layer::Coefficient => missing(avatar.config.shape_bases == 0, "it has no shape bases"),
            Layer::Skin | Layer::Weights | Layer::Offset | Layer::Depth | Layer::Alpha | Layer::Centers => None,
        }
    }

    /// Whether its colours are those of numbers; the others come from the avatar.
    pub fn has_numbers(self) -> bool {
        !matches!(self, Layer::Skin | Layer::Albedo | Layer::Centers)
    }

    /// Whether it needs the posed Gaussians.
    pub fn needs_posed(self) -> bool {
        matches!(self, Layer::Offset | Layer::Depth)
    }

    /// Whether it needs what was learned.
    pub fn needs_properties(self) -> bool {
        matches!(self, Layer::Residual | Layer::Basis | Layer::Coefficient)
    }

    /// Whether it shows one joint.
    pub fn has_joint(self) -> bool {
        matches!(self, Layer::Weights | Layer::Residual)
    }

    /// Whether it shows one shape basis.
    pub fn has_basis(self) -> bool {
        matches!(self, Layer::Basis | Layer::Coefficient)
    }

    /// The colour behind it, display values, if that matters.
    pub fn background(self) -> Option<[f32; 3]> {
        // White that is blended over black is the coverage.
        (self == Layer::Alpha).then_some([0.0; 3])
    }

    /// Its colours; `None` if they are not those of numbers.
    pub fn colors(self, avatar: &Avatar, inputs: &LayerInputs) -> Option<LayerColors> {
        match self {
            Layer::Skin | Layer::Albedo | Layer::Centers => None,
            Layer::Views => {
                let legend = Legend {
                    title: "seen in training, × median".into(),
                    map: Some(ColorMap::Viridis),
                    ticks: ["0.001", "0.1", "≥ 10"].map(String::from),
                };
                Some(LayerColors { colors: rows(avatar.seen_colors()?.into_iter().map(DVec3::from)), legend })
            }
            Layer::Weights => {
                let count = avatar.template.len();
                let weights = avatar.template.weights.get(inputs.joint * count..(inputs.joint + 1) * count)?;
                let name = avatar.model.joint_names.get(inputs.joint)?;
                let ticks = ["0", "0.5", "1"].map(String::from);
                let values: Vec<f64> = weights.iter().map(|weight| f64::from(*weight)).collect();
                let title = format!("skinning weight, {name}");
                Some(of_numbers(&values, [0.0, 1.0], Legend { title, map: Some(ColorMap::Viridis), ticks }))
            }
            Layer::Offset => {
                let millimetres: Vec<f64> = offsets(avatar, inputs).into_iter().map(|offset| 1e3 * offset).collect();
                Some(from_zero("offset from plain skinning, mm", &millimetres))
            }
            Layer::Depth => {
                let depths: Vec<f64> = inputs
                    .posed
                    .iter()
                    .map(|point| inputs.camera.camera_from_world(*point).z - inputs.depth_from)
                    .collect();
                let [low, high] = [0.0, 1.0].map(|part| quantile(depths.iter().copied(), part));
                let legend = Legend::linear("depth, m", [low, high], false);
                Some(of_numbers(&depths, [low, high], legend))
            }
            Layer::Alpha => {
                let title = "coverage (alpha)".into();
                let legend = Legend { title, map: Some(ColorMap::Grey), ticks: ["0", "0.5", "1"].map(String::from) };
                Some(LayerColors { colors: vec![1.0; 3 * avatar.template.len()], legend })
            }
            Layer::Residual => {
                let count = avatar.template.len();
                let joints = avatar.template.joint_count();
                let learned = &inputs.properties?.residual_weights;
                let name = avatar.model.joint_names.get(inputs.joint)?;
                let of_joint = inputs.joint * count..(inputs.joint + 1) * count;
                let weights = match avatar.config.residual_weights {
                    ResidualWeights::Paper => learned.get(of_joint)?.to_vec(),
                    // As they take effect.
                    ResidualWeights::ZeroSum => centred(learned, count, joints).get(of_joint)?.to_vec(),
                };
                Some(around_zero(&format!("residual weight, {name}"), &weights))
            }
            Layer::Basis => {
                let count = avatar.template.len();
                let basis = inputs.properties?.shape_basis.get(inputs.basis * count..(inputs.basis + 1) * count)?;
                let millimetres: Vec<f64> = basis.iter().map(|offset| 1e3 * offset.length()).collect();
                Some(from_zero(&format!("shape basis {}, mm", inputs.basis + 1), &millimetres))
            }
            Layer::Coefficient => {
                let properties = inputs.properties?;
                let count = avatar.template.len();
                let rows = properties.rows;
                let length = rows * count;
                let of_basis = properties.coefficients.get(inputs.basis * length..(inputs.basis + 1) * length)?;
                let sum = |point: usize| of_basis.iter().skip(point).step_by(count).map(|v| f64::from(*v)).sum::<f64>();
                let means: Vec<f64> = (0..count).map(|point| sum(point) / rows as f64).collect();
                let which = if rows == 1 { "" } else { ", mean of x, y, z" };
                Some(around_zero(&format!("coefficient {}{which} (no unit)", inputs.basis + 1), &means))
            }
        }
    }
}

/// Colours of numbers that are not negative.
fn from_zero(title: &str, values: &[f64]) -> LayerColors {
    let limit = round_up(quantile(values.iter().copied(), SHOWN), &STEPS);
    let clamped = values.iter().any(|value| *value > limit);
    of_numbers(values, [0.0, limit], Legend::linear(title, [0.0, limit], clamped))
}

/// Colours of numbers on both sides of zero.
fn around_zero(title: &str, values: &[f64]) -> LayerColors {
    let limit = round_up(quantile(values.iter().map(|value| value.abs()), SHOWN), &STEPS);
    let clamped = values.iter().any(|value| value.abs() > limit);
    of_numbers(values, [-limit, limit], Legend::around_zero(title, limit, clamped))
}

/// How far each Gaussian is from where plain linear blend skinning of the template puts it, metres, N.
fn offsets(avatar: &Avatar, inputs: &LayerInputs) -> Vec<f64> {
    let template = &avatar.template;
    let count = template.len();
    let [x, y, z] = [0, 1, 2].map(|c| template.rest.get(c * count..(c + 1) * count).unwrap_or_default());
    let rest: Vec<DVec3> = x.iter().zip(y).zip(z).map(|((x, y), z)| glam::Vec3::new(*x, *y, *z).as_dvec3()).collect();
    let weights: Vec<f64> = template.weights.iter().map(|weight| f64::from(*weight)).collect();
    let chain = pose_skeleton(&template.parents, &template.joints, &inputs.pose.rotations);
    let plain = skin(&Skinning {
        rest: &rest,
        weights: &weights,
        residual_weights: &[],
        bones: &chain.posed_from_rest,
        residual_bones: &[],
        translation: inputs.pose.translation,
        mode: ResidualWeights::default(),
    });
    inputs.posed.iter().zip(&plain).map(|(posed, plain)| posed.distance(*plain)).collect()
}

fn of_numbers(values: &[f64], [low, high]: [f64; 2], legend: Legend) -> LayerColors {
    let width = (high - low).max(f64::MIN_POSITIVE);
    let map = legend.map.unwrap_or(ColorMap::Viridis);
    LayerColors { colors: rows(values.iter().map(|value| map.color((value - low) / width))), legend }
}

/// Colours `[3][N]` from N colours.
fn rows(colors: impl Iterator<Item = DVec3>) -> Vec<f32> {
    let colors: Vec<[f32; 3]> = colors.map(|color| color.as_vec3().to_array()).collect();
    (0..3).flat_map(|c| colors.iter().map(move |color| color[c])).collect()
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_render::viridis::viridis;

    use super::*;
    use crate::viewer::hand::tests::untrained_avatar;

    #[test]
    fn the_weights_of_a_fingertip_are_bright_there_and_dark_at_the_wrist() {
        let avatar = untrained_avatar();
        let model = builtin_hand(Side::Right).unwrap();
        let pose = Pose::rest(model.joint_count());
        let count = avatar.template.len();
        let posed: Vec<DVec3> = (0..count)
            .map(|p| DVec3::from([0, 1, 2].map(|c| f64::from(avatar.template.rest[c * count + p]))))
            .collect();
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, -0.6), DVec3::ZERO, DVec3::NEG_Y, 0.5, 64, 64);
        let joint = model.joint_index("index-finger-phalanx-distal").unwrap();
        let inputs = LayerInputs {
            pose: &pose,
            camera: &camera,
            depth_from: 0.0,
            posed: &posed,
            joint,
            basis: 0,
            properties: None,
        };
        let colors = Layer::Weights.colors(&avatar, &inputs).unwrap().colors;
        let nearest = |place: DVec3, away: f64| {
            let wanted = |p: &usize| (posed[*p].distance(place) - away).abs();
            (0..count).min_by(|a, b| wanted(a).total_cmp(&wanted(b))).unwrap()
        };
        let color = |p: usize| DVec3::from([0, 1, 2].map(|c| f64::from(colors[c * count + p])));
        // Beyond the last joint there is nothing but the tip.
        let joints = &model.joints;
        let along = (joints[joint] - joints[model.parents[joint].unwrap()]).normalize();
        assert!(color(nearest(joints[joint] + 0.015 * along, 0.0)).distance(viridis(1.0)) < 0.05);
        assert!(color(nearest(joints[0], 0.0)).distance(viridis(0.0)) < 0.01);
        // An untrained avatar is skinned plainly; what is moved by 3 mm has the last colour but for single Gaussians.
        let mut moved = posed.clone();
        moved.iter_mut().step_by(2).for_each(|point| point.x += 0.003);
        let offset = Layer::Offset.colors(&avatar, &LayerInputs { posed: &moved, ..inputs }).unwrap();
        assert_eq!(offset.legend.ticks, ["0", "2", "4"]);
        let at = |p: usize| offset.colors[p];
        assert!((f64::from(at(0)) - viridis(0.75).x).abs() < 1e-2 && (f64::from(at(1)) - viridis(0.0).x).abs() < 1e-2);
    }
}

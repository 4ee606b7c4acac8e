//! The numbers of `explain.json`.

use ghand_avatar::{Avatar, PropertyTables};
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_core::statistics::quantile;
use serde::Serialize;

use super::avatar_properties::{AvatarProperties, PropertiesInPose, layout_name};
use super::statistics::{extremes, mean_and_spread};

/// Millimetres in a metre.
pub const MM: f64 = 1e3;

/// All numbers. Bases are numbered from 1, as in the pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Name of the property model.
    pub model: &'static str,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Ids of the poses.
    pub poses: Vec<String>,
    /// One for each basis.
    pub shape_bases: Vec<BasisFigures>,
    /// What a coefficient is.
    pub coefficients_are: &'static str,
    /// One for each basis and pose.
    pub coefficients: Vec<CoefficientFigures>,
    /// The basis whose coefficients move the Gaussians most over the poses, from 1; none if no pose changes any.
    pub most_pose_dependent_basis: Option<usize>,
    /// How the residual weights are meant.
    pub residual_weights_are: &'static str,
    /// One for each joint that has any.
    pub residual_weights: Vec<JointFigures>,
    /// The residual skeleton, if it has an effect.
    pub residual_skeleton: Option<SkeletonFigures>,
    /// One for each pose.
    pub moved_by_residual_terms: Vec<MovedFigures>,
}

/// A shape basis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BasisFigures {
    /// From 1.
    pub basis: usize,
    /// Lengths of S over the hand.
    pub mean_length_mm: f64,
    /// 95 % are shorter.
    pub p95_length_mm: f64,
    /// The longest.
    pub max_length_mm: f64,
    /// Largest size of a coefficient over the poses.
    pub largest_coefficient: f64,
    /// The farthest that the basis moves a Gaussian away from where it is in the rest pose.
    pub max_motion_over_poses_mm: f64,
}

/// The coefficients of a basis in a pose, over the hand.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CoefficientFigures {
    /// From 1.
    pub basis: usize,
    /// Id of the pose.
    pub pose: String,
    /// Mean over the hand.
    pub mean: f64,
    /// Standard deviation over the hand.
    pub standard_deviation: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
}

/// The residual weights of a joint, over the hand.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFigures {
    /// Its name.
    pub joint: String,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
    /// Mean of the sizes.
    pub mean_size: f64,
}

/// The residual skeleton in one pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SkeletonFigures {
    /// Id of the pose, the most bent one.
    pub pose: String,
    /// What its joints are.
    pub joints_are: &'static str,
    /// One for each joint.
    pub joints: Vec<SkeletonJoint>,
}

/// A joint of the residual skeleton.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SkeletonJoint {
    /// Its name.
    pub joint: String,
    /// Length of what the regressor adds to it before it is posed.
    pub offset_mm: f64,
    /// From the template's joint, both posed.
    pub posed_distance_mm: f64,
}

/// How far the residual terms move the Gaussians of a pose from plain linear blend skinning.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MovedFigures {
    /// Id of the pose.
    pub pose: String,
    /// Mean over the hand.
    pub mean_mm: f64,
    /// Half of the Gaussians move less.
    pub median_mm: f64,
    /// 5 % of them move less.
    pub p5_mm: f64,
    /// 95 % of them move less.
    pub p95_mm: f64,
    /// The farthest.
    pub max_mm: f64,
}

impl Figures {
    /// The numbers of an avatar.
    pub fn new(avatar: &Avatar, explained: &AvatarProperties) -> Figures {
        let bases: Vec<BasisFigures> = (0..explained.bases()).map(|basis| basis_figures(explained, basis)).collect();
        let pairs = (0..explained.bases()).flat_map(|basis| explained.poses.iter().map(move |pose| (basis, pose)));
        let moving: Vec<f64> = (0..explained.bases()).map(|basis| motion(explained, basis)).collect();
        let most = (0..moving.len()).filter(|i| moving[*i] > 0.0).max_by(|a, b| moving[*a].total_cmp(&moving[*b]));
        Figures {
            model: match avatar.tables {
                PropertyTables::Direct(_) => "direct",
                PropertyTables::Network(_) => "network",
                PropertyTables::Baked(_) => "baked",
            },
            gaussians: explained.len(),
            poses: explained.poses.iter().map(|pose| pose.id.clone()).collect(),
            shape_bases: bases,
            coefficients_are: layout_name(avatar.config.coefficients),
            coefficients: pairs.map(|(basis, pose)| coefficient_figures(explained, basis, pose)).collect(),
            most_pose_dependent_basis: most.map(|basis| basis + 1),
            residual_weights_are: match avatar.config.residual_weights {
                ResidualWeights::Paper => "as learned",
                ResidualWeights::ZeroSum => "less their mean over the joints, as they take effect",
            },
            residual_weights: residual_joints(avatar, explained)
                .into_iter()
                .map(|joint| joint_figures(avatar, explained, joint))
                .collect(),
            residual_skeleton: skeleton_figures(avatar, explained),
            moved_by_residual_terms: explained.poses.iter().map(moved_figures).collect(),
        }
    }

    /// One line for the terminal.
    pub fn summary(&self) -> String {
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        let longest = most(&mut self.shape_bases.iter().map(|basis| basis.max_length_mm));
        let moved = most(&mut self.moved_by_residual_terms.iter().map(|pose| pose.p95_mm));
        format!(
            "{} Gaussians in {} poses: {} shape bases of up to {longest:.2} mm; residual terms move 95 % of the hand by at \
             most {moved:.2} mm",
            self.gaussians,
            self.poses.len(),
            self.shape_bases.len()
        )
    }
}

fn basis_figures(explained: &AvatarProperties, basis: usize) -> BasisFigures {
    let lengths = explained.basis(basis).iter().map(|s| MM * s.length());
    let of_all = explained.poses.iter().flat_map(|pose| explained.of_basis(&pose.coefficients, basis));
    let motions = explained.poses.iter().flat_map(|pose| motions(explained, pose, basis));
    BasisFigures {
        basis: basis + 1,
        mean_length_mm: mean_and_spread(lengths.clone())[0],
        p95_length_mm: quantile(lengths.clone(), 0.95),
        max_length_mm: extremes(lengths)[1],
        largest_coefficient: of_all.fold(0.0, |most: f64, c| most.max(f64::from(c.abs()))),
        max_motion_over_poses_mm: motions.fold(0.0, |most: f64, motion| most.max(MM * motion)),
    }
}

/// How far a basis moves each Gaussian in a pose from where it is in the rest pose, metres.
fn motions(explained: &AvatarProperties, pose: &PropertiesInPose, basis: usize) -> Vec<f64> {
    let now = explained.of_basis(&pose.coefficients, basis);
    let rest = explained.of_basis(&explained.coefficients_at_rest, basis);
    let n = explained.len();
    let of = |(p, s): (usize, &glam::DVec3)| {
        let component = |c: usize| {
            let i = if explained.rows == 3 { c * n + p } else { p };
            f64::from(now[i]) - f64::from(rest[i])
        };
        (*s * glam::DVec3::from([0, 1, 2].map(component))).length()
    };
    explained.basis(basis).iter().enumerate().map(of).collect()
}

/// Mean square of [`motions`] over poses and hand.
fn motion(explained: &AvatarProperties, basis: usize) -> f64 {
    let squares = explained.poses.iter().flat_map(|pose| motions(explained, pose, basis)).map(|m| m * m);
    squares.sum::<f64>() / (explained.poses.len() * explained.len()).max(1) as f64
}

fn coefficient_figures(explained: &AvatarProperties, basis: usize, pose: &PropertiesInPose) -> CoefficientFigures {
    let values = explained.of_basis(&pose.coefficients, basis).iter().copied().map(f64::from);
    let [mean, standard_deviation] = mean_and_spread(values.clone());
    let [min, max] = extremes(values);
    CoefficientFigures { basis: basis + 1, pose: pose.id.clone(), mean, standard_deviation, min, max }
}

/// Smallest residual weight that counts: less moves nothing by more than rounding.
const LEAST_WEIGHT: f64 = 1e-5;

/// The joints that have residual weights.
pub fn residual_joints(avatar: &Avatar, explained: &AvatarProperties) -> Vec<usize> {
    let has_any = |joint: &usize| explained.joint_weights(*joint).iter().any(|w| w.abs() > LEAST_WEIGHT);
    (0..avatar.template.joint_count()).filter(has_any).collect()
}

fn joint_name(avatar: &Avatar, joint: usize) -> String {
    avatar.template.joint_names.get(joint).cloned().unwrap_or_else(|| joint.to_string())
}

fn joint_figures(avatar: &Avatar, explained: &AvatarProperties, joint: usize) -> JointFigures {
    let values = explained.joint_weights(joint).iter().copied();
    let [min, max] = extremes(values.clone());
    let [mean_size, _] = mean_and_spread(values.map(f64::abs));
    JointFigures { joint: joint_name(avatar, joint), min, max, mean_size }
}

/// The pose with the largest angles.
pub fn most_bent(explained: &AvatarProperties) -> Option<&PropertiesInPose> {
    // The root turns the whole hand.
    let bent = |pose: &&PropertiesInPose| pose.pose.rotations.iter().skip(1).map(|turn| turn.length()).sum::<f64>();
    explained.poses.iter().max_by(|a, b| bent(a).total_cmp(&bent(b)))
}

fn skeleton_figures(avatar: &Avatar, explained: &AvatarProperties) -> Option<SkeletonFigures> {
    if residual_joints(avatar, explained).is_empty() {
        return None;
    }
    let pose = most_bent(explained)?;
    let joint = |(k, offset): (usize, &glam::DVec3)| SkeletonJoint {
        joint: joint_name(avatar, k),
        offset_mm: MM * offset.length(),
        posed_distance_mm: MM * pose.joints[k].distance(pose.residual_joints[k]),
    };
    Some(SkeletonFigures {
        pose: pose.id.clone(),
        joints_are: match avatar.config.residual_skeleton {
            ResidualSkeleton::Paper => "the regressed offsets alone, near the origin",
            ResidualSkeleton::Anchored => "the template's joints with the regressed offsets",
        },
        joints: pose.joint_offsets.iter().enumerate().map(joint).collect(),
    })
}

fn moved_figures(pose: &PropertiesInPose) -> MovedFigures {
    let values = pose.moved.iter().map(|moved| MM * moved);
    MovedFigures {
        pose: pose.id.clone(),
        mean_mm: mean_and_spread(values.clone())[0],
        median_mm: quantile(values.clone(), 0.5),
        p5_mm: quantile(values.clone(), 0.05),
        p95_mm: quantile(values.clone(), 0.95),
        max_mm: extremes(values)[1],
    }
}

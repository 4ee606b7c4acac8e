//! An avatar with its properties in some poses, and what the deformation makes of them.

use std::collections::HashMap;

use anyhow::Context as _;
use ghand_avatar::pose_properties::{PoseProperties, centred, vectors};
use ghand_avatar::{Avatar, PosedHand};
use ghand_core::Pose;
use ghand_core::blend_shapes::CoefficientLayout;
use ghand_core::deformation::{DeformationInputs, deform};
use ghand_core::residual_skeleton::{ResidualSkeleton, residual_joints};
use ghand_core::skinning::{ResidualWeights, Skinning, skin, skin_normals};
use ghand_hand_model::surface::sample_surface;
use ghand_motion::PoseFrame;
use ghand_render::Gpu;
use glam::DVec3;

/// An avatar with its properties in some poses.
pub struct AvatarProperties {
    /// Rest positions of the Gaussians without any basis, metres, N.
    pub rest: Vec<DVec3>,
    /// Outward normals there, unit length, N.
    pub normals: Vec<DVec3>,
    /// Shape bases S, `[n][N]`, metres.
    pub shape_basis: Vec<DVec3>,
    /// Residual skinning weights, `[n_b][N]`, as they take effect: less their mean over the joints if that is subtracted.
    pub residual_weights: Vec<f64>,
    /// Numbers of a coefficient.
    pub rows: usize,
    /// Coefficients in the rest pose, `[n][rows][N]`.
    pub coefficients_at_rest: Vec<f32>,
    /// The poses.
    pub poses: Vec<PropertiesInPose>,
}

/// One pose.
pub struct PropertiesInPose {
    /// Name or id.
    pub id: String,
    /// The pose.
    pub pose: Pose,
    /// Coefficients, `[n][rows][N]`.
    pub coefficients: Vec<f32>,
    /// Posed Gaussians, metres, N.
    pub posed: Vec<DVec3>,
    /// Their normals.
    pub normals: Vec<DVec3>,
    /// How far the residual terms move them from plain linear blend skinning, metres, N.
    pub moved: Vec<f64>,
    /// Posed joints of the template, metres, world, `n_b`.
    pub joints: Vec<DVec3>,
    /// Posed joints of the residual skeleton, metres, world, `n_b`.
    pub residual_joints: Vec<DVec3>,
    /// What the regressor adds to the joints of the residual skeleton at rest, R Delta, metres, `n_b`.
    pub joint_offsets: Vec<DVec3>,
}

/// Coefficients with three components `[n][N]`, whatever their layout.
fn coefficient_vectors(values: &[f32], rows: usize, count: usize) -> Vec<DVec3> {
    let at = |row: &[f32], p: usize, c: usize| f64::from(row[if rows == 3 { c * count + p } else { p }]);
    let bases = values.chunks_exact(rows * count.max(1));
    bases.flat_map(|row| (0..count).map(move |p| DVec3::from([0, 1, 2].map(|c| at(row, p, c))))).collect()
}

/// The normals of the texels that an avatar's Gaussians are, which may be some of its hand model's.
fn normals_of(avatar: &Avatar) -> anyhow::Result<Vec<DVec3>> {
    let samples = sample_surface(&avatar.model, avatar.config.uv_resolution)?;
    if samples.len() == avatar.template.len() {
        return Ok(samples.normals);
    }
    let place = |p: DVec3| p.as_vec3().to_array().map(f32::to_bits);
    let normals: HashMap<_, _> =
        samples.positions.iter().zip(&samples.normals).map(|(position, normal)| (place(*position), *normal)).collect();
    let rest = &avatar.template.rest;
    let count = avatar.template.len();
    let normal = |p: usize| normals.get(&[0, 1, 2].map(|c| rest[c * count + p].to_bits())).copied();
    let found: Option<Vec<DVec3>> = (0..count).map(normal).collect();
    found.with_context(|| format!("the avatar's {count} Gaussians are not texels of its hand model"))
}

impl AvatarProperties {
    /// Reads an avatar's properties in these poses and in the rest pose.
    ///
    /// # Errors
    /// An error if the device failed or the avatar's hand model cannot be sampled.
    pub fn read(gpu: &Gpu, avatar: &Avatar, frames: &[PoseFrame]) -> anyhow::Result<AvatarProperties> {
        let template = &avatar.template;
        let config = &avatar.config;
        let count = template.len();
        let joint_count = template.joint_count();
        let normals = normals_of(avatar)?;
        let wide = |values: &[f32]| values.iter().copied().map(f64::from).collect::<Vec<f64>>();
        let rest = vectors(&wide(&template.rest), count);
        let weights = wide(&template.weights);
        let mut hand = PosedHand::new(gpu, avatar)?;
        let rows = config.coefficients.rows();
        hand.set_pose(gpu, &Pose::rest(joint_count))?;
        let at_rest = PoseProperties::read(gpu, hand.properties())?;
        let mut poses = vec![];
        for PoseFrame { id, pose, .. } in frames {
            hand.set_pose(gpu, pose)?;
            let p = PoseProperties::read(gpu, hand.properties())?;
            let deformation = DeformationInputs {
                parents: &template.parents,
                joints: &template.joints,
                canonical: &rest,
                weights: &weights,
                shape_basis: &p.shape_basis,
                blend_coefficients: &coefficient_vectors(&p.coefficients, rows, count),
                skeleton_regressor: &p.regressor,
                residual_weights: &p.residual_weights,
                residual_weights_mode: config.residual_weights,
                residual_skeleton_mode: config.residual_skeleton,
            };
            let deformed = deform(&deformation, pose);
            let corrected = Skinning {
                rest: &deformed.rest,
                weights: &weights,
                residual_weights: &p.residual_weights,
                bones: &deformed.chain.posed_from_rest,
                residual_bones: &deformed.residual_chain.posed_from_rest,
                translation: pose.translation,
                mode: config.residual_weights,
            };
            let plain = skin(&Skinning { residual_weights: &[], residual_bones: &[], ..corrected });
            let moved = deformed.posed.iter().zip(&plain).map(|(a, b)| a.distance(*b)).collect();
            let joint_offsets =
                residual_joints(&p.regressor, &deformed.offsets, &template.joints, ResidualSkeleton::Paper);
            let world = |chain: &ghand_core::skeleton::Chain| {
                chain.world.iter().map(|joint| joint.translation + pose.translation).collect()
            };
            poses.push(PropertiesInPose {
                id: id.clone(),
                pose: pose.clone(),
                coefficients: p.coefficients,
                normals: skin_normals(&corrected, &normals),
                moved,
                joints: world(&deformed.chain),
                residual_joints: world(&deformed.residual_chain),
                joint_offsets,
                posed: deformed.posed,
            });
        }
        let residual_weights = match config.residual_weights {
            ResidualWeights::Paper => at_rest.residual_weights,
            ResidualWeights::ZeroSum => centred(&at_rest.residual_weights, count, joint_count),
        };
        Ok(AvatarProperties {
            rest,
            normals,
            shape_basis: at_rest.shape_basis,
            residual_weights,
            rows,
            coefficients_at_rest: at_rest.coefficients,
            poses,
        })
    }

    /// Number of Gaussians, N.
    pub fn len(&self) -> usize {
        self.rest.len()
    }

    /// Number of shape bases, n.
    pub fn bases(&self) -> usize {
        self.shape_basis.len() / self.len().max(1)
    }

    /// One basis, metres, N.
    pub fn basis(&self, basis: usize) -> &[DVec3] {
        self.shape_basis.get(basis * self.len()..(basis + 1) * self.len()).unwrap_or_default()
    }

    /// The residual weights of a joint, N.
    pub fn joint_weights(&self, joint: usize) -> &[f64] {
        self.residual_weights.get(joint * self.len()..(joint + 1) * self.len()).unwrap_or_default()
    }

    /// The coefficients of a basis among those of a pose, `[rows][N]`.
    pub fn of_basis<'a>(&self, coefficients: &'a [f32], basis: usize) -> &'a [f32] {
        let length = self.rows * self.len();
        coefficients.get(basis * length..(basis + 1) * length).unwrap_or_default()
    }

    /// How far a basis's coefficients are from those at rest, N; the mean of the three if there are three.
    pub fn relative_coefficients(&self, pose: &PropertiesInPose, basis: usize) -> Vec<f64> {
        let now = self.of_basis(&pose.coefficients, basis);
        let rest = self.of_basis(&self.coefficients_at_rest, basis);
        let difference = |i: usize| f64::from(now[i]) - f64::from(rest[i]);
        let n = self.len();
        (0..n).map(|p| (0..self.rows).map(|c| difference(c * n + p)).sum::<f64>() / self.rows as f64).collect()
    }
}

/// What a coefficient consists of.
pub fn layout_name(layout: CoefficientLayout) -> &'static str {
    match layout {
        CoefficientLayout::PerBasis => "one number per basis and Gaussian",
        CoefficientLayout::PerComponent => "three numbers per basis and Gaussian",
    }
}

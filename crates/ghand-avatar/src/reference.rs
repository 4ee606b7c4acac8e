//! Twin of a posed avatar in plain f64, with which tests and `ghand-lab stress` compare the device: from tables and pose to
//! Gaussians, and back. Of `direct` avatars, and forward only of baked ones and of networks. Light apart from skin is
//! in [`pose_avatar`] only.

pub mod baked;
#[cfg(feature = "networks")]
pub(crate) mod network;

use crate::deform::CoefficientLayout;
use crate::deform::baked::BakedTables;
use ghand_core::deformation::{DeformationInputs, Deformed, deform, deform_vjp};
use ghand_core::pose_response::{PoseResponse, pose_features, response_features_vjp};
use ghand_core::posing::pose_hand;
use ghand_core::skinning::{Skinning, skin_normals};
use ghand_core::stretch::stretch;
use ghand_core::{InvalidHandModel, Pose};
use ghand_hand_model::HandModelError;
use ghand_render::reference::project::{Color, Gaussian};
use ghand_render::splat::FLATNESS;
use glam::{DQuat, DVec3, DVec4};

use crate::avatar::Avatar;
use crate::light::LitMesh;
use crate::neighbors::neighbors;
use crate::properties::PropertyTables;
use crate::properties::direct::DirectTables;
use crate::properties::network::NetworkTables;
#[cfg(feature = "networks")]
use crate::properties::network::{PositionMap, gaussian_uvs};
use crate::template::{AvatarConfig, GaussianShape};

/// Posed Gaussians, N of each part.
#[derive(Debug, Clone, PartialEq)]
pub struct PosedGaussians {
    /// Centres, metres, world.
    pub means: Vec<DVec3>,
    /// Standard deviations along the surface, metres.
    pub scales: Vec<f64>,
    /// Unit normals, world; zero where the surface is collapsed. `None` if the Gaussians are round.
    pub normals: Option<Vec<DVec3>>,
    /// Colours, display values.
    pub colors: Vec<DVec3>,
}

/// Vectors as rows `[3][N]`.
pub fn rows(vectors: &[DVec3]) -> Vec<f64> {
    (0..3).flat_map(|c| vectors.iter().map(move |v| v[c])).collect()
}

/// The vectors in three rows of a table `[rows][N]`, from row `first` on.
pub fn vectors(table: &[f64], first: usize, count: usize) -> Vec<DVec3> {
    let at = |c: usize, p: usize| table[(first + c) * count + p];
    (0..count).map(|p| DVec3::new(at(0, p), at(1, p), at(2, p))).collect()
}

fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|v| f64::from(*v)).collect()
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

impl PosedGaussians {
    /// From a splatter's table, `[7 or 10][N]`.
    pub fn from_table(table: &[f64], shape: GaussianShape) -> PosedGaussians {
        let flat = shape == GaussianShape::Flat;
        let count = table.len() / if flat { 10 } else { 7 };
        PosedGaussians {
            means: vectors(table, 0, count),
            scales: table[3 * count..4 * count].to_vec(),
            normals: flat.then(|| vectors(table, 4, count)),
            colors: vectors(table, if flat { 7 } else { 4 }, count),
        }
    }

    /// As a splatter's table, `[7 or 10][N]`.
    pub fn table(&self) -> Vec<f64> {
        let normals = self.normals.as_deref().map(rows).unwrap_or_default();
        [rows(&self.means), self.scales.clone(), normals, rows(&self.colors)].concat()
    }

    /// For the splatter's twin, with this opacity.
    pub fn splats(&self, opacity: f64) -> Vec<Gaussian> {
        let splat = |p: usize| {
            let [mean, color] = [self.means[p], self.colors[p]];
            let Some(normals) = &self.normals else { return Gaussian::round(mean, self.scales[p], opacity, color) };
            Gaussian {
                mean,
                scales: DVec3::new(1.0, 1.0, FLATNESS) * self.scales[p],
                // No direction is the device's mark of a broken Gaussian.
                rotation: match normals[p] == DVec3::ZERO {
                    true => DVec4::ZERO,
                    false => DQuat::from_rotation_arc(DVec3::Z, normals[p].normalize()).into(),
                },
                opacity,
                color: Color::Rgb(color),
            }
        };
        (0..self.means.len()).map(splat).collect()
    }
}

/// Why an avatar cannot be posed without a device.
#[derive(Debug, thiserror::Error)]
pub enum TwinError {
    /// The hand model of networks has no usable UV atlas.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
    /// The pose does not fit the hand.
    #[error(transparent)]
    Pose(#[from] InvalidHandModel),
}

/// The Gaussians of any avatar in a pose, in its light without gloss, which depends on the view.
///
/// # Errors
/// [`TwinError`] if the pose does not fit the avatar, or its hand model the networks.
pub fn pose_avatar(avatar: &Avatar, pose: &Pose) -> Result<PosedGaussians, TwinError> {
    let mut posed = pose_unlit(avatar, pose)?;
    if let Some(light) = &avatar.light {
        let mesh = LitMesh::new(light, &avatar.model);
        let parts = mesh.parts(&light.light, pose)?;
        let shades = light.at_gaussians(&mesh, &mesh.shades(&light.light, &parts, light.interreflection));
        let lit = posed.colors.iter_mut().zip(shades);
        lit.for_each(|(color, shade)| *color *= DVec3::from(shade.map(f64::from)));
    }
    Ok(posed)
}

/// As [`pose_avatar`], with the colours of the skin where light is apart from them.
///
/// # Errors
/// As [`pose_avatar`].
pub fn pose_unlit(avatar: &Avatar, pose: &Pose) -> Result<PosedGaussians, TwinError> {
    pose_hand(&avatar.model, &[], pose)?;
    Ok(match &avatar.tables {
        PropertyTables::Baked(tables) => pose_baked(avatar, tables, pose),
        PropertyTables::Network(tables) => pose_network(avatar, tables, pose)?,
        PropertyTables::Direct(tables) => DirectTwin::of(avatar, tables).pose(pose).gaussians,
    })
}

/// A baked avatar's Gaussians in a pose.
pub fn pose_baked(avatar: &Avatar, tables: &BakedTables, pose: &Pose) -> PosedGaussians {
    let posed = tables.posed(&avatar.template.parents, &avatar.template.joints, pose);
    PosedGaussians {
        means: posed.iter().map(|g| g.mean).collect(),
        scales: posed.iter().map(|g| g.scale).collect(),
        normals: (avatar.config.gaussians == GaussianShape::Flat).then(|| posed.iter().map(|g| g.normal).collect()),
        colors: posed.iter().map(|g| g.color).collect(),
    }
}

/// A network avatar's Gaussians in a pose.
///
/// # Errors
/// [`HandModelError`] if the hand model has no usable UV atlas.
#[cfg(not(feature = "networks"))]
pub fn pose_network(_: &Avatar, tables: &NetworkTables, _: &Pose) -> Result<PosedGaussians, HandModelError> {
    tables.never()
}

/// A network avatar's Gaussians in a pose.
///
/// # Errors
/// [`HandModelError`] if the hand model has no usable UV atlas.
#[cfg(feature = "networks")]
pub fn pose_network(avatar: &Avatar, tables: &NetworkTables, pose: &Pose) -> Result<PosedGaussians, HandModelError> {
    let Avatar { template, config, model, .. } = avatar;
    let count = template.len();
    let map = PositionMap::new(model, tables.sizes.map_side)?;
    let named = tables.parameter_names().into_iter().zip(&tables.parameters);
    let twin = network::Twin {
        sizes: tables.sizes.clone(),
        parameters: named.map(|(name, values)| (name, widen(values))).collect(),
        fixed_norms: tables.running_norms.iter().map(|of| of.each_ref().map(|values| widen(values))).collect(),
        uvs: gaussian_uvs(model, config.uv_resolution)?,
        maps: [map.rest(), map.posed(&template.joints, &pose.rotations)],
        base_shape_basis: widen(&tables.base_shape_basis),
        base_logits: widen(&tables.base_logits),
        max_scale: template.max_scale().into(),
        coefficient_rows: config.coefficient_rows(),
    };
    let [shape_basis, residual_weights, channels, regressor, scales, colors] = twin.outputs();
    let rest = vectors(&widen(&template.rest), 0, count);
    let weights = widen(&template.weights);
    let shape_basis: Vec<DVec3> = (0..config.shape_bases).flat_map(|i| vectors(&shape_basis, 3 * i, count)).collect();
    let coefficients = coefficients(config, &channels, count);
    let deformation = DeformationInputs {
        parents: &template.parents,
        joints: &template.joints,
        canonical: &rest,
        weights: &weights,
        shape_basis: &shape_basis,
        blend_coefficients: &coefficients,
        skeleton_regressor: &regressor,
        residual_weights: &residual_weights,
        residual_weights_mode: config.residual_weights,
        residual_skeleton_mode: config.residual_skeleton,
    };
    let deformed = deform(&deformation, pose);
    let normals = posed_normals(avatar, &deformation, &deformed, pose);
    let factors = stretch(&neighbors(template), &deformed.rest, &deformed.posed);
    let scales = scales.iter().zip(factors).map(|(scale, factor)| scale * factor).collect();
    Ok(PosedGaussians { means: deformed.posed, scales, normals, colors: vectors(&colors, 0, count) })
}

/// Blend coefficients, N for each basis, from rows of channels.
fn coefficients(config: &AvatarConfig, channels: &[f64], count: usize) -> Vec<DVec3> {
    match config.coefficients {
        CoefficientLayout::PerBasis => channels.iter().map(|v| DVec3::splat(*v)).collect(),
        CoefficientLayout::PerComponent => {
            (0..config.shape_bases).flat_map(|i| vectors(channels, 3 * i, count)).collect()
        }
    }
}

/// The normals of flat Gaussians, world.
fn posed_normals(
    avatar: &Avatar,
    deformation: &DeformationInputs<'_>,
    deformed: &Deformed,
    pose: &Pose,
) -> Option<Vec<DVec3>> {
    let normals = avatar.template.normals.as_ref()?;
    let skinning = Skinning {
        rest: &deformed.rest,
        weights: deformation.weights,
        residual_weights: deformation.residual_weights,
        bones: &deformed.chain.posed_from_rest,
        residual_bones: &deformed.residual_chain.posed_from_rest,
        translation: pose.translation,
        mode: deformation.residual_weights_mode,
    };
    Some(skin_normals(&skinning, &vectors(&widen(normals), 0, avatar.template.len())))
}

/// The twin of a `direct` avatar.
pub struct DirectTwin<'a> {
    avatar: &'a Avatar,
    response: PoseResponse,
    weights: Vec<f64>,
    rest: Vec<DVec3>,
    shape_basis: Vec<DVec3>,
    residual_weights: Vec<f64>,
    regressor: Vec<f64>,
    appearance: Vec<f64>,
    neighbors: Vec<u32>,
}

/// A pose of a [`DirectTwin`], with what its derivative needs.
pub struct PosedTwin {
    /// The Gaussians.
    pub gaussians: PosedGaussians,
    deformed: Deformed,
    features: Vec<[f64; 9]>,
    coefficients: Vec<DVec3>,
    color_values: Vec<f64>,
    /// Standard deviations before skinning stretches them, metres, and the factors by which it does.
    scales: Vec<f64>,
    stretch: Vec<f64>,
}

/// Gradients, by the names and in the layout of the device's.
pub struct TwinGradients {
    /// Of the learned tables.
    pub tables: [(&'static str, Vec<f64>); 5],
    /// Of the joints' axis-angles and the translation, `3 n_b + 3`.
    pub pose: Vec<f64>,
}

impl<'a> DirectTwin<'a> {
    /// The twin of an avatar; `None` if it has another property model.
    pub fn new(avatar: &'a Avatar) -> Option<DirectTwin<'a>> {
        match &avatar.tables {
            PropertyTables::Direct(tables) => Some(DirectTwin::of(avatar, tables)),
            _ => None,
        }
    }

    fn of(avatar: &'a Avatar, tables: &'a DirectTables) -> DirectTwin<'a> {
        let DirectTables { shape_basis, residual_weights, regressor, appearance, .. } = tables;
        let template = &avatar.template;
        let count = avatar.template.len();
        let basis = widen(shape_basis);
        // Plain skinning is that with residual weights of 0.
        let residual = |values: &[f32]| match avatar.config.plain_skinning {
            true => vec![0.0; template.joint_count() * count],
            false => widen(values),
        };
        DirectTwin {
            avatar,
            response: tables.pose_response(avatar.config.channels()),
            weights: widen(&template.weights),
            rest: vectors(&widen(&template.rest), 0, count),
            shape_basis: (0..avatar.config.shape_bases).flat_map(|i| vectors(&basis, 3 * i, count)).collect(),
            residual_weights: residual(residual_weights),
            regressor: residual(regressor),
            appearance: widen(appearance),
            neighbors: neighbors(template),
        }
    }

    fn count(&self) -> usize {
        self.rest.len()
    }

    fn deformation<'b>(&'b self, coefficients: &'b [DVec3]) -> DeformationInputs<'b> {
        DeformationInputs {
            parents: &self.avatar.template.parents,
            joints: &self.avatar.template.joints,
            canonical: &self.rest,
            weights: &self.weights,
            shape_basis: &self.shape_basis,
            blend_coefficients: coefficients,
            skeleton_regressor: &self.regressor,
            residual_weights: &self.residual_weights,
            residual_weights_mode: self.avatar.config.residual_weights,
            residual_skeleton_mode: self.avatar.config.residual_skeleton,
        }
    }

    /// The vectors of colour component j.
    fn component(&self, j: usize) -> Vec<DVec3> {
        vectors(&self.appearance, 4 + 3 * j, self.count())
    }

    /// The Gaussians in a pose.
    pub fn pose(&self, pose: &Pose) -> PosedTwin {
        let config = &self.avatar.config;
        let count = self.count();
        let features = pose_features(pose);
        let mut channels = self.response.evaluate(&self.weights, &features, count);
        let color_values = channels.split_off(config.coefficient_rows() * count);
        let coefficients = coefficients(&self.avatar.config, &channels, count);
        let deformed = deform(&self.deformation(&coefficients), pose);
        let largest = f64::from(self.avatar.max_scale());
        let scales: Vec<f64> = self.appearance[..count].iter().map(|logit| largest * sigmoid(*logit)).collect();
        let stretch = stretch(&self.neighbors, &deformed.rest, &deformed.posed);
        let mut logits = vectors(&self.appearance, 1, count);
        for j in 0..config.color_components {
            let values = &color_values[j * count..];
            logits.iter_mut().zip(self.component(j)).zip(values).for_each(|((sum, c), value)| *sum += c * *value);
        }
        let colors = logits.iter().map(|c| DVec3::new(sigmoid(c.x), sigmoid(c.y), sigmoid(c.z))).collect();
        let normals = posed_normals(self.avatar, &self.deformation(&coefficients), &deformed, pose);
        let stretched = scales.iter().zip(&stretch).map(|(scale, factor)| scale * factor).collect();
        let gaussians = PosedGaussians { means: deformed.posed.clone(), scales: stretched, normals, colors };
        PosedTwin { gaussians, deformed, features, coefficients, color_values, scales, stretch }
    }

    /// Gradients from dL/d(centres), dL/d(standard deviations) and dL/d(colours), N each, and from the penalties
    /// `offset_weight / 2` times the squared offsets and `scale_weight / 2` times the squared standard deviations before
    /// skinning stretches them. That the stretch depends on the places is neglected, as on the device.
    pub fn gradients(
        &self,
        pose: &Pose,
        posed: &PosedTwin,
        d: &PosedGaussians,
        [offset_weight, scale_weight]: [f64; 2],
    ) -> TwinGradients {
        let config = &self.avatar.config;
        let count = self.count();
        let largest = f64::from(self.avatar.max_scale());
        let PosedTwin { scales, stretch, gaussians: PosedGaussians { colors, .. }, .. } = posed;
        let d_scale = (0..count)
            .map(|p| (d.scales[p] * stretch[p] + scale_weight * scales[p]) * scales[p] * (1.0 - scales[p] / largest))
            .collect();
        let d_logits: Vec<DVec3> = d.colors.iter().zip(colors).map(|(d, c)| *d * *c * (DVec3::ONE - *c)).collect();
        let mut d_appearance: Vec<f64> = [d_scale, rows(&d_logits)].concat();
        let mut d_colors = vec![];
        for j in 0..config.color_components {
            let values = &posed.color_values[j * count..];
            let d_component: Vec<DVec3> = d_logits.iter().zip(values).map(|(d, value)| *d * *value).collect();
            d_appearance.extend(rows(&d_component));
            d_colors.extend(self.component(j).iter().zip(&d_logits).map(|(component, d)| component.dot(*d)));
        }
        let d_offsets: Vec<DVec3> = posed.deformed.offsets.iter().map(|offset| *offset * offset_weight).collect();
        let deformation = self.deformation(&posed.coefficients);
        let mut d = deform_vjp(&deformation, pose, &posed.deformed, &d.means, &d_offsets);
        let mut d_channels: Vec<f64> = match config.coefficients {
            CoefficientLayout::PerBasis => d.blend_coefficients.iter().map(|c| c.element_sum()).collect(),
            CoefficientLayout::PerComponent => d.blend_coefficients.chunks_exact(count).flat_map(rows).collect(),
        };
        d_channels.extend(d_colors);
        let (d_response, d_features) = self.response.evaluate_vjp(&self.weights, &posed.features, &d_channels, count);
        d.local.iter_mut().zip(response_features_vjp(&d_features)).for_each(|(sum, d_local)| *sum += d_local);
        let d_pose = d.rotations(pose).into_iter().chain([d.translation]).flat_map(|v| v.to_array()).collect();
        if config.plain_skinning {
            (d.residual_weights, d.skeleton_regressor) = (vec![], vec![]);
        }
        TwinGradients {
            tables: [
                ("shape_basis", d.shape_basis.chunks_exact(count.max(1)).flat_map(rows).collect()),
                ("residual_weights", d.residual_weights),
                ("skeleton_regressor", d.skeleton_regressor),
                ("appearance", d_appearance),
                ("response", [d_response.bias, d_response.gain].concat()),
            ],
            pose: d_pose,
        }
    }
}

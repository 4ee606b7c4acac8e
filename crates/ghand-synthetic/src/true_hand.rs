//! The hand in the images: in another shape, with a finer mesh and skin.
//!
//! It has no pose correctives: volume-preserving skinning poses it, and its folds.

use ghand_capture::interhand::Landmarks;
use ghand_core::mesh::{RenderMesh, Texture};
use ghand_core::skeleton::pose_skeleton;
use ghand_core::{HandModel, Pose};
use glam::DVec3;
use rayon::prelude::*;

use super::anatomy::{Anatomy, SkinPoint};
use super::atlas::Atlas;
use super::complexion::Complexion;
use super::folds::{Bend, Fold, Folds, bent};
use super::light_visibility::LightVisibility;
use super::skin::{Look, Skin};
use super::skinning::pose_vertices;
use super::subdivision::subdivided;

/// Number of subdivisions of the template's mesh: folds need edges of less than a millimetre, and the template's are
/// 3.6 mm long.
const SUBDIVISIONS: usize = 3;

/// The true hand, ready to be posed.
pub(super) struct TrueHand {
    /// At rest, without relief.
    pub(super) model: HandModel,
    /// Number of its vertices that belong to the mesh before subdivision.
    coarse_vertices: usize,
    pub(super) normals: Vec<DVec3>,
    /// Appearance of each vertex without its folds, and the folds.
    looks: Vec<(Look, Vec<Fold>)>,
    pub mesh: RenderMesh,
    atlas: Atlas,
    pub(super) anatomy: Anatomy,
    complexion: Complexion,
    light_visibility: LightVisibility,
}

/// One frame, at the render mesh's vertices.
pub(super) struct PosedHand {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub light_visibility: Vec<f64>,
    pub texture: Texture,
}

impl TrueHand {
    /// Grows skin on a hand ([`random_hand`]) by the seed.
    ///
    /// [`random_hand`]: super::random_shape::random_hand
    pub(super) fn new(hand: &HandModel, seed: u64) -> TrueHand {
        let mut model = hand.without_blend_shapes();
        // The skin's seed continues from this one.
        let seed = seed & (u64::MAX >> 1);
        let anatomy = Anatomy::of(&model);
        let coarse_vertices = model.vertices.len();
        for _ in 0..SUBDIVISIONS {
            model = subdivided(&model);
        }
        let complexion = Complexion::of(seed);
        let (skin, folds) = (Skin::new(&anatomy, &complexion, seed), Folds::new(&anatomy, seed));
        let finger_weights: Vec<Vec<f64>> =
            (0..model.vertices.len()).map(|v| anatomy.finger_weights(model.vertex_weights(v))).collect();
        let normals = model.vertex_normals(&model.vertices);
        let looks = (0..model.vertices.len())
            .into_par_iter()
            .map(|v| {
                let (position, normal) = (model.vertices[v], normals[v]);
                let point = SkinPoint { position, normal, finger_weights: &finger_weights[v] };
                (skin.look(&point), folds.at(&point))
            })
            .collect();
        let atlas = Atlas::new(&model, &normals, &finger_weights, &skin, &folds);
        let light_visibility = LightVisibility::new(&anatomy, &model);
        let mesh = RenderMesh::from_model(&model);
        TrueHand { mesh, looks, atlas, light_visibility, normals, anatomy, complexion, coarse_vertices, model }
    }

    /// Rest positions with the relief of a pose.
    pub(super) fn rest_with_folds(&self, bend: &Bend) -> Vec<DVec3> {
        (self.model.vertices.par_iter().zip(&self.normals).zip(&self.looks))
            .map(|((position, normal), (look, folds))| {
                *position + *normal * bent(look, folds, bend, &self.complexion).height
            })
            .collect()
    }

    pub(super) fn pose(&self, pose: &Pose) -> PosedHand {
        let bend = Bend::of(&self.anatomy, pose);
        let positions = pose_vertices(&self.model, &self.rest_with_folds(&bend), pose);
        let normals = self.model.vertex_normals(&positions);
        let light_visibility = self.light_visibility.of(&self.model, pose, &positions, &normals);
        PosedHand {
            positions: self.mesh.gather(&positions),
            normals: self.mesh.gather(&normals),
            light_visibility: self.mesh.source_vertices.iter().map(|&v| light_visibility[v as usize]).collect(),
            texture: self.atlas.texture(&bend, &self.complexion),
        }
    }

    /// Some of the posed hand's vertices, a few millimetres apart; world, metres.
    pub(super) fn outline(&self, pose: &Pose) -> Vec<DVec3> {
        // Subdivision puts the coarse mesh's vertices first.
        pose_vertices(&self.model, &self.model.vertices[..self.coarse_vertices], pose)
    }

    /// Joints of the posed hand, in the model's order, then the tips of its fingers, in that of the anatomy; world, metres.
    pub(super) fn landmarks(&self, pose: &Pose) -> Landmarks {
        let motions = pose_skeleton(&self.model.parents, &self.model.joints, &pose.rotations).posed_from_rest;
        let joints = (0..self.model.joint_count()).map(|k| motions[k].apply(self.model.joints[k]));
        let tips = self.anatomy.fingers.iter().map(|f| motions[f.joints[2]].apply(f.points[3]));
        let mut points = joints.chain(tips).map(|p| p + pose.translation);
        std::array::from_fn(|_| points.next().unwrap_or_default())
    }
}

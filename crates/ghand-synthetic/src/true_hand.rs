//! The hand in the images: in another shape, with a finer mesh and skin.
//!
//! Its shape is [`random_shape`]'s. It has no pose correctives: volume-preserving skinning poses it, and its folds.

use ghand_capture::interhand::Landmarks;
use ghand_core::mesh::{RenderMesh, Texture};
use ghand_core::posing::shape_hand;
use ghand_core::skeleton::pose_skeleton;
use ghand_core::{HandModel, Pose};
use ghand_hand_model::HandModelError;
use glam::DVec3;
use rayon::prelude::*;

use super::anatomy::{Anatomy, NailPart, SkinPoint};
use super::atlas::Atlas;
use super::complexion::Complexion;
use super::folds::{Bend, Fold, Folds, bent};
use super::light_visibility::LightVisibility;
use super::random_shape::random_shape;
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
    /// Gives the template a shape by the seed and grows skin on the result.
    pub(super) fn new(template: &HandModel, seed: u64) -> Result<TrueHand, HandModelError> {
        let shaped = shape_hand(template, &random_shape(template, seed))?;
        let mut model =
            HandModel { vertices: shaped.vertices, joints: shaped.joints, ..template.without_blend_shapes() };
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
        let face_nails = face_nails(&anatomy, model.faces.len());
        let vertex_nails = vertex_nails(&model, &face_nails);
        let looks = (0..model.vertices.len())
            .into_par_iter()
            .map(|v| {
                let (position, normal, nail) = (model.vertices[v], normals[v], vertex_nails[v]);
                let point = SkinPoint { position, normal, finger_weights: &finger_weights[v], nail };
                (skin.look(&point), folds.at(&point))
            })
            .collect();
        let atlas = Atlas::new(&model, &normals, &finger_weights, &face_nails, &skin, &folds);
        let light_visibility = LightVisibility::new(&anatomy, &model);
        let mesh = RenderMesh::from_model(&model);
        Ok(TrueHand { mesh, looks, atlas, light_visibility, normals, anatomy, complexion, coarse_vertices, model })
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

/// The part of a nail that each face of the subdivided mesh is on. Subdivision divides each face into four in its place.
fn face_nails(anatomy: &Anatomy, faces: usize) -> Vec<Option<NailPart>> {
    let parts = 4usize.pow(SUBDIVISIONS as u32);
    let mut nails = vec![None; faces];
    let mut mark = |coarse: &[u32], part: NailPart| {
        coarse.iter().map(|&face| face as usize * parts).for_each(|i| nails[i..i + parts].fill(Some(part)));
    };
    for (finger, plate) in anatomy.fingers.iter().enumerate().filter_map(|(i, f)| Some((i, f.nail.as_ref()?))) {
        mark(&plate.faces, NailPart::Plate(finger));
        mark(&plate.groove, NailPart::Groove);
    }
    nails
}

/// The part of a nail that each vertex is on, borders included: there is no relief.
fn vertex_nails(model: &HandModel, face_nails: &[Option<NailPart>]) -> Vec<Option<NailPart>> {
    let mut nails = vec![None; model.vertices.len()];
    for (face, nail) in model.faces.iter().zip(face_nails).filter(|(_, nail)| nail.is_some()) {
        face.iter().for_each(|&v| nails[v as usize] = *nail);
    }
    nails
}

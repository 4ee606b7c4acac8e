//! The hand in the images: in another shape, with a finer mesh and skin.
//!
//! It has no pose correctives: volume-preserving skinning poses it, and its folds. It is made as a right hand; a left
//! one is mirrored after that.

use ghand_core::mesh::{RenderMesh, Texture};
use ghand_core::skeleton::pose_skeleton;
use ghand_core::{HandModel, Pose, Side};
use glam::DVec3;
use rayon::prelude::*;

use super::anatomy::{Anatomy, SkinPoint};
use super::forearm::HandWithForearm;
use super::skinning::pose_vertices;
use super::subdivision::subdivided;
use crate::images::light_visibility::LightVisibility;
use crate::skin::atlas::Atlas;
use crate::skin::complexion::Complexion;
use crate::skin::folds::{Bend, Fold, Folds, bent};
use crate::skin::{Look, Skin};

/// Images of fewer pixels show a hand with a millimetre or more a pixel.
const FEW_PIXELS: u64 = 25_000;
/// From so many pixels on, images of a hand show pores and prints.
const MANY_PIXELS: u64 = 1_000_000;

/// How often the template's mesh is subdivided, whose edges are 3.6 mm long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Detail {
    /// Edges of less than half a millimetre, which folds need.
    Fine,
    /// Edges of about a millimetre: as fine as the pixels of videos, and four times as fast.
    Film,
    /// As [`Detail::Film`], with half as many texels along each side: for images whose pixels are a millimetre or more.
    Small,
    /// As [`Detail::Fine`], with pores and prints.
    Pores,
}

impl Detail {
    /// What images of this size can show of a hand.
    pub fn of_images([width, height]: [u32; 2]) -> Detail {
        match u64::from(width) * u64::from(height) {
            0..FEW_PIXELS => Detail::Small,
            FEW_PIXELS..MANY_PIXELS => Detail::Fine,
            _ => Detail::Pores,
        }
    }

    fn subdivisions(self) -> usize {
        match self {
            Detail::Fine | Detail::Pores => 3,
            Detail::Film | Detail::Small => 2,
        }
    }
}

/// The true hand, ready to be posed.
pub(crate) struct TrueHand {
    /// Of the hand as it is posed and drawn.
    side: Side,
    /// The right hand at rest, without relief.
    pub(crate) model: HandModel,
    /// Number of its vertices that belong to the hand's mesh before subdivision.
    coarse_vertices: usize,
    /// Whether a render vertex is on the forearm; empty without one.
    pub on_forearm: Vec<bool>,
    pub(crate) normals: Vec<DVec3>,
    /// Appearance of each vertex without its folds, and the folds.
    looks: Vec<(Look, Vec<Fold>)>,
    /// Of the hand as it is drawn, but for its positions.
    pub mesh: RenderMesh,
    atlas: Atlas,
    pub(crate) anatomy: Anatomy,
    complexion: Complexion,
    light_visibility: LightVisibility,
}

/// One frame, at the render mesh's vertices.
pub(crate) struct PosedTrueHand {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub light_visibility: Vec<f64>,
    pub texture: Texture,
}

impl TrueHand {
    /// Grows skin on a right hand ([`random_hand`]) by the seed; `side` is that of the result.
    ///
    /// [`random_hand`]: super::random_shape::random_hand
    pub(crate) fn new(hand: &HandModel, side: Side, seed: u64, detail: Detail) -> TrueHand {
        let whole = hand.without_blend_shapes();
        TrueHand::grown(whole, hand.vertices.len(), side, seed, detail)
    }

    /// The same of a right hand with its forearm.
    pub(crate) fn with_forearm(hand: HandWithForearm, side: Side, seed: u64, detail: Detail) -> TrueHand {
        let grown = TrueHand::grown(hand.model, hand.hand_vertices, side, seed, detail);
        let sources = grown.mesh.source_vertices.iter();
        let on_forearm = sources.map(|&v| grown.model.vertices[v as usize].y > hand.end).collect();
        TrueHand { on_forearm, ..grown }
    }

    fn grown(mut model: HandModel, coarse_vertices: usize, side: Side, seed: u64, detail: Detail) -> TrueHand {
        // The skin's seed continues from this one.
        let seed = seed & (u64::MAX >> 1);
        let anatomy = Anatomy::of(&model);
        for _ in 0..detail.subdivisions() {
            model = subdivided(&model);
        }
        let complexion = Complexion::of(seed);
        let skin = Skin::new(&anatomy, &complexion, seed);
        let folds = Folds::new(&anatomy, seed);
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
        let atlas = Atlas::new(&model, &normals, &finger_weights, &skin, &folds, detail);
        let light_visibility = LightVisibility::new(&anatomy, &model);
        let mut mesh = RenderMesh::from_model(&model);
        if side == Side::Left {
            // Mirrored triangles would be seen from inside.
            mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        let on_forearm = vec![];
        TrueHand {
            side,
            mesh,
            looks,
            atlas,
            light_visibility,
            normals,
            anatomy,
            complexion,
            coarse_vertices,
            on_forearm,
            model,
        }
    }

    /// Rest positions with the relief of a pose.
    pub(crate) fn rest_with_folds(&self, bend: &Bend) -> Vec<DVec3> {
        (self.model.vertices.par_iter().zip(&self.normals).zip(&self.looks))
            .map(|((position, normal), (look, folds))| {
                *position + *normal * bent(look, folds, bend, &self.complexion).height
            })
            .collect()
    }

    /// The hand in a pose. `wrist` rotates its forearm, if it has one, against a right hand; axis-angle, radians.
    pub(crate) fn pose(&self, pose: &Pose, wrist: DVec3) -> PosedTrueHand {
        let pose = &self.as_bent_right_hand(pose, wrist);
        let bend = Bend::of(&self.anatomy, pose);
        let positions = pose_vertices(&self.model, &self.rest_with_folds(&bend), pose);
        let normals = self.model.vertex_normals(&positions);
        let light_visibility = self.light_visibility.of(&self.model, pose, &positions, &normals);
        PosedTrueHand {
            positions: self.gathered(&positions),
            normals: self.gathered(&normals),
            light_visibility: self.mesh.source_vertices.iter().map(|&v| light_visibility[v as usize]).collect(),
            texture: self.atlas.texture(&bend, &self.complexion),
        }
    }

    /// Rows and columns of the texture.
    pub(crate) fn texture_size(&self) -> u32 {
        self.atlas.size() as u32
    }

    /// The positions of [`TrueHand::pose`] alone.
    pub(crate) fn positions(&self, pose: &Pose, wrist: DVec3) -> Vec<DVec3> {
        let pose = &self.as_bent_right_hand(pose, wrist);
        let bend = Bend::of(&self.anatomy, pose);
        self.gathered(&pose_vertices(&self.model, &self.rest_with_folds(&bend), pose))
    }

    /// Where points at rest are that move with the last joint, the forearm's if there is one; world, metres.
    pub(crate) fn moved_with_forearm(&self, rest: &[DVec3], pose: &Pose, wrist: DVec3) -> Vec<DVec3> {
        let pose = &self.as_bent_right_hand(pose, wrist);
        let motions = pose_skeleton(&self.model.parents, &self.model.joints, &pose.rotations).posed_from_rest;
        let moved = |point: &DVec3| motions.last().map_or(*point, |motion| motion.apply(*point)) + pose.translation;
        rest.iter().map(|point| self.placed(moved(point))).collect()
    }

    /// Joints of the posed hand in the model's order, without the forearm's; world, metres.
    pub(crate) fn joints(&self, pose: &Pose) -> Vec<DVec3> {
        let pose = &self.as_right_hand(pose);
        let motions = pose_skeleton(&self.model.parents, &self.model.joints, &pose.rotations).posed_from_rest;
        let count = self.model.joint_count() - usize::from(!self.on_forearm.is_empty());
        (0..count).map(|k| self.placed(motions[k].apply(self.model.joints[k]) + pose.translation)).collect()
    }

    /// Some of the posed hand's vertices, a few millimetres apart; world, metres.
    pub(crate) fn outline(&self, pose: &Pose) -> Vec<DVec3> {
        // Subdivision puts the coarse mesh's vertices first.
        let outline =
            pose_vertices(&self.model, &self.model.vertices[..self.coarse_vertices], &self.as_right_hand(pose));
        outline.into_iter().map(|point| self.placed(point)).collect()
    }

    /// The right hand's pose that is this pose of the hand, with the forearm straight.
    fn as_right_hand(&self, pose: &Pose) -> Pose {
        let mut pose = match self.side {
            Side::Right => pose.clone(),
            Side::Left => pose.mirrored(),
        };
        pose.rotations.resize(self.model.joint_count(), DVec3::ZERO);
        pose
    }

    /// The same with the forearm, if there is one, rotated by `wrist`, axis-angle, radians.
    fn as_bent_right_hand(&self, pose: &Pose, wrist: DVec3) -> Pose {
        let mut pose = self.as_right_hand(pose);
        if let Some(forearm) = pose.rotations.last_mut().filter(|_| !self.on_forearm.is_empty()) {
            *forearm = wrist;
        }
        pose
    }

    /// Vectors of the model's vertices at those of the render mesh, on the hand's side.
    fn gathered(&self, vectors: &[DVec3]) -> Vec<DVec3> {
        self.mesh.gather(vectors).into_iter().map(|vector| self.placed(vector)).collect()
    }

    /// Where a point or direction of the posed right hand is on the hand.
    fn placed(&self, vector: DVec3) -> DVec3 {
        match self.side {
            Side::Right => vector,
            Side::Left => DVec3::new(-vector.x, vector.y, vector.z),
        }
    }
}

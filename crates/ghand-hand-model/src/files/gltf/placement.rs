//! Where a hand is: its nodes and inverse bind matrices decide, not the node of its mesh.

use std::collections::HashMap;

use glam::{DMat3, DMat4, DVec3};

use super::Source;
use super::choice::Part;
use super::hands::Hand;
use super::raw_mesh::{Binding, Moves};
use super::skeleton::Skeleton;
use crate::HandModelError;

/// Rounding of products of single precision matrices.
const ROUNDING: f64 = 1e-5;
/// Difference of a scale along different directions that is not rounding.
const UNEVEN: f64 = 1e-3;
/// How far nodes may hold a joint from where it was bound, relative to the hand's length, before it is another pose.
const OTHER_POSE: f64 = 0.02;

/// The bindings of the skins of a hand, and its joints.
pub(super) struct Placement {
    bindings: HashMap<usize, Binding>,
    unbound: Binding,
    /// Rest positions of the hand's joints, metres, in the model's axes.
    pub joints: Vec<DVec3>,
}

impl Placement {
    pub(super) fn of(
        skeleton: &Skeleton,
        hand: &Hand,
        parts: &[Part],
        source: &Source,
        warnings: &mut Vec<String>,
    ) -> Result<Placement, HandModelError> {
        let first = parts.first().map_or(0, |part| part.skin.index());
        let at = skeleton.skins.iter().position(|skin| skin.index == first).unwrap_or(0);
        let world = worlds(skeleton, hand);
        let origin = world[at].w_axis.truncate();
        let mut bindings = HashMap::new();
        for (skin, world_from_mesh) in skeleton.skins.iter().zip(&world) {
            let turn = DMat3::from_mat4(*world_from_mesh);
            let determinant = turn.determinant();
            if !determinant.is_finite() || determinant.abs() < f64::MIN_POSITIVE.sqrt() {
                let problem = "scale the hand to nothing; apply the armature's scale and export the hand again";
                return Err(source.invalid("nodes", problem.into()));
            }
            let to = world_from_mesh.w_axis.truncate() - origin;
            let is_identity = (turn - DMat3::IDENTITY).abs_diff_eq(DMat3::ZERO, ROUNDING) && to.length() < ROUNDING;
            let moves = |&joint: &usize| match hand.joints.iter().position(|own| *own == joint) {
                Some(place) => Moves::Hand(place),
                None if hand.arm.contains(&joint) => Moves::Arm(joint),
                None => Moves::Body(joint),
            };
            let joints = skin.joints.iter().map(moves).collect();
            bindings.insert(skin.index, Binding { joints, model_from_mesh: (!is_identity).then_some((turn, to)) });
        }
        if is_uneven(DMat3::from_mat4(world[at])) {
            warnings.push(
                "its nodes scale it unevenly; other programs shear its fingers when they bend, ghand does not: apply the \
                 armature's scale"
                    .into(),
            );
        }
        warnings.extend(other_pose(skeleton, hand, &world));
        let position = |&joint: &usize| {
            let (skin, bound) = skeleton.bind_position(joint)?;
            Some(bindings.get(&skeleton.skins[skin].index)?.point(bound))
        };
        let joints = hand.joints.iter().map(|joint| position(joint).unwrap_or(DVec3::NAN)).collect();
        Ok(Placement { bindings, unbound: Binding { joints: vec![], model_from_mesh: None }, joints })
    }

    /// The binding of a skin of the file.
    pub(super) fn binding(&self, skin: usize) -> &Binding {
        self.bindings.get(&skin).unwrap_or(&self.unbound)
    }
}

/// Rest positions of a hand's joints in the world, metres.
pub(super) fn joints_in_world(skeleton: &Skeleton, hand: &Hand) -> Vec<DVec3> {
    let world = worlds(skeleton, hand);
    let position = |&joint: &usize| {
        let (skin, bound) = skeleton.bind_position(joint)?;
        Some(world[skin].transform_point3(bound))
    };
    hand.joints.iter().map(|joint| position(joint).unwrap_or(DVec3::NAN)).collect()
}

/// Each skin's mesh to the world, as the wrist was bound.
fn worlds(skeleton: &Skeleton, hand: &Hand) -> Vec<DMat4> {
    let wrist = hand.joints.first().copied().unwrap_or(0);
    skeleton.skins.iter().map(|skin| skeleton.world_from_mesh(skin, wrist)).collect()
}

fn is_uneven(turn: DMat3) -> bool {
    let scaled = turn.transpose() * turn;
    let mean = (scaled.x_axis.x + scaled.y_axis.y + scaled.z_axis.z) / 3.0;
    !(scaled * (1.0 / mean)).abs_diff_eq(DMat3::IDENTITY, UNEVEN)
}

/// A warning if the nodes hold the joints elsewhere than they were bound.
fn other_pose(skeleton: &Skeleton, hand: &Hand, world: &[DMat4]) -> Option<String> {
    let bound = |joint: usize| {
        let (skin, bound) = skeleton.bind_position(joint)?;
        Some(world[skin].transform_point3(bound))
    };
    let wrist = bound(*hand.joints.first()?)?;
    let mut reach: f64 = 0.0;
    let mut worst: (f64, usize) = (0.0, 0);
    for &joint in &hand.joints {
        let bound = bound(joint)?;
        let off = bound.distance(skeleton.world_from_node[joint].w_axis.truncate());
        reach = reach.max(bound.distance(wrist));
        if off > worst.0 {
            worst = (off, joint);
        }
    }
    (worst.0 > OTHER_POSE * reach).then(|| {
        format!(
            "its nodes pose it: they hold joint {} {:.0} mm from where it was bound; the rest pose is the bound one",
            skeleton.names[worst.1],
            1000.0 * worst.0
        )
    })
}

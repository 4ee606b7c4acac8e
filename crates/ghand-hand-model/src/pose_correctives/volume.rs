//! Bulges that keep the volume of a bent hand: flesh does not vanish where skin folds.

use ghand_core::pose_response::rotation_features;
use ghand_core::posing::pose_hand;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{HandModel, InvalidHandModel, Pose};
use glam::DVec3;

use super::{Bend, BendKind, BendingChain, FEATURES, Fit, Skin, bump, smooth_step};

/// Flexions at which the volume is that of the rest pose, degrees: of hinges, and of the thumb's base.
const FLEXION: f64 = 90.0;
const THUMB_BASE_FLEXION: f64 = 40.0;
/// Half the length of the crease inside, in half widths.
const CREASE: f64 = 1.2;

/// Where flesh goes that a bend displaces.
struct Room {
    /// How far a bulge reaches, in half widths: along a finger, or in all directions on the palm.
    reach: f64,
    /// The part of a bulge that the bony back of the joint has.
    back: f64,
    /// Largest bulge, metres: more would look swollen.
    largest: f64,
}

const IN_FINGER: Room = Room { reach: 1.8, back: 0.4, largest: 0.0025 };
/// The flesh between a knuckle and the webs moves into the palm, which gives way all around. When the four knuckles bend
/// together they displace less than the sum of each alone: the hand then has 1 % more volume than at rest.
const IN_PALM: Room = Room { reach: 3.0, back: 0.6, largest: 0.006 };
/// Newton steps; the volume is nearly linear in the bulge.
const STEPS: usize = 2;

/// Adds to the model's pose directions so that every joint of the chains keeps the hand's volume when it bends alone, as
/// far as the largest bulges can.
///
/// # Errors
/// [`InvalidHandModel`] as [`pose_hand`].
pub(super) fn keep_volume(
    model: &mut HandModel,
    chains: &[BendingChain],
    shares: &[Vec<f64>],
) -> Result<(), InvalidHandModel> {
    let normals = model.vertex_normals(&model.vertices);
    let rest = volume(model, &model.vertices);
    let weights = model.weights.clone();
    let joints = model.joint_count();
    // How much of a vertex moves with other chains.
    let other = |c: usize, v: usize| -> f64 {
        let others = chains.iter().enumerate().filter(|(i, _)| *i != c).flat_map(|(_, chain)| chain.joints);
        others.map(|k| weights[v * joints + k]).sum()
    };
    for (c, chain) in chains.iter().enumerate() {
        for k in 0..3 {
            let bend = Bend::of(chain, k, Skin::Fleshy);
            let room = if bend.kind.is_in_palm() { IN_PALM } else { IN_FINGER };
            let joint = chain.joints[k];
            let bulge = bulges(model, &normals, &bend, chain.points[k + 1], &room, |v| shares[v][c], |v| other(c, v));
            let response = response(&bend);
            let flexion = if bend.kind == BendKind::ThumbBase { THUMB_BASE_FLEXION } else { FLEXION };
            let mut pose = Pose::rest(model.joint_count());
            pose.rotations[joint] = bend.hinge * flexion.to_radians();
            let mut size = 0.0;
            for _ in 0..STEPS {
                let before = volume(model, &pose_hand(model, &[], &pose)?.vertices);
                add(model, joint, &bulge, &response, room.largest);
                let gained = volume(model, &pose_hand(model, &[], &pose)?.vertices) - before;
                let wanted = if gained > 0.0 { room.largest * (rest - before) / gained } else { 0.0 };
                let next = (size + wanted).clamp(0.0, room.largest);
                add(model, joint, &bulge, &response, next - size - room.largest);
                size = next;
            }
        }
    }
    Ok(())
}

/// Volume that a surface encloses, metres^3; parts that overlap count twice.
fn volume(model: &HandModel, positions: &[DVec3]) -> f64 {
    let p = |i: u32| positions[i as usize];
    model.faces.iter().map(|&[a, b, c]| p(a).dot(p(b).cross(p(c))) / 6.0).sum()
}

/// Movement of each vertex by a bulge of size 1 around a joint. `share` is how much of a vertex belongs to the joint's
/// chain, `other` how much of it moves with other chains.
fn bulges(
    model: &HandModel,
    normals: &[DVec3],
    bend: &Bend,
    joint: DVec3,
    room: &Room,
    share: impl Fn(usize) -> f64,
    other: impl Fn(usize) -> f64,
) -> Vec<DVec3> {
    let bulge = |v: usize| {
        let offset = (model.vertices[v] - joint) / bend.radius;
        let inner = offset.dot(bend.inner);
        let along = offset.dot(bend.along);
        let back = smooth_step(-inner);
        // The pads of both bones meet in the crease; flesh goes beside it.
        let crease = smooth_step(1.5 * inner) * bump(along / CREASE);
        let near = if bend.kind.is_in_palm() {
            bump(offset.length() / room.reach) * (1.0 - other(v))
        } else {
            // Skin far across the finger belongs to the palm or to a neighbour.
            let across = offset.reject_from(bend.along).length();
            share(v) * bump(along / room.reach) * (1.0 - smooth_step(across - 1.5))
        };
        normals[v] * near * (1.0 - crease) * (1.0 - (1.0 - room.back) * back)
    };
    (0..model.vertices.len()).map(bulge).collect()
}

/// The features by which a bulge follows the joint's rotation: the fit of 1 - cos(flexion).
fn response(bend: &Bend) -> [f64; FEATURES] {
    let fit = Fit::new(bend.samples());
    let mut response = [0.0; FEATURES];
    for (sample, solution) in fit.samples.iter().zip(&fit.solutions) {
        let squeeze = 1.0 - sample.flexion.max(0.0).cos();
        response.iter_mut().zip(solution).for_each(|(r, s)| *r += squeeze * s);
    }
    // Ridge regression shrinks; at a right angle the bulge is to have its size.
    let at = rotation_features(&rotation_from_axis_angle(bend.hinge * FLEXION.to_radians()));
    let value: f64 = response.iter().zip(at).map(|(r, f)| r * f).sum();
    response.map(|r| r / value.max(0.5))
}

fn add(model: &mut HandModel, joint: usize, bulge: &[DVec3], response: &[f64; FEATURES], size: f64) {
    let rows = model.pose_directions.chunks_exact_mut(bulge.len()).skip((joint - 1) * FEATURES);
    for (row, r) in rows.zip(response) {
        row.iter_mut().zip(bulge).for_each(|(d, b)| *d += *b * (size * r));
    }
}

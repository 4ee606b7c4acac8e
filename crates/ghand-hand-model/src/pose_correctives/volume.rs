//! Bulges that keep the volume of a bent hand: flesh does not vanish where skin folds.

use ghand_core::pose_response::rotation_features;
use ghand_core::posing::pose_hand;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{HandModel, InvalidHandModel, Pose};
use glam::DVec3;

use super::{Bend, BendingChain, FEATURES, Fit, bump, smooth_step};

/// Flexions at which the volume is that of the rest pose, degrees: of hinges, and of the thumb's base.
const FLEXION: f64 = 90.0;
const THUMB_BASE_FLEXION: f64 = 40.0;
/// How far along the finger a bulge reaches, in half widths.
const REACH: f64 = 1.8;
/// Half the length of the crease inside, in half widths.
const CREASE: f64 = 1.2;
/// The part of a bulge that the bony back of a joint has.
const BACK: f64 = 0.4;
/// Largest bulge, metres: more would look swollen.
const LARGEST: f64 = 0.0025;
/// Newton steps; the volume is nearly linear in the bulge.
const STEPS: usize = 2;

/// Adds to the model's pose directions so that every joint of the chains keeps the hand's volume when it bends alone, as
/// far as bulges of [`LARGEST`] can.
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
    for (c, chain) in chains.iter().enumerate() {
        for k in 0..3 {
            let bend = Bend::of(chain, k);
            let bulge = bulges(model, &normals, chain, &bend, k, |v| shares[v][c]);
            let response = response(&bend, chain.is_thumb);
            let flexion = if bend.root && chain.is_thumb { THUMB_BASE_FLEXION } else { FLEXION };
            let mut pose = Pose::rest(model.joint_count());
            pose.rotations[chain.joints[k]] = bend.hinge * flexion.to_radians();
            let mut size = 0.0;
            for _ in 0..STEPS {
                let before = volume(model, &pose_hand(model, &[], &pose)?.vertices);
                add(model, chain.joints[k], &bulge, &response, LARGEST);
                let gained = volume(model, &pose_hand(model, &[], &pose)?.vertices) - before;
                let wanted = if gained > 0.0 { LARGEST * (rest - before) / gained } else { 0.0 };
                let next = (size + wanted).clamp(0.0, LARGEST);
                add(model, chain.joints[k], &bulge, &response, next - size - LARGEST);
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

/// Movement of each vertex by a bulge of size 1 around joint `k` of a chain.
fn bulges(
    model: &HandModel,
    normals: &[DVec3],
    chain: &BendingChain,
    bend: &Bend,
    k: usize,
    share: impl Fn(usize) -> f64,
) -> Vec<DVec3> {
    let bulge = |v: usize| {
        let offset = (model.vertices[v] - chain.points[k + 1]) / bend.radius;
        let across = offset.reject_from(bend.along).length();
        let (inner, along) = (offset.dot(bend.inner), offset.dot(bend.along));
        let back = smooth_step(-inner);
        // The pads of both bones meet in the crease; flesh goes beside it.
        let crease = smooth_step(1.5 * inner) * bump(along / CREASE);
        // Skin far across the finger belongs to the palm or to a neighbour.
        let near = bump(along / REACH) * (1.0 - smooth_step(across - 1.5));
        normals[v] * share(v) * near * (1.0 - crease) * (1.0 - (1.0 - BACK) * back)
    };
    (0..model.vertices.len()).map(bulge).collect()
}

/// The features by which a bulge follows the joint's rotation: the fit of 1 - cos(flexion).
fn response(bend: &Bend, is_thumb: bool) -> [f64; FEATURES] {
    let fit = Fit::new(bend.samples(is_thumb));
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

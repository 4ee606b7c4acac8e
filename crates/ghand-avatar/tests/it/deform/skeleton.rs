//! `skeleton.wgsl` and `skeleton_backward.wgsl` against `ghand_core::skeleton`.

use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skeleton::{pose_skeleton, pose_skeleton_vjp, rotations_vjp};
use ghand_core::skinning::ResidualWeights;
use glam::DVec3;

use crate::deform::hand::{PARENTS, Run, assert_near, assert_same, norm};

#[test]
fn the_chain_equals_that_of_its_twin() {
    Run::each(|run| {
        let twin = pose_skeleton(&PARENTS, &run.joints, &run.pose.rotations);
        assert_same(run.kind, "local rotations", &run.chain.local[..], &twin.local);
        assert_same(run.kind, "world_from_joint", &run.chain.world[..], &twin.world);
        assert_same(run.kind, "posed_from_rest", &run.chain.posed_from_rest[..], &twin.posed_from_rest);
    });
}

#[test]
fn gradients_of_joints_and_pose_equal_those_of_their_twins() {
    Run::each(|run| {
        let d_bones = run.d_bones(&run.weights);
        let d = pose_skeleton_vjp(&PARENTS, &run.joints, &run.chain, &d_bones);
        let residual = residual_gradients(run);
        let mut joints = d.joints;
        let mut local = d.local;
        local.iter_mut().zip(&residual.local).for_each(|(sum, d)| *sum += *d);
        if run.kind.skeleton == ResidualSkeleton::Anchored {
            joints.iter_mut().zip(&residual.joints).for_each(|(sum, d)| *sum += *d);
        }
        let scale = norm(&d_bones[..]);
        assert_near(run.kind, "d joints", &run.d_joints[..], &joints, scale);
        assert_near(run.kind, "d local", &run.d_local[..], &local, scale);
        let mut d_pose: Vec<f64> =
            rotations_vjp(&run.pose.rotations, &local).iter().flat_map(|v| v.to_array()).collect();
        d_pose.extend(run.d_posed.iter().sum::<DVec3>().to_array());
        assert_near(run.kind, "d pose", &run.d_pose[..], &d_pose, scale);
    });
}

/// Gradients of the residual chain, from the device's moments.
fn residual_gradients(run: &Run) -> ghand_core::skeleton::ChainGradients {
    let d_bones = crate::deform::residual_skeleton::d_residual_bones(run);
    let chain = run.exact_residual_chain();
    pose_skeleton_vjp(&PARENTS, &run.residual_joints, &chain, &d_bones)
}

/// The two kinds of residual weights are different maps.
#[test]
fn kinds_of_residual_weights_differ() {
    let gpu = crate::deform::hand::gpu();
    let kinds = crate::deform::hand::kinds();
    let of = |weights| {
        let kind = kinds.iter().find(|k| k.weights == weights && k.angle > 1.0).unwrap();
        Run::new(&gpu, *kind).table
    };
    assert!(of(ResidualWeights::Paper) != of(ResidualWeights::ZeroSum));
}

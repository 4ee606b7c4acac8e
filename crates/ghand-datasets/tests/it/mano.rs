//! A hand with MANO's joints, pose space and file, poses of it, and the comparison of a capture with them.

use std::path::{Path, PathBuf};

use ghand_core::posing::pose_hand;
use ghand_core::{Camera, HandModel, Pose, PoseSpace, Side};
use ghand_datasets::Written;
use ghand_test_support::mano_files::hands::number;
use ghand_test_support::mano_files::model::write_mano;
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec3;

pub struct Mano {
    pub model: HandModel,
    pub path: PathBuf,
}

impl Mano {
    /// Writes the model's file into a folder.
    pub fn new(folder: &Path, side: Side) -> Mano {
        let mut model = ProceduralHand { detail: 1, left: side == Side::Left, ..Default::default() }.build().unwrap();
        // The built-in wrist is at the origin; MANO's is not.
        let shift = DVec3::new(0.0957, 0.0064, 0.0062);
        model.vertices.iter_mut().chain(&mut model.joints).for_each(|point| *point += shift);
        let vector = |k: usize| 0.1 * DVec3::new(number(3 * k), number(3 * k + 1), number(3 * k + 2));
        let mean = (0..15).map(vector).collect();
        let components = (15..15 + 45 * 15).map(vector).collect();
        model.pose_space = Some(PoseSpace { mean, components });
        let name = if side == Side::Right { "MANO_RIGHT.npz" } else { "MANO_LEFT.npz" };
        let path = folder.join(name);
        write_mano(&path, &model);
        Mano { model, path }
    }

    /// Vertices and joints of MANO's own equations: `fingers` from the flat hand, nothing added.
    pub fn posed(&self, root: DVec3, fingers: &[DVec3], shape: &[f64]) -> (Vec<DVec3>, Vec<DVec3>) {
        let rotations = [&[root], fingers].concat();
        let pose = Pose { rotations, translation: DVec3::ZERO };
        let posed = pose_hand(&self.model, shape, &pose).unwrap();
        (posed.vertices, posed.joints)
    }

    /// Fingers from the flat hand of numbers from the mean pose.
    pub fn with_mean(&self, fingers: &[DVec3]) -> Vec<DVec3> {
        let space = self.model.pose_space.as_ref().unwrap();
        space.mean.iter().zip(fingers).map(|(mean, own)| *mean + *own).collect()
    }

    /// Rotations of components.
    pub fn of_components(&self, components: &[f64]) -> Vec<DVec3> {
        let all = &self.model.pose_space.as_ref().unwrap().components;
        (0..15).map(|joint| components.iter().enumerate().map(|(k, part)| *part * all[15 * k + joint]).sum()).collect()
    }
}

/// Numbers that differ by frame.
pub fn numbers(count: usize, seed: usize, scale: f64) -> Vec<f64> {
    (0..count).map(|k| scale * number(1000 * seed + k)).collect()
}

pub fn vectors(count: usize, seed: usize, scale: f64) -> Vec<DVec3> {
    numbers(3 * count, seed, scale).chunks(3).map(DVec3::from_slice).collect()
}

/// Checks that the posed hand of each frame has the expected vertices, as a camera of the capture and the camera of the scene
/// see them.
pub fn check_vertices(written: &Written, camera: usize, scene: &Camera, expected: impl Fn(&str) -> Vec<DVec3>) {
    let capture = &written.capture;
    assert!(written.fit.is_none() && !capture.frames.is_empty());
    let mut worst = 0.0_f64;
    for frame in &capture.frames {
        let posed = pose_hand(&capture.hand_model, &frame.shape, &frame.pose).unwrap();
        let expected = expected(&frame.id);
        assert_eq!(posed.vertices.len(), expected.len());
        for (own, expected) in posed.vertices.iter().zip(expected) {
            let own = capture.cameras[camera].camera_from_world(*own);
            worst = worst.max(own.distance(scene.camera_from_world(expected)));
        }
    }
    // Files have single precision.
    assert!(worst < 1e-5, "vertices are {worst} m off");
}

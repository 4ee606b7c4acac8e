//! How far from the capture's hand each camera saw the landmarks, frame by frame.

use ghand_capture::cameras::list::LensCamera;
use ghand_core::statistics::median;
use ghand_core::{HandModel, Pose};
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;
use glam::DVec3;

use crate::ImportError;
use crate::moments::moments;
use crate::rig::LANDMARKS;
use crate::track::Track;

/// The median distance of the landmarks that a camera saw from those of `person`, the hand in the person's shape, in the
/// poses of the first camera's frames: `[camera][frame]`, pixels without distortion of the lens. `None` where the camera
/// saw no hand, or the frame has no pose. Landmarks of fingertips lie `tip_inset` metres before the ends of the fingers.
///
/// # Errors
/// If the names of the model's joints do not identify their parts.
pub fn residuals(
    tracks: &[Track],
    lenses: &[LensCamera],
    offsets: &[f64],
    person: &HandModel,
    tip_inset: f64,
    poses: &[Option<Pose>],
) -> Result<Vec<Vec<Option<f64>>>, ImportError> {
    let ik = HandIk::new(&RestSkeleton::of(person)?);
    let Some(first) = tracks.first() else { return Ok(vec![]) };
    let mut all = vec![vec![None; first.times.len()]; lenses.len()];
    for (frame, (moment, pose)) in moments(tracks, lenses, offsets, &first.times).iter().zip(poses).enumerate() {
        let Some(pose) = pose else { continue };
        let hand = with_inset_tips(ik.landmarks(pose), tip_inset);
        for ((view, lens), of_camera) in moment.iter().zip(lenses).zip(&mut all) {
            of_camera[frame] = view.as_ref().map(|view| {
                let off = |(seen, at): (&glam::DVec2, &DVec3)| lens.camera.project(*at).0.distance(*seen);
                median(view.pixels.iter().zip(&hand).map(off))
            });
        }
    }
    Ok(all)
}

fn with_inset_tips(mut points: [DVec3; LANDMARKS], tip_inset: f64) -> [DVec3; LANDMARKS] {
    for tip in (4..LANDMARKS).step_by(4) {
        let bone = points[tip] - points[tip - 1];
        points[tip] -= bone.normalize_or_zero() * tip_inset.min(0.5 * bone.length());
    }
    points
}

#[cfg(test)]
mod tests {
    use ghand_core::{Camera, Side};
    use ghand_hand_model::builtin::builtin_hand;
    use glam::DVec2;

    use super::*;
    use crate::track::Sighting;

    #[test]
    fn each_camera_has_its_own_distances_and_none_without_pose_or_hand() {
        let model = builtin_hand(Side::Right).unwrap();
        let pose = Pose::rest(model.joint_count());
        let inset = 0.006;
        let ik = HandIk::new(&RestSkeleton::of(&model).unwrap());
        let points = with_inset_tips(ik.landmarks(&pose), inset);
        let camera = |eye| Camera::look_at(eye, points[9], DVec3::NEG_Y, 0.6, 640, 480);
        let cameras = [camera(DVec3::new(0.0, 0.0, -0.6)), camera(DVec3::new(0.5, 0.1, -0.3))];
        // The second camera's clock is two seconds late, and it sees all landmarks beside the hand.
        let offsets = [0.0, 2.0];
        let beside = [DVec2::ZERO, DVec2::new(3.0, -4.0)];
        let track = |k: usize| Track {
            times: (0..6).map(|frame| f64::from(frame) / 30.0 + offsets[k]).collect(),
            sightings: (0..6)
                .map(|frame| {
                    let pixels = points.map(|at| cameras[k].project(at).0 + beside[k]);
                    let sighting = Sighting { pixels, world: points, presence: 1.0, sharpness: 1.0, other_hand: None };
                    (k == 0 || frame > 2).then_some(sighting)
                })
                .collect(),
        };
        let lenses = cameras.clone().map(|camera| LensCamera { camera, distortion: None });
        let mut poses = vec![Some(pose); 6];
        poses[5] = None;
        let found = residuals(&[track(0), track(1)], &lenses, &offsets, &model, inset, &poses).unwrap();
        let near = |value: Option<f64>, wanted: f64| value.is_some_and(|value| (value - wanted).abs() < 1e-6);
        assert!(found[0][..5].iter().all(|value| near(*value, 0.0)), "{found:?}");
        assert!(found[1][3..5].iter().all(|value| near(*value, 5.0)), "{found:?}");
        assert!(found[1][..2].iter().all(Option::is_none) && found.iter().all(|of| of[5].is_none()), "{found:?}");
    }
}

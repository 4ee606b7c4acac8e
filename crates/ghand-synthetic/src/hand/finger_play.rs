//! Rotations of the fingers' joints that are not bends: twist about the bone and turns sideways, in all three joints of
//! a finger. With them no joint is an exact hinge.

use ghand_core::{HandModel, Pose};
use ghand_hand_model::joints::axes::JointAxes;
use ghand_hand_model::joints::limits::{AngleRange, JointLimits};
use ghand_hand_model::joints::names::JointRole;
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::anatomy::Anatomy;
use crate::normal::normal;

/// An anatomical range of zero is a hinge's. It still gives way by so much to either side, radians: our choice.
const HINGE_PLAY: f64 = 10f64.to_radians();
/// Width of the smoothing over frames: a gesture takes about three frames to the next.
const SMOOTHING_FRAMES: f64 = 1.5;

/// Standard deviations, radians.
pub(crate) struct FingerPlay {
    pub abduction: f64,
    pub twist: f64,
}

/// How the play of one frame depends on that of others.
#[derive(Clone, Copy)]
pub(crate) enum Frames {
    /// Neighbours have similar play.
    Motion,
    /// Each frame has its own.
    Single,
}

impl FingerPlay {
    /// Adds the play to poses of a model whose joint names identify the fingers' joints. No angle leaves its anatomical
    /// range, but one that is outside already stays there.
    pub(crate) fn add(&self, model: &HandModel, anatomy: &Anatomy, poses: &mut [Pose], frames: Frames, seed: u64) {
        let Some(axes) = JointAxes::of_joints(model) else { return };
        let roles = JointRole::of_joints(&model.joint_names);
        let stream = match frames {
            Frames::Motion => 0x71A7,
            Frames::Single => 0x71A8,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ stream);
        for joint in anatomy.fingers.iter().flat_map(|finger| finger.joints) {
            let series = [(); 2].map(|()| match frames {
                Frames::Motion => smooth_series(poses.len(), &mut rng),
                Frames::Single => (0..poses.len()).map(|_| normal(&mut rng)).collect(),
            });
            let (Some(role), axes) = (roles[joint], &axes[joint]) else { continue };
            let limits = JointLimits::of(role);
            for (frame, pose) in poses.iter_mut().enumerate() {
                let angles = axes.angles(pose.rotations[joint]);
                let abduction = played(angles.y, self.abduction * series[0][frame], limits.abduction);
                let twist = played(angles.z, self.twist * series[1][frame], limits.twist);
                pose.rotations[joint] = axes.rotation(DVec3::new(angles.x, abduction, twist));
            }
        }
    }
}

/// The angle moved by `play`, within the range or no farther outside than it is.
fn played(angle: f64, play: f64, range: AngleRange) -> f64 {
    let is_hinge = range.low == range.high;
    let spare = if is_hinge { HINGE_PLAY } else { 0.0 };
    (angle + play).clamp((range.low - spare).min(angle), (range.high + spare).max(angle))
}

/// Normal numbers that vary smoothly: white noise under a Gaussian window, scaled to a standard deviation of 1.
fn smooth_series(count: usize, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let reach = (4.0 * SMOOTHING_FRAMES) as usize;
    let white: Vec<f64> = (0..count + 2 * reach).map(|_| normal(rng)).collect();
    let weights: Vec<f64> =
        (0..=2 * reach).map(|k| (-0.5 * ((k as f64 - reach as f64) / SMOOTHING_FRAMES).powi(2)).exp()).collect();
    let norm = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
    white.windows(weights.len()).map(|near| near.iter().zip(&weights).map(|(n, w)| n * w).sum::<f64>() / norm).collect()
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;
    use crate::hand::trajectory::natural_motion;

    /// Abduction and twist of the fingers' joints before and after, degrees: `[joint][frame]`.
    fn changes(frames: Frames, degrees: f64) -> Vec<Vec<[f64; 4]>> {
        let model = builtin_hand(Side::Right).unwrap();
        let anatomy = Anatomy::of(&model);
        let before = natural_motion(&model, 400, 3);
        let mut after = before.clone();
        let play = FingerPlay { abduction: degrees.to_radians(), twist: degrees.to_radians() };
        play.add(&model, &anatomy, &mut after, frames, 3);
        let axes = JointAxes::of_joints(&model).unwrap();
        let angles = |pose: &Pose, k: usize| axes[k].angles(pose.rotations[k]).to_array().map(f64::to_degrees);
        (anatomy.fingers.iter().flat_map(|finger| finger.joints))
            .map(|k| {
                let pairs = before.iter().zip(&after).map(|(b, a)| (angles(b, k), angles(a, k)));
                pairs
                    .map(|(b, a)| {
                        assert!((a[0] - b[0]).abs() < 1e-9, "the bend stays");
                        [b[1], b[2], a[1], a[2]]
                    })
                    .collect()
            })
            .collect()
    }

    fn deviation(values: impl Iterator<Item = f64>) -> f64 {
        let (sum, count) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
        (sum / count).sqrt()
    }

    #[test]
    fn play_has_the_given_size_is_smooth_in_a_motion_and_stays_in_range() {
        for (frames, roughness) in [(Frames::Motion, 0.3..0.6), (Frames::Single, 1.2..1.6)] {
            // Small play is hardly clamped. 400 frames, of which in a motion every fifth or so is independent.
            let small = changes(frames, 0.5);
            let play = |c: &[f64; 4]| [c[2] - c[0], c[3] - c[1]];
            for angle in 0..2 {
                // Twist of the thumb's base may be outside its range before; the first finger is the index.
                let size = deviation(small[..12].iter().flatten().map(|c| play(c)[angle]));
                assert!((0.4..0.55).contains(&size), "{size} degrees");
                let steps =
                    small[..12].iter().flat_map(|s| s.windows(2).map(|w| play(&w[1])[angle] - play(&w[0])[angle]));
                let steps = deviation(steps) / size;
                assert!(roughness.contains(&steps), "{steps} times its size from frame to frame");
            }
            // The third joint of the index finger is a hinge.
            let large = changes(frames, 20.0);
            assert!(
                large[2].iter().all(|c| c[2].abs() < 10.0 + c[0].abs() + 1e-9 && c[3].abs() < 10.0 + c[1].abs() + 1e-9)
            );
            assert!(large[2].iter().any(|c| c[3].abs() > 9.99));
            assert!(large[0].iter().all(|c| c[2].abs() <= 20.0 + 1e-9 || c[2].abs() <= c[0].abs() + 1e-9));
        }
    }
}

//! How much light reaches the skin past the hand's other parts: balls along the bones approximate the flesh.

use ghand_core::skeleton::pose_skeleton;
use ghand_core::{HandModel, Pose};
use glam::DVec3;
use rayon::prelude::*;

use crate::hand::anatomy::Anatomy;

/// Balls along each finger bone.
const BALLS_PER_BONE: usize = 4;

/// A ball that moves with a joint.
struct Ball {
    joint: usize,
    rest: DVec3,
    radius: f64,
}

/// The balls of a hand.
pub(crate) struct LightVisibility {
    balls: Vec<Ball>,
    /// How much of each vertex belongs to the palm, whose balls move with the wrist.
    palm_parts: Vec<f64>,
}

impl LightVisibility {
    pub(crate) fn new(anatomy: &Anatomy, model: &HandModel) -> LightVisibility {
        let mut balls = Vec::new();
        for finger in &anatomy.fingers {
            for k in 0..3 {
                let tip = if k == 2 { 0.85 } else { 1.0 };
                for i in 0..BALLS_PER_BONE {
                    let t = (i as f64 + 0.5) / BALLS_PER_BONE as f64 * tip;
                    let rest = finger.points[k].lerp(finger.points[k + 1], t);
                    balls.push(Ball { joint: finger.joints[k], rest, radius: finger.radius * 0.95 });
                }
            }
            if !finger.is_thumb {
                let wrist = model.joints[0].lerp(finger.points[0], 0.2);
                for i in 0..3 {
                    let rest = wrist.lerp(finger.points[0], f64::from(i) / 3.0 + 0.1);
                    balls.push(Ball { joint: 0, rest, radius: finger.radius * 1.3 });
                }
            }
        }
        let palm_part = |v: usize| 1.0 - anatomy.finger_weights(model.vertex_weights(v)).iter().sum::<f64>().min(1.0);
        LightVisibility { balls, palm_parts: (0..model.vertices.len()).map(palm_part).collect() }
    }

    /// The fraction of the light that reaches each vertex, `[0, 1]`.
    pub(crate) fn of(&self, model: &HandModel, pose: &Pose, positions: &[DVec3], normals: &[DVec3]) -> Vec<f64> {
        let motions = pose_skeleton(&model.parents, &model.joints, &pose.rotations).posed_from_rest;
        let centers: Vec<DVec3> =
            self.balls.iter().map(|b| motions[b.joint].apply(b.rest) + pose.translation).collect();
        (positions.par_iter().zip(normals).enumerate())
            .map(|(v, (p, n))| {
                let weights = model.vertex_weights(v);
                let mut light_visibility = 1.0;
                for (ball, center) in self.balls.iter().zip(&centers) {
                    let towards = *center - *p;
                    let squared = towards.length_squared().max(ball.radius * ball.radius);
                    // A ball covers cos x (r/d)^2 of the ambient light; flesh does not shade itself.
                    let cosine = n.dot(towards) / squared.sqrt();
                    if cosine > 0.0 {
                        let own = if ball.joint == 0 { self.palm_parts[v] } else { weights[ball.joint] };
                        light_visibility *=
                            1.0 - (1.0 - own) * cosine * (ball.radius * ball.radius / squared).min(1.0) * 0.8;
                    }
                }
                light_visibility
            })
            .collect()
    }
}

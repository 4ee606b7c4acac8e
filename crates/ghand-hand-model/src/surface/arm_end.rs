//! Where a hand model ends and the arm goes on.
//!
//! A real arm does not end there: what an image shows beyond is no error of the model, and the model's end is no outline.

use ghand_core::{Camera, HandModel};
use glam::{DMat3, DVec2, DVec3};

/// The last part of the model before its end, relative to the distance from the wrist to the farthest fingertip: it holds
/// the cap of the built-in hand (8.7 of 190 mm) and the jagged border of an open mesh.
const BAND: f64 = 0.06;
/// The part before the end whose vertices carry it along, relative to the same distance, if only the root moves them.
const STUB: f64 = 0.25;
/// Fewer vertices do not determine how the end lies.
const LEAST_STUB: usize = 4;
/// Where the sine of the angle between the arm and the line of sight is less, arm and hand lie behind each other, and no
/// line in the image parts them.
const LEAST_SINE: f64 = 0.35;
/// In an image, an arm is up to this much wider than the model's end, and wider by so much per pixel along it: it grows
/// towards the elbow, and bends at the wrist by some 30 degrees either way.
const ARM_WIDTH: f64 = 1.3;
const ARM_SPREAD: f64 = 0.6;

/// The end of a hand model at the wrist.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmEnd {
    /// For each vertex whether it is in the band before the end.
    in_band: Vec<bool>,
    /// Vertices near the end, each with its parts of two points: where the band starts, and where the model ends.
    anchors: Vec<(u32, [f64; 2])>,
    /// Half the width of the model at the end, relative to the length of the band.
    half_width: f64,
}

/// The end of a posed hand model in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmEndInImage {
    /// The middle of the line where the band starts, pixels.
    start: DVec2,
    /// Unit direction towards the arm.
    towards_arm: DVec2,
    /// Length of the band and half its width, pixels.
    band: f64,
    half_width: f64,
}

impl ArmEnd {
    /// The end opposite to the fingers; `None` if the model has none, as without vertices that move with the root alone.
    pub fn of(model: &HandModel) -> Option<ArmEnd> {
        let (wrist, others) = model.joints.split_first()?;
        let middle = others.iter().sum::<DVec3>() / others.len() as f64;
        let axis = (*wrist - middle).try_normalize()?;
        let along: Vec<f64> = model.vertices.iter().map(|v| (*v - *wrist).dot(axis)).collect();
        let (reach, end) = along.iter().fold((0.0_f64, f64::MIN), |(reach, end), t| (reach.max(-t), end.max(*t)));
        let start = end - BAND * reach;
        let of_root = |v: usize| model.vertex_weights(v).first().is_some_and(|weight| *weight > 0.9);
        let stub: Vec<usize> = (0..along.len()).filter(|&v| along[v] > end - STUB * reach && of_root(v)).collect();
        if stub.len() < LEAST_STUB || reach <= 0.0 {
            return None;
        }
        let mean = stub.iter().map(|&v| model.vertices[v]).sum::<DVec3>() / stub.len() as f64;
        let mut spread = DMat3::ZERO;
        for &v in &stub {
            let d = model.vertices[v] - mean;
            spread += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        }
        if spread.determinant() < 1e-12 * reach.powi(6) {
            return None;
        }
        let inverse = spread.inverse();
        // The sum of a rigid motion's vertices in these parts moves as the point itself does.
        let on_axis = |t: f64| mean + axis * (t - (mean - *wrist).dot(axis));
        let points = [start, end].map(|t| inverse * (on_axis(t) - mean));
        let part = |v: usize, k: usize| 1.0 / stub.len() as f64 + points[k].dot(model.vertices[v] - mean);
        let anchors = stub.iter().map(|&v| (v as u32, [part(v, 0), part(v, 1)])).collect();
        let near_end = stub.iter().filter(|&&v| along[v] > start - BAND * reach);
        let widths = near_end.map(|&v| (model.vertices[v] - mean).reject_from(axis).length());
        Some(ArmEnd {
            in_band: (0..along.len()).map(|v| along[v] > start && of_root(v)).collect(),
            anchors,
            half_width: widths.fold(0.0, f64::max) / (BAND * reach),
        })
    }

    /// Whether a vertex of the model is in the band before its end.
    pub fn contains(&self, vertex: u32) -> bool {
        self.in_band.get(vertex as usize).copied().unwrap_or(false)
    }

    /// The end in an image of the model at `positions` (world, metres, one per vertex). `None` where no line parts arm and
    /// hand: the arm points towards the camera or away from it.
    pub fn seen(&self, positions: &[DVec3], camera: &Camera) -> Option<ArmEndInImage> {
        let at = |k: usize| -> Option<DVec3> {
            self.anchors.iter().map(|(v, parts)| Some(*positions.get(*v as usize)? * parts[k])).sum()
        };
        let (start, end) = (at(0)?, at(1)?);
        let sight = (start - camera.center()).try_normalize()?;
        let axis = (end - start).try_normalize()?;
        let [(p, p_depth), (q, q_depth)] = [start, end].map(|point| camera.project(point));
        if p_depth <= 0.0 || q_depth <= 0.0 || sight.cross(axis).length() < LEAST_SINE {
            return None;
        }
        let half_width = self.half_width * start.distance(end) * camera.focal.max_element() / p_depth;
        Some(ArmEndInImage { start: p, towards_arm: (q - p).try_normalize()?, band: p.distance(q), half_width })
    }
}

impl ArmEndInImage {
    /// How far a pixel is beyond the start of the band, in lengths of the band: less than 0 on the side of the hand, more
    /// than 1 where the arm alone is.
    pub fn beyond(&self, pixel: DVec2) -> f64 {
        (pixel - self.start).dot(self.towards_arm) / self.band
    }

    /// The pixel on the arm's axis that is so many lengths of the band beyond its start.
    pub fn at(&self, bands: f64) -> DVec2 {
        self.start + bands * self.band * self.towards_arm
    }

    /// Whether an arm that goes on from the model may be at a pixel.
    pub fn may_be_arm(&self, pixel: DVec2) -> bool {
        let offset = pixel - self.start;
        let along = offset.dot(self.towards_arm);
        along > 0.0 && offset.perp_dot(self.towards_arm).abs() < ARM_WIDTH * self.half_width + ARM_SPREAD * along
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::posing::pose_hand;
    use ghand_core::rotation::rotation_from_axis_angle;
    use ghand_core::{Pose, Side};

    use super::*;
    use crate::builtin::builtin_hand;
    use ghand_test_support::procedural_hand::ProceduralHand;

    #[test]
    fn the_end_is_opposite_to_the_fingers_and_holds_the_cap() {
        for model in [
            builtin_hand(Side::Right).unwrap(),
            builtin_hand(Side::Left).unwrap(),
            ProceduralHand::default().build().unwrap(),
        ] {
            let end = ArmEnd::of(&model).unwrap();
            // Fingers point along -Y: the end is the last 6 % of the hand there.
            let highest = model.vertices.iter().map(|v| v.y).fold(f64::MIN, f64::max);
            for (v, position) in (0..).zip(&model.vertices) {
                let below = highest - position.y;
                assert!(below > 0.005 || end.contains(v), "{}: {below} m below the end", model.name);
                assert!(below < 0.018 || !end.contains(v), "{}: {below} m below the end", model.name);
            }
        }
    }

    #[test]
    fn the_end_follows_the_root_and_parts_hand_and_arm_in_the_image() {
        let model = builtin_hand(Side::Right).unwrap();
        let end = ArmEnd::of(&model).unwrap();
        let mut pose = Pose::rest(model.joint_count());
        pose.rotations[0] = DVec3::new(0.2, -0.9, 0.4);
        pose.rotations[7] = DVec3::new(0.0, 0.0, 1.2);
        pose.translation = DVec3::new(0.1, 0.05, -0.2);
        let posed = pose_hand(&model, &[], &pose).unwrap();
        let turn = rotation_from_axis_angle(pose.rotations[0]);
        let placed = |rest: DVec3| turn * (rest - model.joints[0]) + model.joints[0] + pose.translation;
        let eye = placed(DVec3::new(0.6, 0.0, 0.0));
        let camera = Camera::look_at(eye, placed(DVec3::ZERO), turn * DVec3::NEG_Y, 0.5, 400, 400);
        let seen = end.seen(&posed.vertices, &camera).unwrap();
        let at = |y: f64| camera.project(placed(DVec3::new(0.036, y, 0.009))).0;
        // The mesh ends at 95 mm; the band has 6 % of 190 mm.
        assert!((seen.beyond(at(0.084))).abs() < 0.1 && (seen.beyond(at(0.0952)) - 1.0).abs() < 0.1);
        assert!(seen.beyond(at(0.0)) < -5.0 && seen.may_be_arm(at(0.15)) && !seen.may_be_arm(at(0.08)));
        let beside = camera.project(placed(DVec3::new(0.036, 0.10, 0.08))).0;
        assert!(seen.beyond(beside) > 1.0 && !seen.may_be_arm(beside));
        // From the elbow, hand and arm lie behind each other.
        let behind =
            Camera::look_at(placed(DVec3::new(0.03, 0.6, 0.0)), placed(DVec3::ZERO), turn * DVec3::X, 0.5, 400, 400);
        assert_eq!(end.seen(&posed.vertices, &behind), None);
    }
}

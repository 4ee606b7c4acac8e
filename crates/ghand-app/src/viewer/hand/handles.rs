//! Handles on a hand's joints: dragging one bends its finger, turns the hand or moves it.

use egui::{Color32, Painter, Pos2, Stroke, Vec2};
use ghand_core::posing::shape_hand;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::skeleton::pose_skeleton;
use ghand_core::{HandModel, Pose};
use ghand_hand_model::joints::names::{Finger, JointRole};
use ghand_motion::RestSkeleton;
use ghand_motion::ik::{HandIk, LANDMARK_COUNT};
use glam::{DMat3, DQuat, DVec3};

use crate::viewer::rendering::screen::Screen;

/// Landmark at the wrist.
const WRIST: usize = 0;
/// Landmark at the thumb's base, which has no handle: it hardly moves.
const THUMB_BASE: usize = 1;
/// A press this near to a handle takes it, points.
const REACH: f32 = 11.0;
/// The handles appear when the pointer is this near to a bone, metres: half the width of a palm.
const NEAR_HAND: f64 = 0.03;
/// Radii of a handle and of the one under the pointer, points.
const RADIUS: f32 = 4.0;
const HOVERED_RADIUS: f32 = 6.5;
/// Colours on any skin: an orange rarely found there, with a dark edge.
const HANDLE_COLOR: Color32 = Color32::from_rgb(255, 176, 46);
const EDGE_COLOR: Color32 = Color32::from_black_alpha(170);

/// The handles of a hand.
#[derive(Debug, Clone)]
pub struct Handles {
    ik: HandIk,
    /// The shape that they are for.
    shape: Vec<f64>,
}

/// A handle that is dragged.
#[derive(Debug, Clone, PartialEq)]
pub struct HandleDrag {
    /// Its landmark.
    pub landmark: usize,
    /// The pose at the beginning.
    held: Pose,
    /// Where it should go, metres, world.
    target: DVec3,
}

/// What dragging a handle does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Effect {
    MoveHand,
    TurnHand,
    BendFinger,
}

impl Effect {
    fn of(landmark: usize) -> Option<Effect> {
        match landmark {
            WRIST => Some(Effect::MoveHand),
            THUMB_BASE => None,
            // Knuckles of the fingers.
            5 | 9 | 13 | 17 => Some(Effect::TurnHand),
            _ => Some(Effect::BendFinger),
        }
    }
}

impl Handles {
    /// The handles of a hand in a shape; `None` if its joints are unknown.
    pub fn new(model: &HandModel, shape: &[f64]) -> Option<Handles> {
        let skeleton = if shape.is_empty() {
            RestSkeleton::of(model)
        } else {
            let shaped = shape_hand(model, shape).ok()?;
            RestSkeleton::of(&HandModel { vertices: shaped.vertices, joints: shaped.joints, ..model.clone() })
        };
        Some(Handles { ik: HandIk::new(&skeleton.ok()?), shape: shape.to_vec() })
    }

    /// Whether they are for this shape.
    pub fn fit(&self, shape: &[f64]) -> bool {
        self.shape == shape
    }

    /// The handle at a place on the screen: its landmark.
    pub fn at(&self, pose: &Pose, screen: &Screen, pointer: Pos2) -> Option<usize> {
        let near = self.on_screen(pose, screen).into_iter().filter_map(|(landmark, place, depth)| {
            let distance = place.distance(pointer);
            (distance < REACH).then_some((landmark, distance, depth))
        });
        // Of two fingers behind each other the nearer one counts.
        near.min_by(|a, b| (a.1 + 100.0 * a.2 as f32).total_cmp(&(b.1 + 100.0 * b.2 as f32)))
            .map(|(landmark, ..)| landmark)
    }

    /// Whether a place on the screen is on the hand or close to it.
    pub fn is_near(&self, pose: &Pose, screen: &Screen, pointer: Pos2) -> bool {
        let places: Vec<Option<(Pos2, f64)>> =
            self.ik.landmarks(pose).iter().map(|place| screen.project(*place)).collect();
        (1..LANDMARK_COUNT).any(|landmark| {
            let from = if landmark % 4 == 1 { WRIST } else { landmark - 1 };
            let (Some(Some((a, depth))), Some(Some((b, _)))) = (places.get(from), places.get(landmark)) else {
                return false;
            };
            distance_to_segment(pointer, *a, *b) < screen.points(NEAR_HAND, *depth)
        })
    }

    /// Where a handle is on the screen.
    #[cfg(test)]
    pub(crate) fn place(&self, pose: &Pose, screen: &Screen, landmark: usize) -> Option<Pos2> {
        self.on_screen(pose, screen).into_iter().find(|(number, ..)| *number == landmark).map(|(_, place, _)| place)
    }

    /// Draws the handles, the one of `hovered` larger.
    pub fn draw(&self, painter: &Painter, pose: &Pose, screen: &Screen, hovered: Option<usize>) {
        for (landmark, place, _) in self.on_screen(pose, screen) {
            let radius = if hovered == Some(landmark) { HOVERED_RADIUS } else { RADIUS };
            let fill = if Effect::of(landmark) == Some(Effect::BendFinger) { HANDLE_COLOR } else { Color32::WHITE };
            painter.circle(place, radius, fill.gamma_multiply(0.92), Stroke::new(1.5, EDGE_COLOR));
        }
    }

    /// Begins to drag a handle.
    pub fn begin(&self, pose: &Pose, landmark: usize) -> HandleDrag {
        let target = self.ik.landmarks(pose).get(landmark).copied().unwrap_or_default();
        HandleDrag { landmark, held: pose.clone(), target }
    }

    /// Continues a drag by an offset in points.
    pub fn drag(&self, drag: &mut HandleDrag, pose: &mut Pose, screen: &Screen, by: Vec2) {
        let depth = screen.camera.camera_from_world(drag.target).z;
        drag.target += screen.unproject_offset(by, depth);
        match Effect::of(drag.landmark) {
            Some(Effect::MoveHand) => pose.translation += drag.target - self.ik.landmarks(pose)[WRIST],
            Some(Effect::TurnHand) => self.turn(drag, pose),
            Some(Effect::BendFinger) => {
                let sight = (drag.target - screen.camera.center()).try_normalize();
                *pose = self.ik.reach(&drag.held, drag.landmark, drag.target, sight);
            }
            None => {}
        }
    }

    /// Turns the hand about the wrist so that a knuckle points to the target.
    fn turn(&self, drag: &HandleDrag, pose: &mut Pose) {
        let places = self.ik.landmarks(&drag.held);
        let (Some(knuckle), wrist) = (places.get(drag.landmark), places[WRIST]) else { return };
        let directions = ((*knuckle - wrist).try_normalize(), (drag.target - wrist).try_normalize());
        let (Some(from), Some(to)) = directions else { return };
        let turn = DMat3::from_quat(DQuat::from_rotation_arc(from, to));
        if let (Some(root), Some(held)) = (pose.rotations.first_mut(), drag.held.rotations.first()) {
            *root = axis_angle_from_rotation(&(turn * rotation_from_axis_angle(*held)));
        }
    }

    /// Landmark, place on the screen and depth of each handle.
    fn on_screen(&self, pose: &Pose, screen: &Screen) -> Vec<(usize, Pos2, f64)> {
        let places = self.ik.landmarks(pose);
        let shown = places.iter().enumerate().filter(|(landmark, _)| Effect::of(*landmark).is_some());
        shown
            .filter_map(|(landmark, place)| {
                let (at, depth) = screen.project(*place)?;
                Some((landmark, at, depth))
            })
            .collect()
    }
}

/// Draws a joint and the bones that move with it: those to its children, and to the fingertip.
pub fn draw_joint(painter: &Painter, model: &HandModel, shape: &[f64], pose: &Pose, screen: &Screen, joint: usize) {
    let joints = shape_hand(model, shape).map_or_else(|_| model.joints.clone(), |shaped| shaped.joints);
    if pose.rotations.len() != joints.len() {
        return;
    }
    let chain = pose_skeleton(&model.parents, &joints, &pose.rotations);
    let place = |joint: usize| Some(chain.world.get(joint)?.translation + pose.translation);
    let Some((center, _)) = place(joint).and_then(|place| screen.project(place)) else { return };
    let children = (0..joints.len()).filter(|child| model.parents.get(*child) == Some(&Some(joint)));
    let ends = children.filter_map(place).chain(tip(model, shape, pose, joint));
    for (end, _) in ends.filter_map(|end| screen.project(end)) {
        painter.line_segment([center, end], Stroke::new(6.0, EDGE_COLOR));
        painter.line_segment([center, end], Stroke::new(3.0, HANDLE_COLOR));
    }
    painter.circle(center, HOVERED_RADIUS, HANDLE_COLOR, Stroke::new(1.5, EDGE_COLOR));
}

/// The fingertip that a joint moves directly, metres, world.
fn tip(model: &HandModel, shape: &[f64], pose: &Pose, joint: usize) -> Option<DVec3> {
    let role = JointRole::of_joints(&model.joint_names).get(joint).copied().flatten()?;
    let finger = Finger::ALL.into_iter().position(|finger| role == JointRole::Bend(finger, 3))?;
    Handles::new(model, shape)?.ik.landmarks(pose).get(4 * finger + 4).copied()
}

fn distance_to_segment(point: Pos2, from: Pos2, to: Pos2) -> f32 {
    let along = to - from;
    let part = ((point - from).dot(along) / along.length_sq().max(1e-6)).clamp(0.0, 1.0);
    point.distance(from + part * along)
}

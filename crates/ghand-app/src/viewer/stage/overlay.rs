//! Lines over the view: the skeleton and the template's mesh.

use std::collections::HashSet;

use clap::ValueEnum;
use egui::{Align2, Color32, FontId, Painter, Pos2, Shape, Stroke};
use ghand_core::posing::{pose_hand, shape_hand};
use ghand_core::skeleton::pose_skeleton;
use ghand_core::{HandModel, Pose};

use crate::viewer::rendering::screen::Screen;

/// What is drawn over the view.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, ValueEnum)]
pub enum Overlay {
    /// Joints and bones of the hand model
    Skeleton,
    /// The hand model's mesh, as the edges of its triangles that face the camera
    Wireframe,
}

/// Radius of a joint, and how near the pointer must be for its name, points.
const RADIUS: f32 = 3.5;
const REACH: f32 = 9.0;
/// Blue is not found on skin, and is told from it with any colour vision.
const BONE_COLOR: Color32 = Color32::from_rgb(86, 180, 233);
const EDGE_COLOR: Color32 = Color32::from_black_alpha(170);

impl Overlay {
    /// What it shows, one sentence.
    pub const fn summary(self) -> &'static str {
        match self {
            Overlay::Skeleton => "Draws joints and bones; the pointer on a joint shows its name.",
            Overlay::Wireframe => "Draws the edges of the hand model's triangles that face the camera.",
        }
    }

    /// Draws it for a hand in a shape and a pose.
    pub fn draw(
        self,
        painter: &Painter,
        model: &HandModel,
        (shape, pose): (&[f64], &Pose),
        screen: &Screen,
        pointer: Option<Pos2>,
    ) {
        match self {
            Overlay::Skeleton => draw_skeleton(painter, model, (shape, pose), screen, pointer),
            Overlay::Wireframe => draw_wireframe(painter, model, (shape, pose), screen),
        }
    }
}

fn draw_skeleton(
    painter: &Painter,
    model: &HandModel,
    (shape, pose): (&[f64], &Pose),
    screen: &Screen,
    pointer: Option<Pos2>,
) {
    let joints = shape_hand(model, shape).map_or_else(|_| model.joints.clone(), |shaped| shaped.joints);
    if pose.rotations.len() != joints.len() {
        return;
    }
    let chain = pose_skeleton(&model.parents, &joints, &pose.rotations);
    let places: Vec<Option<Pos2>> = chain
        .world
        .iter()
        .map(|joint| screen.project(joint.translation + pose.translation).map(|(place, _)| place))
        .collect();
    let at = |joint: usize| places.get(joint).copied().flatten();
    for (width, color) in [(4.0, EDGE_COLOR), (2.0, BONE_COLOR)] {
        for (joint, parent) in model.parents.iter().enumerate() {
            if let (Some(end), Some(start)) = (at(joint), parent.and_then(at)) {
                painter.line_segment([start, end], Stroke::new(width, color));
            }
        }
    }
    for place in places.iter().flatten() {
        painter.circle(*place, RADIUS, BONE_COLOR, Stroke::new(1.5, EDGE_COLOR));
    }
    let Some(pointer) = pointer else { return };
    let distance = |joint: usize| at(joint).map_or(f32::INFINITY, |place| place.distance(pointer));
    let nearest = (0..places.len()).min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    if let Some(joint) = nearest.filter(|joint| distance(*joint) < REACH)
        && let (Some(place), Some(name)) = (at(joint), model.joint_names.get(joint))
    {
        let galley = painter.layout_no_wrap(name.clone(), FontId::proportional(13.0), Color32::WHITE);
        let text = Align2::LEFT_BOTTOM.anchor_size(place + egui::vec2(12.0, -8.0), galley.size());
        painter.rect_filled(text.expand2(egui::vec2(6.0, 3.0)), 4.0, EDGE_COLOR);
        painter.galley(text.min, galley, Color32::WHITE);
    }
}

fn draw_wireframe(painter: &Painter, model: &HandModel, (shape, pose): (&[f64], &Pose), screen: &Screen) {
    let Ok(posed) = pose_hand(model, shape, pose) else { return };
    let places: Vec<Option<Pos2>> =
        posed.vertices.iter().map(|vertex| screen.project(*vertex).map(|(place, _)| place)).collect();
    let stroke = Stroke::new(0.7, BONE_COLOR.gamma_multiply(0.8));
    let mut drawn = HashSet::new();
    let mut lines = Vec::new();
    for face in &model.faces {
        let [Some(a), Some(b), Some(c)] = face.map(|vertex| places.get(vertex as usize).copied().flatten()) else {
            continue;
        };
        // Counter-clockwise seen from outside; y points down on the screen.
        let (u, v) = (b - a, c - a);
        if u.x * v.y - u.y * v.x >= 0.0 {
            continue;
        }
        let [i, j, k] = *face;
        for (ends, place) in [([i, j], [a, b]), ([j, k], [b, c]), ([k, i], [c, a])] {
            if drawn.insert([ends[0].min(ends[1]), ends[0].max(ends[1])]) {
                lines.push(Shape::line_segment(place, stroke));
            }
        }
    }
    painter.extend(lines);
}

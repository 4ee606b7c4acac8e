//! The controls of the pose: named poses as buttons, and sliders for each joint.

use std::ops::RangeInclusive;

use egui::{
    Align2, Button, CollapsingHeader, Color32, FontId, Pos2, Rect, Role, Sense, StrokeKind, TextureHandle, Ui, Vec2,
    WidgetInfo, pos2, vec2,
};
use ghand_core::{HandModel, Pose};
use ghand_hand_model::joints::axes::JointAxes;
use ghand_hand_model::joints::limits::{AngleRange, JointLimits};
use ghand_hand_model::joints::names::JointRole;
use ghand_hand_model::named_poses::POSE_NAMES;
use glam::DVec3;

use crate::pose_choice::pose_by_name;
use crate::viewer::hand::thumbnails::Thumbnails;
use crate::viewer::widgets::number_slider::number_slider;

/// Groups of joints in the order of the panel: title, and text that the joints' names contain.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Wrist", &["wrist"]),
    ("Thumb", &["thumb"]),
    ("Index finger", &["index"]),
    ("Middle finger", &["middle"]),
    ("Ring finger", &["ring"]),
    ("Little finger", &["pinky", "little"]),
];
/// Size of a named pose's picture with its name, points: four fit the panel.
const THUMBNAIL: Vec2 = vec2(57.0, 70.0);
/// Title of the joints in no other group.
const OTHERS: &str = "Other joints";

/// Angles that can change by less than this, in degrees, have no slider.
const LEAST_WIDTH: f64 = 6.0;

struct Group {
    title: &'static str,
    joints: Vec<Joint>,
}

struct Joint {
    index: usize,
    label: String,
    angles: Vec<Angle>,
}

/// A component of a joint's axis-angle vector.
struct Angle {
    label: &'static str,
    /// A unit vector in model axes; those of a joint are at right angles.
    axis: DVec3,
    degrees: RangeInclusive<f64>,
}

impl Angle {
    /// The anatomical angles of a joint that can move, within its limits. If its part of the hand is unknown, and for
    /// the root, which turns the whole hand in space: the components in model axes.
    fn of_joint(role: Option<JointRole>, axes: &JointAxes) -> Vec<Angle> {
        match role {
            Some(role) if role != JointRole::Wrist => {
                let [flexion, abduction, twist] = JointLimits::of(role).ranges().map(in_degrees);
                let angles = [
                    Angle { label: "flexion", axis: axes.flexion, degrees: flexion },
                    Angle { label: "abduction", axis: axes.abduction, degrees: abduction },
                    Angle { label: "twist", axis: axes.twist, degrees: twist },
                ];
                angles.into_iter().filter(|angle| angle.degrees.end() - angle.degrees.start() >= LEAST_WIDTH).collect()
            }
            _ => [("x", DVec3::X), ("y", DVec3::Y), ("z", DVec3::Z)]
                .map(|(label, axis)| Angle { label, axis, degrees: -180.0..=180.0 })
                .into(),
        }
    }

    /// The angle in a joint's rotation, degrees.
    fn get(&self, rotation: DVec3) -> f64 {
        self.axis.dot(rotation).to_degrees()
    }

    /// Sets the angle and keeps the joint's others.
    fn set(&self, rotation: &mut DVec3, degrees: f64) {
        *rotation += (degrees - self.get(*rotation)).to_radians() * self.axis;
    }
}

/// The range without the rounding error of radians: its ends can be typed.
fn in_degrees(range: AngleRange) -> RangeInclusive<f64> {
    let rounded = |angle: f64| (1e6 * angle.to_degrees()).round() / 1e6;
    rounded(range.low)..=rounded(range.high)
}

/// What the user does with the sliders of the joints.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct JointsResponse {
    /// Whether a slider was moved.
    pub moved: bool,
    /// The joint of the slider under the pointer, or of the one that has the keyboard.
    pub pointed_at: Option<usize>,
}

/// A button with the picture of a pose above its name. Returns whether it was clicked.
fn thumbnail_button(ui: &mut Ui, name: &str, picture: Option<&TextureHandle>, is_present: bool) -> bool {
    let (rect, response) = ui.allocate_exact_size(THUMBNAIL, Sense::click());
    response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_present, name));
    let visuals = ui.style().interact_selectable(&response, is_present);
    ui.painter().rect(rect, 5.0, visuals.weak_bg_fill, visuals.bg_stroke, StrokeKind::Inside);
    if let Some(picture) = picture {
        let place = Rect::from_min_size(rect.min, Vec2::splat(rect.width())).shrink(2.0);
        let whole = Rect::from_min_max(Pos2::ZERO, pos2(1.0, 1.0));
        ui.painter().image(picture.id(), place, whole, Color32::WHITE);
    }
    let font = FontId::proportional(11.0);
    let place = rect.center_bottom() - vec2(0.0, 2.0);
    ui.painter().text(place, Align2::CENTER_BOTTOM, name, font, visuals.text_color());
    response.clicked()
}

/// The pose's controls for one hand model.
pub struct PosePanel {
    thumbnails: Thumbnails,
    thumbnails_shown: bool,
    named: Vec<(&'static str, Pose)>,
    groups: Vec<Group>,
}

impl PosePanel {
    /// The controls for a model.
    pub fn new(model: &HandModel) -> PosePanel {
        // A skeleton with unknown joint names has only the named pose rest.
        let named = POSE_NAMES.iter().filter_map(|name| Some((*name, pose_by_name(name, model).ok()?))).collect();
        let titles = GROUPS.iter().map(|(title, _)| *title).chain([OTHERS]);
        let mut groups: Vec<Group> = titles.map(|title| Group { title, joints: Vec::new() }).collect();
        // Without axes, no role says how a joint moves.
        let axes = JointAxes::of_joints(model);
        let roles = JointRole::of_joints(&model.joint_names);
        for (joint, name) in model.joint_names.iter().enumerate() {
            let is_leaf = !model.parents.contains(&Some(joint));
            if is_leaf && name.ends_with("tip") {
                // Marks the end of a finger; rotating it has almost no effect.
                continue;
            }
            let group = GROUPS.iter().position(|(_, parts)| parts.iter().any(|p| name.contains(p)));
            if let Some(group) = groups.get_mut(group.unwrap_or(GROUPS.len())) {
                // WebXR's names begin with the finger, which is the group's title already.
                let part = name.split_once("-finger-").or_else(|| name.split_once("thumb-"));
                let label = part.map_or(name.as_str(), |(_, part)| part).replace('-', " ");
                let angles = match axes.as_ref().and_then(|axes| axes.get(joint)) {
                    Some(axes) => Angle::of_joint(roles.get(joint).copied().flatten(), axes),
                    None => Angle::of_joint(None, &JointAxes::OF_MODEL),
                };
                // OpenXR's palm does not move by itself.
                if !angles.is_empty() {
                    group.joints.push(Joint { index: joint, label, angles });
                }
            }
        }
        groups.retain(|g| !g.joints.is_empty());
        PosePanel { thumbnails: Thumbnails::default(), thumbnails_shown: false, named, groups }
    }

    /// The named poses of this model.
    pub fn named(&self) -> &[(&'static str, Pose)] {
        &self.named
    }

    /// Shows the named poses. Returns whether the user chose one.
    pub fn named_poses(&self, ui: &mut Ui, pose: &mut Pose) -> bool {
        let mut chosen = false;
        ui.horizontal_wrapped(|ui| {
            if self.thumbnails_shown {
                ui.spacing_mut().item_spacing = vec2(4.0, 4.0);
            }
            for (number, (name, named)) in self.named.iter().enumerate() {
                let is_present = named == pose;
                let clicked = match self.thumbnails_shown {
                    true => thumbnail_button(ui, name, self.thumbnails.get(number), is_present),
                    false => ui.add(Button::new(*name).selected(is_present)).clicked(),
                };
                if clicked {
                    pose.clone_from(named);
                    chosen = true;
                }
            }
        });
        chosen
    }

    /// Whether the named poses have pictures.
    pub fn show_thumbnails(&mut self, shown: bool) {
        self.thumbnails_shown = shown;
    }

    /// See [`PosePanel::show_thumbnails`].
    pub fn shows_thumbnails(&self) -> bool {
        self.thumbnails_shown
    }

    /// The pictures of the named poses.
    pub fn thumbnails_mut(&mut self) -> &mut Thumbnails {
        &mut self.thumbnails
    }

    /// Shows the sliders, grouped by finger. They are the joints' angles ([`JointAxes`]) in degrees, or the components of
    /// axis-angle rotations in model axes.
    pub fn joints(&self, ui: &mut Ui, pose: &mut Pose) -> JointsResponse {
        let mut response = JointsResponse::default();
        for group in &self.groups {
            CollapsingHeader::new(group.title).id_salt(("joints", group.title)).show(ui, |ui| {
                for joint in &group.joints {
                    let Some(rotation) = pose.rotations.get_mut(joint.index) else { continue };
                    let mut is_pointed_at = ui.label(&joint.label).hovered();
                    for angle in &joint.angles {
                        let mut degrees = angle.get(*rotation);
                        let slider = number_slider(&mut degrees, angle.degrees.clone(), 0, "°").text(angle.label);
                        let slider = ui.add(slider);
                        is_pointed_at |= slider.hovered() || slider.dragged() || slider.has_focus();
                        if slider.changed() {
                            angle.set(rotation, degrees);
                            response.moved = true;
                        }
                    }
                    if is_pointed_at {
                        response.pointed_at = Some(joint.index);
                    }
                }
            });
        }
        response
    }
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn every_joint_is_in_one_group_under_its_finger() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let panel = PosePanel::new(&model);
        assert_eq!(panel.groups.iter().map(|g| g.joints.len()).collect::<Vec<_>>(), [1, 3, 3, 3, 3, 3]);
        assert_eq!(panel.named.len(), POSE_NAMES.len());
        let mut strange = model.clone();
        strange.joint_names[2] = "bone".into();
        let panel = PosePanel::new(&strange);
        assert_eq!(panel.groups.iter().map(|g| g.joints.len()).sum::<usize>(), 16);
        assert_eq!(panel.named.len(), 1);
    }

    /// Labels of the sliders of a joint.
    fn labels(panel: &PosePanel, index: usize) -> Vec<&'static str> {
        let joint = panel.groups.iter().flat_map(|group| &group.joints).find(|joint| joint.index == index).unwrap();
        joint.angles.iter().map(|angle| angle.label).collect()
    }

    #[test]
    fn known_joints_have_sliders_for_how_they_move_and_others_for_model_axes() {
        let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let joint = |name: &str| model.joint_index(name).unwrap();
        let wrist = joint("wrist");
        let knuckle = joint("index1");
        let hinge = joint("index2");
        let thumb = joint("thumb1");
        let panel = PosePanel::new(&model);
        assert_eq!(labels(&panel, wrist), ["x", "y", "z"]);
        assert_eq!(labels(&panel, knuckle), ["flexion", "abduction"]);
        assert_eq!(labels(&panel, hinge), ["flexion"]);
        assert_eq!(labels(&panel, thumb), ["flexion", "abduction", "twist"]);
        model.joint_names[hinge] = "bone".into();
        assert!((0..16).all(|joint| labels(&PosePanel::new(&model), joint) == ["x", "y", "z"]));
    }

    #[test]
    fn a_slider_sets_one_angle_and_reaches_the_ends_of_its_range() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let panel = PosePanel::new(&model);
        let knuckle = model.joint_index("index1").unwrap();
        let joint = panel.groups.iter().flat_map(|group| &group.joints).find(|joint| joint.index == knuckle).unwrap();
        let [flexion, abduction] = &joint.angles[..] else { panic!("{} sliders", joint.angles.len()) };
        assert_eq!((&flexion.degrees, &abduction.degrees), (&(-45.0..=90.0), &(-20.0..=20.0)));
        let mut rotation = DVec3::new(0.1, -0.2, 0.3);
        let before = abduction.get(rotation);
        flexion.set(&mut rotation, 90.0);
        assert!((flexion.get(rotation) - 90.0).abs() < 1e-9 && (abduction.get(rotation) - before).abs() < 1e-9);
        let fist = pose_by_name("fist", &model).unwrap().rotations[knuckle];
        assert!(flexion.get(fist) > 60.0);
    }
}

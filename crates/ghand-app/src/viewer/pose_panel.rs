//! The controls of the pose: named poses as buttons, and three sliders per joint.

use egui::{Button, CollapsingHeader, Ui};
use ghand_core::{HandModel, Pose};
use ghand_hand_model::named_poses::POSE_NAMES;

use crate::pose_choice::pose_by_name;
use crate::viewer::number_slider::number_slider;

/// Groups of joints in the order of the panel: title, and text that the joints' names contain.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Wrist", &["wrist"]),
    ("Thumb", &["thumb"]),
    ("Index finger", &["index"]),
    ("Middle finger", &["middle"]),
    ("Ring finger", &["ring"]),
    ("Little finger", &["pinky", "little"]),
];
/// Title of the joints in no other group.
const OTHERS: &str = "Other joints";

struct Group {
    title: &'static str,
    /// Joint and its label.
    joints: Vec<(usize, String)>,
}

/// The pose's controls for one hand model.
pub struct PosePanel {
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
                group.joints.push((joint, part.map_or(name.as_str(), |(_, part)| part).replace('-', " ")));
            }
        }
        groups.retain(|g| !g.joints.is_empty());
        PosePanel { named, groups }
    }

    /// Shows the named poses. Returns whether the user chose one.
    pub fn named_poses(&self, ui: &mut Ui, pose: &mut Pose) -> bool {
        let mut chosen = false;
        ui.horizontal_wrapped(|ui| {
            for (name, named) in &self.named {
                if ui.add(Button::new(*name).selected(named == pose)).clicked() {
                    pose.clone_from(named);
                    chosen = true;
                }
            }
        });
        chosen
    }

    /// Shows the sliders, grouped by finger. They are the components of the joints' axis-angle rotations, degrees.
    /// Returns whether the user moved one.
    pub fn joints(&self, ui: &mut Ui, pose: &mut Pose) -> bool {
        let mut moved = false;
        for group in &self.groups {
            CollapsingHeader::new(group.title).id_salt(("joints", group.title)).show(ui, |ui| {
                for (joint, name) in &group.joints {
                    let Some(rotation) = pose.rotations.get_mut(*joint) else { continue };
                    ui.label(name);
                    for (axis, component) in ["x", "y", "z"].into_iter().zip(rotation.as_mut()) {
                        let mut degrees = component.to_degrees();
                        if ui.add(number_slider(&mut degrees, -180.0..=180.0, 0, "°").text(axis)).changed() {
                            *component = degrees.to_radians();
                            moved = true;
                        }
                    }
                }
            });
        }
        moved
    }
}

#[cfg(test)]
mod tests {
    use ghand_hand_model::procedural::ProceduralHand;

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
}

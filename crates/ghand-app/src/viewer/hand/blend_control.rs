//! Blends the present pose with a named one.

use egui::{ComboBox, Ui};
use ghand_core::Pose;
use ghand_motion::pose_sequence::between;

use crate::viewer::widgets::number_slider::number_slider;

/// The named pose to blend with, and how much of it.
#[derive(Debug, Clone)]
pub struct BlendControl {
    target: &'static str,
    percent: f64,
    /// The pose at 0 %.
    from: Pose,
    /// The pose that was set last; another one starts a new blend.
    blended: Option<Pose>,
}

impl BlendControl {
    /// A blend with the pose of that name.
    pub fn new(target: &'static str, pose: &Pose) -> BlendControl {
        BlendControl { target, percent: 0.0, from: pose.clone(), blended: None }
    }

    /// Shows the controls. Returns whether the user changed the pose.
    pub fn show(&mut self, ui: &mut Ui, named: &[(&'static str, Pose)], pose: &mut Pose) -> bool {
        if self.blended.as_ref() != Some(pose) {
            (self.percent, self.blended) = (0.0, None);
            self.from.clone_from(pose);
        }
        let before = (self.target, self.percent);
        ui.horizontal(|ui| {
            let label = ui.label("blend").id;
            let list = ComboBox::from_id_salt("blend").selected_text(format!("to {}", self.target)).width(84.0);
            let list = list.show_ui(ui, |ui| {
                for (name, _) in named {
                    ui.selectable_value(&mut self.target, *name, *name);
                }
            });
            list.response.labelled_by(label);
            ui.spacing_mut().slider_width = 54.0;
            let slider = ui.add(number_slider(&mut self.percent, 0.0..=100.0, 0, " %"));
            slider.on_hover_text("Blend with the named pose");
        });
        let changed = (self.target, self.percent) != before && (self.percent > 0.0 || before.1 > 0.0);
        if let (true, Some((_, target))) = (changed, named.iter().find(|(name, _)| *name == self.target)) {
            *pose = between(&self.from, target, 0.01 * self.percent);
            self.blended = Some(pose.clone());
        }
        changed
    }
}

#[cfg(test)]
mod tests {
    use egui::accesskit::Role;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;
    use glam::DVec3;

    use super::*;

    fn pose(x: f64) -> Pose {
        Pose { rotations: vec![DVec3::X * x], translation: DVec3::ZERO }
    }

    #[test]
    fn the_slider_leads_from_the_present_pose_to_the_named_one() {
        let show = |ui: &mut Ui, (blend, now): &mut (BlendControl, Pose)| {
            blend.show(ui, &[("bent", pose(1.0))], now);
        };
        let mut ui = Harness::new_ui_state(show, (BlendControl::new("bent", &pose(0.0)), pose(0.0)));
        let enter = |ui: &mut Harness<(BlendControl, Pose)>, text: &str| {
            ui.get_by_role_and_label(Role::SpinButton, "Blend with the named pose").click();
            (0..3).for_each(|_| ui.step());
            ui.input_mut().events.push(egui::Event::Text(text.into()));
            ui.key_press(egui::Key::Enter);
            (0..3).for_each(|_| ui.step());
            ui.state().1.rotations[0].x
        };
        assert!((enter(&mut ui, "50") - 0.5).abs() < 1e-9);
        assert!((enter(&mut ui, "100") - 1.0).abs() < 1e-9);
        assert!(enter(&mut ui, "0").abs() < 1e-9);
        enter(&mut ui, "25");
        // Another pose is the new beginning.
        ui.state_mut().1 = pose(0.6);
        ui.run();
        assert!((enter(&mut ui, "50") - 0.8).abs() < 1e-9);
    }
}

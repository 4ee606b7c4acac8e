//! The controls of the light, for avatars whose light is apart from their skin.

use egui::Ui;
use ghand_avatar::Light;

use crate::viewer::widgets::number_slider::number_slider;

/// The lights to choose from, and how far the light is turned.
pub struct LightPanel {
    lights: Vec<(&'static str, Light)>,
    chosen: usize,
    /// Degrees about the vertical.
    turn: f64,
    now: Light,
}

impl LightPanel {
    /// The controls of an avatar in this light.
    pub fn new(light: &Light) -> LightPanel {
        let lights = vec![("as captured", light.clone()), ("studio", Light::studio())];
        LightPanel { lights, chosen: 0, turn: 0.0, now: light.clone() }
    }

    /// The light now.
    pub fn light(&self) -> &Light {
        &self.now
    }

    /// Back to the light in which the avatar was opened.
    pub fn reset(&mut self) {
        (self.chosen, self.turn) = (0, 0.0);
        self.update();
    }

    /// Shows the controls.
    pub fn show(&mut self, ui: &mut Ui) {
        let before = (self.chosen, self.turn);
        ui.horizontal(|ui| {
            for (k, (name, _)) in self.lights.iter().enumerate() {
                ui.selectable_value(&mut self.chosen, k, *name);
            }
        });
        ui.horizontal(|ui| {
            let label = ui.label("turned").id;
            ui.add(number_slider(&mut self.turn, -180.0..=180.0, 0, "°")).labelled_by(label);
        });
        if before != (self.chosen, self.turn) {
            self.update();
        }
    }

    fn update(&mut self) {
        if let Some((_, light)) = self.lights.get(self.chosen) {
            self.now = light.turned(self.turn.to_radians());
        }
    }
}

#[cfg(test)]
mod tests {
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    use super::*;

    #[test]
    fn a_chosen_light_is_shown_until_the_reset() {
        let coefficients = (0..64).map(|k| [k as f32 / 31.5; 3]).collect();
        let captured = Light { coefficients, ..Light::studio() };
        let panel = LightPanel::new(&captured);
        let mut ui = Harness::new_ui_state(|ui, panel: &mut LightPanel| panel.show(ui), panel);
        assert_eq!(ui.state().light(), &captured);
        ui.get_by_label("studio").click();
        ui.run();
        assert_eq!(ui.state().light(), &Light::studio());
        ui.get_by_label("as captured").click();
        ui.run();
        assert_eq!(ui.state().light(), &captured);
        ui.state_mut().turn = 90.0;
        ui.state_mut().update();
        assert_ne!(ui.state().light(), &captured);
        ui.state_mut().reset();
        assert_eq!((ui.state().light(), ui.state().turn), (&captured, 0.0));
    }
}

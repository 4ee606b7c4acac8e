//! Asks for a name.

use egui::{Align2, Context, Id, Key, Modal, Modifiers, TextEdit, WidgetText};

/// Width, points.
const WIDTH: f32 = 320.0;

/// The question, while it is open.
#[derive(Debug, Default)]
pub struct NameDialog {
    text: String,
}

/// What the user did.
#[derive(Debug, PartialEq, Eq)]
pub enum Named {
    /// Nothing yet.
    Open,
    /// Closed the question.
    Closed,
    /// Gave this name, which may be unusable.
    As(String),
}

impl NameDialog {
    /// Shows the question.
    pub fn show(&mut self, context: &Context, title: &str, confirm: impl Into<WidgetText>) -> Named {
        let enter = context.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Enter));
        let area = Modal::default_area(Id::unique("name")).anchor(Align2::CENTER_TOP, [0.0, 60.0]);
        let mut confirmed = enter;
        let response = Modal::new(Id::unique("name")).area(area).show(context, |ui| {
            ui.set_width(WIDTH.min(context.content_rect().width() - 40.0));
            let label = ui.label(title).id;
            ui.horizontal(|ui| {
                let edit = TextEdit::singleline(&mut self.text).desired_width(ui.available_width() - 64.0);
                ui.add(edit).labelled_by(label).request_focus();
                confirmed |= ui.button(confirm).clicked();
            });
        });
        match confirmed {
            true => Named::As(std::mem::take(&mut self.text)),
            false if response.should_close() => Named::Closed,
            false => Named::Open,
        }
    }
}

//! Short messages over the view that disappear by themselves.

use egui::{Align2, Area, Color32, Context, Frame, Id, Order, RichText, Stroke};

/// How long a note and an error stay, seconds.
const NOTE_SECS: f64 = 4.0;
const ERROR_SECS: f64 = 12.0;
/// Most messages at once; older ones make room.
const MOST: usize = 4;
/// Largest width, points.
const WIDTH: f32 = 420.0;
/// Left edge of an error and of a note.
const ERROR_COLOR: Color32 = Color32::from_rgb(222, 82, 70);
const NOTE_COLOR: Color32 = Color32::from_rgb(70, 150, 200);

struct Toast {
    text: String,
    is_error: bool,
    /// When it is first shown, in the user interface's seconds.
    since: Option<f64>,
}

impl Toast {
    fn lifetime(&self) -> f64 {
        if self.is_error { ERROR_SECS } else { NOTE_SECS }
    }
}

/// The messages that are shown.
#[derive(Default)]
pub struct Toasts {
    shown: Vec<Toast>,
}

impl Toasts {
    /// Tells something that the user may not see otherwise.
    pub fn note(&mut self, text: impl Into<String>) {
        self.add(text.into(), false);
    }

    /// Tells what went wrong, one sentence.
    pub fn error(&mut self, error: &anyhow::Error) {
        self.add(crate::cli::sentence(error), true);
    }

    fn add(&mut self, text: String, is_error: bool) {
        // A repeated message is shown once, for its whole time again.
        self.shown.retain(|toast| toast.text != text);
        self.shown.push(Toast { text, is_error, since: None });
        let excess = self.shown.len().saturating_sub(MOST);
        self.shown.drain(..excess);
    }

    /// Shows them in the lower right corner; the newest is the lowest.
    pub fn show(&mut self, context: &Context) {
        let now = context.input(|input| input.time);
        for toast in &mut self.shown {
            toast.since.get_or_insert(now);
        }
        self.shown.retain(|toast| toast.since.is_none_or(|since| now < since + toast.lifetime()));
        let ends = self.shown.iter().filter_map(|toast| Some(toast.since? + toast.lifetime()));
        let Some(next) = ends.min_by(f64::total_cmp) else { return };
        context.request_repaint_after(std::time::Duration::from_secs_f64((next - now).max(0.01)));
        let width = WIDTH.min(context.content_rect().width() - 40.0);
        let area =
            Area::new(Id::unique("toasts")).order(Order::Foreground).anchor(Align2::RIGHT_BOTTOM, [-14.0, -14.0]);
        let mut closed = None;
        area.show(context, |ui| {
            ui.set_max_width(width);
            for (k, toast) in self.shown.iter().enumerate() {
                let color = if toast.is_error { ERROR_COLOR } else { NOTE_COLOR };
                let frame = Frame::popup(ui.style()).stroke(Stroke::new(1.5, color)).inner_margin(10.0);
                frame.show(ui, |ui| {
                    ui.horizontal(|ui| {
                        let text = ui.add(egui::Label::new(RichText::new(&toast.text)).wrap());
                        if toast.is_error {
                            let button = ui.small_button("×").on_hover_text("Close this message");
                            closed = button.clicked().then_some(k).or(closed);
                        }
                        text
                    });
                });
            }
        });
        if let Some(k) = closed {
            self.shown.remove(k);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_shown_once_and_only_the_newest_stay() {
        let mut toasts = Toasts::default();
        for k in 0..10 {
            toasts.note(format!("note {}", k / 2));
        }
        toasts.error(&anyhow::anyhow!("broken"));
        let texts: Vec<&str> = toasts.shown.iter().map(|toast| toast.text.as_str()).collect();
        assert_eq!(texts, ["note 2", "note 3", "note 4", "broken"]);
    }
}

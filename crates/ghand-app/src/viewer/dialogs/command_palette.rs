//! The command palette: finds by name what can be done.

use egui::{Align2, Button, Context, Id, Key, Modal, Modifiers, ScrollArea, TextEdit};

/// Width, points.
const WIDTH: f32 = 440.0;
/// Most entries that are shown at once; typing finds the others.
const MOST_SHOWN: usize = 12;

/// One thing to do.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry<A> {
    /// Its name.
    pub title: String,
    /// Its key as text, or a remark.
    pub remark: String,
    /// What it does, a sentence for the pointer over it.
    pub summary: String,
    /// Identifies it.
    pub action: A,
}

/// An open palette.
#[derive(Debug, Default)]
pub struct CommandPalette {
    query: String,
    selected: usize,
}

/// What the user did.
#[derive(Debug, PartialEq)]
pub enum Choice<A> {
    /// Nothing yet.
    Open,
    /// Closed the palette.
    Closed,
    /// Chose an entry.
    Chosen(A),
}

impl CommandPalette {
    /// Shows the palette with those of the entries that fit the typed text.
    pub fn show<A: Clone>(&mut self, context: &Context, entries: &[Entry<A>]) -> Choice<A> {
        let down = |key| context.input_mut(|input| input.consume_key(Modifiers::NONE, key));
        let next = down(Key::ArrowDown);
        let before = down(Key::ArrowUp);
        let enter = down(Key::Enter);
        let width = WIDTH.min(context.content_rect().width() - 40.0);
        let area = Modal::default_area(Id::unique("palette")).anchor(Align2::CENTER_TOP, [0.0, 60.0]);
        let mut chosen = None;
        let response = Modal::new(Id::unique("palette")).area(area).show(context, |ui| {
            ui.set_width(width);
            let edit = TextEdit::singleline(&mut self.query).hint_text("Find a command, pose or motion");
            let edit = ui.add(edit.desired_width(f32::INFINITY));
            edit.request_focus();
            if edit.changed() {
                self.selected = 0;
            }
            let found = matching(entries, &self.query);
            let last = found.len().saturating_sub(1).min(MOST_SHOWN - 1);
            self.selected = (self.selected + usize::from(next)).saturating_sub(usize::from(before)).min(last);
            ui.add_space(4.0);
            // Otherwise the list stays as short as it was for the text before.
            let room = context.content_rect().height() - 160.0;
            ScrollArea::vertical().max_height(room).min_scrolled_height(room).show(ui, |ui| {
                for (k, entry) in found.iter().take(MOST_SHOWN).enumerate() {
                    let button = Button::new(&entry.title).shortcut_text(&entry.remark).selected(k == self.selected);
                    let button = ui.add(button.frame_when_inactive(false).min_size([width, 0.0].into()));
                    if button.on_hover_text(&entry.summary).clicked() || (enter && k == self.selected) {
                        chosen = Some(entry.action.clone());
                    }
                }
                if found.is_empty() {
                    ui.weak("Nothing has that name.");
                }
            });
        });
        match chosen {
            Some(action) => Choice::Chosen(action),
            None if response.should_close() => Choice::Closed,
            None => Choice::Open,
        }
    }
}

/// The entries whose titles contain all words of the query; those that begin with it come first.
fn matching<'a, A>(entries: &'a [Entry<A>], query: &str) -> Vec<&'a Entry<A>> {
    let query = query.trim().to_lowercase();
    let fits = |entry: &&Entry<A>| {
        let title = entry.title.to_lowercase();
        query.split_whitespace().all(|word| title.contains(word))
    };
    let mut found: Vec<&Entry<A>> = entries.iter().filter(fits).collect();
    found.sort_by_key(|entry| {
        let title = entry.title.to_lowercase();
        let begins = |text: &str| text.starts_with(&query);
        (!begins(&title), !title.split_whitespace().any(begins))
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_in_any_order_find_entries_and_beginnings_come_first() {
        let entry = |title: &str| Entry { title: title.into(), remark: "".into(), summary: "".into(), action: () };
        let entries = ["Reset view", "Frame the hand", "Pose: fist", "View from the palm"].map(entry);
        let found = |query| matching(&entries, query).iter().map(|e| e.title.as_str()).collect::<Vec<_>>();
        assert_eq!(found(""), ["Reset view", "Frame the hand", "Pose: fist", "View from the palm"]);
        assert_eq!(found("view"), ["View from the palm", "Reset view"]);
        assert_eq!(found("HAND the"), ["Frame the hand"]);
        assert_eq!(found("fi"), ["Pose: fist"]);
        assert!(found("fish").is_empty());
    }
}

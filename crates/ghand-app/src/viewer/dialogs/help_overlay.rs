//! The help: what the mouse does, and all commands with their keys.

use egui::{Align, Context, Grid, Id, Layout, Modal, RichText, ScrollArea, Ui};

use crate::viewer::command::{COMMANDS, Command, Menu};

/// What the mouse does: gesture and effect.
const GESTURES: [(&str, &str); 6] = [
    ("Drag", "turn the view"),
    ("Right-drag, Shift-drag", "move the view"),
    ("Scroll, pinch", "zoom towards the pointer"),
    ("Double-click", "reset the view"),
    ("Drag an orange dot", "bend the finger"),
    ("Drag a white dot", "move the hand, turn it"),
];
/// Width of one column of commands, points.
const COLUMN_WIDTH: f32 = 300.0;

/// Shows the help over everything. Returns whether it stays open.
pub fn help_overlay(context: &Context) -> bool {
    let room = context.content_rect().size() * 0.9;
    let columns = if room.x > 2.4 * COLUMN_WIDTH { 2 } else { 1 };
    let mut open = true;
    let response = Modal::new(Id::unique("help")).show(context, |ui| {
        ui.set_width(COLUMN_WIDTH * columns as f32 + 24.0);
        ui.horizontal(|ui| {
            ui.heading("Keys and mouse");
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| open &= !ui.button("Close").clicked());
        });
        ui.separator();
        ScrollArea::vertical().max_height(room.y - 80.0).min_scrolled_height(room.y - 80.0).show(ui, |ui| {
            ui.columns(columns, |uis| {
                if let Some(ui) = uis.first_mut() {
                    gestures(ui);
                }
                let places = if columns == 2 { [0, 0, 1, 1, 1] } else { [0; 5] };
                for (menu, place) in Menu::ALL.into_iter().zip(places) {
                    if let Some(ui) = uis.get_mut(place) {
                        commands(ui, menu);
                    }
                }
            });
        });
    });
    open && !response.should_close()
}

fn section(ui: &mut Ui, title: &str, rows: impl FnOnce(&mut Ui)) {
    ui.add_space(4.0);
    ui.label(RichText::new(title).strong());
    Grid::new(("help", title)).num_columns(2).spacing([12.0, 4.0]).show(ui, rows);
    ui.add_space(6.0);
}

fn commands(ui: &mut Ui, menu: Menu) {
    section(ui, menu.title(), |ui| {
        for command in COMMANDS.iter().filter(|command| command.menu == menu) {
            ui.label(RichText::new(all_shortcuts(ui.ctx(), command)).monospace());
            ui.label(command.title).on_hover_text(command.summary);
            ui.end_row();
        }
    });
}

fn gestures(ui: &mut Ui) {
    section(ui, "Mouse", |ui| {
        for (gesture, effect) in GESTURES {
            ui.label(gesture);
            ui.label(effect);
            ui.end_row();
        }
    });
}

/// The keys of a command, each once.
fn all_shortcuts(context: &Context, command: &Command) -> String {
    let texts: Vec<String> = command.shortcuts.iter().map(|shortcut| context.format_shortcut(shortcut)).collect();
    texts
        .join(", ")
        .replace("Questionmark", "?")
        .replace("Comma", ",")
        .replace("Period", ".")
        .replace("OpenBracket", "[")
        .replace("CloseBracket", "]")
}

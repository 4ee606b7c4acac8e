//! Views under a name: sides of the hand and what the user has saved.

use anyhow::bail;
use egui::{Context, Ui};

use crate::viewer::app::Viewer;
use crate::viewer::dialogs::name_dialog::{NameDialog, Named};
use crate::viewer::rendering::view_side::ViewSide;
use crate::viewer::session::saved_view::{SavedView, view_name};

impl Viewer {
    /// Shows the view of that name: a side of the hand, or one that was saved.
    ///
    /// # Errors
    /// One sentence with the names that there are.
    pub fn go_to_view(&mut self, name: &str) -> anyhow::Result<()> {
        if let (Some(side), true) = (ViewSide::of(name), self.subject.pose().is_some()) {
            self.turntable = false;
            self.look_from(side);
            return Ok(());
        }
        let Some(view) = self.settings.views.iter().find(|view| view.name == name) else {
            let sides = ViewSide::ALL.into_iter().filter(|_| self.subject.pose().is_some()).map(ViewSide::name);
            let mut names: Vec<&str> = sides.collect();
            names.extend(self.settings.views.iter().map(|view| view.name.as_str()));
            match names.is_empty() {
                true => bail!("there is no view {name:?}; none has been saved"),
                false => bail!("there is no view {name:?}, only {}", names.join(", ")),
            }
        };
        self.camera.take(&view.point);
        self.turntable = false;
        Ok(())
    }

    /// Saves the present view under a name; one of that name is replaced.
    fn save_view(&mut self, name: &str) -> Result<(), String> {
        let name = view_name(name)?;
        let view = SavedView { name: name.clone(), point: self.camera.view_point() };
        match self.settings.views.iter_mut().find(|view| view.name == name) {
            Some(old) => *old = view,
            None => self.settings.views.push(view),
        }
        self.save_settings();
        Ok(())
    }

    pub(super) fn delete_view(&mut self, name: &str) {
        self.settings.views.retain(|view| view.name != name);
        self.save_settings();
    }

    /// The saved views as buttons.
    pub(super) fn saved_views(&mut self, ui: &mut Ui) {
        let names: Vec<String> = self.settings.views.iter().map(|view| view.name.clone()).collect();
        ui.horizontal_wrapped(|ui| {
            for name in names {
                // One piece, so that a name and its cross stay on one line.
                ui.horizontal(|ui| {
                    ui.spacing_mut().item_spacing.x = 0.0;
                    if ui.button(&name).clicked() {
                        self.show_view(&name);
                    }
                    let cross = ui.button("×").on_hover_text(format!("Delete the view {name}"));
                    if cross.clicked() {
                        self.delete_view(&name);
                    }
                });
            }
            if ui.button("Save view").on_hover_text("Keep this view under a name (V)").clicked() {
                self.naming_view = Some(NameDialog::default());
            }
        });
    }

    /// Shows a view; if there is none of that name, a message says so.
    pub(super) fn show_view(&mut self, name: &str) {
        if let Err(error) = self.go_to_view(name) {
            self.toasts.error(&error);
        }
    }

    /// Asks for the name under which the view is to be saved, if the user wants to save it.
    pub(super) fn name_view(&mut self, context: &Context) {
        let Some(mut dialog) = self.naming_view.take() else { return };
        match dialog.show(context, "Save this view as", "Save") {
            Named::Open => self.naming_view = Some(dialog),
            Named::Closed => {}
            Named::As(name) => match self.save_view(&name) {
                Ok(()) => self.toasts.note(format!("The view is saved as {}.", name.trim())),
                Err(problem) => {
                    self.toasts.note(problem);
                    self.naming_view = Some(NameDialog::default());
                }
            },
        }
    }
}

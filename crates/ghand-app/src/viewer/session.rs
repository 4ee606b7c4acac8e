//! What stays when another file is opened: settings, saved views, and messages.
//!
//! [`Session`] owns these and the file of the settings. It knows nothing of what is open.

pub mod saved_view;
pub mod settings;
pub mod toasts;

use std::path::{Path, PathBuf};

use egui::{Context, Ui};

use crate::viewer::session::saved_view::{SavedView, view_name};
use crate::viewer::session::settings::Settings;
use crate::viewer::session::toasts::Toasts;
use ghand_avatar::orbit_camera::ViewPoint;

/// Settings and messages.
#[derive(Default)]
pub struct Session {
    pub(in crate::viewer) settings: Settings,
    /// Where the settings are kept; `None` if they are not.
    path: Option<PathBuf>,
    toasts: Toasts,
}

/// What the user wants of the saved views.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ViewRequest {
    /// To see the one of this name.
    Show(String),
    /// To delete the one of this name.
    Delete(String),
    /// To save the present one.
    Save,
}

impl Session {
    /// Uses these settings; changes are kept in the file, if there is one.
    pub fn use_settings(&mut self, settings: Settings, path: Option<PathBuf>) {
        (self.settings, self.path) = (settings, path);
    }

    /// Keeps the settings for the next start.
    pub fn save(&mut self) {
        let Some(path) = &self.path else { return };
        if let Err(error) = self.settings.write(path) {
            self.toasts.note(format!("{}: the settings cannot be kept: {error}", path.display()));
        }
    }

    /// Remembers a file that was opened.
    pub fn add_recent(&mut self, path: &Path) {
        self.settings.add_recent(path);
        self.save();
    }

    /// The saved view of a name.
    pub fn view(&self, name: &str) -> Option<&SavedView> {
        self.settings.views.iter().find(|view| view.name == name)
    }

    /// Saves a view under a name; one of that name is replaced.
    ///
    /// # Errors
    /// One sentence if the name cannot be kept.
    pub fn save_view(&mut self, name: &str, point: ViewPoint) -> Result<(), String> {
        let name = view_name(name)?;
        let view = SavedView { name: name.clone(), point };
        match self.settings.views.iter_mut().find(|view| view.name == name) {
            Some(old) => *old = view,
            None => self.settings.views.push(view),
        }
        self.save();
        Ok(())
    }

    /// Deletes the saved view of a name.
    pub fn delete_view(&mut self, name: &str) {
        self.settings.views.retain(|view| view.name != name);
        self.save();
    }

    /// The saved views as buttons.
    pub fn view_buttons(&self, ui: &mut Ui) -> Option<ViewRequest> {
        let mut request = None;
        ui.horizontal_wrapped(|ui| {
            for SavedView { name, .. } in &self.settings.views {
                // One piece, so that a name and its cross stay on one line.
                ui.horizontal(|ui| {
                    ui.spacing_mut().item_spacing.x = 0.0;
                    if ui.button(name).clicked() {
                        request = Some(ViewRequest::Show(name.clone()));
                    }
                    let cross = ui.button("×").on_hover_text(format!("Delete the view {name}"));
                    if cross.clicked() {
                        request = Some(ViewRequest::Delete(name.clone()));
                    }
                });
            }
            if ui.button("Save view").on_hover_text("Keep this view under a name (V)").clicked() {
                request = Some(ViewRequest::Save);
            }
        });
        request
    }

    /// Tells something that the user may not see otherwise.
    pub fn note(&mut self, text: impl Into<String>) {
        self.toasts.note(text);
    }

    /// Tells what went wrong, one sentence.
    pub fn error(&mut self, error: &anyhow::Error) {
        self.toasts.error(error);
    }

    /// Shows the messages.
    pub fn show_messages(&mut self, context: &Context) {
        self.toasts.show(context);
    }
}

#[cfg(test)]
impl Session {
    /// Removes all messages.
    pub(crate) fn forget_messages(&mut self) {
        self.toasts = Toasts::default();
    }
}

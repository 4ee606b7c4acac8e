//! The viewer's user interface, without the window around it.
//!
//! [`Viewer`] is its parts and what they do together. What concerns one part alone is a method of that part.

mod commands;
mod controls;
mod files;
mod output;
mod recovery;
mod view;
mod views;

use std::path::PathBuf;
use std::time::Instant;

use egui::{CentralPanel, Frame, Panel, ScrollArea, Ui};
use ghand_render::{Gpu, RenderError};

use crate::viewer::dialogs::Dialogs;
use crate::viewer::document::Document;
use crate::viewer::document::subject::Subject;
use crate::viewer::live::link::LiveLink;
use crate::viewer::output::OutputJob;
use crate::viewer::rendering::picture::Progress;
use crate::viewer::session::Session;
use crate::viewer::session::settings::Settings;
use crate::viewer::stage::Stage;
use crate::viewer::stage::viewport::Viewport;

/// Width of the side panel, points.
const PANEL_WIDTH: f32 = 260.0;

/// The viewer.
pub struct Viewer {
    document: Document,
    stage: Stage,
    session: Session,
    dialogs: Dialogs,
    live: LiveLink,
    /// A picture or film that is being saved.
    output: Option<OutputJob>,
}

impl Viewer {
    /// A viewer of a subject; `source` says where the subject is from.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold the subject.
    pub fn new(gpu: &Gpu, subject: Subject, source: String) -> Result<Viewer, RenderError> {
        Ok(Viewer {
            stage: Stage::new(gpu, &subject)?,
            document: Document::new(subject, source),
            session: Session::default(),
            dialogs: Dialogs::default(),
            live: LiveLink::default(),
            output: None,
        })
    }

    /// The subject.
    pub fn subject_mut(&mut self) -> &mut Subject {
        &mut self.document.subject
    }

    /// Uses these settings; changes are kept in the file, if there is one.
    pub fn use_settings(&mut self, settings: Settings, path: Option<PathBuf>) {
        self.session.use_settings(settings, path);
    }

    /// The settings.
    pub fn settings_mut(&mut self) -> &mut Settings {
        &mut self.session.settings
    }

    /// Keeps the settings for the next start.
    pub fn save_settings(&mut self) {
        self.session.save();
    }

    /// Logs how long after `start` the first picture is done.
    pub fn log_start(&mut self, start: Instant) {
        self.stage.log_start(start);
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        self.stage.gpu()
    }

    /// Where the subject is from.
    pub fn source(&self) -> &str {
        self.document.source()
    }

    /// Waits for files and for the picture. Returns whether all is complete; if not, the user interface must run once more.
    ///
    /// # Errors
    /// [`RenderError`] if the picture could not be rendered.
    pub fn finish(&mut self) -> Result<bool, RenderError> {
        if self.document.is_reading() {
            self.wait_for_files();
            return Ok(false);
        }
        self.gpu().wait()?;
        self.collect();
        self.stage.truth.wait();
        match self.stage.canvas.take_failure() {
            Some(failure) => Err(failure),
            None => Ok(self.stage.canvas.shown().is_some() && !self.stage.is_comparing(self.document.capture())),
        }
    }

    /// Runs the user interface; the picture is drawn through `renderer`.
    pub fn ui(&mut self, ui: &mut Ui, renderer: &mut egui_wgpu::Renderer) {
        let progress = self.collect();
        ui.ctx().set_theme(self.session.settings.theme.preference());
        self.open_files(ui.ctx());
        self.save_chosen(ui.ctx());
        self.run_pressed(ui.ctx());
        self.follow_thumbnails(ui.ctx(), progress);
        if self.session.settings.panel_shown {
            Panel::left("controls").resizable(false).exact_size(PANEL_WIDTH).show(ui, |ui| {
                self.menu_bar(ui);
                ui.separator();
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| self.controls(ui));
            });
        }
        self.follow_key_buttons(ui.ctx());
        self.document.subject.advance(ui.ctx());
        self.advance_live(ui.ctx());
        self.stage.advance_turntable(ui.ctx());
        CentralPanel::default().frame(Frame::NONE).show(ui, |ui| {
            let viewport = Viewport::of(ui, self.session.settings.adaptive);
            self.view(ui, renderer, &viewport, progress);
        });
        self.overlays(ui.ctx());
        if !ui.input(|input| input.pointer.any_down()) && !self.live.drives() {
            self.document.edit_hand(|hand| hand.remember_pose());
        }
    }

    /// Handles a finished picture.
    fn collect(&mut self) -> Progress {
        let progress = self.stage.canvas.collect();
        if progress == Progress::Complete {
            self.live.picture_complete();
        }
        progress
    }
}

#[cfg(test)]
mod tests;

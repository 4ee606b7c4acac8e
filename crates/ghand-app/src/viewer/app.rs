//! The viewer's user interface, without the window around it.

mod camera_controls;
mod commands;
mod controls;
mod files;
mod layers;
mod live;
mod output;
mod recovery;
mod saved_views;
mod saving;
mod truth;
mod view;

use std::path::PathBuf;
use std::time::Instant;

use egui::{CentralPanel, Frame, Panel, ScrollArea, Ui};
use ghand_render::{Gpu, RenderError};

use crate::lighting::Lighting;
use crate::viewer::app::layers::LayerView;
use crate::viewer::app::saving::Saving;
use crate::viewer::app::truth::TruthView;
use crate::viewer::dialogs::command_palette::CommandPalette;
use crate::viewer::dialogs::file_dialog::FileDialog;
use crate::viewer::dialogs::name_dialog::NameDialog;
use crate::viewer::dialogs::output_dialog::OutputDialog;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::document::file_reader::FileReader;
use crate::viewer::document::subject::Subject;
use crate::viewer::document::training_run::TrainingRun;
use crate::viewer::document::watched_file::WatchedFile;
use crate::viewer::hand::handles::HandleDrag;
use crate::viewer::live::{Live, LiveSettings};
use crate::viewer::output::OutputJob;
use crate::viewer::rendering::camera::OrbitCamera;
use crate::viewer::rendering::frame::{Median, PictureInputs};
use crate::viewer::rendering::picture::{Picture, Progress};
use crate::viewer::session::settings::Settings;
use crate::viewer::session::toasts::Toasts;
use crate::viewer::stage::adaptive_detail::AdaptiveDetail;
use crate::viewer::stage::drags::Drags;

/// Longest edge of the picture, pixels, on a graphics card.
const LARGEST_PICTURE: u32 = 2048;
/// The same on a software rasteriser.
const LARGEST_PICTURE_CPU: u32 = 1024;
/// Width of the side panel, points.
const PANEL_WIDTH: f32 = 260.0;
/// Colour behind the subject in the dark and in the light theme.
const DARK_BACKGROUND: [u8; 3] = [30, 32, 36];
const LIGHT_BACKGROUND: [u8; 3] = [222, 225, 229];
/// Step by which the picture's edges shrink while the device cannot hold it, and grow when it can again.
const DETAIL_STEP: f32 = 0.75;
/// Below this scale the viewer gives up.
const LEAST_DETAIL: f32 = 0.1;

/// The state of the viewer.
pub struct Viewer {
    gpu: Gpu,
    subject: Subject,
    source: String,
    picture: Picture,
    camera: OrbitCamera,
    drags: Drags,
    /// Colour behind the subject; `None` for that of the theme.
    background: Option<[u8; 3]>,
    largest_edge: u32,
    /// Edge of the picture as a fraction of the panel's: less than 1 if the device cannot hold so large a close-up.
    detail: f32,
    /// Fewer pixels while the picture changes.
    adaptive: AdaptiveDetail,
    /// What the picture should show, at any size.
    wanted: Option<PictureInputs>,
    /// Part of the edge that the last picture had for being in motion.
    drawn_scale: f32,
    /// Fewest tile intersections that the device could not hold.
    too_many: u32,
    /// What the picture shows, if it is complete or in progress.
    shown: Option<PictureInputs>,
    texture: Option<egui::TextureId>,
    failure: Option<RenderError>,
    measure: bool,
    settings: Settings,
    /// Where the settings are kept; `None` if they are not.
    settings_path: Option<PathBuf>,
    watched: Option<WatchedFile>,
    /// The run of training whose avatar is shown.
    run: Option<TrainingRun>,
    /// The light in which the watched file is read.
    light: Lighting,
    file_dialog: Option<FileDialog>,
    /// Files that are being read.
    files: FileReader,
    /// The dialog that chooses a file to save to, and what is saved there.
    save_dialog: Option<(FileDialog, Saving)>,
    palette: Option<CommandPalette>,
    help_shown: bool,
    /// Asks under which name the view is to be saved.
    naming_view: Option<NameDialog>,
    /// Asks what to save of the view.
    output_dialog: Option<OutputDialog>,
    /// A picture or film that is being saved.
    output: Option<OutputJob>,
    /// Whether the view turns by itself, and when it last did, in the user interface's seconds.
    turntable: bool,
    turntable_time: Option<f64>,
    capture: Option<CapturePanel>,
    truth: TruthView,
    layers: LayerView,
    /// Live poses, while their port is open.
    live: Option<Live>,
    live_settings: LiveSettings,
    toasts: Toasts,
    /// The handle that is dragged.
    handle_drag: Option<HandleDrag>,
    /// When the program was started, until the first picture is done.
    started: Option<Instant>,
    last_frame: Option<Instant>,
    between_frames_ms: Median,
}

impl Viewer {
    /// A viewer of a subject; `source` says where the subject is from.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold the subject.
    pub fn new(gpu: &Gpu, subject: Subject, source: String) -> Result<Viewer, RenderError> {
        let largest_edge = if gpu.is_cpu() { LARGEST_PICTURE_CPU } else { LARGEST_PICTURE };
        let picture = Picture::new(gpu, subject.on_device(gpu, [largest_edge; 2])?)?;
        let camera = subject.first_view();
        Ok(Viewer {
            gpu: gpu.clone(),
            subject,
            source,
            picture,
            camera,
            drags: Drags::default(),
            background: None,
            largest_edge,
            detail: 1.0,
            adaptive: AdaptiveDetail::default(),
            wanted: None,
            drawn_scale: 1.0,
            too_many: u32::MAX,
            shown: None,
            texture: None,
            failure: None,
            measure: false,
            settings: Settings::default(),
            settings_path: None,
            watched: None,
            run: None,
            light: Lighting::default(),
            file_dialog: None,
            files: FileReader::default(),
            save_dialog: None,
            palette: None,
            help_shown: false,
            naming_view: None,
            output_dialog: None,
            output: None,
            turntable: false,
            turntable_time: None,
            capture: None,
            truth: TruthView::default(),
            layers: LayerView::default(),
            live: None,
            live_settings: LiveSettings::default(),
            toasts: Toasts::default(),
            handle_drag: None,
            started: None,
            last_frame: None,
            between_frames_ms: Median::default(),
        })
    }

    /// The subject.
    pub fn subject_mut(&mut self) -> &mut Subject {
        &mut self.subject
    }

    /// Uses these settings; changes are kept in the file, if there is one.
    pub fn use_settings(&mut self, settings: Settings, path: Option<PathBuf>) {
        (self.settings, self.settings_path) = (settings, path);
    }

    /// The settings.
    pub fn settings_mut(&mut self) -> &mut Settings {
        &mut self.settings
    }

    /// Keeps the settings for the next start.
    pub fn save_settings(&mut self) {
        let Some(path) = &self.settings_path else { return };
        if let Err(error) = self.settings.write(path) {
            self.toasts.note(format!("{}: the settings cannot be kept: {error}", path.display()));
        }
    }

    /// Logs how long after `start` the first picture is done.
    pub fn log_start(&mut self, start: Instant) {
        self.started = Some(start);
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Where the subject is from.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// Waits for files and for the picture. Returns whether all is complete; if not, the user interface must run once more.
    ///
    /// # Errors
    /// [`RenderError`] if the picture could not be rendered.
    pub fn finish(&mut self) -> Result<bool, RenderError> {
        if self.files.is_busy() {
            self.wait_for_files();
            return Ok(false);
        }
        self.gpu.wait()?;
        self.collect();
        self.wait_for_truth();
        match self.failure.take() {
            Some(failure) => Err(failure),
            None => Ok(self.shown.is_some() && !self.comparison_is_busy()),
        }
    }

    /// Runs the user interface; the picture is drawn through `renderer`.
    pub fn ui(&mut self, ui: &mut Ui, renderer: &mut egui_wgpu::Renderer) {
        let progress = self.collect();
        ui.ctx().set_theme(self.settings.theme.preference());
        self.open_files(ui.ctx());
        self.save_chosen(ui.ctx());
        self.run_pressed(ui.ctx());
        self.follow_thumbnails(ui.ctx(), progress);
        if self.settings.panel_shown {
            Panel::left("controls").resizable(false).exact_size(PANEL_WIDTH).show(ui, |ui| {
                self.menu_bar(ui);
                ui.separator();
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| self.controls(ui));
            });
        }
        self.follow_key_buttons(ui.ctx());
        self.subject.advance(ui.ctx());
        self.advance_live(ui.ctx());
        self.advance_turntable(ui.ctx());
        CentralPanel::default().frame(Frame::NONE).show(ui, |ui| self.view(ui, renderer, progress));
        self.overlays(ui.ctx());
        if let Subject::Hand(hand) = &mut self.subject
            && !ui.input(|input| input.pointer.any_down())
            && !self.live.as_ref().is_some_and(Live::drives)
        {
            hand.remember_pose();
        }
    }

    /// Handles a finished picture.
    fn collect(&mut self) -> Progress {
        let was_busy = self.picture.is_busy();
        let progress = self.picture.poll(&self.gpu).unwrap_or_else(|e| {
            self.failure.get_or_insert(e);
            Progress::Complete
        });
        let wanted = self.picture.intersections();
        if was_busy && progress == Progress::Complete {
            self.adaptive.took(self.drawn_scale, self.picture.last_ms());
            if let Some(start) = self.started.take() {
                log::info!("the first picture was done {:.2} s after the start", start.elapsed().as_secs_f64());
            }
        }
        if let (Progress::Complete, Some(live)) = (progress, &mut self.live) {
            live.picture_complete();
        }
        match progress {
            Progress::Busy => {}
            Progress::Incomplete => self.shown = None,
            Progress::TooFine if self.detail > LEAST_DETAIL => {
                self.too_many = self.too_many.min(wanted);
                self.detail *= DETAIL_STEP;
                self.shown = None;
            }
            Progress::TooFine => {
                let problem = format!("the view needs {wanted} tile intersections, more than the device can hold");
                self.failure.get_or_insert(RenderError::Invalid(problem));
            }
            // One step less than doubles the number; the rest is a margin against oscillation.
            Progress::Complete if self.detail < 1.0 && wanted < self.too_many / 3 => {
                self.detail = (self.detail / DETAIL_STEP).min(1.0);
            }
            Progress::Complete => {}
        }
        progress
    }
}

#[cfg(test)]
mod tests;

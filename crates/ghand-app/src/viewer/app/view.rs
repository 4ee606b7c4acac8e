//! One frame of the view: the picture of the subject, and what is over it.

use std::time::Duration;

use egui::{Align2, Button, Color32, Context, FontId, Rect, Ui, vec2};
use ghand_motion::live::PacketKind;

use crate::viewer::app::Viewer;
use crate::viewer::live::LiveEvent;
use crate::viewer::live::feed::FeedSettings;
use crate::viewer::rendering::picture::Progress;
use crate::viewer::stage::viewport::Viewport;

/// Interval of checks whether a picture is done.
const SOON: Duration = Duration::from_millis(5);
/// Shown when the user or a motion changes the pose while live poses drive the hand.
const PAUSED: &str = "Live poses are paused, because the pose was changed here. \"Resume\" in the panel follows them.";

impl Viewer {
    /// Shows the picture, and renders it if it is outdated.
    pub(super) fn view(
        &mut self,
        ui: &mut Ui,
        renderer: &mut egui_wgpu::Renderer,
        viewport: &Viewport,
        mut progress: Progress,
    ) {
        let handles_shown = self.session.settings.handles_shown;
        self.stage.navigate(ui, viewport, &mut self.document, handles_shown);
        let inputs = self.stage.inputs(ui, viewport, &self.document);
        if progress == Progress::Busy && self.gpu().is_cpu() && self.stage.canvas.is_outdated(&inputs) {
            // One processor draws the picture and the user interface: drawing the latter twice would only delay the
            // next picture.
            progress = match self.gpu().wait() {
                Ok(()) => self.collect(),
                Err(_) => progress,
            };
        }
        let is_outdated = self.stage.canvas.is_outdated(&inputs);
        if is_outdated && progress != Progress::Busy && self.stage.render(inputs, viewport, &self.document, renderer) {
            self.live.picture_started();
        }
        if is_outdated || progress == Progress::Busy {
            // The counters will show soon whether the picture is complete.
            ui.ctx().request_repaint_after(SOON);
        }
        self.stage.paint(ui, viewport, &mut self.document, &mut self.session);
        drop_hint(ui, viewport.rect);
        if !self.session.settings.panel_shown {
            self.panel_button(ui, viewport.rect);
        }
        self.stage.canvas.paint_failure(ui, viewport.rect);
    }

    /// The button that shows the panel again.
    fn panel_button(&mut self, ui: &mut Ui, rect: Rect) {
        let place = Rect::from_min_size(rect.min + vec2(8.0, 8.0), vec2(52.0, 24.0));
        if ui.put(place, Button::new("Panel")).on_hover_text("Show the panel (N)").clicked() {
            self.session.settings.panel_shown = true;
        }
    }

    /// Has pictures of the named poses made while nothing moves.
    pub(super) fn follow_thumbnails(&mut self, context: &Context, progress: Progress) {
        let settings = &self.session.settings;
        let is_shown = settings.thumbnails_shown && settings.panel_shown;
        let is_busy = self.stage.is_working(progress)
            || self.live.is_receiving()
            || self.document.is_training()
            || context.input(|input| input.pointer.any_down());
        let gpu = self.stage.gpu();
        self.document.edit_hand(|hand| {
            let is_busy = is_busy || hand.is_playing();
            hand.follow_thumbnails(gpu, is_shown, is_busy, context);
        });
    }

    /// Opens the port or webcam for live poses, now and whenever the user starts them again. If that is impossible, a
    /// message says why.
    pub fn start_live(&mut self, settings: FeedSettings) {
        if let Err(error) = self.live.start(settings) {
            self.session.error(&error);
        }
    }

    /// Waits until the webcam has given its first picture.
    ///
    /// # Errors
    /// One sentence that says why there is none, such as when another program uses the camera.
    pub fn wait_for_webcam(&mut self) -> anyhow::Result<()> {
        self.live.wait_for_webcam()
    }

    /// Takes the newest live pose. With the first one of a tracker, the view becomes that of the tracker: its hand may
    /// have any orientation.
    pub(super) fn advance_live(&mut self, context: &Context) {
        match self.live.advance(&mut self.document, context) {
            None | Some(LiveEvent::Begun(PacketKind::Pose)) => {}
            Some(LiveEvent::Begun(_)) => self.stage.look_as_tracker(&self.document.subject),
            Some(LiveEvent::Paused) => self.session.note(PAUSED),
            Some(LiveEvent::Failed(problem)) => self.session.error(&problem),
        }
    }
}

/// Says over the view what dropping files does, while they are held there.
fn drop_hint(ui: &Ui, rect: Rect) {
    if ui.input(|input| input.raw.hovered_files.is_empty()) {
        return;
    }
    ui.painter().rect_filled(rect, 0.0, Color32::from_black_alpha(160));
    let text = "Drop an avatar, hand model, scene, poses, capture or run of training";
    ui.painter().text(rect.center(), Align2::CENTER_CENTER, text, FontId::proportional(20.0), Color32::WHITE);
}

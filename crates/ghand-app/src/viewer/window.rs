//! The window around the user interface.

pub mod slow_frames;

use anyhow::anyhow;
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupExisting};
use egui::ViewportCommand;
use ghand_render::{Gpu, RenderError};

use crate::cli::{self, WITHOUT_WINDOW};
use crate::viewer::app::Viewer;
use crate::viewer::window::slow_frames::keep_clicks_in_slow_frames;

/// Initial size of the window, points.
pub const WINDOW_SIZE: [u32; 2] = [1280, 800];
/// Smallest window in which everything fits, points.
const SMALLEST_WINDOW: [f32; 2] = [480.0, 320.0];

struct Window<'a> {
    viewer: &'a mut Viewer,
    title: String,
    /// Whether the window is about to close because the device is lost.
    closing: bool,
}

impl eframe::App for Window<'_> {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        // The loss was noticed while the window was painted. The surface has an image that will never be shown, and
        // wgpu panics when such a surface is dropped: recovery is not possible here.
        if let Err(lost @ RenderError::Lost(_)) = self.viewer.gpu().check()
            && !self.closing
        {
            cli::end(&lost.into());
        }
        self.remember_window(ui.ctx());
        self.renew_title(ui.ctx());
        if let Some(state) = frame.wgpu_render_state().filter(|_| !self.viewer.is_lost()) {
            self.viewer.ui(ui, &mut state.renderer.write());
        }
        // The loss was noticed before the window was painted. Its painter cannot change the device: the window closes,
        // and another opens with a new device.
        if self.viewer.is_lost() {
            self.closing = true;
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
    }
}

impl Window<'_> {
    /// Names the file that is shown now.
    fn renew_title(&mut self, context: &egui::Context) {
        let title = title(self.viewer);
        if self.title != title {
            context.send_viewport_cmd(ViewportCommand::Title(title.clone()));
            self.title = title;
        }
    }

    fn remember_window(&mut self, context: &egui::Context) {
        let (rect, maximized) = context.input(|input| {
            let viewport = input.viewport();
            (viewport.inner_rect, viewport.maximized.unwrap_or(false))
        });
        let settings = self.viewer.settings_mut();
        settings.maximized = maximized;
        if let Some(rect) = rect.filter(|_| !maximized) {
            settings.window_size = Some(rect.size().into());
        }
    }
}

/// Removes everything to draw once the device is lost, because the painter panics if it cannot allocate memory.
struct DrawNothingOnceLost {
    gpu: Gpu,
}

impl egui::Plugin for DrawNothingOnceLost {
    fn debug_name(&self) -> &'static str {
        "draw nothing once the device is lost"
    }

    fn output_hook(&mut self, _: &egui::Context, output: &mut egui::FullOutput) {
        if self.gpu.is_lost() {
            output.shapes.clear();
        }
    }
}

/// Sets the style of the user interface, in either theme.
pub fn style(context: &egui::Context) {
    context.all_styles_mut(|style| {
        // Ctrl+C copies the pose.
        style.interaction.selectable_labels = false;
        style.spacing.item_spacing = egui::vec2(6.0, 5.0);
    });
}

/// Opens the window and runs until it is closed. If the device is lost, the window opens again with a new one, in the
/// same pose and view; if the window system noticed the loss first, the program ends with an error.
///
/// # Errors
/// An error that says why there is no window and what to do.
pub fn open(viewer: &mut Viewer) -> anyhow::Result<()> {
    viewer.retry_on_device_loss(|viewer| {
        let closed = run(viewer);
        viewer.save_settings();
        closed?;
        Ok(viewer.gpu().check()?)
    })
}

/// The title of the window.
fn title(viewer: &Viewer) -> String {
    format!("ghand - {}", viewer.source())
}

/// Runs until the window is closed or the device is lost.
fn run(viewer: &mut Viewer) -> anyhow::Result<()> {
    let gpu = viewer.gpu().clone();
    gpu.poll()?;
    let instance = gpu.instance.clone().ok_or_else(|| anyhow!("a window needs a device that this program opened"))?;
    let setup = WgpuSetupExisting {
        instance,
        adapter: gpu.adapter.clone(),
        device: gpu.device.clone(),
        queue: gpu.queue.clone(),
    };
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_inner_size(viewer.settings_mut().window_size.unwrap_or(WINDOW_SIZE.map(|v| v as f32)))
            .with_maximized(viewer.settings_mut().maximized)
            .with_min_inner_size(SMALLEST_WINDOW)
            .with_title(title(viewer)),
        wgpu_options: WgpuConfiguration { wgpu_setup: WgpuSetup::Existing(setup), ..Default::default() },
        // The picture is shown as it was rendered.
        dithering: false,
        ..Default::default()
    };
    let create: eframe::AppCreator<'_> = Box::new(|context| {
        style(&context.egui_ctx);
        keep_clicks_in_slow_frames(&context.egui_ctx);
        context.egui_ctx.add_plugin(DrawNothingOnceLost { gpu });
        Ok(Box::new(Window { title: title(viewer), viewer, closing: false }))
    });
    eframe::run_native("ghand", options, create).map_err(|e| {
        // winit's messages begin with a position in its source code.
        let message = e.to_string();
        let cause = message.rsplit(": ").next().unwrap_or(&message);
        anyhow!("the window cannot be opened: {cause}; {WITHOUT_WINDOW}")
    })
}

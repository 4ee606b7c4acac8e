//! The window around the user interface.

use anyhow::{anyhow, bail};
use eframe::egui_wgpu::{WgpuConfiguration, WgpuSetup, WgpuSetupExisting};
use egui::ViewportCommand;
use ghand_render::{Gpu, RenderError};

use crate::cli;
use crate::viewer::app::Viewer;
use crate::viewer::slow_frames::take_clicks_in_slow_frames;

/// Size of the window at first, points.
pub const WINDOW_SIZE: [u32; 2] = [1280, 800];
/// Smallest window in which everything has room, points.
const SMALLEST_WINDOW: [f32; 2] = [480.0, 320.0];
/// What to do without a display.
const REMEDY: &str = "use --screenshot FILE.png, which needs no display";

struct Window<'a> {
    viewer: &'a mut Viewer,
    /// Whether the window is about to close since the device is lost.
    closing: bool,
}

impl eframe::App for Window<'_> {
    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        // The loss showed while the window was painted. The surface is left with an image that will never be shown, and
        // wgpu panics when such a surface is dropped: there is no way back from here.
        if let Err(lost @ RenderError::Lost(_)) = self.viewer.gpu().check()
            && !self.closing
        {
            cli::end(&lost.into());
        }
        if let Some(state) = frame.wgpu_render_state().filter(|_| !self.viewer.is_lost()) {
            self.viewer.ui(ui, &mut state.renderer.write());
        }
        // The loss showed before the window was painted. Its painter has no way to change the device: the window closes,
        // and another opens with a new device.
        if self.viewer.is_lost() {
            self.closing = true;
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
    }
}

/// Leaves nothing to draw once the device is lost: the painter panics where it gets no memory for what it draws.
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

/// Sets how the user interface looks.
pub fn style(context: &egui::Context) {
    context.set_theme(egui::Theme::Dark);
}

/// Fails where there can be no window.
///
/// # Errors
/// One that says so and what to do.
pub fn check_display() -> anyhow::Result<()> {
    let unix = cfg!(all(unix, not(target_vendor = "apple"), not(target_os = "android")));
    let set = |name: &str| std::env::var_os(name).is_some_and(|v| !v.is_empty());
    if unix && !["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"].into_iter().any(set) {
        bail!("there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set); {REMEDY}");
    }
    Ok(())
}

/// Opens the window and runs until it is closed. If the device is lost the window is opened again with a new one, at the
/// same pose and view; where the window system was the first to notice, the program ends with an error.
///
/// # Errors
/// One that says why there is no window and what to do.
pub fn open(viewer: &mut Viewer, title: &str) -> anyhow::Result<()> {
    viewer.persist(|viewer| {
        run(viewer, title)?;
        Ok(viewer.gpu().check()?)
    })
}

/// Runs until the window is closed or the device is lost.
fn run(viewer: &mut Viewer, title: &str) -> anyhow::Result<()> {
    let gpu = viewer.gpu().clone();
    gpu.poll()?;
    let setup = WgpuSetupExisting {
        instance: gpu.instance.clone(),
        adapter: gpu.adapter.clone(),
        device: gpu.device.clone(),
        queue: gpu.queue.clone(),
    };
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_inner_size(WINDOW_SIZE.map(|v| v as f32))
            .with_min_inner_size(SMALLEST_WINDOW)
            .with_title(title),
        wgpu_options: WgpuConfiguration { wgpu_setup: WgpuSetup::Existing(setup), ..Default::default() },
        // The picture is shown as it was rendered.
        dithering: false,
        ..Default::default()
    };
    let create: eframe::AppCreator<'_> = Box::new(|context| {
        style(&context.egui_ctx);
        take_clicks_in_slow_frames(&context.egui_ctx);
        context.egui_ctx.add_plugin(DrawNothingOnceLost { gpu });
        Ok(Box::new(Window { viewer, closing: false }))
    });
    eframe::run_native("ghand", options, create).map_err(|e| {
        // winit's messages begin with the place in its source.
        let message = e.to_string();
        let cause = message.rsplit(": ").next().unwrap_or(&message);
        anyhow!("the window cannot be opened: {cause}; {REMEDY}")
    })
}

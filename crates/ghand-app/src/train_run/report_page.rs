//! `report.html`: a run on one page, without any other file.

use std::path::Path;

use anyhow::Context;
use ghand_files::atomic_file::write_atomically;
use ghand_measure::evaluation::SimilarityMetrics;
use ghand_train::trainer::simplification::Simplification;
use ghand_train::{CurvePoint, TrainSettings};
use image::RgbImage;
use maud::{Markup, PreEscaped, html};

use super::live_files::line_plots;
use super::metrics::Metrics;
use crate::html_page::{data_url, html_page};

/// What the page shows.
pub struct Page<'a> {
    /// Where the capture is.
    pub capture: &'a Path,
    /// The command that made the run.
    pub command: &'a str,
    /// The settings.
    pub settings: &'a TrainSettings,
    /// The figures.
    pub metrics: &'a Metrics,
    /// The loss over the run.
    pub curve: &'a [CurvePoint],
    /// Pictures with their captions.
    pub pictures: Vec<(&'static str, &'a RgbImage)>,
}

/// Writes the page.
///
/// # Errors
/// An error that names the file if it cannot be written, or the plot that cannot be drawn.
pub fn write_report_page(path: &Path, page: &Page) -> anyhow::Result<()> {
    let text = page.markup()?.into_string();
    write_atomically(path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
}

impl Page<'_> {
    fn markup(&self) -> anyhow::Result<Markup> {
        let plots: Vec<String> = line_plots(self.curve).iter().map(|plot| plot.to_svg()).collect::<Result<_, _>>()?;
        let pictures: Vec<(&str, String)> = self
            .pictures
            .iter()
            .map(|(caption, picture)| Ok((*caption, data_url(picture)?)))
            .collect::<anyhow::Result<_>>()?;
        let m = self.metrics;
        let name = self.capture.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let changed = self.changed();
        let body = html! {
            h1 { "Avatar of " (name) }
            p {
                (m.gaussians) " Gaussians, model " code { (word(&m.model)) } ", components " code { (word(&m.components)) }
                "; " (m.iterations) " iterations in " (format!("{:.0} s", m.seconds))
                @if m.stopped_early { " (stopped early)" }
                @if m.skipped_steps > 0 { ", of which " (m.skipped_steps) " were skipped: a gradient was not finite" }
                "."
            }
            @if let Some(images) = &m.images {
                h2 { "Images that training did not see" }
                p { (images.frames) " images of the split " code { (images.split) } ", " (images.protocol.description()) "." }
                table {
                    tr { th { "" } th { "PSNR, dB" } th { "in the hand's square, dB" } th { "on the hand, dB" } th { "SSIM" } }
                    (row("floor: the textured template", &images.baseline))
                    (row("avatar", &images.avatar))
                    @if let Some(given) = &m.given { (row(&format!("avatar, {}", given.protocol.description()), &given.avatar)) }
                }
            }
            @if let Some(simplification) = &m.simplification { (simplification_table(simplification)) }
            h2 { "Training" }
            div.plots { @for plot in &plots { (PreEscaped(plot)) } }
            @if let Some(error) = &m.pose_error_deg {
                p { (format!("Pose error {:.2} degrees before, {:.2} after.", error.before, error.after)) }
            }
            @for (caption, picture) in &pictures {
                figure { img src=(picture) alt=(caption); figcaption { (caption) } }
            }
            h2 { "How it was made" }
            pre { (self.command) }
            p { "Capture: " code { (self.capture.display().to_string()) } "; preset " code { (m.preset) } "; ghand " (env!("CARGO_PKG_VERSION")) "." }
            @if changed.is_empty() { p { "All settings are the defaults." } } @else {
                p { "Settings other than the defaults:" }
                table {
                    tr { th { "setting" } th { "value" } th { "default" } }
                    @for [key, value, default] in &changed { tr { td { code { (key) } } td { (value) } td { (default) } } }
                }
            }
            details { summary { "All settings" } pre { (self.settings.to_toml()) } }
        };
        Ok(html_page(&format!("ghand: {name}"), &body))
    }

    /// Settings that are not the defaults, with these.
    fn changed(&self) -> Vec<[String; 3]> {
        let lines = |settings: &TrainSettings| settings.to_toml().lines().map(str::to_owned).collect::<Vec<_>>();
        let split = |line: &str| line.split_once(" = ").map(|(key, value)| [key.to_owned(), value.to_owned()]);
        let pairs = lines(self.settings).into_iter().zip(lines(&TrainSettings::default()));
        let different = pairs.filter(|(here, default)| here != default);
        different
            .filter_map(|(here, default)| {
                let [key, value] = split(&here)?;
                let [_, default] = split(&default)?;
                Some([key, value, default])
            })
            .collect()
    }
}

fn word(value: &impl serde::Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

fn row(name: &str, m: &SimilarityMetrics) -> Markup {
    html! {
        tr {
            td { (name) }
            td { (format!("{:.2}", m.psnr)) }
            td { (m.psnr_square.map_or("-".into(), |psnr| format!("{psnr:.2}"))) }
            td { (format!("{:.2}", m.psnr_hand)) }
            td { (format!("{:.4}", m.ssim)) }
        }
    }
}

/// What short trainings showed of how simple the avatar may be.
fn simplification_table(found: &Simplification) -> Markup {
    html! {
        h2 { "What the images require" }
        p {
            "Trials of " (found.iterations) " iterations that held out " (found.frames_left_out) " frames, judged by "
            (found.images) " images of these. The avatar has what is printed in bold; the first line is as set."
        }
        table {
            tr { th { "other than the settings" } th { "Gaussians" } th { "PSNR, dB" } th { "ms an iteration" } th { "MB" } }
            @for (k, trial) in found.trials.iter().enumerate() {
                @let changes = if trial.changes.is_empty() { "nothing".to_owned() } else { trial.changes.join(", ") };
                tr {
                    td { @if k == found.taken { strong { (changes) } } @else { (changes) } }
                    td { (trial.gaussians) }
                    td { (format!("{:.2}", trial.psnr)) }
                    td { (format!("{:.1}", trial.iteration_ms)) }
                    td { (format!("{:.1}", trial.bytes as f64 / 1e6)) }
                }
            }
        }
        @if found.never_shown > 0 {
            p { (found.never_shown) " of its Gaussians were removed in the end: no image or other view of the hand shows them." }
        }
    }
}

//! The files of `ghand-lab tradeoff`.

use std::path::Path;

use anyhow::{Context, bail};
use ghand_files::atomic_file::write_atomically;
use ghand_pictures::plot::{Point, ScatterPlot};
use ghand_pictures::write_png;
use ghand_render::Gpu;
use serde::Serialize;

use super::TradeoffArgs;
use super::measure::Measured;
use super::variants::KNOBS;

/// Room that a name takes in the plot: dB, and times its place.
const NAME_HEIGHT: f64 = 0.12;
const NAME_WIDTH: f64 = 1.4;

const FILES: [&str; 3] = ["tradeoff.md", "tradeoff.json", "tradeoff.png"];

/// Contents of `tradeoff.json`.
#[derive(Debug, Serialize)]
pub struct TradeoffReport {
    adapter: String,
    capture: String,
    split: String,
    /// Images compared, and rounds of timing.
    images: usize,
    rounds: u32,
    /// The fastest first.
    variants: Vec<Measured>,
}

/// Makes the folder, unless it has files of an earlier run that may not be replaced.
///
/// # Errors
/// An error that names the folder.
pub fn check_folder(folder: &Path, force: bool) -> anyhow::Result<()> {
    if !force && FILES.iter().any(|file| folder.join(file).exists()) {
        bail!("--out {}: has the files of an earlier run; give another folder, or --force", folder.display());
    }
    Ok(())
}

impl TradeoffReport {
    pub fn new(
        gpu: &Gpu,
        capture: &Path,
        args: &TradeoffArgs,
        images: usize,
        mut variants: Vec<Measured>,
    ) -> TradeoffReport {
        variants.sort_by(|a, b| a.relative.total_cmp(&b.relative));
        let name = capture.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        TradeoffReport {
            adapter: gpu.info.name.clone(),
            capture: name,
            split: args.split.clone(),
            images,
            rounds: args.rounds,
            variants,
        }
    }

    /// A Markdown table, the fastest first.
    pub fn table(&self) -> String {
        let mut text =
            "| | variant | ms a frame | relative | PSNR, dB | on the hand, dB | SSIM | MB | on the device, MB | Gaussians |\n\
                        |---|---|---|---|---|---|---|---|---|---|\n"
                .to_owned();
        for m in &self.variants {
            let [low, high] = m.frame_ms_range;
            text += &format!(
                "| {} | {} | {:.1} ({low:.1} to {high:.1}) | {:.2} | {:.2} | {:.2} | {:.4} | {:.2} | {} | {} |\n",
                if m.best { "*" } else { "" },
                m.name,
                m.frame_ms,
                m.relative,
                m.psnr,
                m.psnr_hand,
                m.ssim,
                m.bytes as f64 * 1e-6,
                m.device_bytes.map_or("-".into(), |bytes| format!("{:.1}", bytes as f64 * 1e-6)),
                m.gaussians
            );
        }
        text
    }

    fn page(&self) -> String {
        format!(
            "# Speed and accuracy\n\nCapture `{}`, split `{}`, {} images; {}. A frame is the time from a pose to the picture on \
             the device, the median over {} rounds in which all variants have their turn, with their quartiles; relative is \
             the median of the rounds' ratios to the exact avatar. PSNR and SSIM are over the hand's surroundings. No \
             other variant is faster and as accurate, or as fast and more accurate, than those with a star.\n\n![Speed and accuracy](tradeoff.png)\n\n{}",
            self.capture,
            self.split,
            self.images,
            self.adapter,
            self.rounds,
            self.table()
        )
    }

    fn plot(&self) -> ScatterPlot {
        let mut named: Vec<&Measured> = vec![];
        let mut points = vec![];
        for m in &self.variants {
            // Of those that lie side by side only the fastest: names would hide each other, and those that matter.
            let beside = |other: &&Measured| {
                (other.psnr - m.psnr).abs() < NAME_HEIGHT && m.frame_ms < NAME_WIDTH * other.frame_ms
            };
            let is_named = (m.best || m.knob == KNOBS[0]) && !named.iter().any(beside);
            if is_named {
                named.push(m);
            }
            points.push(Point {
                name: if is_named { m.name.clone() } else { String::new() },
                group: KNOBS.iter().position(|knob| *knob == m.knob).unwrap_or(0),
                at: [m.frame_ms, m.psnr],
                across: m.frame_ms_range,
                best: m.best,
            });
        }
        ScatterPlot {
            title: format!("Speed and accuracy, {}, {}", self.capture, self.adapter),
            axes: ["ms a frame".into(), "PSNR, dB".into()],
            groups: KNOBS.map(str::to_owned).to_vec(),
            points,
        }
    }

    /// Writes all files.
    ///
    /// # Errors
    /// An error that names the file.
    pub fn write(&self, folder: &Path) -> anyhow::Result<()> {
        let texts = [self.page(), serde_json::to_string_pretty(self)?];
        for (name, text) in FILES.iter().zip(texts) {
            let path = folder.join(name);
            write_atomically(&path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))?;
        }
        Ok(write_png(&folder.join("tradeoff.png"), &self.plot().to_image()?)?)
    }
}

//! `import.html`: an import on one page, without any other file.

use std::path::Path;

use anyhow::Context;
use ghand_files::atomic_file::write_atomically;
use ghand_import::Imported;
use ghand_import::track::Track;
use image::RgbImage;
use maud::{Markup, html};

use super::summary::{camera_rows, clock_rows, frame_sentences};
use crate::html_page::{data_url, html_page};

/// Width and height of a camera's line of time, and its parts' colours.
const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 22.0;
const FOUND: &str = "#5a9";
const SHARP: &str = "#2b6";
const CHOSEN: &str = "#e83";
/// Frames at least this sharp, relative to the sharpest tenth, count as sharp.
const SHARP_PART: f64 = 0.7;

/// What the page shows beside the import itself.
pub struct Page<'a> {
    /// The import.
    pub imported: &'a Imported,
    /// The command that made it.
    pub command: &'a str,
    /// What the user should know, one sentence each.
    pub notes: &'a [String],
    /// Some images with the hand model over them.
    pub sheet: Option<RgbImage>,
}

/// Writes the page.
///
/// # Errors
/// If it cannot be written.
pub fn write_page(path: &Path, page: &Page) -> anyhow::Result<()> {
    let text = page.markup()?.into_string();
    write_atomically(path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))
}

impl Page<'_> {
    fn markup(&self) -> anyhow::Result<Markup> {
        let imported = self.imported;
        let sheet = self.sheet.as_ref().map(data_url).transpose()?;
        let name =
            imported.capture.root.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let body = html! {
            h1 { "Import of " (name) }
            pre { (self.command) }
            @if !self.notes.is_empty() {
                h2 { "What you should know" }
                ul { @for note in self.notes { li { (note) } } }
            }
            h2 { "Cameras" }
            (table(&["camera", "images", "hand found", "focal length, px", "angle of view", "from the first one", "landmarks off the hand, px"], &camera_rows(imported)))
            @if imported.tracks.len() > 1 {
                h2 { "Clocks" }
                (table(&["camera", "later than the first one", "in frames", "agreement of the movements"], &clock_rows(imported)))
            }
            h2 { "Frames" }
            @for sentence in frame_sentences(imported) { p { (sentence) } }
            div.plots { @for (k, track) in imported.tracks.iter().enumerate() { (self.timeline(k, track)) } }
            p {
                span style=(format!("color:{FOUND}")) { "■" } " the hand is found  "
                span style=(format!("color:{SHARP}")) { "■" } " and sharp  "
                span style=(format!("color:{CHOSEN}")) { "■" } " chosen"
            }
            @if let Some(sheet) = sheet {
                h2 { "The hand in some of them" }
                figure {
                    img src=(sheet) alt="images of the capture with the hand model over them";
                    figcaption { "Each image, and the hand model over it in the pose that was found; training refines poses, proportions and masks." }
                }
            }
            h2 { "To change something" }
            p {
                "Run the command again with other options; what was tracked is kept. "
                code { "--cameras" } " gives a calibration, " code { "--board" } " a board in the footage, " code { "--hand-length" } " the unit of length, "
                code { "--side" } " the other hand, " code { "--frames" } " their number."
            }
        };
        Ok(html_page(&format!("ghand import: {name}"), &body))
    }

    fn timeline(&self, camera: usize, track: &Track) -> Markup {
        let imported = self.imported;
        let sharp = ghand_import::candidates::sharp_tenth(track);
        let count = track.sightings.len().max(1) as f64;
        let width = WIDTH / count;
        let chosen: Vec<usize> = (imported.choice.train.iter().chain(&imported.choice.test))
            .filter_map(|k| imported.image_of(imported.candidates[*k].0, camera))
            .collect();
        let bar = |k: usize, color: &str, top: f64| {
            html! { rect x=(format!("{:.2}", k as f64 * width)) y=(top) width=(format!("{:.2}", width.max(0.5))) height=(HEIGHT - top) fill=(color) {} }
        };
        html! {
            figure {
                figcaption { (imported.sources[camera].id) }
                svg viewBox=(format!("0 0 {WIDTH} {HEIGHT}")) role="img" aria-label="frames of this camera over time" {
                    rect x="0" y="0" width=(WIDTH) height=(HEIGHT) fill="#ddd" {}
                    @for (k, sighting) in track.sightings.iter().enumerate() {
                        @if let Some(sighting) = sighting {
                            (bar(k, if sighting.sharpness >= SHARP_PART * sharp { SHARP } else { FOUND }, 8.0))
                        }
                    }
                    @for k in chosen { (bar(k, CHOSEN, 0.0)) }
                }
            }
        }
    }
}

fn table(head: &[&str], rows: &[Vec<String>]) -> Markup {
    html! {
        table {
            tr { @for title in head { th { (title) } } }
            @for row in rows { tr { @for cell in row { td { (cell) } } } }
        }
    }
}

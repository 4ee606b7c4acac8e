//! `import.html`: an import on one page, without any other file and without scripts.

use anyhow::Context;
use ghand_capture::Capture;
use ghand_files::atomic_file::write_atomically;
use image::RgbImage;
use maud::{Markup, html};

use super::decisions::Decision;
use super::pictures::Pictures;
use super::summary::CameraSummary;
use super::timeline::{Timeline, timelines};
use super::{plan, timeline, turntable};
use crate::html_page::{data_url, html_page_with};
use crate::say;

/// The page, in the folder of the import.
const PAGE: &str = "import.html";

const STYLE: &str = "
pre { white-space: pre-wrap; overflow-wrap: anywhere; } li { overflow-wrap: anywhere; }
.table { overflow-x: auto; } .decisions td { text-align: left; } .decisions th { text-align: left; }
td code, .cameras td { white-space: nowrap; } .cameras td:nth-child(2) { white-space: normal; min-width: 6rem; }
.cameras th, .cameras td { padding: .3rem .7rem; } .turntable figcaption, .plan figcaption { margin-top: .4rem; }
.rig { display: flex; flex-wrap: wrap; gap: 1.5rem; } .rig figure { margin: 1.5rem 0 0; } .rig .plan { flex: 1 1 26rem; }
.rig .turntable { flex: 0 1 260px; }
";

/// What an import found.
#[derive(Debug, Clone)]
pub struct Found {
    /// What it decided.
    pub decisions: Vec<Decision>,
    /// The cameras, in the capture's order.
    pub cameras: Vec<CameraSummary>,
    /// What is told of the frames.
    pub sentences: Vec<String>,
    /// The cameras over time; empty for data sets.
    pub timelines: Vec<Timeline>,
    /// What the user should know, one sentence each.
    pub notes: Vec<String>,
}

/// Writes the page of an import, and says where it is.
///
/// # Errors
/// If it cannot be written.
pub fn write_page(capture: &Capture, found: &Found, pictures: &Pictures) -> anyhow::Result<()> {
    let path = capture.root.join(PAGE);
    let command: Vec<String> = std::env::args().collect();
    let text = markup(capture, &command.join(" "), found, pictures)?.into_string();
    write_atomically(&path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))?;
    say!("page: {}", path.display());
    Ok(())
}

fn markup(capture: &Capture, command: &str, found: &Found, pictures: &Pictures) -> anyhow::Result<Markup> {
    let Found { decisions, cameras, sentences, timelines: lines, notes } = found;
    let name = capture.root.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let body = html! {
        h1 { "Import of " (name) }
        pre { (command) }
        @if !notes.is_empty() {
            h2 { "What you should know" }
            ul { @for note in notes { li { (note) } } }
        }
        h2 { "What was decided" }
        (decision_table(decisions))
        p { "Options decide otherwise: run the command again with them. What was tracked of videos is kept." }
        h2 { "Cameras and hand" }
        (camera_table(cameras))
        div.rig {
            (plan::plan(capture, pictures.frame))
            (turntable(capture, pictures)?)
        }
        @if !lines.is_empty() {
            h2 { "Frames" }
            @for sentence in sentences { p { (sentence) } }
            (timelines(lines))
        }
        h2 { "The hand in some images" }
        (sheet(&pictures.sheet)?)
    };
    let style = [STYLE, plan::STYLE, timeline::STYLE, &turntable::style()].concat();
    Ok(html_page_with(&style, &format!("ghand import: {name}"), &body))
}

fn decision_table(decisions: &[Decision]) -> Markup {
    html! {
        div.table {
            table.decisions {
                tr { th { "of" } th { "decided" } th { "because" } th { "option" } }
                @for Decision { subject, choice, grounds, option } in decisions {
                    tr {
                        td { (subject) }
                        td { (choice) }
                        td { (grounds) }
                        td { @for (k, option) in option.split_terminator(", ").enumerate() { @if k > 0 { ", " } code { (option) } } }
                    }
                }
            }
        }
    }
}

fn camera_table(cameras: &[CameraSummary]) -> Markup {
    let are_several = cameras.len() > 1;
    let has_error = cameras.iter().any(|camera| camera.error.is_some());
    html! {
        div.table {
            table.cameras {
                tr {
                    th { "camera" } th { "images" } th { "with the hand" } th { "focal length" } th { "to the hand" }
                    @if are_several { th { "to the first camera" } th { "angle to it at the hand" } }
                    @if has_error { th { "landmarks off the fitted hand" } }
                }
                @for camera in cameras {
                    tr {
                        td { (camera.id) }
                        td { (camera.images) }
                        td { (camera.found) }
                        td { (camera.focal) }
                        td { (camera.to_hand) }
                        @if are_several { td { (camera.to_first) } td { (camera.angle) } }
                        @if has_error { td { (camera.error.as_deref().unwrap_or("-")) } }
                    }
                }
            }
        }
    }
}

fn turntable(capture: &Capture, pictures: &Pictures) -> anyhow::Result<Markup> {
    let id = capture.frames.get(pictures.frame).map_or("", |frame| &frame.id);
    match &pictures.strip {
        Ok(strip) => turntable::turntable(strip, id),
        Err(problem) => Ok(html! { p { "The hand of frame " (id) " cannot be drawn: " (problem) } }),
    }
}

fn sheet(sheet: &Result<RgbImage, String>) -> anyhow::Result<Markup> {
    Ok(match sheet {
        Ok(sheet) => html! {
            figure.sheet {
                img src=(data_url(sheet)?) alt="images of the capture with the hand model over them";
                figcaption { "Each image, and the hand model over it in the pose that was found; training refines poses, proportions and masks." }
            }
        },
        Err(problem) => html! { p { "There are no pictures: " (problem) } },
    })
}
#[cfg(test)]
mod tests;

//! Describes a capture.

use std::path::Path;

use ghand_capture::capture::{Capture, HandModelSource};
use ghand_capture::inspection::{CaptureInspection, Severity, SplitFacts, Spread, ViewFit};
use ghand_capture::{Opened, capture};
use ghand_fit::alignment::results::review::Review;

use super::contact_sheet::SheetView;

/// Most cameras with a line each; more are summarised.
const MOST_CAMERAS: usize = 32;
/// Most broken files that are named; further ones are counted.
const MOST_FILES: usize = 5;

/// The description of a capture with its oddities, and a numbered list of the views on its sheet.
pub fn describe(
    path: &Path,
    opened: &Opened,
    found: &CaptureInspection,
    reviewed: Option<&Review>,
    views: &[SheetView],
) -> String {
    let capture = &opened.capture;
    let mut lines = vec![format!("{}: {}, {} hand", path.display(), opened.kind, capture.side)];
    let mut rows = |name: &str, texts: Vec<String>| {
        for (i, text) in texts.into_iter().enumerate() {
            lines.push(format!("  {:<12} {text}", if i == 0 { name } else { "" }).trim_end().to_owned());
        }
    };
    rows("hand model", vec![hand_model(capture)]);
    rows("frames", vec![frames(capture, found)]);
    rows("cameras", cameras(capture, found));
    rows("splits", splits(found));
    rows("sizes", sizes(found));
    rows("files", files(opened, found));
    rows("masks", coverage(found));
    rows("template", fits(found));
    let unusual = reviewed.map(Review::sentences).unwrap_or_default();
    rows("fitted", reviewed.map(fitted).into_iter().collect());
    if opened.warnings.is_empty() && found.findings.is_empty() && unusual.is_empty() {
        rows("warnings", vec!["none".into()]);
    }
    for sentence in unusual {
        rows("warning", vec![sentence]);
    }
    for warning in &opened.warnings {
        rows("warning", vec![warning.clone()]);
    }
    for finding in &found.findings {
        let name = match finding.severity {
            Severity::Pointless => "problem",
            Severity::Odd => "warning",
        };
        rows(name, vec![finding.to_string()]);
    }
    if !views.is_empty() {
        lines.push(String::new());
        lines.extend(view_table(capture, views));
    }
    lines.join("\n") + "\n"
}

/// How the template fits the masks once size and poses are free.
fn fitted(review: &Review) -> String {
    let [given, found] = review.fit;
    format!(
        "to the masks of {} frames of train: contours {:.1} px off, {:.1} px as given; overlap {:.2}, {:.2} as given; {:.0} % of \
         the template's size",
        review.frames,
        found.contours[0],
        given.contours[0],
        found.overlap,
        given.overlap,
        100.0 * review.size
    )
}

fn hand_model(capture: &Capture) -> String {
    let model = &capture.hand_model;
    let source = match &capture.hand_model_source {
        HandModelSource::Gltf { path } => format!("{path} (glTF)"),
        HandModelSource::Builtin => "the built-in hand".into(),
        HandModelSource::Mano => format!("{} (MANO)", model.name),
    };
    let correctives = if model.pose_directions.is_empty() { "no" } else { "with" };
    format!(
        "{source}, {} joints, {} vertices, {} shape directions, {correctives} pose correctives",
        model.joint_count(),
        model.vertices.len(),
        model.shape_count()
    )
}

fn frames(capture: &Capture, found: &CaptureInspection) -> String {
    let truth = match found.frames_with_truth {
        0 => "true poses: none".into(),
        all if all == capture.frames.len() => "true poses: all".into(),
        some => format!("true poses: {some}"),
    };
    format!("{}; {truth}", capture.frames.len())
}

fn cameras(capture: &Capture, found: &CaptureInspection) -> Vec<String> {
    let both = || capture.cameras.iter().zip(&found.cameras);
    let range = |values: &mut dyn Iterator<Item = f64>, digits: usize| {
        Spread::of(values).map_or("-".into(), |s| format!("{:.digits$} to {:.digits$}", s.min, s.max))
    };
    let count = capture.cameras.len();
    let mut lines = vec![format!("{count}, {} m from the hand", range(&mut both().map(|(_, f)| f.distance), 2))];
    if count > MOST_CAMERAS {
        lines.push(format!("focal lengths {} px", range(&mut both().flat_map(|(c, _)| c.focal.to_array()), 1)));
        lines.push(format!("{} images each", range(&mut both().map(|(_, f)| f.images as f64), 0)));
        return lines;
    }
    let width = capture.cameras.iter().map(|c| c.id.chars().count()).max().unwrap_or(0);
    lines.extend(both().map(|(camera, facts)| {
        format!(
            "{:<width$}  {} x {}  focal {:.1}, {:.1} px  {:.3} m  {} images",
            camera.id, camera.width, camera.height, camera.focal.x, camera.focal.y, facts.distance, facts.images
        )
    }));
    lines
}

fn splits(found: &CaptureInspection) -> Vec<String> {
    let line = |split: &SplitFacts| {
        format!("{}: {} cameras x {} frames: {} images", split.name, split.cameras, split.frames, split.images)
    };
    found.splits.iter().map(line).collect()
}

fn sizes(found: &CaptureInspection) -> Vec<String> {
    let line = |(size, count): (&[u32; 2], &usize)| format!("{} x {} pixels: {count} images", size[0], size[1]);
    found.files.sizes.iter().map(line).collect()
}

fn files(opened: &Opened, found: &CaptureInspection) -> Vec<String> {
    let files = &found.files;
    let state = match files.missing + files.broken {
        0 => "all present, with their cameras' sizes".into(),
        _ => format!("{} missing, {} broken", files.missing, files.broken),
    };
    let mut lines = vec![format!("{}, images and masks of {} views: {state}", files.files, files.images)];
    lines.extend(files.problems.iter().take(MOST_FILES).map(|problem| problem.reason.clone()));
    let more = (files.missing + files.broken).saturating_sub(MOST_FILES);
    if more > 0 {
        lines.push(format!("and {more} more"));
    }
    if opened.skipped_images.total() > 0 {
        lines.push(opened.skipped_images.to_string());
    }
    let decoded = |split: &SplitFacts| format!("{} {} of {}", split.name, split.views.len(), split.images);
    let samples: Vec<String> = found.splits.iter().map(decoded).collect();
    lines.push(format!("decoded for the checks below: {}", samples.join(", ")));
    lines
}

fn coverage(found: &CaptureInspection) -> Vec<String> {
    let line = |split: &SplitFacts| {
        let text = split.coverage().map_or("none".into(), |s| {
            format!("{:.1}% of the image, {:.1}% to {:.1}%", 100.0 * s.mean, 100.0 * s.min, 100.0 * s.max)
        });
        format!("{}: {text}", split.name)
    };
    found.splits.iter().map(line).collect()
}

fn fits(found: &CaptureInspection) -> Vec<String> {
    let mut lines = vec!["mean IoU of the posed hand model with the masks".to_owned()];
    lines.extend(found.splits.iter().map(|split| {
        let truth = split.iou_true().map_or(String::new(), |s| format!(", true poses {:.3}", s.mean));
        let given = split.iou_given().map_or("-".into(), |s| format!("{:.3} ({:.3} to {:.3})", s.mean, s.min, s.max));
        format!("{}: given poses {given}{truth}", split.name)
    }));
    lines
}

fn view_table(capture: &Capture, views: &[SheetView]) -> Vec<String> {
    let head = ["view", "split", "camera", "frame", "given", "true"].map(String::from);
    let value = |iou: Option<f64>| iou.map_or("-".into(), |iou| format!("{iou:.3}"));
    let cells = |(number, view): (usize, &SheetView)| {
        let ViewFit { camera, frame, iou_given, iou_true, .. } = view.fit;
        let camera = capture.cameras.get(camera).map_or(String::new(), |camera| camera.id.clone());
        let frame = capture.frames.get(frame).map_or(String::new(), |frame: &capture::Frame| frame.id.clone());
        [number.to_string(), view.split.clone(), camera, frame, value(iou_given), value(iou_true)]
    };
    let table: Vec<[String; 6]> = std::iter::once(head).chain((1..).zip(views).map(cells)).collect();
    let width = |column: usize| table.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths = [0, 1, 2, 3, 4, 5].map(width);
    let line = |row: &[String; 6]| {
        let cells: Vec<String> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
        format!("  {}", cells.join("  ")).trim_end().to_owned()
    };
    table.iter().map(line).collect()
}

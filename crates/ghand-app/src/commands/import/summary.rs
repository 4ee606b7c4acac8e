//! An import in numbers, for the terminal and the page.

use ghand_capture::Capture;
use ghand_core::Camera;
use ghand_import::Imported;
use ghand_import::track::Track;

use super::plan::{mean, wrists};

/// What is told of a camera.
#[derive(Debug, Clone)]
pub struct CameraSummary {
    /// Its name.
    pub id: String,
    /// Size of its images, and how many there are in a second.
    pub images: String,
    /// In how many of them the hand is.
    pub found: String,
    /// Focal length, and angle of view.
    pub focal: String,
    /// Distance from the hand.
    pub to_hand: String,
    /// Distance from the first camera.
    pub to_first: String,
    /// Angle at the hand to the first camera.
    pub angle: String,
    /// How far landmarks are off the hand, if there are any.
    pub error: Option<String>,
}

impl CameraSummary {
    /// Where a camera of a capture is, and how it sees.
    pub fn of(capture: &Capture, camera: &Camera) -> CameraSummary {
        let hand = mean(&wrists(capture));
        let first = capture.cameras.first().unwrap_or(camera);
        let from = |camera: &Camera| camera.center() - hand;
        let angle = from(first).angle_between(from(camera)).to_degrees();
        let wide = 2.0 * (0.5 * f64::from(camera.width) / camera.focal.x).atan();
        CameraSummary {
            id: camera.id.clone(),
            images: format!("{} × {}", camera.width, camera.height),
            found: String::new(),
            focal: format!("{:.0} px, {:.0}° wide", camera.focal.x, wide.to_degrees()),
            to_hand: format!("{:.2} m", from(camera).length()),
            to_first: format!("{:.2} m", camera.center().distance(first.center())),
            angle: format!("{:.0}°", if angle.is_finite() { angle } else { 0.0 }),
            error: None,
        }
    }
}

/// Those of an import of videos.
pub fn cameras(imported: &Imported) -> Vec<CameraSummary> {
    let summary = |(camera, track): (&Camera, &Track)| {
        let error = imported.fit.cameras.iter().find(|(id, _)| *id == camera.id);
        CameraSummary {
            images: format!("{} × {}, {:.2} per second", camera.width, camera.height, track.rate()),
            found: format!("{} of {}", track.found(), track.sightings.len()),
            error: error.map(|(_, distances)| format!("{:.1} px", distances.median)),
            ..CameraSummary::of(&imported.capture, camera)
        }
    };
    imported.capture.cameras.iter().zip(&imported.tracks).map(summary).collect()
}

/// One row for each camera but the first: name, seconds, frames, agreement.
pub fn clock_rows(imported: &Imported) -> Vec<[String; 4]> {
    let solved = &imported.solved;
    let row = |k: usize| {
        let seconds = solved.rig.offsets[k];
        [
            imported.sources[k].id.clone(),
            format!("{seconds:+.4} s"),
            format!("{:+.2}", seconds * imported.tracks[k].rate()),
            solved.clocks[k].map_or("too little to tell".into(), |clock| format!("{:.2}", clock.agreement)),
        ]
    };
    (1..imported.sources.len()).map(row).collect()
}

/// What was chosen, and what could not be.
pub fn frame_sentences(imported: &Imported) -> Vec<String> {
    let choice = &imported.choice;
    let count = |split: &str| imported.capture.splits.get(split).map_or(0, |split| split.frames.len());
    let mut sentences = vec![format!(
        "{} frames to train with and {} held out are chosen of {} with a pose: sharp ones that differ most",
        count("train"),
        count("test"),
        imported.candidates.len()
    )];
    let rejected: Vec<String> = choice.rejected.iter().map(|(reason, n)| format!("{reason} ({n})")).collect();
    if !rejected.is_empty() {
        sentences.push(format!("frames that could not be: {}", rejected.join("; ")));
    }
    sentences
}

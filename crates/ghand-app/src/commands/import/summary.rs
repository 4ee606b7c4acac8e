//! An import in numbers, for the terminal and the page.

use ghand_import::Imported;

/// One row for each camera: name, images, found, focal length, angle of view, distance from the first camera, error.
pub fn camera_rows(imported: &Imported) -> Vec<Vec<String>> {
    let cameras = &imported.capture.cameras;
    let row = |(k, camera): (usize, &ghand_core::Camera)| {
        let track = &imported.tracks[k];
        let angle = 2.0 * (0.5 * f64::from(camera.width) / camera.focal.x).atan();
        let error = imported.fit.cameras.iter().find(|(id, _)| *id == camera.id);
        vec![
            camera.id.clone(),
            format!("{} x {}, {:.2} per second", camera.width, camera.height, track.rate()),
            format!("{} of {}", track.found(), track.sightings.len()),
            format!("{:.0}", camera.focal.x),
            format!("{:.0}°", angle.to_degrees()),
            format!("{:.2} m", camera.center().distance(cameras[0].center())),
            error.map_or(String::new(), |(_, distances)| format!("{:.1}", distances.median)),
        ]
    };
    cameras.iter().enumerate().map(row).collect()
}

/// One row for each camera but the first: name, seconds, frames, agreement.
pub fn clock_rows(imported: &Imported) -> Vec<Vec<String>> {
    let solved = &imported.solved;
    let row = |k: usize| {
        let seconds = solved.rig.offsets[k];
        vec![
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

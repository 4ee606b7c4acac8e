//! Cameras by a calibration board that their footage shows before or after the hand.

use ghand_board::{BoardCalibration, BoardCamera, BoardError, BoardFinder, BoardKind, Sight, calibrate};
use ghand_capture::cameras::list::LensCamera;

use crate::ImportError;
use crate::clocks;
use crate::progress::{OnProgress, Progress, Step};
use crate::sources::Source;
use crate::track::Track;

/// Most images of a camera in which the board is searched.
const MOST_IMAGES: usize = 600;
/// Hands hold the board between two images that show it, if they are at most this far apart, seconds.
const HELD: f64 = 1.0;
/// A clock that the board tells less exactly is better told by the hand, seconds: a quarter of a frame.
const MOST_CLOCK_ERROR: f64 = 0.008;
/// Images between reports of progress.
const REPORT_EVERY: usize = 10;

/// The cameras, and what to add to the first one's time to have each one's, seconds, if the board tells it. Removes hands from
/// images near those with the board: they hold it.
///
/// # Errors
/// If a camera does not see the board well enough, or footage cannot be decoded.
pub fn cameras_by_board(
    sources: &[Source],
    tracks: &mut [Track],
    kind: &BoardKind,
    on_progress: &mut OnProgress,
    remarks: &mut Vec<String>,
) -> Result<(Vec<LensCamera>, Option<Vec<f64>>), ImportError> {
    let mut cameras = vec![];
    let mut likeliest = vec![];
    for (k, source) in sources.iter().enumerate() {
        let offsets = clocks::offsets(&tracks[0], &tracks[k]);
        likeliest.push(offsets.first().map(|clock| clock.seconds));
        // Gestures that are repeated do not tell the clock: the board's own movements may.
        let clock = if k == 0 { Some(0.0) } else { likeliest[k].filter(|_| offsets.len() == 1) };
        cameras.push(search(source, kind, clock, &mut tracks[k], on_progress)?);
    }
    let calibrated = calibrate(kind, &cameras).or_else(|error| {
        let BoardError::UnknownClock { .. } = error else { return Err(error) };
        cameras.iter_mut().zip(likeliest).skip(1).for_each(|(camera, clock)| camera.clock = clock);
        calibrate(kind, &cameras)
    });
    let BoardCalibration { cameras: found, remarks: told } = calibrated?;
    remarks.extend(told);
    for camera in &found {
        remarks.push(format!(
            "{}: calibrated by the board at {} moments, to {:.2} pixels (median); focal length good to {:.1} %",
            camera.lens.camera.id,
            camera.views,
            camera.residual,
            1e2 * camera.errors.focal
        ));
    }
    let are_told = found.iter().all(|camera| camera.errors.clock <= MOST_CLOCK_ERROR);
    let clocks = are_told.then(|| found.iter().map(|camera| camera.clock).collect());
    Ok((found.into_iter().map(|camera| camera.lens).collect(), clocks))
}

/// Looks for the board in the images of a camera.
fn search(
    source: &Source,
    kind: &BoardKind,
    clock: Option<f64>,
    track: &mut Track,
    on_progress: &mut OnProgress,
) -> Result<BoardCamera, ImportError> {
    let (width, height) = source.footage.size();
    let times = source.footage.times();
    let stride = times.len().div_ceil(MOST_IMAGES).max(1);
    let numbers: Vec<usize> = (0..times.len()).step_by(stride).collect();
    let finder = BoardFinder::new(kind)?;
    let mut camera = BoardCamera::new(&source.id, [width, height], clock);
    let mut images = source.footage.frames_at(&numbers)?;
    let mut rgb = vec![];
    let mut done = 0;
    let mut last: Option<usize> = None;
    while let Some(number) = images.next_into(&mut rgb)? {
        let sight = finder.find_in_rgb(&rgb, width, height)?;
        // Other squares may be a shirt's.
        if matches!(sight, Sight::Board(_)) {
            let first =
                last.filter(|last| times[number] - times[*last] <= HELD).unwrap_or(number.saturating_sub(stride));
            let end = (number + stride + 1).min(track.sightings.len());
            track.sightings[first.min(end)..end].fill(None);
            last = Some(number);
        }
        camera.add(times[number], sight);
        done += 1;
        let progress = Progress { step: Step::Board, subject: source.id.clone(), done, total: numbers.len() };
        if done % REPORT_EVERY == 0 && !on_progress(&progress) {
            return Err(ImportError::Stopped);
        }
    }
    Ok(camera)
}

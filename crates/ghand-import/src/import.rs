//! The whole way from footage to a capture.

use std::fs;
use std::path::PathBuf;

use ghand_board::BoardKind;
use ghand_capture::Capture;
use ghand_capture::cameras::list::LensCamera;
use ghand_core::{Camera, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_motion::LandmarkFit;
use ghand_motion::image_landmarks::UsualFocal;

use crate::ImportError;
use crate::board::cameras_by_board;
use crate::cameras::{GivenCameras, given_cameras};
use crate::candidates::{candidates, image_at};
use crate::checks::{
    Origin, check_cameras, check_choice, check_fit, check_sides, check_still, check_tracks, clock_remarks,
    guessed_focal, side, too_little_in_common, wrong_size,
};
use crate::choice::{Candidate, Choice, choose};
use crate::hand::{Hand, UnknownCameras, fit_hand, frame_id};
use crate::landmarks::{GivenLandmarks, LandmarkPlaces, Tracked, track_all};
use crate::outlines::{fit_outlines, refine_cameras};
use crate::progress::{OnProgress, Progress, Step};
use crate::residuals::relative;
use crate::rig::lengths::{BONES, hand_length, lengths_of};
use crate::solve::{Known, Solved};
use crate::sources::{Source, open};
use crate::track::Track;
use crate::uneven::solve_with_times;
use crate::writing::{ChosenFrame, write_capture, write_images};

/// How many frames a capture has by default, of which one in five is held out.
pub const USUAL_FRAMES: usize = 64;
/// A hand this many times the mean hand, or as many times smaller, means a wrong unit of length.
const LARGEST_SIZE: f64 = 1.6;
/// Landmarks that are this many times as far off the hand by cameras that its outlines refined as by their own contradict these.
const MOST_FARTHER: f64 = 1.5;

/// What to import.
#[derive(Debug, Clone)]
pub struct ImportOptions {
    /// Videos, or folders of pictures, one for each camera; or a folder of these.
    pub footage: Vec<PathBuf>,
    /// A calibration, a file or a folder of any kind that [`ghand_capture`] reads; without it, the hand tells where the
    /// cameras are.
    pub cameras: Option<PathBuf>,
    /// A calibration board that all cameras saw, instead of a calibration.
    pub board: Option<BoardKind>,
    /// Landmarks of the hand from another tracker, a file for all cameras or one for each; empty to track it.
    pub landmarks: Vec<PathBuf>,
    /// From the wrist to the tip of the middle finger, metres, where the cameras' unit of length is not known.
    pub hand_length: Option<f64>,
    /// Which hand; by default the one that is seen most.
    pub side: Option<Side>,
    /// How many frames to choose.
    pub frames: usize,
    /// The folder of the capture.
    pub out: PathBuf,
    /// Where it is kept what hands were found in the footage.
    pub work: PathBuf,
}

/// What was imported, and how sure it is.
pub struct Imported {
    /// The capture, as written.
    pub capture: Capture,
    /// The footage.
    pub sources: Vec<Source>,
    /// All hands of each camera.
    pub tracked: Vec<Tracked>,
    /// The hand's track in each camera.
    pub tracks: Vec<Track>,
    /// What was known of the cameras.
    pub known: Known,
    /// Cameras and clocks.
    pub solved: Solved,
    /// The hand's poses and how well they fit.
    pub fit: LandmarkFit,
    /// All frames that could be chosen, with their numbers.
    pub candidates: Vec<(usize, Candidate)>,
    /// The chosen ones.
    pub choice: Choice,
    /// What the user should know, one sentence each.
    pub remarks: Vec<String>,
    /// How far each camera saw the landmarks from the fitted hand, as [`residuals`](crate::residuals::residuals) has it.
    pub residuals: Vec<Vec<Option<f64>>>,
}

impl Imported {
    /// The number of a camera's image at the time of a frame, if it shows the hand.
    pub fn image_of(&self, frame: usize, camera: usize) -> Option<usize> {
        image_at(&self.tracks[camera], self.tracks[0].times[frame] + self.solved.rig.offsets[camera])
    }
}

/// Imports footage.
///
/// # Errors
/// [`ImportError`]: one sentence with the cause and the remedy.
pub fn import(options: &ImportOptions, on_progress: &mut OnProgress) -> Result<Imported, ImportError> {
    let sources = open(&options.footage)?;
    let mut remarks = vec![];
    for source in &sources {
        remarks.extend(source.footage.remarks().iter().map(|remark| format!("{}: {remark}", source.id)));
    }
    let GivenCameras { mut lenses, mut known, focal_deviations } =
        given_cameras(&sources, options.cameras.as_deref(), &mut remarks)?;
    for folder in [&options.out, &options.work] {
        fs::create_dir_all(folder).map_err(ImportError::write(folder))?;
    }
    let given = match &options.landmarks[..] {
        [] => None,
        paths => {
            let cameras: Vec<Camera> = lenses.iter().map(|lens| lens.camera.clone()).collect();
            let side = options.side.unwrap_or(Side::Right);
            Some(GivenLandmarks::read(paths, side, &sources, &cameras, &mut remarks)?)
        }
    };
    let places = given.as_ref().map_or(LandmarkPlaces::TRACKER, |given| given.places);
    let tracked = track_all(&sources, given.as_ref(), &options.work, on_progress)?;
    let side = side(&sources, &tracked, options.side, &mut remarks)?;
    let mut tracks: Vec<Track> =
        sources.iter().zip(&tracked).map(|(s, t)| t.hands.track(side, s.footage.times())).collect();
    check_still(&sources, &tracked, &mut remarks)?;
    let mut clocks = None;
    if let Some(kind) = &options.board {
        (lenses, clocks) = cameras_by_board(&sources, &mut tracks, kind, on_progress, &mut remarks)?;
        known = Known::All;
    }
    let clocks = clocks.as_deref();
    check_tracks(&sources, &tracked, &tracks, side, &mut remarks)?;
    tell(on_progress, Step::Cameras)?;
    let model = builtin_hand(side)?;
    let lengths = lengths_of(&model, places.tip_inset, places.beside)?;
    let whole = hand_length(&lengths_of(&model, 0.0, &[])?);
    let usual_focal =
        |(lens, deviation): (&LensCamera, &f64)| UsualFocal { pixels: lens.camera.focal.x, deviation: *deviation };
    let usual_focals: Vec<UsualFocal> = lenses.iter().zip(&focal_deviations).map(usual_focal).collect();
    let (solved, uneven) = solve_with_times(&mut tracks, &lenses, known, &usual_focals, &lengths, clocks)
        .map_err(|camera| too_little_in_common(&sources[camera].id, known))?;
    if clocks.is_none() {
        remarks.extend(clock_remarks(&sources, &solved, &uneven));
    }
    let origin = Origin::of(options.board.is_some(), known);
    let hand_length = place(&mut lenses, &solved, known, &lengths, whole, options.hand_length, &mut remarks)
        .map_err(|length| wrong_size(length, origin))?;
    if let (Known::Nothing, [source]) = (known, &sources[..]) {
        remarks.extend(guessed_focal(source));
    }
    tell(on_progress, Step::Poses)?;
    let is_unknown = matches!(known, Known::Nothing | Known::Lenses) && lenses.len() > 1;
    let focals_are_known = known == Known::Lenses;
    let unknown = is_unknown.then_some(UnknownCameras { usual_focals, focals_are_known, hand_length });
    let mut hand = fit_hand(&tracks, &mut lenses, &solved.rig.offsets, &model, places, unknown)?;
    if known == Known::AllButTheUnit && lenses.len() > 1 {
        scale(&mut lenses, hand_length / hand.fit.lengths[1]);
        hand = fit_hand(&tracks, &mut lenses, &solved.rig.offsets, &model, places, None)?;
    }
    let candidates = candidates(&tracks, &lenses, &solved.rig.offsets, &model, &hand)?;
    let frames: Vec<Candidate> = candidates.iter().map(|(_, candidate)| candidate.clone()).collect();
    let ids: Vec<&str> = sources.iter().map(|source| source.id.as_str()).collect();
    check_cameras(&ids, &relative(&hand.residuals, &candidates, &lenses, hand.fit.lengths[1]), origin)?;
    let errors: Vec<f64> = frames.iter().map(|frame| frame.error).collect();
    check_fit(&errors, origin, &mut remarks)?;
    if let Some(frame) = frames.get(frames.len() / 2) {
        let cameras: Vec<Camera> = lenses.iter().map(|lens| lens.camera.clone()).collect();
        check_sides(&sources, &cameras, frame.points[9])?;
    }
    let choice = choose(&frames, options.frames);
    check_choice(&choice, candidates.len())?;
    let mut chosen: Vec<(usize, bool)> = choice.train.iter().map(|k| (*k, false)).collect();
    chosen.extend(choice.test.iter().map(|k| (*k, true)));
    chosen.sort_unstable();
    let frames_in = |hand: &Hand| -> Vec<ChosenFrame> {
        let frame = |(k, is_held_out): &(usize, bool)| {
            let number = candidates[*k].0;
            let time = tracks[0].times[number];
            let image = |(track, offset): (&Track, &f64)| image_at(track, time + offset);
            Some(ChosenFrame {
                id: frame_id(number),
                images: tracks.iter().zip(&solved.rig.offsets).map(image).collect(),
                pose: hand.poses[number].clone()?,
                is_held_out: *is_held_out,
            })
        };
        chosen.iter().filter_map(frame).collect()
    };
    let near = write_images(&options.out, &sources, &tracks, &frames_in(&hand), on_progress)?;
    let beside = sources.iter().zip(near).filter(|(_, count)| *count > 0);
    remarks.extend(beside.map(|(source, count)| {
        format!("{}: another hand is near this one in {count} images, and is cut out of their masks", source.id)
    }));
    let mut capture = write_capture(&options.out, &lenses, &model, &hand.shape, &frames_in(&hand))?;
    if is_unknown {
        tell(on_progress, Step::Contours)?;
        let by_landmarks = lenses.clone();
        refine_cameras(&options.out, &mut lenses, focals_are_known)?;
        let rough = fit_hand(&tracks, &mut lenses, &solved.rig.offsets, &model, places, None)?;
        let [before, after] = [&hand, &rough].map(|hand| mean_distance(&hand.fit));
        log::debug!("landmarks are {before:.2} pixels off by their own cameras, {after:.2} by those of the contours");
        if after > MOST_FARTHER * before {
            lenses = by_landmarks;
            remarks.push(format!(
                "the cameras are those that landmarks tell: by the hand's outlines landmarks would be {after:.1} pixels off, \
                 not {before:.1}"
            ));
        } else {
            scale(&mut lenses, hand_length / rough.fit.lengths[1]);
            hand = fit_hand(&tracks, &mut lenses, &solved.rig.offsets, &model, places, None)?;
            capture = write_capture(&options.out, &lenses, &model, &hand.shape, &frames_in(&hand))?;
        }
    }
    let mut length = hand.fit.lengths[1];
    // One camera's outlines do not tell how far away the hand is: poses become no better by them.
    if lenses.len() > 1 {
        tell(on_progress, Step::Contours)?;
        let mut outlined = fit_outlines(&options.out, &capture)?;
        if let (true, Some(found)) = (is_unknown || known == Known::AllButTheUnit, outlined.length) {
            // Landmarks lie inside the hand: its outlines tell its length better.
            scale(&mut lenses, hand_length / found);
            hand = fit_hand(&tracks, &mut lenses, &solved.rig.offsets, &model, places, None)?;
            capture = write_capture(&options.out, &lenses, &model, &hand.shape, &frames_in(&hand))?;
            outlined = fit_outlines(&options.out, &capture)?;
        }
        match &outlined.why_not {
            Some(why) => remarks.push(format!("the poses are those of the landmarks: {why}")),
            None => {
                let mut frames = frames_in(&hand);
                frames.iter_mut().zip(outlined.poses).for_each(|(frame, pose)| frame.pose = pose);
                capture = write_capture(&options.out, &lenses, &model, &outlined.shape, &frames)?;
            }
        }
        length = outlined.length.unwrap_or(hand.fit.lengths[1]);
    }
    let Hand { mut fit, residuals, .. } = hand;
    fit.lengths[1] = length;
    Ok(Imported { capture, sources, tracked, tracks, known, solved, fit, candidates, choice, remarks, residuals })
}

/// How far landmarks are off the fitted hand: the median of each camera, mean over these, pixels.
fn mean_distance(fit: &LandmarkFit) -> f64 {
    fit.cameras.iter().map(|(_, distances)| distances.median).sum::<f64>() / fit.cameras.len().max(1) as f64
}

/// Moves cameras to `factor` times their distances from the world's origin.
fn scale(lenses: &mut [LensCamera], factor: f64) {
    lenses.iter_mut().for_each(|lens| lens.camera.translation *= factor);
}

fn tell(on_progress: &mut OnProgress, step: Step) -> Result<(), ImportError> {
    let goes_on = on_progress(&Progress { step, subject: String::new(), done: 0, total: 0 });
    if goes_on { Ok(()) } else { Err(ImportError::Stopped) }
}

/// Puts what was found into the cameras: places and focal lengths, and the unit of length from the hand's length, which it
/// returns. `whole` is the length of the mean hand, whose landmarks are `lengths` apart.
///
/// # Errors
/// The length that no hand has, metres.
fn place(
    lenses: &mut [LensCamera],
    solved: &Solved,
    known: Known,
    lengths: &[f64; BONES.len()],
    whole: f64,
    hand_length_given: Option<f64>,
    remarks: &mut Vec<String>,
) -> Result<f64, f64> {
    let rig = &solved.rig;
    let own: [f64; BONES.len()] = std::array::from_fn(|k| lengths[k] * rig.bones[k].exp() * rig.size);
    // Landmarks do not reach from end to end.
    let length = hand_length(&own) + (whole - hand_length(lengths)) * rig.size;
    let wanted = hand_length_given.unwrap_or(whole);
    let factor = match known {
        Known::All => {
            if lenses.len() > 1 && !(1.0 / LARGEST_SIZE..LARGEST_SIZE).contains(&rig.size) {
                return Err(length);
            }
            1.0
        }
        Known::AllButTheUnit | Known::Lenses | Known::Nothing => wanted / length,
    };
    for (lens, camera) in lenses.iter_mut().zip(&rig.cameras) {
        lens.camera = camera.clone();
        lens.camera.translation *= factor;
    }
    if hand_length_given.is_some() && (known == Known::All || lenses.len() == 1) {
        let cause =
            if lenses.len() == 1 { "one camera's capture has the mean hand" } else { "the cameras tell the unit" };
        remarks.push(format!("--hand-length is not used: {cause}"));
    }
    if known != Known::All && lenses.len() > 1 && hand_length_given.is_none() {
        remarks.push(format!(
            "nothing tells the unit of length: the hand is taken for {:.0} mm long, the mean of adults; --hand-length gives \
             another one",
            1e3 * whole
        ));
    }
    Ok(wanted)
}

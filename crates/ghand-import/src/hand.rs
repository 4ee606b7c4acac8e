//! One hand and its poses, from the landmarks of all cameras.

use ghand_capture::cameras::list::LensCamera;
use ghand_core::{HandModel, Pose};
use ghand_motion::LandmarkFit;
use ghand_motion::image_landmarks::{self, FitOptions, ImageFrame, ImagePoint, UsualFocal};
use glam::DVec3;

use crate::ImportError;
use crate::landmarks::LandmarkPlaces;
use crate::moments::moments;
use crate::residuals::residuals;
use crate::rig::lengths::{BONES, lengths_of};
use crate::rig::start::points_in_camera;
use crate::rig::{LANDMARKS, Moment, View};
use crate::track::Track;

/// The hand in all frames.
pub struct Hand {
    /// Shape parameters of the hand model.
    pub shape: Vec<f64>,
    /// The pose in each frame; `None` where there are too few landmarks, or they contradict each other.
    pub poses: Vec<Option<Pose>>,
    /// How far the landmarks are off the hand.
    pub fit: LandmarkFit,
    /// The same by camera and frame.
    pub residuals: Vec<Vec<Option<f64>>>,
}

/// Fits a hand to what all cameras see at the times of the first one's clock. Where one camera sees it alone, the tracker's
/// guess of its shape counts, too. Cameras that are only roughly known, with their likeliest focal lengths `usual_focals`,
/// are fitted with it: first they, then their unit of length, so that the hand is `hand_length` long (metres, from the wrist
/// to the tip of the middle finger), then the poses.
///
/// # Errors
/// If the landmarks are not a hand.
pub fn fit_hand(
    tracks: &[Track],
    lenses: &mut [LensCamera],
    offsets: &[f64],
    model: &HandModel,
    places: LandmarkPlaces,
    unknown: Option<UnknownCameras>,
) -> Result<Hand, ImportError> {
    let plain: Vec<LensCamera> =
        lenses.iter().map(|lens| LensCamera { camera: lens.camera.clone(), distortion: None }).collect();
    let seen = moments(tracks, &plain, offsets, &tracks[0].times);
    let frames: Vec<ImageFrame> = seen.iter().enumerate().map(|(k, moment)| image_frame(k, moment, lenses)).collect();
    // With cameras that outlines are still to move, smooth poses would only agree better with these.
    let times = if unknown.is_some() { &[] } else { &tracks[0].times[..] };
    if let Some(unknown) = unknown {
        let options = FitOptions {
            usual_focals: Some(&unknown.usual_focals),
            focals_are_known: unknown.focals_are_known,
            beside: places.beside,
            ..FitOptions::default()
        };
        let fitted = image_landmarks::fit_hand(&frames, lenses, model, places.tip_inset, &options)?;
        let scale = unknown.hand_length / fitted.report.lengths[1];
        for (lens, camera) in lenses.iter_mut().zip(fitted.cameras) {
            lens.camera = camera;
            lens.camera.translation *= scale;
        }
    }
    // What is guessed in space lies at the joints: with `beside` the hand of one camera comes out too near.
    let lengths = lengths_of(model, places.tip_inset, &[])?;
    let guesses: Vec<Option<[DVec3; LANDMARKS]>> = match lenses {
        [lens] => {
            let scale = guessed_scale(&seen, &lengths);
            seen.iter().map(|moment| guess(moment, lens, scale)).collect()
        }
        _ => vec![],
    };
    let options = FitOptions { guesses: &guesses, times, beside: places.beside, ..FitOptions::default() };
    let fitted = image_landmarks::fit_hand(&frames, lenses, model, places.tip_inset, &options)?;
    if fitted.poses.iter().all(Option::is_none) {
        return Err(ImportError::Unusable(
            "in no frame the landmarks are a hand's: cameras or clocks are wrong, or they see different hands".into(),
        ));
    }
    let residuals = residuals(&fitted.distances, lenses.len());
    Ok(Hand { shape: fitted.shape, poses: fitted.poses, fit: fitted.report, residuals })
}

/// What is known of cameras whose calibration is not.
pub struct UnknownCameras {
    /// Likeliest focal lengths.
    pub usual_focals: Vec<UsualFocal>,
    /// Whether these are right.
    pub focals_are_known: bool,
    /// The hand's length, metres.
    pub hand_length: f64,
}

/// How many times what the tracker guesses the mean hand is, over all bones: the median of the moments.
fn guessed_scale(seen: &[Moment], lengths: &[f64; BONES.len()]) -> f64 {
    let total: f64 = lengths.iter().sum();
    let guessed = |view: &View| BONES.iter().map(|(from, to)| view.world[*from].distance(view.world[*to])).sum::<f64>();
    let mut scales: Vec<f64> = seen.iter().flatten().flatten().map(|view| total / guessed(view)).collect();
    scales.sort_by(f64::total_cmp);
    scales.get(scales.len() / 2).copied().filter(|scale| scale.is_finite()).unwrap_or(1.0)
}

/// What the tracker guesses of the hand in space, `scale` times as large, where it covers its pixels.
fn guess(moment: &Moment, lens: &LensCamera, scale: f64) -> Option<[DVec3; LANDMARKS]> {
    let mut view = moment.first()?.clone()?;
    view.world.iter_mut().for_each(|point| *point *= scale);
    for pixel in &mut view.pixels {
        *pixel = lens.undistorted(*pixel)?;
    }
    let camera = &lens.camera;
    let in_world = |at| camera.rotation.transpose() * (at - camera.translation);
    Some(points_in_camera(&view, camera)?.map(in_world))
}

fn image_frame(number: usize, moment: &Moment, lenses: &[LensCamera]) -> ImageFrame {
    let views = moment.iter().zip(lenses).filter_map(|(view, lens)| Some((view.as_ref()?, lens)));
    let points = |view: &View| view.pixels.map(|at| Some(ImagePoint { at, score: 1.0 }));
    let cameras = views.map(|(view, lens)| (lens.camera.id.clone(), points(view))).collect();
    ImageFrame { id: frame_id(number), cameras }
}

/// The name of a frame.
pub fn frame_id(number: usize) -> String {
    format!("{number:05}")
}

//! Landmarks of a hand in images of calibrated cameras, and the hand that fits them.
//!
//! [`fit_hand`] fits one hand, with one shape and one set of bone lengths, and its pose at every moment: what
//! [`crate::read_poses`] does with a file of such landmarks. [`read_image_landmarks`] reads them from files of many
//! trackers.

mod arrays;
pub(crate) mod files;
mod joint_names;
mod mediapipe;
mod openpose;
mod tables;
#[cfg(test)]
mod tests;
mod view;

use ghand_capture::cameras::list::LensCamera;
use ghand_core::{Camera, HandModel};
use glam::{DVec2, DVec3};

pub use self::files::{ImageLandmarks, read_image_landmarks};
use crate::PoseError;
pub use crate::ik::LANDMARK_COUNT;
use crate::ik::person::camera_freedom::CameraFreedom;
pub use crate::ik::person::camera_freedom::UsualFocal;
pub use crate::ik::person::proportions::in_skeleton;
use crate::ik::person::sightings::{Sighting, SightingPosition};
pub use crate::pose_sequence::LandmarkFit;
pub use crate::pose_sequence::formats::landmarks::MEDIAPIPE_TIP_INSET;
pub use crate::pose_sequence::transfer::landmark_fit::FittedHand;
use crate::pose_sequence::transfer::landmark_fit::{fit, seen_by_cameras};
pub use crate::pose_sequence::transfer::landmark_report::SightingDistance;

/// One moment, seen by some cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageFrame {
    /// Id of the frame.
    pub id: String,
    /// The landmarks that each camera, by its id, saw, in the order of MediaPipe: the wrist, then four from the palm to
    /// the tip of each finger, thumb first.
    pub cameras: Vec<(String, [Option<ImagePoint>; LANDMARK_COUNT])>,
}

/// A landmark in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagePoint {
    /// Pixels of the image as filmed, the middle of the first one at (0.5, 0.5); or, in all frames of a camera, fractions of
    /// the image's width and height.
    pub at: DVec2,
    /// How sure the tracker is, from 0 to 1: the weight of the point.
    pub score: f64,
}

/// Landmarks of a hand in an image, pixels of the image as filmed; `None` where one is missing.
pub type SeenPixels = [Option<DVec2>; LANDMARK_COUNT];

impl ImageLandmarks {
    /// What each camera saw in each frame; of the cameras, ids and sizes of images count.
    ///
    /// # Errors
    /// [`PoseError`] if a frame has another camera.
    pub fn by_camera(&self, cameras: &[Camera]) -> Result<Vec<Vec<SeenPixels>>, PoseError> {
        let lenses: Vec<LensCamera> =
            cameras.iter().map(|camera| LensCamera { camera: camera.clone(), distortion: None }).collect();
        let mut all = vec![vec![]; cameras.len()];
        for frame in seen_by_cameras("landmarks", &self.frames, &lenses)? {
            for (camera, views) in all.iter_mut().enumerate() {
                let mut pixels = [None; LANDMARK_COUNT];
                for sighting in frame.sightings.iter().filter(|sighting| sighting.confidence > 0.0) {
                    match sighting.place {
                        SightingPosition::Pixel(of, at) if of == camera => pixels[sighting.landmark] = Some(at),
                        _ => {}
                    }
                }
                views.push(pixels);
            }
        }
        Ok(all)
    }
}

/// What is known beside the landmarks, or not known.
#[derive(Debug, Clone, Copy, Default)]
pub struct FitOptions<'a> {
    /// Where a tracker guesses the landmarks of each frame in space: metres, world, at the hand's place; empty without any.
    /// Where one camera sees the hand, they tell how deep fingers lie.
    pub guesses: &'a [Option<[DVec3; LANDMARK_COUNT]>],
    /// The times of the frames of a film, seconds, whose poses are then smooth; empty if frames do not follow each other.
    pub times: &'a [f64],
    /// The likeliest focal length of each camera, if cameras are to be fitted, too: where they are relative to the
    /// first one, and their focal lengths. They start from what is given. Only proportions of lengths are told then.
    pub usual_focals: Option<&'a [UsualFocal]>,
    /// Whether focal lengths stay as given then.
    pub focals_are_known: bool,
    /// Landmarks of the palm that lie beside their joints, and where: in the axes of a right hand's palm (x towards the little
    /// finger, y towards the back, z towards the arm), parts of the distance from the wrist to the middle finger's knuckle.
    /// [`MEDIAPIPE_BESIDE`], or empty.
    pub beside: &'a [(usize, DVec3)],
}

/// Where MediaPipe's landmarks of the wrist and of the thumb's base lie beside the joints of the built-in hand. On 206
/// moments of two made hands seen by three and four cameras the wrist lies 9 mm nearer to the fingers, the thumb's base 10 mm
/// further out, 5 mm nearer to the fingers and 7 mm towards the palm (medians); on a real hand 5, 6 and 9 mm, and not towards
/// the palm.
pub const MEDIAPIPE_BESIDE: [(usize, DVec3); 2] =
    [(0, DVec3::new(0.0, 0.0, -0.08)), (1, DVec3::new(-0.09, -0.04, -0.055))];

/// Fits a hand to landmarks in images. `model` must be of the side that was filmed. Landmarks of fingertips lie `tip_inset`
/// metres before the ends of the fingers: [`MEDIAPIPE_TIP_INSET`], or 0 for the skin.
///
/// With one camera, the size of the hand and its distance come from the model's mean size.
///
/// # Errors
/// [`PoseError`] if a frame has a camera that `cameras` lack, or the names of the model's joints do not identify their
/// parts.
pub fn fit_hand(
    frames: &[ImageFrame],
    cameras: &[LensCamera],
    model: &HandModel,
    tip_inset: f64,
    options: &FitOptions,
) -> Result<FittedHand, PoseError> {
    let mut seen = seen_by_cameras("landmarks", frames, cameras)?;
    for (frame, guess) in seen.iter_mut().zip(options.guesses) {
        let guessed = |(landmark, at): (usize, &DVec3)| Sighting {
            landmark,
            confidence: 1.0,
            place: SightingPosition::Guess(*at),
        };
        frame.sightings.extend(guess.iter().flatten().enumerate().map(guessed));
    }
    let pinholes: Vec<Camera> = cameras.iter().map(|lens| lens.camera.clone()).collect();
    let freedom = options
        .usual_focals
        .map(|focals| CameraFreedom { usual_focals: focals.to_vec(), focals_are_known: options.focals_are_known });
    fit(&seen, options.times, &pinholes, freedom.as_ref(), tip_inset, options.beside, model)
}

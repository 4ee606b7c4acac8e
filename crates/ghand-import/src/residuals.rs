//! How far from the fitted hand each camera saw the landmarks, frame by frame.

use ghand_capture::cameras::list::LensCamera;
use ghand_core::statistics::median;
use ghand_motion::image_landmarks::SightingDistance;

use crate::choice::Candidate;

/// The landmark in the middle of the hand.
const MIDDLE_KNUCKLE: usize = 9;

/// The median distance of the landmarks that a camera saw from the fitted hand: `[camera][frame]`, pixels without distortion
/// of the lens. `distances` are those of all landmarks, by frame. `None` where the camera saw no hand, or there is none that
/// fits.
pub fn residuals(distances: &[Vec<SightingDistance>], cameras: usize) -> Vec<Vec<Option<f64>>> {
    let of = |frame: &Vec<SightingDistance>, camera: usize| {
        let own = frame.iter().filter(|seen| seen.camera == Some(camera));
        let distances: Vec<f64> = own.map(|seen| seen.distance).collect();
        (!distances.is_empty()).then(|| median(distances))
    };
    (0..cameras).map(|camera| distances.iter().map(|frame| of(frame, camera)).collect()).collect()
}

/// The same relative to how long the hand is in the camera's images: the median over the frames, by camera; `None` where it
/// saw no hand in any of them. `hand_length` in metres.
pub fn relative(
    residuals: &[Vec<Option<f64>>],
    candidates: &[(usize, Candidate)],
    lenses: &[LensCamera],
    hand_length: f64,
) -> Vec<Option<f64>> {
    let of_camera = |(residuals, lens): (&Vec<Option<f64>>, &LensCamera)| {
        let camera = &lens.camera;
        let of_frame = |(number, candidate): &(usize, Candidate)| {
            let depth = camera.camera_from_world(candidate.points[MIDDLE_KNUCKLE]).z;
            let off = residuals.get(*number).copied().flatten()? * depth / (camera.focal.x * hand_length);
            (depth > 0.0).then_some(off)
        };
        let all: Vec<f64> = candidates.iter().filter_map(of_frame).collect();
        (!all.is_empty()).then(|| median(all))
    };
    residuals.iter().zip(lenses).map(of_camera).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_camera_has_its_own_distances_and_none_where_it_saw_nothing() {
        let seen = |camera, distance| SightingDistance { landmark: 3, camera, distance, is_wrong: false };
        let both = vec![seen(Some(0), 1.0), seen(Some(1), 7.0), seen(Some(0), 2.0), seen(Some(0), 9.0)];
        let distances = [both, vec![], vec![seen(Some(1), 4.0), seen(None, 50.0)]];
        assert_eq!(residuals(&distances, 2), [vec![Some(2.0), None, None], vec![Some(7.0), None, Some(4.0)]]);
    }
}

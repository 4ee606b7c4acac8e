//! A calibration board that is moved about where the hand will be: held still for a moment in each place, turned towards
//! one camera after the other, tilted to all sides.

use ghand_board::BoardKind;
use ghand_board::picture::{is_black, margin};
use ghand_core::Camera;
use ghand_core::rotation::rotation_from_axis_angle;
use glam::{DMat3, DVec2, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::FootageOptions;
use super::camera_path::{HAND, arc, direction};
use crate::noise::smoothstep;

/// Seconds from place to place, and the part of them in which it moves.
const PERIOD: f64 = 0.8;
const MOVING: f64 = 0.65;
/// Places from the first to the last camera.
const PLACES_ACROSS: usize = 7;
/// How much it is tilted and turned at most, radians, and moved sideways and towards the cameras, metres.
const TILT: f64 = 0.6;
const TURN: f64 = 0.3;
const SIDEWAYS: f64 = 0.08;
const NEARER: f64 = 0.10;
/// How much it looks down on the desk from where cameras are, radians.
const ELEVATION: f64 = 0.25;
/// Display colours of its ink, of its paper, and of its back.
const INK: f32 = 0.06;
const PAPER: f32 = 0.85;
const BACK: Vec3 = Vec3::new(0.55, 0.47, 0.36);
/// The part of the light that comes from above.
const FROM_ABOVE: f64 = 0.25;
/// Samples along each axis of a pixel, of each moment of an exposure: edges of squares are within pixels.
const SAMPLES: usize = 2;

/// The board with its motion.
pub(crate) struct Board {
    pub kind: BoardKind,
    /// Until when it is shown, seconds.
    pub until: f64,
    places: Vec<Place>,
}

/// A place where it is held.
struct Place {
    /// The direction that it is turned to.
    azimuth: f64,
    /// About its own axes.
    turn: DVec3,
    /// Along its own axes.
    shift: DVec3,
}

impl Board {
    /// The board of the options, if they have one.
    pub(crate) fn of(options: &FootageOptions) -> Option<Board> {
        let filmed = options.board.as_ref()?;
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ 0xB0A2D);
        let mut even = || 2.0 * rng.random::<f64>() - 1.0;
        let count = (options.seconds.max(filmed.seconds) / PERIOD) as usize + 3;
        let place = |k: usize| {
            // To the last camera and back again.
            let along = (k % (2 * PLACES_ACROSS)) as f64 / PLACES_ACROSS as f64;
            let azimuth = arc(options.views) * (0.5 - (1.0 - along).abs());
            Place {
                azimuth,
                turn: DVec3::new(TILT * even(), TILT * even(), TURN * even()),
                shift: DVec3::new(SIDEWAYS * even(), SIDEWAYS * even(), NEARER * even()),
            }
        };
        Some(Board { kind: filmed.kind, until: filmed.seconds, places: (0..count).map(place).collect() })
    }

    /// Whether it is shown at a time, seconds; then the hand is not.
    pub(crate) fn is_shown(&self, time: f64) -> bool {
        time < self.until
    }

    /// `world_from_board` at a time.
    pub(crate) fn pose(&self, time: f64) -> (DMat3, DVec3) {
        // Cameras may start earlier than the first one.
        let steps = (time / PERIOD).max(0.0);
        let last = self.places.len() - 1;
        let [from, to] = [steps as usize, steps as usize + 1].map(|k| &self.places[k.min(last)]);
        let part = smoothstep(0.0, MOVING, steps.fract());
        let azimuth = from.azimuth + part * (to.azimuth - from.azimuth);
        let away = -direction(azimuth, ELEVATION);
        let right = DVec3::Y.cross(away).normalize();
        let facing = DMat3::from_cols(right, away.cross(right), away);
        let rotation = facing * rotation_from_axis_angle(from.turn.lerp(to.turn, part));
        let middle = HAND + facing * from.shift.lerp(to.shift, part);
        (rotation, middle - rotation * (0.5 * self.kind.size()).extend(0.0))
    }

    /// Puts it over the image of a camera with these rays (x/z and y/z in its axes), which look by `jitter` pixels beside the
    /// middles of pixels.
    pub(crate) fn put_over(&self, image: &mut [Vec3], camera: &Camera, rays: &[DVec2], jitter: DVec2, time: f64) {
        let (rotation, shift) = self.pose(time);
        let eye = rotation.transpose() * (camera.center() - shift);
        let board_from_camera = rotation.transpose() * camera.rotation.transpose();
        let light = (1.0 - FROM_ABOVE * (0.5 - 0.5 * rotation.z_axis.y)) as f32;
        image.par_iter_mut().zip(rays).for_each(|(pixel, ray)| {
            let mut sum = Vec3::ZERO;
            for k in 0..SAMPLES * SAMPLES {
                let within = DVec2::new((k % SAMPLES) as f64 + 0.5, (k / SAMPLES) as f64 + 0.5) / SAMPLES as f64 - 0.5;
                let ray = *ray + (jitter + within) / camera.focal;
                sum += self.color(eye, board_from_camera * ray.extend(1.0), light).unwrap_or(*pixel);
            }
            *pixel = sum / (SAMPLES * SAMPLES) as f32;
        });
    }

    /// The colour where a ray in the board's axes meets it.
    fn color(&self, eye: DVec3, direction: DVec3, light: f32) -> Option<Vec3> {
        let along = -eye.z / direction.z;
        let place = (eye + along * direction).truncate();
        let margin = margin(&self.kind);
        let is_on = along > 0.0 && place.min_element() > -margin && (self.kind.size() - place).min_element() > -margin;
        if !is_on {
            return None;
        }
        // Its front is towards -z.
        if eye.z > 0.0 {
            return Some(BACK * light);
        }
        Some(Vec3::splat(light * if is_black(&self.kind, place) { INK } else { PAPER }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::footage::FilmedBoard;

    #[test]
    fn a_board_is_still_in_each_place_moves_smoothly_and_faces_the_cameras() {
        let kind: BoardKind = "charuco:8x6:30mm".parse().unwrap();
        let filmed = FilmedBoard { kind, seconds: 8.0 };
        let options = FootageOptions { board: Some(filmed), views: 3, seconds: 12.0, ..Default::default() };
        let board = Board::of(&options).unwrap();
        assert!(board.is_shown(7.99) && !board.is_shown(8.0));
        let middle = |time: f64| {
            let (rotation, shift) = board.pose(time);
            (rotation, rotation * (0.5 * kind.size()).extend(0.0) + shift)
        };
        let mut moves = vec![];
        for frame in 0..240 {
            let time = f64::from(frame) / 30.0;
            let ((_, a), (_, b)) = (middle(time), middle(time + 1.0 / 30.0));
            moves.push(a.distance(b));
            assert!(a.distance(HAND) < 0.16 && a.distance(b) < 0.03, "{time}: {a} {b}");
        }
        let still = moves.iter().filter(|moved| **moved < 1e-4).count();
        assert!((40..140).contains(&still), "{still} of 240");
        // Some camera looks at its front nearly always; none of the azimuths is left out.
        for azimuth in [-0.5, 0.0, 0.5].map(|part| part * arc(3)) {
            let towards = direction(azimuth, ELEVATION);
            let facing = (0..240).filter(|k| -middle(f64::from(*k) / 30.0).0.z_axis.dot(towards) > 0.5).count();
            assert!(facing > 60, "{azimuth}: {facing}");
        }
    }
}

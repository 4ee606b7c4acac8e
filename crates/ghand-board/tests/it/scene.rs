//! Cameras, a board that is moved about in front of them, and what they see of it.

use ghand_board::picture::{is_black, margin};
use ghand_board::{BoardCalibration, BoardCamera, BoardKind, CalibratedCamera, SeenCorner, Sight};
use ghand_capture::cameras::distortion::Distortion;
use ghand_capture::cameras::list::LensCamera;
use ghand_core::Camera;
use ghand_core::rotation::rotation_from_axis_angle;
use glam::{DMat3, DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Columns and rows of all images.
pub const SIZE: [u32; 2] = [640, 480];

/// A camera with its clock.
#[derive(Clone)]
pub struct Filming {
    pub lens: LensCamera,
    /// What to add to the scene's time to have the camera's, seconds.
    pub clock: f64,
    /// Frames per second.
    pub rate: f64,
    /// The ray (x/z, y/z) that the middle of each pixel sees, row by row.
    rays: Vec<DVec2>,
}

/// `count` cameras in an arc around the board, 0.6 m from it, `step` degrees apart, each with a lens of its own.
pub fn cameras(count: usize, step: f64) -> Vec<Filming> {
    let camera = |k: usize| {
        let angle = ((k as f64 - 0.5 * (count as f64 - 1.0)) * step).to_radians();
        let eye = DVec3::new(-0.6 * angle.sin(), 0.08 * (k as f64 - 0.7), -0.6 * angle.cos());
        let up = DVec3::new(0.05 * (k as f64 - 1.0), -1.0, 0.0);
        let [width, height] = SIZE;
        let camera = Camera::look_at(eye, DVec3::new(0.01, 0.0, 0.0), up, 1.0, width, height);
        let focal = 560.0 + 25.0 * k as f64;
        let principal = DVec2::new(320.0 + 6.0 * k as f64 - 4.0, 240.0 - 5.0 * k as f64 + 3.0);
        let camera = Camera { id: format!("cam{k}"), focal: DVec2::splat(focal), principal, ..camera };
        let distortion = Distortion::from_opencv(&[-0.12 + 0.02 * k as f64, 0.05, 0.0006, -0.0008, 0.0]).ok();
        let lens = LensCamera { camera, distortion };
        let ray = |i: u32| {
            let pixel = DVec2::new((i % width).into(), (i / width).into()) + 0.5;
            (lens.undistorted(pixel).unwrap() - principal) / focal
        };
        Filming { rays: (0..width * height).map(ray).collect(), lens, clock: 0.0, rate: 30.0 }
    };
    (0..count).map(camera).collect()
}

/// `world_from_board` at a time: moved and tilted to all sides, slower and faster, around the world's origin.
pub fn board_at(kind: &BoardKind, time: f64) -> (DMat3, DVec3) {
    let turn = DVec3::new(0.55 * (1.1 * time).sin(), 0.6 * (0.8 * time + 1.0).sin(), 0.25 * (0.5 * time).sin());
    let rotation = rotation_from_axis_angle(turn);
    let middle = DVec3::new(0.13 * (0.9 * time + 0.4).sin(), 0.09 * (1.3 * time).cos(), 0.1 * (0.6 * time).sin());
    (rotation, middle - rotation * (0.5 * kind.size()).extend(0.0))
}

/// Where a camera sees a point of the world.
pub fn seen(lens: &LensCamera, point: DVec3) -> Option<DVec2> {
    let at = lens.camera.camera_from_world(point);
    let ray = at.truncate() / at.z;
    let bent = lens.distortion.map_or(ray, |distortion| distortion.distorted(ray));
    (at.z > 0.0).then_some(bent * lens.camera.focal + lens.camera.principal)
}

/// The true corners in an image of a time of the scene, with noise, those within the image.
pub fn true_corners(
    kind: &BoardKind,
    lens: &LensCamera,
    time: f64,
    noise: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<SeenCorner> {
    let (rotation, shift) = board_at(kind, time);
    let corner = |number: usize| {
        let off = noise * DVec2::new(normal(rng), normal(rng));
        let pixel = seen(lens, rotation * kind.corner(number) + shift)? + off;
        let size = DVec2::from_array(SIZE.map(f64::from));
        let inside = pixel.min_element() > 6.0 && (size - pixel).min_element() > 6.0;
        inside.then_some(SeenCorner { number, pixel })
    };
    (0..kind.corner_count()).filter_map(corner).collect()
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    // The sum of twelve even numbers has a variance of 1.
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// What the cameras see of the board for some seconds, as if a finder had found it with this noise, pixels.
pub fn filmed(kind: &BoardKind, cameras: &[Filming], seconds: f64, noise: f64) -> Vec<BoardCamera> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut film = |filming: &Filming| {
        let mut camera = BoardCamera::new(filming.lens.camera.id.clone(), SIZE, Some(0.0));
        for frame in 0..(seconds * filming.rate) as u32 {
            let time = f64::from(frame) / filming.rate;
            let corners = true_corners(kind, &filming.lens, time - filming.clock, noise, &mut rng);
            let is_enough = if kind.to_string().starts_with("chess") {
                corners.len() == kind.corner_count()
            } else {
                corners.len() >= 8
            };
            camera.add(time, if is_enough { Sight::Board(corners) } else { Sight::Nothing });
        }
        camera
    };
    cameras.iter().map(&mut film).collect()
}

/// How an image is taken.
#[derive(Clone, Copy)]
pub struct Exposure {
    /// How long the shutter is open, seconds.
    pub shutter: f64,
    /// Standard deviation of the noise, of 255.
    pub noise: f64,
}

/// A camera's image of the board at a time of the scene: brightness, row by row, the mean of some moments.
pub fn render(kind: &BoardKind, filming: &Filming, time: f64, exposure: Exposure) -> Vec<u8> {
    const MOMENTS: u32 = 3;
    /// Samples along each axis of a pixel.
    const SAMPLES: u32 = 2;
    let camera = &filming.lens.camera;
    let [width, height] = SIZE;
    let margin = margin(kind);
    let mut image = vec![0.0f64; (width * height) as usize];
    for moment in 0..MOMENTS {
        let later = exposure.shutter * ((f64::from(moment) + 0.5) / f64::from(MOMENTS) - 0.5);
        let (rotation, shift) = board_at(kind, time + later);
        let eye = rotation.transpose() * (camera.center() - shift);
        let board_from_camera = rotation.transpose() * camera.rotation.transpose();
        let brightness = |ray: DVec2| {
            let direction = board_from_camera * ray.extend(1.0);
            let along = -eye.z / direction.z;
            let place = (eye + along * direction).truncate();
            let size = kind.size();
            let is_on = along > 0.0 && place.min_element() > -margin && (size - place).min_element() > -margin;
            // A grey room, a white board in uneven light.
            match is_on {
                true if is_black(kind, place) => 30.0,
                true => 190.0 + 60.0 * place.x,
                false => 90.0 + 20.0 * (11.0 * ray.x).sin() * (17.0 * ray.y).cos(),
            }
        };
        let near = seen_outline(kind, filming, (rotation, shift));
        image.par_iter_mut().enumerate().for_each(|(i, value)| {
            let at = DVec2::new((i as u32 % width).into(), (i as u32 / width).into());
            if at.cmplt(near[0]).any() || at.cmpgt(near[1]).any() {
                *value += brightness(filming.rays[i]) / f64::from(MOMENTS);
                return;
            }
            // Lenses bend little within a pixel.
            let within = (0..SAMPLES * SAMPLES).map(|k| DVec2::new((k % SAMPLES).into(), (k / SAMPLES).into()) - 0.5);
            let sum: f64 =
                within.map(|within| brightness(filming.rays[i] + within / f64::from(SAMPLES) / camera.focal)).sum();
            *value += sum / f64::from(SAMPLES * SAMPLES * MOMENTS);
        });
    }
    let mut rng = ChaCha8Rng::seed_from_u64((1e6 * time.abs()) as u64 ^ u64::from(camera.id.as_bytes()[3]));
    image.iter().map(|value| (value + exposure.noise * normal(&mut rng)).round().clamp(0.0, 255.0) as u8).collect()
}

/// A rectangle of pixels around the board with its margin.
fn seen_outline(kind: &BoardKind, filming: &Filming, (rotation, shift): (DMat3, DVec3)) -> [DVec2; 2] {
    let size = kind.size() + 2.0 * margin(kind);
    let edge = |k: u32| {
        let part = f64::from(k % 8) / 8.0;
        let place =
            [DVec2::new(part, 0.0), DVec2::new(1.0, part), DVec2::new(1.0 - part, 1.0), DVec2::new(0.0, 1.0 - part)];
        rotation * (place[k as usize / 8] * size - margin(kind)).extend(0.0) + shift
    };
    let pixels = (0..32).filter_map(|k| seen(&filming.lens, edge(k)));
    let [low, high] = pixels.fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[a, b], p| [a.min(p), b.max(p)]);
    [low - 8.0, high + 8.0]
}

/// How far calibrated cameras are from the truth.
#[derive(Debug, Clone, Copy)]
pub struct Off {
    /// Relative.
    pub focal: f64,
    /// Pixels.
    pub principal: f64,
    /// Of the pixels at which points are seen, in all of the image, up to the camera's turn: the worst.
    pub pixels: f64,
    /// Degrees.
    pub rotation: f64,
    /// Metres.
    pub place: f64,
    /// Seconds.
    pub clock: f64,
}

/// How far each camera is off; places relative to the first camera.
pub fn compare(truth: &[Filming], found: &BoardCalibration) -> Vec<Off> {
    let first = &truth[0].lens.camera;
    let off = |(filming, found): (&Filming, &CalibratedCamera)| {
        let (wanted, camera) = (&filming.lens.camera, &found.lens.camera);
        let rotation = wanted.rotation * first.rotation.transpose();
        let turn = camera.rotation * rotation.transpose();
        let cosine = 0.5 * (turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0);
        // In the first camera's axes.
        let place = first.camera_from_world(wanted.center());
        let mut pixels: f64 = 0.0;
        for (x, y) in (1..8).flat_map(|y| (1..8).map(move |x| (x, y))) {
            let pixel = DVec2::new(f64::from(SIZE[0] * x) / 8.0, f64::from(SIZE[1] * y) / 8.0);
            let [a, b] = [&filming.lens, &found.lens].map(|lens| {
                let at = lens.undistorted(pixel).unwrap();
                (at - lens.camera.principal) / lens.camera.focal
            });
            pixels = pixels.max(a.distance(b) * wanted.focal.x);
        }
        let off = Off {
            focal: (camera.focal / wanted.focal - 1.0).abs().max_element(),
            principal: camera.principal.distance(wanted.principal),
            pixels,
            rotation: cosine.clamp(-1.0, 1.0).acos().to_degrees(),
            place: camera.center().distance(place),
            clock: found.clock - (filming.clock - truth[0].clock),
        };
        println!("{off:?}");
        println!("{:?}, residual {:.3}", found.errors, found.residual);
        off
    };
    truth.iter().zip(&found.cameras).map(off).collect()
}

//! One frame: what a camera's sensor gathers while its shutter is open, as the mean of some moments.

use ghand_capture::CaptureError;
use ghand_capture::cameras::list::LensCamera;
use ghand_core::Camera;
use glam::{DVec2, DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::FootageOptions;
use super::board::Board;
use super::camera_path::CameraPath;
use super::clock::Clock;
use super::lens::{Lens, bent};
use super::room::Room;
use super::sensor::Sensor;
use super::subject::Subject;
use crate::images::labels::hand_alone;
use crate::{RenderScene, SceneLighting, SceneMesh};

/// How long shutters are open, at least and at most, seconds.
const SHUTTER: [f64; 2] = [0.005, 0.014];
/// Where each moment of an exposure looks within a pixel, pixels from its middle: together they smooth edges.
const JITTER: [DVec2; 3] = [DVec2::new(-1.0 / 3.0, 0.0), DVec2::new(0.0, 1.0 / 3.0), DVec2::new(1.0 / 3.0, -1.0 / 3.0)];
/// Pixels around the arm that are drawn with it.
const BORDER: f64 = 2.0;

/// One camera that films.
pub(crate) struct FilmCamera {
    pub id: String,
    pub clock: Clock,
    /// How long its shutter is open for each frame, seconds.
    pub shutter: f64,
    lens: Lens,
    path: CameraPath,
    sensor: Sensor,
    rays: Vec<DVec2>,
    /// What a camera that stands sees of the room.
    behind: Option<Vec<Vec3>>,
}

impl FilmCamera {
    /// All cameras of the footage.
    pub(crate) fn all(options: &FootageOptions, clocks: Vec<Clock>, room: &Room) -> Vec<FilmCamera> {
        let own = clocks.into_iter().zip(Sensor::all(options.views, options.seed));
        own.enumerate().map(|(k, own)| FilmCamera::of(options, room, k, own)).collect()
    }

    fn of(options: &FootageOptions, room: &Room, index: usize, (clock, sensor): (Clock, Sensor)) -> FilmCamera {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ 0xCA3 ^ ((index as u64) << 32));
        let lens = Lens::random([options.width, options.height], &mut rng);
        let path = if options.is_moving {
            CameraPath::walking(options.seconds, options.seed, &mut rng)
        } else {
            CameraPath::standing(index, options.views, &mut rng)
        };
        let shutter = SHUTTER[0] + (SHUTTER[1] - SHUTTER[0]) * rng.random::<f64>();
        let rays = lens.rays();
        let mut camera =
            FilmCamera { id: format!("cam{index}"), clock, shutter, lens, path, sensor, rays, behind: None };
        if camera.path.is_standing() {
            camera.behind = Some(camera.room_in_exposure(room, 0.0));
        }
        camera
    }

    /// Whether it stands.
    pub(crate) fn is_standing(&self) -> bool {
        self.path.is_standing()
    }

    /// The camera at a time, seconds.
    pub(crate) fn at(&self, time: f64) -> LensCamera {
        self.lens.at(&self.path.at(time), self.id.clone())
    }

    /// The moments of an exposure around a time, seconds, each with its place within pixels.
    fn moments(&self, middle: f64) -> impl Iterator<Item = (f64, DVec2)> {
        let count = JITTER.len() as f64;
        let shutter = self.shutter;
        (0..).zip(JITTER).map(move |(k, jitter)| (middle + shutter * ((f64::from(k) + 0.5) / count - 0.5), jitter))
    }

    /// The room in an exposure around a time: the mean of its moments.
    fn room_in_exposure(&self, room: &Room, middle: f64) -> Vec<Vec3> {
        let moments = self.moments(middle).map(|(time, jitter)| self.room_at(room, time, jitter));
        mean(moments, self.rays.len())
    }

    /// What is behind everything at a moment of an exposure.
    fn behind(&self, room: &Room, time: f64, jitter: DVec2) -> Vec<Vec3> {
        self.behind.clone().unwrap_or_else(|| self.room_at(room, time, jitter))
    }

    fn room_at(&self, room: &Room, time: f64, jitter: DVec2) -> Vec<Vec3> {
        let camera = self.at(time).camera;
        let rays: Vec<DVec2> = self.rays.iter().map(|ray| *ray + jitter / camera.focal).collect();
        room.seen(&camera, &rays)
    }
}

/// Sum of images, each of `count` pixels, over their number.
fn mean(images: impl Iterator<Item = Vec<Vec3>>, count: usize) -> Vec<Vec3> {
    let mut sum = vec![Vec3::ZERO; count];
    let mut images_summed = 0;
    for image in images {
        sum.par_iter_mut().zip(&image).for_each(|(sum, color)| *sum += *color);
        images_summed += 1;
    }
    sum.par_iter_mut().for_each(|sum| *sum /= images_summed as f32);
    sum
}

/// A part of an image with an arm.
struct Drawn {
    left: i32,
    top: i32,
    width: u32,
    /// Straight colour and coverage, row-major.
    pixels: Vec<[u8; 4]>,
}

/// What is filmed, and where.
pub(crate) struct Scene<'a> {
    pub subject: &'a Subject,
    pub room: &'a Room,
    pub lighting: &'a SceneLighting,
    /// What is shown before the subject.
    pub board: Option<&'a Board>,
}

impl Scene<'_> {
    /// A frame of a camera's video: red, green and blue of its pixels; and its true mask, if wanted.
    ///
    /// # Errors
    /// [`CaptureError::Render`] if `render` fails.
    pub(crate) fn frame(
        &self,
        camera: &FilmCamera,
        frame: usize,
        wants_mask: bool,
        render: &mut RenderScene,
    ) -> Result<(Vec<u8>, Option<Vec<bool>>), CaptureError> {
        let middle = camera.clock.time(frame);
        if let Some(board) = self.board.filter(|board| board.is_shown(middle)) {
            let images = camera.moments(middle).map(|(time, jitter)| {
                let mut image = camera.behind(self.room, time, jitter);
                board.put_over(&mut image, &camera.at(time).camera, &camera.rays, jitter, time);
                image
            });
            let colors = camera.sensor.record(&mean(images, camera.rays.len()), frame);
            return Ok((colors, wants_mask.then(|| vec![false; camera.rays.len()])));
        }
        let posed = self.subject.posed(middle);
        let scene = SceneMesh {
            positions: &posed.positions,
            normals: &posed.normals,
            uvs: &self.subject.uvs,
            light_visibility: &posed.light_visibility,
            triangles: &self.subject.triangles,
            texture: &posed.texture,
            lighting: self.lighting,
        };
        let failed =
            |problem| CaptureError::Render { frame: format!("{frame:04}"), camera: camera.id.clone(), problem };
        let mut images = Vec::with_capacity(JITTER.len());
        for (time, jitter) in camera.moments(middle) {
            let positions = self.subject.positions(time);
            let drawn = drawn(&SceneMesh { positions: &positions, ..scene }, &camera.at(time), jitter, render);
            let mut image = camera.behind(self.room, time, jitter);
            drawn.map_err(failed)?.put_over(&mut image, camera.lens.columns());
            images.push(image);
        }
        let count = camera.rays.len();
        let colors = camera.sensor.record(&mean(images.into_iter(), count), frame);
        let mask = wants_mask.then(|| self.mask(&scene, &camera.at(middle), render)).transpose().map_err(failed)?;
        Ok((colors, mask))
    }

    /// Which pixels show the hand without its forearm.
    fn mask(&self, scene: &SceneMesh, camera: &LensCamera, render: &mut RenderScene) -> Result<Vec<bool>, String> {
        let positions: Vec<DVec3> = scene.positions.par_iter().map(|point| bent(camera, *point)).collect();
        let scene = SceneMesh { positions: &positions, ..*scene };
        hand_alone(&scene, &self.subject.on_forearm, |labels| render(labels, &camera.camera))
    }
}

/// Draws an arm as a camera with its lens sees it.
fn drawn(scene: &SceneMesh, lens: &LensCamera, jitter: DVec2, render: &mut RenderScene) -> Result<Drawn, String> {
    let positions: Vec<DVec3> = scene.positions.par_iter().map(|point| bent(lens, *point)).collect();
    let camera = Camera { principal: lens.camera.principal - jitter, ..lens.camera.clone() };
    let (low, high) = (positions.iter().map(|point| camera.project(*point).0))
        .fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), pixel| (low.min(pixel), high.max(pixel)));
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    let low = (low - BORDER).floor().clamp(DVec2::ZERO, size);
    let high = (high + BORDER).ceil().clamp(low, size);
    let [left, top] = low.to_array().map(|v| v as i32);
    let [width, height] = (high - low).to_array().map(|v| v as u32);
    if width == 0 || height == 0 {
        return Ok(Drawn { left, top, width: 0, pixels: vec![] });
    }
    let window = camera.cropped(left, top, width, height);
    let pixels = render(&SceneMesh { positions: &positions, ..*scene }, &window)?;
    let expected = width as usize * height as usize;
    if pixels.len() != expected {
        return Err(format!("it returned {} pixels, expected {expected}", pixels.len()));
    }
    Ok(Drawn { left, top, width, pixels })
}

impl Drawn {
    /// Puts it over an image with so many columns.
    fn put_over(&self, image: &mut [Vec3], columns: usize) {
        if self.width == 0 {
            return;
        }
        for (row, pixels) in self.pixels.chunks(self.width as usize).enumerate() {
            let start = (self.top as usize + row) * columns + self.left as usize;
            for ([r, g, b, a], behind) in pixels.iter().zip(&mut image[start..start + pixels.len()]) {
                let color = Vec3::new(f32::from(*r), f32::from(*g), f32::from(*b)) / 255.0;
                *behind = behind.lerp(color, f32::from(*a) / 255.0);
            }
        }
    }
}
